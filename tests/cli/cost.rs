//! `skyloop cost` and `--budget-ms`: the settings as a table, lines, JSON and a plot, and the
//! choice of a run.

use crate::{Folder, camera, has, repository_text};
use serde_json::Value;
use skyloop::measure::cost::settings;

/// The shipped scene `limb-by-night` on few pixels, for fast frames.
const SCENE: &str = "camera = \"small.toml\"\n[observer]\norbit = \"leo-570.tle\"\n[sequence]\n\
     epoch = \"2026-06-20T10:45:00Z\"\nframes = 2\nperiod_s = 1.0\n\
     attitudes = [{ q = [-0.302633392, 0.539097425, 0.637848687, 0.459277747] }]\n";
/// Budgets above and below the time of any frame.
const AMPLE: &str = "--budget-ms 1000000";
const SCANT: &str = "--budget-ms 0.001";
const FASTEST: &str = "no setting is within the budget, this is the fastest";

/// A folder with the scene and its camera.
fn folder() -> Folder {
    let small = [
        ("width_px", "16"),
        ("height_px", "16"),
        ("principal_px", "[7.5, 7.5]"),
    ];
    Folder::with(&[
        ("small.toml", &camera("fai-nir", &small)),
        ("scene.toml", SCENE),
        (
            "leo-570.tle",
            &repository_text("configs/scenes/leo-570.tle"),
        ),
    ])
}

#[test]
fn every_setting_is_in_the_json_the_lines_and_the_table() {
    let here = folder();
    let cost = "cost --scene scene.toml --frames 2 --rounds 5";
    let ended = here.run(&format!("{cost} {AMPLE} --json --out o")).exits(0);
    assert!(!ended.log.contains("error"), "{}", ended.log);
    let report = ended.json();
    assert!(report["cpu"].is_string() && report["level"].is_string());
    for (key, value) in [
        ("scene", Value::from("scene.toml")),
        ("frames", 2.into()),
        ("rounds", 5.into()),
        // The reference has no error, and an unlimited budget selects it.
        ("chosen", "reference".into()),
        ("fits", true.into()),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    let rows = report["rows"].as_array().unwrap();
    let named: Vec<String> = settings().into_iter().map(|setting| setting.name).collect();
    let in_rows = rows.iter().map(|row| row["setting"].as_str().unwrap());
    assert!(in_rows.eq(&named), "{rows:?}");
    for row in rows {
        let figure = |name: &str| row[name].as_f64().unwrap();
        assert!(
            figure("p50_ms") > 0.0 && figure("p99_ms") >= figure("p50_ms"),
            "{row}"
        );
        let is_reference = row["setting"] == "reference";
        for error in "centroid_rms_mpx photometry_ppm frame_rms_e worst_e".split(' ') {
            assert!(figure(error) >= 0.0, "{row}");
            assert!(!is_reference || figure(error) == 0.0, "{row}");
        }
        // The error of the background has either sign; that of `reference` is zero.
        let most_e = if is_reference { f64::MIN_POSITIVE } else { 1.0 };
        assert!(figure("background_e").abs() < most_e, "{row}");
    }
    assert!(rows.iter().any(|row| row["is_front"] == true));
    let off = |name: &str| {
        let row = rows.iter().find(|row| row["setting"] == name).unwrap();
        row["frame_rms_e"].as_f64().unwrap()
    };
    assert!(off("fast") > off("realtime") && off("realtime") > 0.0);

    assert_eq!(here.names("o"), ["cost.csv", "cost.svg"]);
    let csv = here.read("o/cost.csv");
    let lines = csv.lines().skip(1);
    let names = lines.map(|line| line.split(',').next().unwrap());
    assert!(names.eq(&named), "{csv}");
    let plot = here.read("o/cost.svg");
    let dots = plot.lines().filter(|line| line.starts_with("<circle"));
    assert_eq!(dots.count(), named.len());
    has(&plot, &[">\nfast\n<", ">\nrealtime\n<", ">\nreference\n<"]);
    has(&plot, &["budget 1000000 ms"]);

    let table = here.run(&format!("{cost} --one-core {SCANT}")).exits(0);
    let names: Vec<&str> = named.iter().map(String::as_str).collect();
    has(&table.out, &names);
    has(&table.out, &["bias", "photometry", "p99", "front", FASTEST]);
    assert!(!table.out.contains("wrote "), "{}", table.out);
}

#[test]
fn a_budget_selects_the_setting_of_runs_and_labels() {
    let here = folder();
    let fidelity = |out: &str| -> Vec<Value> {
        let labels = here.labels(out).into_iter();
        labels.map(|label| label["fidelity"].clone()).collect()
    };
    let reference = serde_json::json!({ "preset": "reference" });
    for command in ["render", "loopback --frames 1"] {
        let run = |flags: &str| {
            let ended = here.run(&format!("{command} --scene scene.toml {flags}"));
            ended.exits(0)
        };
        let taken = "fidelity for 1000000 ms: reference, p50 ";
        run(&format!("{AMPLE} --out ample")).prints(&[taken, "(fidelity = \"reference\")"]);
        let ample = fidelity("ample");
        assert!(ample.iter().all(|label| *label == reference), "{ample:?}");
        assert!(!ample.is_empty());
        run(&format!("{SCANT} --out scant")).logs(&[FASTEST]);
        assert!(!fidelity("scant").contains(&reference));
        run("--out plain");
        assert_ne!(fidelity("plain"), ample);
    }
}

#[test]
#[cfg(unix)]
fn a_live_run_without_a_sequence_measures_along_the_axes() {
    let here = folder();
    here.write("run.toml", "camera = \"small.toml\"\n");
    let run = format!("run --config run.toml --link udp://127.0.0.1:0 {AMPLE}");
    let begin = "fidelity for 1000000 ms: ";
    let process = crate::run::Process::printing(&here, &run, begin);
    let chosen = &process.address;
    assert!(chosen.starts_with("reference, p50 "), "{chosen}");
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    folder().refuses(
        "cost",
        "--scene scene.toml --budget-ms -1   | --budget-ms | from 0.001 to 1000000
         --scene scene.toml --budget-ms nan  | --budget-ms | from 0.001 to 1000000
         --scene scene.toml --budget-ms soon | --budget-ms | from 0.001 to 1000000
         --scene scene.toml --frames 0       | --frames | 1 to 1000
         --scene scene.toml --frames -3      | --frames | 1 to 1000
         --scene scene.toml --rounds 0       | --rounds | 1 to 100000
         --scene none.toml                   | none.toml
         --scene small.toml                  | small.toml | unknown key `detector`
         --scene scene.toml --out scene.toml --frames 1 --rounds 5 | scene.toml",
    );
}
