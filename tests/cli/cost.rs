//! `skyloop cost` and `--budget-ms`: the settings as a table, lines, JSON and a plot, and the one that a run takes.

use crate::run::Process;
use crate::{names, skyloop};
use serde_json::Value;
use skyloop::measure::cost::settings;
use std::path::Path;

/// The shipped scene `limb-by-night` on few pixels, so that its frames take little.
const SCENE: &str = "camera = \"small.toml\"\n[observer]\norbit = \"leo-570.tle\"\n[sequence]\n\
     epoch = \"2026-06-20T10:45:00Z\"\nframes = 2\nperiod_s = 1.0\n\
     attitudes = [{ q = [-0.302633392, 0.539097425, 0.637848687, 0.459277747] }]\n";
/// More than any frame takes, and less.
const AMPLE: &str = "1000000";
const SCANT: &str = "0.001";

/// A folder with the scene and its camera.
fn folder() -> tempfile::TempDir {
    let here = tempfile::tempdir().unwrap();
    let camera =
        std::fs::read_to_string(crate::repository("configs/cameras/fai-nir.toml")).unwrap();
    let small = camera
        .replace("width_px = 256", "width_px = 16")
        .replace("height_px = 256", "height_px = 16")
        .replace("principal_px = [127.5, 127.5]", "principal_px = [7.5, 7.5]");
    assert!(small.contains("width_px = 16") && small.contains("height_px = 16"));
    std::fs::write(here.path().join("small.toml"), small).unwrap();
    std::fs::write(here.path().join("scene.toml"), SCENE).unwrap();
    let orbit = crate::repository("configs/scenes/leo-570.tle");
    std::fs::copy(orbit, here.path().join("leo-570.tle")).unwrap();
    here
}

/// What a command that succeeds writes to standard output, and to standard error.
fn told(at: &Path, words: &str) -> (String, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let [out, log] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(0), "{words}: {out}{log}");
    (out, log)
}

/// The `fidelity` of each label in a folder.
fn labelled(folder: &Path) -> Vec<Value> {
    let labels = std::fs::read_to_string(folder.join("labels.jsonl")).unwrap();
    let label = |line: &str| serde_json::from_str::<Value>(line).unwrap()["fidelity"].clone();
    labels.lines().map(label).collect()
}

#[test]
fn every_setting_is_in_the_json_the_lines_and_the_table() {
    let here = folder();
    let cost = "cost --scene scene.toml --frames 2 --rounds 5";
    let (json, log) = told(
        here.path(),
        &format!("{cost} --budget-ms {AMPLE} --json --out o"),
    );
    assert!(!log.contains("error"), "{log}");
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&report["scene"], &report["frames"]),
        (&"scene.toml".into(), &2.into())
    );
    assert!(report["cpu"].is_string() && report["level"].is_string() && report["rounds"] == 5);
    let rows = report["rows"].as_array().unwrap();
    let named: Vec<String> = settings().into_iter().map(|setting| setting.name).collect();
    let in_rows: Vec<&str> = rows
        .iter()
        .map(|row| row["setting"].as_str().unwrap())
        .collect();
    assert_eq!(in_rows, named);
    for row in rows {
        let figure = |name: &str| row[name].as_f64().unwrap();
        assert!(
            figure("p50_ms") > 0.0 && figure("p99_ms") >= figure("p50_ms"),
            "{row}"
        );
        let is_reference = row["setting"] == "reference";
        for error in [
            "centroid_rms_mpx",
            "photometry_ppm",
            "frame_rms_e",
            "worst_e",
        ] {
            assert!(figure(error) >= 0.0, "{row}");
            assert!(!is_reference || figure(error) == 0.0, "{row}");
        }
        // Too much or too little.
        let background_e = figure("background_e");
        assert!(
            background_e.abs() < 1.0 && (!is_reference || background_e == 0.0),
            "{row}"
        );
    }
    // Nothing is closer to the reference than itself, and what has all time takes it.
    assert_eq!(
        (&report["chosen"], &report["fits"]),
        (&"reference".into(), &true.into())
    );
    let is_front = |row: &&Value| row["is_front"] == true;
    assert!(rows.iter().filter(is_front).count() >= 1);
    let off = |name: &str| {
        let row = rows.iter().find(|row| row["setting"] == name).unwrap();
        row["frame_rms_e"].as_f64().unwrap()
    };
    assert!(off("fast") > off("realtime") && off("realtime") > 0.0);

    assert_eq!(names(&here.path().join("o")), ["cost.csv", "cost.png"]);
    let csv = std::fs::read_to_string(here.path().join("o/cost.csv")).unwrap();
    let lines: Vec<&str> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap())
        .collect();
    assert_eq!(lines, named);
    let plot = image::open(here.path().join("o/cost.png"))
        .unwrap()
        .to_rgb8();
    let colours: std::collections::HashSet<_> = plot.pixels().collect();
    assert!(colours.len() > 3, "a plot has axes, dots and a line");

    let (table, _) = told(
        here.path(),
        &format!("{cost} --one-core --budget-ms {SCANT}"),
    );
    for name in named
        .iter()
        .map(String::as_str)
        .chain(["bias", "photometry", "p99", "front"])
    {
        assert!(table.contains(name), "no {name:?} in\n{table}");
    }
    assert!(
        table.contains("no setting is that fast, this is the fastest"),
        "{table}"
    );
    assert!(!table.contains("wrote "), "{table}");
}

#[test]
fn runs_take_the_setting_that_a_budget_buys_and_labels_say_so() {
    let here = folder();
    let is_reference = |label: &Value| *label == serde_json::json!({ "preset": "reference" });
    for command in ["render", "loopback --frames 1"] {
        let command = format!("{command} --scene scene.toml");
        let (out, _) = told(
            here.path(),
            &format!("{command} --budget-ms {AMPLE} --out ample"),
        );
        assert!(
            out.contains("fidelity for 1000000 ms: reference, p50 "),
            "{out}"
        );
        assert!(out.contains("(fidelity = \"reference\")"), "{out}");
        let ample = labelled(&here.path().join("ample"));
        assert!(
            !ample.is_empty() && ample.iter().all(is_reference),
            "{ample:?}"
        );
        let (_, log) = told(
            here.path(),
            &format!("{command} --budget-ms {SCANT} --out scant"),
        );
        assert!(
            log.contains("no setting is that fast, this is the fastest"),
            "{log}"
        );
        let scant = labelled(&here.path().join("scant"));
        assert!(!scant.iter().any(is_reference), "{scant:?}");
        told(here.path(), &format!("{command} --out plain"));
        assert_ne!(labelled(&here.path().join("plain")), ample);
    }
}

#[test]
#[cfg(unix)]
fn a_live_run_without_a_sequence_measures_along_the_axes() {
    let here = folder();
    let config = here.path().join("run.toml");
    let camera = here.path().join("small.toml");
    std::fs::write(&config, format!("camera = {:?}\n", camera.display())).unwrap();
    let config = config.display().to_string();
    let run = [
        "run",
        "--config",
        &config,
        "--link",
        "udp://127.0.0.1:0",
        "--budget-ms",
        AMPLE,
    ];
    let process = Process::of(&run, "fidelity for 1000000 ms: ");
    assert!(
        process.address.starts_with("reference, p50 "),
        "{}",
        process.address
    );
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    let here = folder();
    let (scene, frames) = ("--scene scene.toml", "--frames 1 --rounds 5");
    for (flags, words) in [
        (
            format!("{scene} {frames} --budget-ms -1"),
            &["--budget-ms", "from 0.001 to 1000000"][..],
        ),
        (
            format!("{scene} {frames} --budget-ms nan"),
            &["--budget-ms", "from 0.001 to 1000000"],
        ),
        (
            format!("{scene} {frames} --budget-ms soon"),
            &["--budget-ms", "from 0.001 to 1000000"],
        ),
        (format!("{scene} --frames 0"), &["--frames", "1 to 1000"]),
        (format!("{scene} --frames -3"), &["--frames", "1 to 1000"]),
        (format!("{scene} --rounds 0"), &["--rounds", "1 to 100000"]),
        (format!("{frames} --scene none.toml"), &["none.toml"]),
        (
            format!("{frames} --scene small.toml"),
            &["small.toml", "unknown key `detector`"],
        ),
        (
            format!("{scene} {frames} --out scene.toml"),
            &["scene.toml"],
        ),
    ] {
        let cost = skyloop(here.path())
            .arg("cost")
            .args(flags.split(' '))
            .output()
            .unwrap();
        let log = String::from_utf8(cost.stderr).unwrap();
        assert!(
            !cost.status.success() && log.contains("error: "),
            "{flags}: {log}"
        );
        for word in words {
            assert!(log.contains(word), "{flags}: no {word:?} in {log}");
        }
    }
}
