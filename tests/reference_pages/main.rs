//! The pages of `docs/reference/` are up to date. To renew them after a change of options, keys,
//! labels, metrics or their texts: `SKYLOOP_WRITE_DOCS=1 cargo test --test reference_pages`.

mod commands;
mod counters;
mod keys;
mod page;

use keys::Keys;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::fidelity::{PRESETS, TOLERANCES};
use skyloop::load::DEFAULT_TOML;

fn check(page: &str, part: &str, text: &str) {
    page::check(page, part, text, "reference_pages");
}

#[test]
fn the_page_of_the_command_line_is_current() {
    let sections = commands::sections("skyloop", env!("CARGO_BIN_EXE_skyloop"));
    check("command-line.md", "commands", &sections);
}

#[test]
fn the_page_of_the_configuration_is_current() {
    let defaults: toml::Table = DEFAULT_TOML.parse().unwrap();
    for (part, schema, defaults) in [
        ("camera", Camera::schema(), toml::Table::new()),
        ("run", Config::schema("skyloop run file"), defaults),
        (
            "population",
            Config::population_schema(),
            toml::Table::new(),
        ),
    ] {
        let keys = Keys {
            schema: schema.into(),
            defaults,
            is_output: false,
        };
        let sections = keys.sections("Keys at the top of the file");
        check("configuration.md", part, &sections);
    }
    check("configuration.md", "presets", &presets());
}

/// The tolerances of each preset.
fn presets() -> String {
    let names = PRESETS.iter().map(|(name, _)| page::code(name));
    let names: Vec<String> = [String::from("Key")].into_iter().chain(names).collect();
    let rows = TOLERANCES.iter().map(|tolerance| {
        let values = PRESETS
            .iter()
            .map(|(_, preset)| (tolerance.get)(preset).to_string());
        let cells: Vec<String> = [page::code(tolerance.name)]
            .into_iter()
            .chain(values)
            .collect();
        page::row(&cells)
    });
    page::head(&names) + &rows.collect::<String>()
}

#[test]
fn the_page_of_labels_is_current() {
    let keys = Keys {
        schema: skyloop::label::schema().into(),
        defaults: toml::Table::new(),
        is_output: true,
    };
    check("labels.md", "labels", &keys.sections("Keys of the frame"));
}

#[test]
fn the_page_of_counters_is_current() {
    let packets = counters::packets();
    check("counters.md", "metrics", &counters::metric_table(&packets));
    check(
        "counters.md",
        "counters",
        &counters::counter_table(&packets),
    );
}
