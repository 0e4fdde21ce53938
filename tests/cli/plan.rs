//! `skyloop plan`: the verdicts as a table and as JSON, declared and measured.

use crate::{repository, skyloop};
use serde_json::Value;
use skyloop::effect::EFFECTS;
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
    let lines: Vec<Value> = serde_json::from_str(&json).unwrap();
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
            &["name.toml: effects.off = \"stray dogs\"", "shot noise"],
        ),
        (
            &["--scene", "last.toml"],
            &["effects.off = \"readout\"", "read noise"],
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
