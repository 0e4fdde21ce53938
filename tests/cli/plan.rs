//! `skyloop plan`: the verdicts as a table and as JSON, declared and measured.

use crate::{repository, skyloop};
use serde_json::{Value, json};
use skyloop::effect::EFFECTS;
use skyloop::fidelity::Fidelity;
use std::path::Path;

/// What the command writes: its code, and both outputs.
fn plan(at: &Path, flags: &[&str]) -> (i32, String, String) {
    let output = skyloop(at).arg("plan").args(flags).output().unwrap();
    let text = |octets| String::from_utf8(octets).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn the_table_has_every_effect_in_order_with_its_reason() {
    let here = tempfile::tempdir().unwrap();
    let (code, table, log) = plan(here.path(), &[]);
    assert_eq!((code, log.as_str()), (0, ""), "{table}");
    let lines: Vec<&str> = table
        .lines()
        .filter(|line| line.starts_with("  "))
        .collect();
    assert!(lines[0].contains("error if skipped") && lines[0].contains("because"));
    for (line, effect) in lines[1..].iter().zip(EFFECTS) {
        assert!(line.trim().starts_with(effect.name), "{line}");
        assert!(line.contains(" run ") || line.contains(" skip "), "{line}");
        assert!(line.contains(" e-") || line.contains(" px"), "{line}");
    }
    assert_eq!(lines.len(), EFFECTS.len() + 2, "{table}");
    assert!(table.contains("stars in the field"), "{table}");
}

#[test]
fn json_has_the_fields_of_the_labels_and_what_was_measured() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(
        here.path().join("scene.toml"),
        "camera = \"fai-630\"\n[effects]\noff = [\"dark current\"]\n[sequence]\nepoch = \"2026-01-01T00:00:00Z\"\n\
         frames = 2\nperiod_s = 1.0\nattitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\n",
    )
    .unwrap();
    let flags = [
        "--scene",
        "scene.toml",
        "--frame",
        "1",
        "--measure",
        "--json",
    ];
    let (code, json, log) = plan(here.path(), &flags);
    assert_eq!((code, log.as_str()), (0, ""), "{json}");
    let report: Value = serde_json::from_str(&json).unwrap();
    let keys: Vec<&str> = report
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    assert_eq!(
        keys,
        [
            "camera",
            "effects",
            "epoch_mid",
            "frame",
            "scene",
            "tolerances"
        ]
    );
    assert_eq!(
        (&report["scene"], &report["camera"], &report["frame"]),
        (&json!("scene.toml"), &json!("fai-630"), &json!(1))
    );
    // One second after the first.
    assert_eq!(report["epoch_mid"], "2026-01-01T00:00:01.000Z");
    let tolerances = Fidelity::preset("realtime").unwrap();
    assert_eq!(
        report["tolerances"],
        json!({ "skip_e": tolerances.skip_e, "skip_snr": tolerances.skip_snr, "skip_px": tolerances.skip_px })
    );
    let lines = report["effects"].as_array().unwrap();
    let line = |name: &str| lines.iter().find(|line| line["effect"] == name).unwrap();
    let dark = line("dark current");
    assert_eq!(
        (dark["run"].as_bool(), dark["price_ms"].is_null()),
        (Some(false), true)
    );
    assert_eq!(dark["why"], "it is switched off");
    // 20 e-/s for 0.1 s.
    assert!(
        (dark["error_e"].as_f64().unwrap() - 2.0).abs() < 1e-9,
        "{dark}"
    );
    let read = line("read noise");
    // An rms over 24 frames of one pixel of 65,536, chosen by other frames: 12 e- and 15 %, four times.
    assert!(
        (read["measured_error_e"].as_f64().unwrap() - 12.0).abs() < 7.0,
        "{read}"
    );
    assert!(read["measured_ms"].as_f64().unwrap() > 0.0);
    assert_eq!((&read["rms"], &dark["rms"]), (&json!(true), &json!(false)));
    assert!(read["measured_error_px"].is_null(), "{read}");
}

/// What is judged by px is measured in px, what is random is called an rms, and no two columns have one name.
#[test]
fn declared_and_measured_errors_are_of_one_kind() {
    let here = tempfile::tempdir().unwrap();
    // Too faint for noise to hide anything: 0.5 deg/s for 0.1 s over pixels of 389 arcsec are 0.46 px in the middle
    // of the field and 0.49 px in its corners.
    let scene = "camera = \"fai-630\"\n[sequence]\nepoch = \"2026-01-01T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\n\
                 attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\nrates_deg_s = [0.5, 0.0, 0.0]\n";
    std::fs::write(here.path().join("scene.toml"), scene).unwrap();
    let (code, table, log) = plan(here.path(), &["--scene", "scene.toml", "--measure"]);
    assert_eq!((code, log.as_str()), (0, ""), "{table}");
    let lines: Vec<&str> = table
        .lines()
        .filter(|line| line.starts_with("  "))
        .collect();
    for column in ["measured error", "measured time", "price"] {
        assert_eq!(lines[0].matches(column).count(), 1, "{}", lines[0]);
    }
    let line = |name: &str| {
        *lines
            .iter()
            .find(|line| line.trim().starts_with(name))
            .unwrap()
    };
    // Half of its way each, declared and measured.
    let smear = line("smear");
    let px: Vec<f64> = smear
        .split(" px")
        .take(2)
        .map(|before| before.split(' ').next_back().unwrap().parse().unwrap())
        .collect();
    assert!(
        (0.23..0.27).contains(&px[0]) && (0.23..0.25).contains(&px[1]) && !smear.contains(" e-"),
        "{smear}"
    );
    assert_eq!(line("shot noise").matches(" e- rms").count(), 2, "{table}");
    assert_eq!(line("dark current").matches(" e- ").count(), 2, "{table}");
    assert!(!line("dark current").contains("rms"), "{table}");
}

/// On a terminal, and nowhere else, standard error tells how far the measurement is.
#[test]
#[cfg(unix)]
fn a_terminal_sees_what_is_being_measured() {
    use std::io::Read;
    let here = tempfile::tempdir().unwrap();
    let (mut near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    let terminal = std::fs::File::options().write(true).open(device).unwrap();
    serialport::SerialPort::set_timeout(&mut near, crate::support::PATIENCE).unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skyloop"));
    command.args(["plan", "--measure", "--camera", "fai-630"]);
    command
        .current_dir(here.path())
        .env("TERM", "xterm")
        .stderr(terminal);
    let mut running = command.stdout(std::process::Stdio::null()).spawn().unwrap();
    let wanted = format!("/{} effects measured  rolling shutter", EFFECTS.len());
    let (mut seen, mut octets) = (String::new(), [0; 4096]);
    while !seen.contains(&wanted) {
        let count = near.read(&mut octets).unwrap_or(0);
        assert!(count > 0, "no {wanted:?} in {seen:?}");
        seen += &String::from_utf8_lossy(&octets[..count]);
    }
    running.kill().unwrap();
    running.wait().unwrap();
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    std::fs::write(at.join("none.toml"), "seed = 1\n").unwrap();
    std::fs::write(at.join("name.toml"), "[effects]\noff = [\"stray dogs\"]\n").unwrap();
    std::fs::write(at.join("last.toml"), "[effects]\noff = [\"readout\"]\n").unwrap();
    for (flags, words) in [
        (&["--frame", "50"][..], &["--frame 50", "0 to 49"][..]),
        (&["--camera", "nope"], &["nope", "fai-nir"]),
        (&["--scene", "none.toml"], &["none.toml", "[sequence]"]),
        (
            &["--scene", "name.toml"],
            &[": effects.off[0] = \"stray dogs\"", "shot noise"],
        ),
        (
            &["--scene", "last.toml"],
            &[
                ": effects.off[0]: \"readout\" cannot be switched off; these can:",
                "read noise, stuck pixels",
            ],
        ),
    ] {
        let (code, _, log) = plan(at, flags);
        assert_eq!((code, log.lines().count()), (1, 1), "{flags:?}: {log}");
        for word in words {
            assert!(log.contains(word), "{flags:?}: no {word:?} in {log}");
        }
    }
}

/// A full well above the converter's reach: one warning, and none of the cameras that are built in has one.
#[test]
fn a_converter_that_clips_first_is_told_once() {
    let here = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(repository("configs/cameras/cots-wide.toml")).unwrap();
    let line = text
        .lines()
        .find(|line| line.starts_with("full_well_e"))
        .unwrap();
    let deep = text.replace(line, "full_well_e = 20000.0");
    std::fs::write(here.path().join("deep.toml"), &deep).unwrap();
    let meant = deep.replace("[detector]", "[detector]\nadc_clips_first = true");
    std::fs::write(here.path().join("meant.toml"), meant).unwrap();
    let (code, _, log) = plan(here.path(), &["--camera", "deep.toml"]);
    assert_eq!((code, log.lines().count()), (0, 1), "{log}");
    // (4095 - 32) 2.6 = 10563.8.
    for word in [
        "WARN",
        "deep.toml: detector.full_well_e = 20000",
        "10564 e-",
        "adc_clips_first",
    ] {
        assert!(log.contains(word), "no {word:?} in {log}");
    }
    let flags = [
        ["--camera", "meant.toml"],
        ["--camera", "fai-nir"],
        ["--camera", "ccd-transfer"],
    ];
    for flags in flags {
        let (code, _, log) = plan(here.path(), &flags);
        assert_eq!((code, log.as_str()), (0, ""), "{flags:?}");
    }
}

/// What a scene's plan says of each effect. `tables` come before the sequence, `sequence` ends it.
fn reasons(at: &Path, camera: &str, epoch: &str, tables: &str, sequence: &str) -> Value {
    let scene = format!(
        "camera = {camera:?}\n{tables}\n[sequence]\nepoch = {epoch:?}\nframes = 1\nperiod_s = 1.0\n{sequence}\n"
    );
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    let (code, json, log) = plan(at, &["--scene", "scene.toml", "--json"]);
    assert_eq!((code, log.as_str()), (0, ""), "{tables}");
    serde_json::from_str(&json).unwrap()
}

const STILL: &str = "attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]";
const EPOCH: &str = "2026-06-01T00:00:00Z";

/// Whoever is told that an effect is left out must know what to change: the cause, not what follows from it.
#[test]
fn reasons_are_causes() {
    let here = tempfile::tempdir().unwrap();
    let orbit = repository("configs/scenes/leo-570.tle");
    let orbit = format!("[observer]\norbit = {orbit:?}\n");
    let open = std::fs::read_to_string(repository("configs/cameras/cmos-rolling.toml")).unwrap();
    let capped = open.replace("transmission = 0.85", "transmission = 0.0");
    std::fs::write(here.path().join("capped.toml"), capped).unwrap();
    let sky = "\"zodiacal light\", \"starlight\", \"planets\", \"moon\", \"earth\", \"limb\", \"sunlight\", \"moonglow\", \"earthshine\"";
    let off = format!("[effects]\noff = [\"stars\", \"dark current\", \"smear\", {sky}]\n");
    for (camera, tables, sequence, reasons_of) in [
        (
            "cmos-rolling",
            String::new(),
            STILL,
            &[
                ("aberration drift", "the observer has no orbit"),
                ("smear", "the body's rates are 0"),
                ("rolling shutter", "the body's rates are 0"),
                ("rsos", "the scene has no objects"),
                ("frame transfer", "the shutter is rolling"),
                // 0.262 cm^2 for 0.1 s.
                (
                    "radiation",
                    "0.0472 expected at 1.80 /cm^2/s, free space's: the observer has no position",
                ),
                ("full well", "of the 30000 e- that it holds"),
            ][..],
        ),
        (
            "cmos-rolling",
            format!("{orbit}[sky]\naberration = false\n"),
            STILL,
            &[
                ("aberration drift", "aberration is switched off"),
                ("radiation", "/cm^2/s by the orbit"),
            ],
        ),
        (
            "cmos-rolling",
            format!("{orbit}{off}"),
            "attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\nrates_deg_s = [1.0, 0.0, 0.0]",
            &[
                ("aberration drift", "stars are switched off"),
                ("rolling shutter", "neither smear nor aberration drift runs"),
                ("vignetting", "stars are switched off"),
                (
                    "pixel response",
                    "no light: stars are switched off; the scene has no objects",
                ),
                ("shot noise", "dark current is switched off"),
                ("dead pixels", "no charge that they could lose"),
            ],
        ),
        (
            "ccd-transfer",
            format!("[effects]\noff = [\"stars\", \"rsos\", {sky}]\n"),
            STILL,
            &[
                ("rolling shutter", "frame transfer"),
                (
                    "frame transfer",
                    "no light: stars are switched off; objects are switched off",
                ),
                ("dark current", "with 62 hot pixels"),
                ("stuck pixels", "the detector has no stuck pixels"),
            ],
        ),
        (
            "capped.toml",
            String::new(),
            STILL,
            &[
                (
                    "stars",
                    " stars in the field: the camera turns no light into charge",
                ),
                ("vignetting", "no source in the field gives light"),
                ("pixel response", "no light: "),
            ],
        ),
        (
            "rigel-l",
            orbit.clone(),
            "attitudes = [{ q = [1.0, 0.0, 0.0, 0.0] }]",
            &[("stars", " stars in the field, behind the Earth")],
        ),
        (
            "fai-nir",
            "[effects]\nall = true\n".to_string(),
            STILL,
            &[
                ("smear", "effects.all is set; else not: the body's rates"),
                ("vignetting", "else not: the optics have no vignetting"),
            ],
        ),
    ] {
        let report = reasons(here.path(), camera, EPOCH, &tables, sequence);
        for (name, words) in reasons_of {
            let lines = report["effects"].as_array().unwrap();
            let line = lines.iter().find(|line| line["effect"] == *name).unwrap();
            let why = line["why"].as_str().unwrap();
            assert!(why.contains(words), "{camera}, {name}: {why}");
        }
    }
}

/// One object ahead of the observer on its orbit, lit or not, seen or not.
#[test]
fn reasons_say_where_the_objects_are() {
    let here = tempfile::tempdir().unwrap();
    // The orbit of leo-570.tle, a degree further on.
    let ahead = "AHEAD\n\
        1 99002U 26001B   26152.00000000  .00000000  00000-0  20000-4 0    15\n\
        2 99002  97.6000 200.0000 0008000  80.0000  11.0000 15.05000000    16\n";
    std::fs::write(here.path().join("ahead.tle"), ahead).unwrap();
    let orbit = repository("configs/scenes/leo-570.tle");
    let tables = format!(
        "[observer]\norbit = {orbit:?}\n[objects]\nfiles = [\"ahead.tle\"]\n[sky]\ncatalog = \"bsc\"\n"
    );
    let down = "attitudes = [{ q = [1.0, 0.0, 0.0, 0.0] }]";
    for (camera, epoch, sequence, words) in [
        ("all-sky", EPOCH, down, "1 object in the field, up to "),
        // Its vignetting ends at 90 deg, a little short of the object.
        (
            "all-sky",
            EPOCH,
            STILL,
            "1 object in the field: no light passes the optics there",
        ),
        // Half an orbit on.
        (
            "all-sky",
            "2026-06-01T00:50:00Z",
            STILL,
            "1 object in the field, in the Earth's shadow",
        ),
        (
            "rigel-l",
            EPOCH,
            STILL,
            "the scene's object is not in the field",
        ),
    ] {
        let report = reasons(here.path(), camera, epoch, &tables, sequence);
        let lines = report["effects"].as_array().unwrap();
        let line = lines.iter().find(|line| line["effect"] == "rsos").unwrap();
        let why = line["why"].as_str().unwrap();
        assert!(why.contains(words), "{camera}, {epoch}: {why}");
    }
}

/// What is legal and hardly meant is told, and loads.
#[test]
fn figures_that_nobody_means_are_warned_of() {
    let here = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(repository("configs/cameras/cmos-rolling.toml")).unwrap();
    for (key, value, words) in [
        // Its aperture in metres, and its focal length in centimetres.
        (
            "aperture_mm",
            "0.0157",
            "WARN mine.toml: optics.aperture_mm = 0.0157: with optics.focal_length_mm = 22 it is f/1401",
        ),
        (
            "focal_length_mm",
            "2.2",
            "WARN mine.toml: optics.aperture_mm = 15.7143: with optics.focal_length_mm = 2.2 it is f/0.140",
        ),
        // DN/e-.
        (
            "gain_e_per_dn",
            "800.0",
            "WARN mine.toml: detector.gain_e_per_dn = 800: pixels are full at 0.916 %",
        ),
        // ms.
        ("row_us", "0.04", "WARN mine.toml: timing.row_us = 0.04: "),
        // 80 K above where it is stated: 5,000 times 12 e-.
        (
            "temperature_c",
            "100.0",
            "WARN mine.toml: detector.dark_e_s: at detector.temperature_c 6.",
        ),
        // k2 of another lens, or of other coordinates: no fold, but all stars far outside of their places.
        (
            "k",
            "[-0.08, 1e6]",
            "WARN mine.toml: optics.projection.k = [-0.08, 1000000.0]: at the detector's edge it sees ",
        ),
        // rad.
        (
            "width_by_field",
            "[[0.0, 1.0], [0.16, 1.2]]",
            "WARN mine.toml: optics.psf.width_by_field: it ends at 0.16 deg, the field at 9.",
        ),
    ] {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        // Of a wider field the Sun is to stay away.
        let mine = text.replace("sun_exclusion_deg = 30.0", "sun_exclusion_deg = 100.0");
        let mine = mine.replace(line, &format!("{key} = {value}"));
        std::fs::write(here.path().join("mine.toml"), mine).unwrap();
        let (code, _, log) = plan(here.path(), &["--camera", "mine.toml"]);
        assert_eq!((code, log.lines().count()), (0, 1), "{log}");
        let log = log.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(log.contains(words), "{key}: {log}");
    }
}
