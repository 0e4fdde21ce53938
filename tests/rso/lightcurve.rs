//! `skyloop lightcurve`: what it writes, and what it refuses.

use assert_cmd::Command;
use std::path::Path;

const ROCKET: &str = "configs/scenes/tumbling-rocket-body/scene.toml";

/// Standard output, standard error and the exit code.
fn skyloop(args: &[&str]) -> (String, String, i32) {
    let output = Command::new(env!("CARGO_BIN_EXE_skyloop"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .arg("lightcurve")
        .args(args)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (
        text(output.stdout),
        text(output.stderr),
        output.status.code().unwrap(),
    )
}

/// The rows of a table, without its head.
fn table(folder: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join("lightcurve.csv")).unwrap();
    let mut lines = text.lines();
    let head = "utc,t_s,mag,band_mag,range_km,phase_deg,illumination,reason";
    assert_eq!(lines.next(), Some(head));
    lines
        .map(|line| line.split(',').map(str::to_string).collect())
        .collect()
}

#[test]
fn a_table_and_a_picture_are_written_and_nothing_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    std::fs::write(folder.path().join("labels.jsonl"), "mine").unwrap();
    let (said, warned, code) = skyloop(&[
        "--scene",
        ROCKET,
        "--object",
        "rocket body",
        "--step",
        "0.25",
        "--out",
        out,
    ]);
    assert_eq!((warned.as_str(), code), ("", 0), "{said}");
    assert!(
        said.contains("NORAD 99002 (ROCKET BODY) seen from NORAD 99001")
            && said.contains("81 instants"),
        "{said}"
    );
    let rows = table(folder.path());
    assert_eq!(rows.len(), 81);
    assert_eq!(rows[0][..2], ["2026-06-01T00:33:00.000Z", "0.000000"]);
    assert_eq!(rows[80][..2], ["2026-06-01T00:33:20.000Z", "20.000000"]);
    // It tumbles: brighter and fainter by more than range and phase explain, in flashes.
    let mags: Vec<f64> = rows.iter().map(|row| row[2].parse().unwrap()).collect();
    let span = mags.iter().copied().fold(f64::MIN, f64::max)
        - mags.iter().copied().fold(f64::MAX, f64::min);
    assert!(span > 2.0, "{span}");
    assert!(
        rows.iter()
            .all(|row| row[2] == row[3] && row[6] == "1.000000" && row[7].is_empty())
    );
    let picture = image::open(folder.path().join("lightcurve.png"))
        .unwrap()
        .to_rgb8();
    let curve = picture
        .pixels()
        .filter(|pixel| pixel.0 == [255, 200, 80])
        .count();
    assert!(curve > 900, "{curve}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("labels.jsonl")).unwrap(),
        "mine"
    );
}

/// The picture in the README is this one; a platform may draw a line a pixel beside.
#[test]
fn the_readme_shows_what_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let (_, _, code) = skyloop(&[
        "--scene",
        ROCKET,
        "--object",
        "ROCKET BODY",
        "--step",
        "0.05",
        "--out",
        out,
    ]);
    assert_eq!(code, 0);
    let open = |path: &Path| image::open(path).unwrap().to_rgb8();
    let shown = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/lightcurve.png");
    let (drawn, shown) = (open(&folder.path().join("lightcurve.png")), open(&shown));
    assert_eq!(drawn.dimensions(), shown.dimensions());
    let differ = drawn
        .pixels()
        .zip(shown.pixels())
        .filter(|(a, b)| a != b)
        .count();
    assert!(
        differ < 100,
        "{differ} pixels: skyloop lightcurve --scene {ROCKET} --object \"ROCKET BODY\" --step 0.05"
    );
}

/// The light curve and the labels of the same exposures are one: of a sphere, and of a body that tumbles.
#[test]
fn it_says_what_labels_say() {
    let builtin = skyloop::config::Config::builtin().unwrap();
    says_what_labels_say(&["--object", "RCM-2"], "RCM-2", builtin);
    let rocket = Path::new(env!("CARGO_MANIFEST_DIR")).join(ROCKET);
    let rocket = skyloop::config::Config::load(&rocket).unwrap();
    says_what_labels_say(
        &["--scene", ROCKET, "--object", "99002"],
        "ROCKET BODY",
        rocket,
    );
}

fn says_what_labels_say(args: &[&str], name: &str, mut config: skyloop::config::Config) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let (_, said, code) = skyloop(&[args, &["--out", out]].concat());
    assert_eq!(code, 0, "{said}");
    let rows = table(folder.path());
    let mission = skyloop::flight::mission(&config).unwrap();
    let mut emulator = skyloop::engine::Emulator::new(&mut config);
    let vehicle = skyloop::flight::vehicle(&mission, 7).unwrap();
    let label = emulator.shoot(&vehicle, 0).unwrap().label;
    let is_meant = |object: &&skyloop::label::ObjectLabel| object.names.iter().any(|n| n == name);
    let object = label.objects.iter().find(is_meant).unwrap();
    let rso = object.rso.as_ref().unwrap();
    for (column, wanted, tolerance) in [
        (2, object.mag, 1e-4),
        (3, object.band_mag.unwrap(), 1e-4),
        (4, rso.range_km, 1e-6),
        (5, rso.phase_deg, 1e-6),
        (6, rso.illumination, 1e-6),
    ] {
        let got: f64 = rows[7][column].parse().unwrap();
        assert!(
            (got - wanted).abs() <= tolerance,
            "{name}, column {column}: {got} {wanted}"
        );
    }
    assert_eq!(rows[7][0], label.epoch_mid);
}

#[test]
fn what_is_hidden_has_a_reason_and_no_magnitude_that_arrives() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let scene = "configs/scenes/geo-belt-stare/scene.toml";
    let args = [
        "--scene",
        scene,
        "--object",
        "GEO 4",
        "--to",
        "2026-06-01T16:00:00Z",
        "--step",
        "300",
        "--out",
        out,
    ];
    let (said, _, code) = skyloop(&args);
    assert_eq!(code, 0, "{said}");
    let rows = table(folder.path());
    let hidden: Vec<_> = rows
        .iter()
        .filter(|row| row[7] == "behind the Earth")
        .collect();
    assert!(!hidden.is_empty() && hidden.len() < rows.len());
    assert!(hidden.iter().all(|row| row[3].is_empty()));
    let cause = format!("at others none: {} behind the Earth", hidden.len());
    assert!(said.contains(&cause), "{said}");
}

/// An object on the observer's own orbit, under another name.
#[test]
fn the_observer_itself_reflects_nothing_to_itself() {
    let folder = tempfile::tempdir().unwrap();
    let mid = skyloop::orbit::time::parse_utc("2026-03-01T12:00:00").unwrap();
    let path = |t: f64| {
        let along = nalgebra::Vector3::new(0.0, 7.5, 0.0);
        (nalgebra::Vector3::new(7000.0, 0.0, 0.0) + along * t, along)
    };
    let text = crate::glints::oem::oem_text("EYE", mid, path);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("eye.oem", &text);
    write("twin.oem", &text.replace("EYE", "TWIN"));
    write(
        "scene.toml",
        "[observer]\norbit = \"eye.oem\"\n[objects]\nfiles = [\"twin.oem\"]\n",
    );
    let here = folder.path().to_str().unwrap();
    let curve = |to: &str| {
        let times = ["--from", "2026-03-01T12:00:00", "--to", to, "--step", "1"];
        let others = ["--scene", here, "--object", "TWIN", "--exposure", "0.1"];
        skyloop(&[&times[..], &others, &["--out", here]].concat())
    };
    let (said, log, code) = curve("2026-03-01T12:00:00");
    assert_eq!(code, 0, "{log}");
    assert!(said.contains(": 1 instant from"), "{said}");
    assert!(
        said.contains("no light of it arrives: 1 at the observer itself"),
        "{said}"
    );
    let rows = table(folder.path());
    assert_eq!(
        [&rows[0][2], &rows[0][3], &rows[0][7]],
        ["", "", "at the observer itself"]
    );

    // The ephemeris ends at 12:00:10, in the middle of the last exposure.
    let (_, log, code) = curve("2026-03-01T12:00:10");
    assert_eq!(code, 1, "{log}");
    let works = "--to 2026-03-01T12:00:09.000Z works";
    for word in [
        here,
        "outside its ephemeris",
        "half of --exposure 0.1",
        works,
    ] {
        assert!(log.contains(word), "{log} has no {word}");
    }
    assert_eq!(curve("2026-03-01T12:00:09").2, 0);
}

#[test]
fn wrong_input_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let refuses = |args: &[&str], words: &[&str]| {
        let (_, said, code) = skyloop(&[args, &["--out", out]].concat());
        assert!(code != 0, "{args:?}");
        for word in words {
            assert!(said.contains(word), "{args:?}: {said} has no {word:?}");
        }
        assert!(!Path::new(out).exists(), "{args:?} left something behind");
    };
    let rocket = ["--scene", ROCKET, "--object"];
    let with = |more: &[&'static str]| [&rocket[..], more].concat();
    refuses(
        &with(&["ISS"]),
        &[
            "error: --object ISS: no object called",
            "NORAD 99002 (ROCKET BODY)",
        ],
    );
    refuses(
        &with(&["99002", "--step", "0"]),
        &["error: --step 0: ", "from 1e-6 to 1e6"],
    );
    refuses(
        &with(&["99002", "--step", "nan"]),
        &["--step <S>", "a number is wanted"],
    );
    refuses(
        &with(&["99002", "--exposure", "-1"]),
        &["error: --exposure -1: ", "0 to 10000"],
    );
    refuses(
        &with(&["99002", "--step", "1e-6"]),
        &[
            "error: --step 0.000001, --from 2026-06-01T00:33:00",
            "20000001 points",
            "enlarge --step",
        ],
    );
    refuses(
        &with(&["99002", "--from", "2026-06-02T00:00:00Z"]),
        &[
            "error: --from 2026-06-02T00:00:00",
            "--to 2026-06-01T00:33:20.000Z (the scene's)",
            "the end lies before the start",
        ],
    );
    refuses(
        &with(&["99002", "--from", "tomorrow"]),
        &["--from", "tomorrow"],
    );
    refuses(
        &["--scene", "nowhere.toml", "--object", "X"],
        &["nowhere.toml", "check the path"],
    );
    refuses(
        &["--object", "RCM-1", "--to", "2019-06-16T00:00:00Z"],
        &[
            "the built-in scene: ",
            "outside its ephemeris",
            "23:36:30",
            "half of --exposure 0.1",
        ],
    );
    refuses(&["--object", "CASSIOPE"], &["no object called", "RCM-1"]);
    refuses(
        &["--scene", "configs/scenes/deep-sky.toml", "--object", "X"],
        &["deep-sky.toml", "no observer", "[observer]"],
    );
    refuses(
        &[
            "--scene",
            "configs/scenes/south-atlantic-anomaly.toml",
            "--object",
            "X",
        ],
        &["south-atlantic-anomaly.toml: has no objects", "[objects]"],
    );
}

#[test]
fn an_observer_below_the_ground_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mid = skyloop::orbit::time::parse_utc("2026-03-01T12:00:00").unwrap();
    // Sinking by 2 km a second.
    let path = |t: f64| {
        let down = nalgebra::Vector3::new(-2.0, 0.0, 0.0);
        (nalgebra::Vector3::new(6388.0, 0.0, 0.0) + down * t, down)
    };
    let text = crate::glints::oem::oem_text("DIVER", mid, path);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("diver.oem", &text);
    write("high.oem", &text.replace("DIVER", "HIGH"));
    write(
        "scene.toml",
        "[observer]\norbit = \"diver.oem\"\n[objects]\nfiles = [\"high.oem\"]\n",
    );
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let (scene, out) = (file("scene.toml"), file("out"));
    let (_, said, code) = skyloop(&[
        "--scene",
        &scene,
        "--object",
        "HIGH",
        "--from",
        "2026-03-01T12:00:00",
        "--to",
        "2026-03-01T12:00:08",
        "--step",
        "1",
        "--out",
        &out,
    ]);
    assert_eq!(code, 1, "{said}");
    // X-Val: WGS84: the equator's radius is 6378.137 km.
    for word in ["DIVER", "below the ground", "2026-03-01T12:00:05"] {
        assert!(said.contains(word), "{said} has no {word}");
    }
    assert!(!Path::new(&out).exists());
}
