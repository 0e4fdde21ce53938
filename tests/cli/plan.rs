//! `skyloop plan`: the decisions as a table and as JSON, with declared and measured errors.

use crate::{Folder, Outcome, camera, has, repository, rows, still, with_keys};
use serde_json::{Value, json};
use skyloop::effect::EFFECTS;
use skyloop::fidelity::Fidelity;

const EPOCH: &str = "2026-06-01T00:00:00Z";

/// The row of a table, or of JSON, of this effect.
fn row<'a>(report: &'a Value, effect: &str) -> &'a Value {
    let rows = report["effects"].as_array().unwrap();
    rows.iter().find(|row| row["effect"] == effect).unwrap()
}

/// The rows of a table with its head.
fn lines(table: &str) -> Vec<&str> {
    let lines = table.lines();
    lines.filter(|line| line.starts_with("  ")).collect()
}

#[test]
fn the_table_has_every_effect_in_order_with_its_reason() {
    let table = Folder::new().run("plan").quiet();
    let lines = lines(&table);
    has(lines[0], &["error if skipped", "because"]);
    for (line, effect) in lines[1..].iter().zip(EFFECTS) {
        assert!(line.trim().starts_with(effect.name), "{line}");
        assert!(line.contains(" run ") || line.contains(" skip "), "{line}");
        assert!(line.contains(" e-") || line.contains(" px"), "{line}");
    }
    assert_eq!(lines.len(), EFFECTS.len() + 2, "{table}");
    assert!(table.contains("stars in the field"), "{table}");
}

#[test]
fn json_has_the_fields_of_labels_and_the_measurements() {
    let sequence = with_keys(&still("2026-01-01T00:00:00Z"), &[("frames", "2")]);
    let scene = format!("camera = \"fai-630\"\n[effects]\noff = [\"dark current\"]\n{sequence}");
    let here = Folder::with(&[("scene.toml", &scene)]);
    let measured = here.run("plan --scene scene.toml --frame 1 --measure --json");
    let report: Value = serde_json::from_str(&measured.quiet()).unwrap();
    let keys: Vec<&String> = report.as_object().unwrap().keys().collect();
    let expected = [
        "camera",
        "effects",
        "epoch_mid",
        "frame",
        "scene",
        "tolerances",
    ];
    assert_eq!(keys, expected);
    let tolerances = Fidelity::preset("realtime").unwrap();
    for (key, value) in [
        ("scene", json!("scene.toml")),
        ("camera", json!("fai-630")),
        ("frame", json!(1)),
        // One second after the first.
        ("epoch_mid", json!("2026-01-01T00:00:01.000Z")),
        (
            "tolerances",
            json!({ "skip_e": tolerances.skip_e, "skip_snr": tolerances.skip_snr, "skip_px": tolerances.skip_px }),
        ),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    let dark = row(&report, "dark current");
    assert_eq!(
        (&dark["run"], &dark["price_ms"]),
        (&json!(false), &Value::Null)
    );
    assert_eq!(dark["why"], "it is switched off");
    // 20 e-/s for 0.1 s.
    assert!(
        (dark["error_e"].as_f64().unwrap() - 2.0).abs() < 1e-9,
        "{dark}"
    );
    let read = row(&report, "read noise");
    // An rms of one pixel of 65,536 over 24 frames, chosen by other frames: 12 e- within four
    // times 15 %.
    let measured_e = read["measured_error_e"].as_f64().unwrap();
    assert!((measured_e - 12.0).abs() < 7.0, "{read}");
    assert!(read["measured_ms"].as_f64().unwrap() > 0.0);
    assert_eq!((&read["rms"], &dark["rms"]), (&json!(true), &json!(false)));
    assert!(read["measured_error_px"].is_null(), "{read}");
}

/// Errors in px are measured in px, random errors are marked as rms, and names of columns are
/// unique.
#[test]
fn declared_and_measured_errors_are_of_one_kind() {
    // The sky is so faint that noise hides nothing. 0.5 deg/s for 0.1 s over pixels of 389 arcsec
    // are 0.46 px in the centre of the field and 0.49 px in its corners.
    let sequence = still("2026-01-01T00:00:00Z");
    let scene = format!("camera = \"fai-630\"\n{sequence}rates_deg_s = [0.5, 0.0, 0.0]\n");
    let here = Folder::with(&[("scene.toml", &scene)]);
    let table = here.run("plan --scene scene.toml --measure").quiet();
    let lines = lines(&table);
    for column in ["measured error", "measured time", "price"] {
        assert_eq!(lines[0].matches(column).count(), 1, "{}", lines[0]);
    }
    let line = |name: &str| {
        *lines
            .iter()
            .find(|line| line.trim().starts_with(name))
            .unwrap()
    };
    // Both the declared and the measured error are half of the path.
    let smear = line("smear");
    let number = |before: &str| before.split(' ').next_back().unwrap().parse().unwrap();
    let px: Vec<f64> = smear.split(" px").take(2).map(number).collect();
    let is_half = (0.23..0.27).contains(&px[0]) && (0.23..0.25).contains(&px[1]);
    assert!(is_half && !smear.contains(" e-"), "{smear}");
    assert_eq!(line("shot noise").matches(" e- rms").count(), 2, "{table}");
    assert_eq!(line("dark current").matches(" e- ").count(), 2, "{table}");
    assert!(!line("dark current").contains("rms"), "{table}");
}

/// Only on a terminal, standard error shows the progress of the measurement.
#[test]
#[cfg(unix)]
fn a_terminal_shows_the_progress() {
    use std::io::Read;
    let here = Folder::new();
    let (mut near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    let terminal = std::fs::File::options().write(true).open(device).unwrap();
    serialport::SerialPort::set_timeout(&mut near, crate::support::TIMEOUT).unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skyloop"));
    command.args(["plan", "--measure", "--camera", "fai-630"]);
    let command = command
        .current_dir(&here)
        .env("TERM", "xterm")
        .stderr(terminal);
    let mut running = command.stdout(std::process::Stdio::null()).spawn().unwrap();
    let wanted = format!("/{} effects measured  rolling shutter", EFFECTS.len());
    let (mut seen, mut bytes) = (String::new(), [0; 4096]);
    while !seen.contains(&wanted) {
        let count = near.read(&mut bytes).unwrap_or(0);
        assert!(count > 0, "no {wanted:?} in {seen:?}");
        seen += &String::from_utf8_lossy(&bytes[..count]);
    }
    running.kill().unwrap();
    running.wait().unwrap();
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    let here = Folder::with(&[
        ("none.toml", "seed = 1\n"),
        ("name.toml", "[effects]\noff = [\"stray dogs\"]\n"),
        ("last.toml", "[effects]\noff = [\"readout\"]\n"),
    ]);
    here.refuses(
        "plan",
        "--frame 50        | --frame 50 | 0 to 49
         --camera nope     | nope | fai-nir
         --scene none.toml | none.toml | [sequence]
         --scene name.toml | : effects.off[0] = \"stray dogs\" | shot noise
         --scene last.toml | read noise, stuck pixels
         | : effects.off[0]: \"readout\" cannot be switched off; these can:",
    );
}

/// The plan of a scene as JSON; `tables` come before its sequence.
fn planned(here: &Folder, camera: &str, tables: &str, sequence: &str) -> Value {
    here.write(
        "scene.toml",
        format!("camera = {camera:?}\n{tables}\n{sequence}\n"),
    );
    let plan = here.run("plan --scene scene.toml --json").quiet();
    serde_json::from_str(&plan).unwrap()
}

/// A reason names the cause, which the user can change, not its consequence.
#[test]
fn reasons_are_causes() {
    let here = Folder::new();
    here.write(
        "capped.toml",
        camera("cmos-rolling", &[("transmission", "0.0")]),
    );
    let orbit = repository("configs/scenes/leo-570.tle");
    let orbit = format!("[observer]\norbit = {orbit:?}\n");
    let sky = "\"zodiacal light\", \"starlight\", \"planets\", \"moon\", \"earth\", \"limb\", \"sunlight\", \"moonglow\", \"earthshine\"";
    let no_sky = |more: &str| format!("[effects]\noff = [\"stars\", {more}, {sky}]\n");
    let no_aberration = format!("{orbit}[sky]\naberration = false\n");
    let turned = format!("{orbit}{}", no_sky("\"dark current\", \"smear\""));
    for (camera, tables, sequence, reasons) in [
        // 0.262 cm^2 for 0.1 s.
        (
            "cmos-rolling",
            "",
            "",
            "aberration drift | the observer has no orbit
             smear            | the body's rates are 0
             rolling shutter  | the body's rates are 0
             rsos             | the scene has no objects
             frame transfer   | the shutter is rolling
             radiation        | 0.0472 expected at 1.80 /cm^2/s, free space's: the observer has no position
             full well        | of the 30000 e- that it holds",
        ),
        (
            "cmos-rolling",
            &no_aberration,
            "",
            "aberration drift | aberration is switched off
             radiation        | /cm^2/s by the orbit",
        ),
        (
            "cmos-rolling",
            &turned,
            "rates_deg_s = [1.0, 0.0, 0.0]",
            "aberration drift | stars are switched off
             rolling shutter  | neither smear nor aberration drift runs
             vignetting       | stars are switched off
             pixel response   | no light: stars are switched off; the scene has no objects
             shot noise       | dark current is switched off
             dead pixels      | no charge that they could lose",
        ),
        (
            "ccd-transfer",
            &no_sky("\"rsos\""),
            "",
            "rolling shutter | frame transfer
             frame transfer  | no light: stars are switched off; objects are switched off
             dark current    | with 62 hot pixels
             stuck pixels    | the detector has no stuck pixels",
        ),
        (
            "capped.toml",
            "",
            "",
            "stars          | stars in the field: the camera turns no light into charge
             vignetting     | no source in the field gives light
             pixel response | no light:",
        ),
        (
            "fai-nir",
            "[effects]\nall = true\n",
            "",
            "smear      | effects.all is set; else not: the body's rates
             vignetting | else not: the optics have no vignetting",
        ),
    ] {
        let report = planned(&here, camera, tables, &(still(EPOCH) + sequence));
        for (effect, reason) in rows(reasons) {
            let why = row(&report, effect)["why"].as_str().unwrap();
            assert!(why.contains(reason[0]), "{camera}, {effect}: {why}");
        }
    }
}

/// Stars behind the Earth, and one object ahead of the observer on its orbit, sunlit or not, in
/// view or not.
#[test]
fn reasons_state_the_visibility_of_stars_and_objects() {
    // The orbit of leo-570.tle, a degree ahead.
    let ahead = "AHEAD\n\
        1 99002U 26001B   26152.00000000  .00000000  00000-0  20000-4 0    15\n\
        2 99002  97.6000 200.0000 0008000  80.0000  11.0000 15.05000000    16\n";
    let here = Folder::with(&[("ahead.tle", ahead)]);
    let orbit = repository("configs/scenes/leo-570.tle");
    let observer = format!("[observer]\norbit = {orbit:?}\n");
    let objects =
        format!("{observer}[objects]\nfiles = [\"ahead.tle\"]\n[sky]\ncatalog = \"bsc\"\n");
    // The vignetting of the third row ends at 90 deg, just before the object. The fourth is half an
    // orbit ahead.
    for (scene, reason) in rows(
        "rigel-l stars 00:00 down  | stars in the field, behind the Earth
         all-sky rsos  00:00 down  | 1 object in the field, up to
         all-sky rsos  00:00 ahead | 1 object in the field: no light passes the optics there
         all-sky rsos  00:50 ahead | 1 object in the field, in the Earth's shadow
         rigel-l rsos  00:00 ahead | the scene's object is not in the field",
    ) {
        let words: Vec<&str> = scene.split_whitespace().collect();
        let [camera, effect, time, pointing] = words[..] else {
            panic!("{scene}");
        };
        let tables = if effect == "stars" {
            &observer
        } else {
            &objects
        };
        let mut sequence = still(&format!("2026-06-01T{time}:00Z"));
        if pointing == "down" {
            let attitudes = "[{ q = [1.0, 0.0, 0.0, 0.0] }]";
            sequence = with_keys(&sequence, &[("attitudes", attitudes)]);
        }
        let plan = planned(&here, camera, tables, &sequence);
        let why = row(&plan, effect)["why"].as_str().unwrap();
        assert!(why.contains(reason[0]), "{scene}: {why}");
    }
}

/// The plan of this camera file.
fn of_camera(text: &str) -> Outcome {
    Folder::with(&[("mine.toml", text)]).run("plan --camera mine.toml")
}

/// Valid but implausible values cause one warning; no built-in camera causes one.
#[test]
fn implausible_values_cause_a_warning() {
    // The exclusion angle of the Sun is larger than the field.
    let rolling = camera("cmos-rolling", &[("sun_exclusion_deg", "100.0")]);
    let wide = camera("cots-wide", &[]);
    let of_rolling = "
        // Its aperture in metres, and its focal length in centimetres.
        aperture_mm = 0.0157
        | optics.aperture_mm = 0.0157: with optics.focal_length_mm = 22 it is f/1401
        focal_length_mm = 2.2
        | optics.aperture_mm = 15.7143: with optics.focal_length_mm = 2.2 it is f/0.140
        // DN/e-.
        gain_e_per_dn = 800.0 | detector.gain_e_per_dn = 800: full well is at 0.916 %
        // ms.
        row_us = 0.04 | timing.row_us = 0.04:
        // 80 K above the stated temperature: 5,000 times 12 e-.
        temperature_c = 100.0 | detector.dark_e_s: at detector.temperature_c 6.
        // k2 of another lens, or of other coordinates: no fold, but all positions are wrong.
        k = [-0.08, 1e6]
        | optics.projection.k = [-0.08, 1000000.0]: at the detector's edge it sees
        // rad.
        width_by_field = [[0.0, 1.0], [0.16, 1.2]]
        | optics.psf.width_by_field: it ends at 0.16 deg, the field at 9.";
    // A full well above the range of the converter, (4095 - 32) 2.6 = 10563.8.
    let of_wide = "full_well_e = 20000.0
        | detector.full_well_e = 20000 | 10564 e- | adc_clips_first";
    let of = |camera, table| rows(table).into_iter().map(move |row| (camera, row));
    for (camera, (key, words)) in of(&rolling, of_rolling).chain(of(&wide, of_wide)) {
        let (name, value) = key.split_once(" = ").unwrap();
        let warned = of_camera(&with_keys(camera, &[(name, value)]));
        let warned = warned.exits(0).logs_lines(1);
        let log = warned.log.split_whitespace().collect::<Vec<_>>().join(" ");
        has(&log, &["WARN mine.toml: "]);
        has(&log, &words);
    }
    let deep = with_keys(&wide, &[("full_well_e", "20000.0")]);
    of_camera(&deep.replace("[detector]", "[detector]\nadc_clips_first = true")).quiet();
    for camera in ["fai-nir", "ccd-transfer"] {
        Folder::new()
            .run(&format!("plan --camera {camera}"))
            .quiet();
    }
}
