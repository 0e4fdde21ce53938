//! The documents agree with the program: labels, command line, configuration keys, cameras, rooms,
//! dependencies.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use skyloop::camera::Camera;
use skyloop::config::{Clock, Config};
use skyloop::effect::EFFECTS;
use skyloop::engine::Emulator;
use skyloop::fidelity::{PRESETS, TOLERANCES, Value};
use skyloop::link::{self, Options, Roles};
use skyloop::load::{CAMERAS, DEFAULT_TOML, Folder};
use skyloop::serve::Server;
use skyloop_protocols::personality::NATIVE;

/// The folder of the repository.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A document, by its path from the root.
fn page(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

const ARCHITECTURE: &str = include_str!("../ARCHITECTURE.md");
const MANIFEST: &str = include_str!("../Cargo.toml");

type Names = BTreeSet<String>;

/// The part of `document` below `heading`, up to the next one of its kind.
fn section<'a>(document: &'a str, heading: &str) -> &'a str {
    let (_, rest) = document
        .split_once(&format!("\n{heading}\n"))
        .unwrap_or_else(|| panic!("no {heading:?}"));
    let level = heading.split(' ').next().unwrap();
    let ends = ["\n# ", "\n## ", "\n### "];
    let end = ends[..level.len()]
        .iter()
        .filter_map(|end| rest.find(end))
        .min();
    &rest[..end.unwrap_or(rest.len())]
}

/// The code spans in the first column of a section's tables.
fn first_column(section: &str) -> Names {
    let rows = section.lines().filter_map(|line| line.strip_prefix("| "));
    let cells = rows.filter_map(|row| row.split(" |").next());
    cells
        .flat_map(|cell| cell.split('`').skip(1).step_by(2))
        .map(str::to_string)
        .collect()
}

/// A file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap().to_string_lossy().into_owned()
}

fn names<'a>(names: impl IntoIterator<Item = &'a str>) -> Names {
    names.into_iter().map(str::to_string).collect()
}

#[path = "documents/accuracy.rs"]
mod accuracy;
#[path = "../examples/effect_pictures/draw.rs"]
mod draw;
#[path = "support/fixtures.rs"]
mod fixtures;
#[path = "../examples/effect_pictures/pictures.rs"]
mod pictures;
#[path = "documents/prose.rs"]
mod prose;
#[path = "documents/reference.rs"]
mod reference;
#[path = "support/words.rs"]
mod words;

#[test]
fn every_effect_has_its_section_and_the_picture_that_the_program_draws() {
    let page = page("docs/explanation/effects.md");
    let sections = page.lines().filter_map(|line| line.strip_prefix("## "));
    let effects: Vec<&str> = EFFECTS.iter().map(|effect| effect.name).collect();
    assert_eq!(sections.collect::<Vec<_>>(), effects);
    let pictured: Vec<&str> = pictures::PICTURES.iter().map(|p| p.effect).collect();
    assert_eq!(pictured, effects);
    for picture in pictures::PICTURES {
        let file = format!("effects/{}", picture.file());
        assert!(page.contains(&format!("](../{file})")), "{file}");
        let decoded = |png: &[u8]| image::load_from_memory(png).unwrap();
        let committed = std::fs::read(root().join("docs").join(&file)).unwrap();
        assert!(
            decoded(&committed) == decoded(&draw::png(picture).unwrap()),
            "docs/{file} is stale: cargo run --release --example effect_pictures"
        );
    }
}

#[test]
fn every_scene_has_its_section_and_a_picture() {
    let page = page("docs/explanation/scenes.md");
    let files = std::fs::read_dir(root().join("configs/scenes")).unwrap();
    let files = files.map(|entry| entry.unwrap().path());
    let scenes: Names = files
        .filter(|path| path.is_dir() || path.extension().is_some_and(|end| end == "toml"))
        .map(|path| stem(&path))
        .collect();
    let sections = page.lines().filter_map(|line| line.strip_prefix("## "));
    assert_eq!(names(sections), scenes);
    for scene in &scenes {
        let text = section(&page, &format!("## {scene}"));
        assert!(
            text.contains(&format!("](../scenes/{scene}.png)")),
            "{scene}"
        );
        let picture = image::open(root().join(format!("docs/scenes/{scene}.png"))).unwrap();
        assert!(picture.width() <= 512, "{scene}");
    }
}

#[test]
fn the_tolerances_of_presets_are_listed() {
    let page = page("docs/how-to/accuracy-and-time.md");
    let rows = section(&page, "## Fidelity").lines();
    let rows = rows.filter(|row| row.starts_with("| `"));
    let rows: Vec<Vec<&str>> = rows.map(cells).collect();
    assert_eq!(rows.len(), TOLERANCES.len());
    for (row, tolerance) in rows.iter().zip(TOLERANCES) {
        assert_eq!(row[0].trim_matches('`'), tolerance.name);
        for (cell, (preset, fidelity)) in row[2..].iter().zip(PRESETS) {
            let listed = match cell.parse() {
                Ok(number) => Value::Number(number).to_string(),
                Err(_) => cell.trim_matches('`').to_string(),
            };
            let value = (tolerance.get)(fidelity).to_string();
            assert_eq!(listed, value, "{} of {preset}", tolerance.name);
        }
    }
}

#[test]
fn the_readmes_commands_exist() {
    let readme = page("README.md");
    assert!(readme.contains("    cargo run --release -- loopback "));
    assert!(readme.contains("    tests/run "));
    for file in [
        "tests/run",
        "configs/run.toml",
        "docs/loopback.png",
        "protocols/docs/icd.md",
    ] {
        let is_there = root().join(file).is_file();
        assert!(readme.contains(file) && is_there, "{file}");
    }
    assert!(include_str!("../.ci/run").contains("tests/run"));
    Config::load(&root().join("configs/run.toml")).unwrap();
}

/// The known keys of a table, as listed in the refusal of an unknown key.
fn known(refusal: impl std::fmt::Display, table: &str) -> Names {
    let text = refusal.to_string();
    let (_, list) = text.split_once(", known: ").expect(&text);
    let keys = list.lines().next().unwrap().split(", ");
    keys.map(|key| format!("{table}{key}")).collect()
}

/// All keys of a file: those of its root and of these tables. `probe` returns the known keys of a
/// text with an unknown key, each after the name of its table.
fn all_keys(tables: &[&str], probe: impl Fn(&str, &str) -> Names) -> Names {
    let mut all = probe("no_such_key = 1", "");
    for table in tables {
        assert!(all.remove(*table), "{table}");
        let text = format!("[{table}]\nno_such_key = 1");
        all.extend(probe(&text, &format!("{table}.")));
    }
    all
}

#[test]
fn the_default_file_has_every_key_and_no_other() {
    let probe = |text: &str, table: &str| {
        let refused = Config::parse("probe", text, &Folder::current());
        known(refused.unwrap_err(), table)
    };
    let tables = [
        "fidelity", "effects", "sky", "objects", "observer", "run", "sequence",
    ];
    let mut wanted = all_keys(&tables, probe);
    assert!(wanted.remove("heads"));
    wanted.extend(probe("[[heads]]\nno_such_key = 1", "heads."));
    assert!(wanted.contains("run.link") && wanted.contains("sequence.rates_deg_s"));

    let mut found = Names::new();
    let mut table = String::new();
    for line in DEFAULT_TOML.lines() {
        // Tables and keys without a default are commented out with `#`, alternatives with `##`.
        let line = line.strip_prefix("# ").unwrap_or(line);
        let line = line.strip_prefix("##").unwrap_or(line);
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            table = format!("{}.", name.0.trim_start_matches('['));
        } else if let Some((key, _)) = line.split_once(" = ")
            && key.chars().all(|c| c.is_ascii_lowercase() || c == '_')
        {
            found.insert(format!("{table}{key}"));
        }
    }
    assert_eq!(found, wanted);

    let attitude = "[sequence]\nepoch = \"2019-06-15T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\n\
                    attitudes = [{ q = [0.0, 0.0, 0.0, 1.0], no_such_key = 1 }]";
    for key in probe(attitude, "") {
        let is_there = DEFAULT_TOML.contains(&format!(" {key} = "));
        assert!(is_there, "attitudes: {key}");
    }
}

#[test]
fn the_default_files_values_are_the_defaults() {
    let written = Config::parse("default.toml", DEFAULT_TOML, &Folder::current()).unwrap();
    let built = Config::defaults().unwrap();
    assert_eq!(format!("{written:?}"), format!("{built:?}"));
}

/// The embedded file with every commented key active: `# key = value` becomes `key = value`. Keys
/// behind `##` exclude another key.
fn uncommented() -> String {
    let is_key = |rest: &str| {
        let (head, _) = rest.split_once(['=', ']']).unwrap_or_default();
        rest.starts_with('[') || (rest.contains('=') && !head.trim().contains(' '))
    };
    let line = |line: &str| match line.strip_prefix("# ") {
        Some(rest) if is_key(rest) => rest.to_string(),
        _ => line.to_string(),
    };
    DEFAULT_TOML.lines().map(|l| line(l) + "\n").collect()
}

#[test]
fn the_default_file_is_valid_with_every_commented_key() {
    let folder = tempfile::tempdir().unwrap();
    // X-Val: Spacetrack Report 3, first test case, as a three-line element set.
    let elements = "NAME\n\
        1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
        2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
    std::fs::write(folder.path().join("FILE"), elements).unwrap();
    std::fs::write(folder.path().join("POPULATION"), "objects = []\n").unwrap();
    let folder = Folder::Disk(folder.path().to_path_buf());
    let mut config = Config::parse("default.toml", &uncommented(), &folder).unwrap();
    let sequence = config.sequence.take().unwrap();
    assert_eq!((sequence.frames, sequence.period_s), (50, 0.5));
    assert!(config.observer.take().is_some());
    let run = &mut config.run;
    assert_eq!(run.latency_s.take(), Some(0.1));
    assert_eq!(run.metrics.take().as_deref(), Some("127.0.0.1:9464"));
    assert_eq!(run.realtime.priority.take(), Some(50));
    let heads = std::mem::take(&mut config.cameras);
    assert_eq!((heads.len(), heads[0].name.as_str()), (1, "B"));
    // All other keys have their defaults.
    let built = Config::defaults().unwrap();
    assert_eq!(format!("{config:?}"), format!("{built:?}"));
}

#[test]
fn the_cameras_are_listed_and_sourced() {
    let folder = root().join("configs/cameras");
    let files = std::fs::read_dir(&folder).unwrap();
    let files: Names = files.map(|entry| stem(&entry.unwrap().path())).collect();
    assert_eq!(files, names(CAMERAS.iter().copied()), "built in");
    let page = page("docs/how-to/camera.md");
    let listed = first_column(section(&page, "## Built-in cameras"));
    for name in CAMERAS {
        assert!(
            listed.contains(*name),
            "{name} is not on the page of cameras"
        );
        assert_eq!(Camera::load(name, &Folder::current()).unwrap().name, *name);
        let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
        for line in text.lines().filter(|line| {
            line.contains(" = ") && !line.starts_with("name") && !line.starts_with('#')
        }) {
            let comment = line.split_once('#').map_or("", |(_, comment)| comment);
            let sources = ["[T1", "[class", "[assumed", "[section", "[paper", "[fitted"];
            let is_sourced = sources.iter().any(|source| comment.contains(source));
            assert!(is_sourced, "{name}: source of {line}");
        }
    }
}

#[test]
fn the_architecture_has_every_room_and_dependency() {
    let rooms = first_column(section(ARCHITECTURE, "## Rooms"));
    for lib in [
        include_str!("../src/lib.rs"),
        include_str!("../src/base/lib.rs"),
        include_str!("../src/live/lib.rs"),
        include_str!("../src/measure/lib.rs"),
        include_str!("../src/render/lib.rs"),
    ] {
        let modules = lib.lines().filter_map(|line| line.strip_prefix("pub mod "));
        for module in modules.filter_map(|line| line.strip_suffix(';')) {
            assert!(rooms.contains(module), "no room for {module}");
        }
    }
    let manifest: toml::Table = MANIFEST.parse().unwrap();
    let wanted = manifest["workspace"]["dependencies"].as_table().unwrap();
    let mut wanted: Names = wanted.keys().cloned().collect();
    wanted.retain(|name| !name.starts_with("skyloop-"));
    let listed = first_column(section(ARCHITECTURE, "## Dependencies"));
    assert_eq!(listed, wanted);
}

/// The cells of a table's row.
fn cells(row: &str) -> Vec<&str> {
    row.trim_matches('|').split('|').map(str::trim).collect()
}

#[test]
fn the_page_of_links_has_the_time_of_each_output_level() {
    let page = page("docs/how-to/links.md");
    let text = section(&page, "## Output levels");
    let mut rows = text.lines().skip_while(|row| !row.starts_with("| | `"));
    let links = cells(rows.next().expect("the table's head"));
    let rows = rows.skip(1).take_while(|row| row.starts_with('|'));
    let rows: Vec<Vec<&str>> = rows.map(cells).collect();
    for (column, link) in links.iter().enumerate().skip(1) {
        let mut config = Config::builtin().unwrap();
        let options = Options {
            idle: Duration::from_secs(5),
            personality: &NATIVE,
            bus: None,
        };
        let (wire, _client) = link::loopback(link.trim_matches('`'), &options).unwrap();
        let output = config.run.output;
        let emulator = Emulator::new(&mut config);
        let links = [(wire, Roles::ALL)];
        let server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
        let levels = server.levels();
        assert_eq!(levels.lines().count(), rows.len() + 1, "{levels}");
        for (row, line) in rows.iter().zip(levels.lines().skip(1)) {
            let printed = line.trim().strip_prefix(row[0]).expect(line);
            let seconds = format!(" bytes {:>10} s ", row[column]);
            assert!(
                printed.contains(&seconds),
                "{link}: the page has {seconds:?}, the program{printed}"
            );
        }
    }
}
