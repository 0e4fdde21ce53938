//! The generated reference agrees with the program: the keys of its readers, and the fields of
//! its labels.

use super::fixtures::{self, Frames, scene};
use super::{Names, all_keys, first_column, known, page};
use skyloop::camera::{Camera, Flux, Radiation};
use skyloop::config::Config;
use skyloop::load::Folder;

/// Asserts that a page has each of these names as code, alone or after the name of its table.
fn lists(path: &str, names: &Names) {
    let text = page(path);
    let missing: Vec<&String> = names
        .iter()
        .filter(|name| {
            let last = name.rsplit('.').next().unwrap();
            ![format!("`{last}`"), format!(".{last}`")]
                .iter()
                .any(|code| text.contains(code))
        })
        .collect();
    assert!(missing.is_empty(), "{path} lacks {missing:?}");
}

/// The fields of the labels of frames with all kinds of content.
fn label_fields() -> Names {
    let first = |config: Config| Frames::of(config).expose(0);
    let mut label = first(Config::builtin().unwrap()).label;
    let too_faint = vec!["NORAD 5".to_string()];
    label.unseen.insert("too faint", too_faint);
    label.unseen_counts.insert("too faint", 2);
    label.unseen_left_out = Some(1);
    label.overrun = Some("late");
    // A detector with defects, and more particles than the limit.
    let mut flawed = Config::builtin().unwrap();
    flawed.camera = fixtures::camera("cmos-rolling");
    flawed.camera.radiation = Some(Radiation {
        flux: Flux::Fixed(1e9),
        thickness_um: 1.0,
        energy_mev: 534.0,
        diffusion_um: 0.0,
        readout_s: 0.0,
    });
    let mut near_sun = Frames::of(scene("near-sun.toml"));
    let last = near_sun.mission.frames - 1;
    let texts = [
        label.to_json(),
        first(flawed).json.to_string(),
        first(scene("moon-in-field.toml")).json.to_string(),
        near_sun.expose(last).json.to_string(),
    ];
    let labels = texts.map(|text| serde_json::from_str::<serde_json::Value>(&text).unwrap());
    let [label, flaws, moon, sun] = &labels;
    let of_frames = [label, flaws, sun].map(|label| label.as_object().unwrap().keys().cloned());
    let mut fields: Names = of_frames.into_iter().flatten().collect();
    let of_frame = label["effects"].as_array().unwrap();
    let objects = [label, flaws, moon].map(|label| label["objects"].as_array().unwrap());
    for object in of_frame.iter().chain(objects.into_iter().flatten()) {
        fields.extend(object.as_object().unwrap().keys().cloned());
    }
    // The frame has stars and satellites, both visible and too faint.
    assert!(fields.contains("range_km") && fields.contains("reason"));
    // The server adds the first (tested in `tests/wire/live`), files the second
    // (`tests/render/output`), frames without objects the third (`tests/render/area`).
    fields.extend(["timing", "files", "no_objects"].map(str::to_string));
    fields
}

#[test]
fn the_reference_lists_exactly_the_fields_of_labels() {
    let fields = label_fields();
    lists("docs/reference/labels.md", &fields);
    let explained = first_column(&page("docs/explanation/labels.md"));
    assert!(explained.len() > 5);
    let unknown: Vec<&String> = explained.difference(&fields).collect();
    assert!(
        unknown.is_empty(),
        "docs/explanation/labels.md: {unknown:?}"
    );
}

#[test]
fn the_reference_lists_the_cameras_keys() {
    let folder = tempfile::tempdir().unwrap();
    let probe = |text: &str, table: &str| {
        let file = folder.path().join("probe.toml");
        std::fs::write(&file, text).unwrap();
        let refused = Camera::load("probe.toml", &Folder::of(&file)).unwrap_err();
        known(refused, table)
    };
    let tables = [
        "optics",
        "optics.psf",
        "optics.projection",
        "optics.vignetting",
        "optics.stray",
        "detector",
        "radiation",
        "timing",
        "mounting",
    ];
    let keys = all_keys(&tables, probe);
    assert!(keys.contains("optics.psf.kind"));
    lists("docs/reference/configuration.md", &keys);
}

#[test]
fn the_reference_lists_a_populations_keys() {
    let folder = tempfile::tempdir().unwrap();
    let probe = |population: &str, table: &str| {
        std::fs::write(folder.path().join("people.toml"), population).unwrap();
        let scene = "[objects]\npopulation = \"people.toml\"";
        let folder = Folder::Disk(folder.path().to_path_buf());
        let refused = Config::parse("scene.toml", scene, &folder);
        known(refused.unwrap_err(), table)
    };
    let mut keys = probe("no_such_key = 1", "");
    for (text, table) in [
        ("[[objects]]\nno_such_key = 1", "objects."),
        ("[[objects]]\nsphere = { no_such_key = 1 }", "sphere."),
        ("[[objects]]\nattitude = { no_such_key = 1 }", "attitude."),
        ("[shapes.thing]\nno_such_key = 1", "shapes.NAME."),
        ("[shapes.thing]\nparts = [{ no_such_key = 1 }]", "parts."),
    ] {
        keys.extend(probe(&format!("{text}\n"), table));
    }
    // Names of tables are headings.
    for table in [
        "shapes",
        "objects",
        "objects.sphere",
        "objects.attitude",
        "shapes.NAME.parts",
    ] {
        assert!(keys.remove(table), "{table}");
    }
    assert!(keys.contains("parts.lobe_deg"));
    lists("docs/reference/configuration.md", &keys);
}
