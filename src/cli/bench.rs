//! `skyloop bench`: benchmarks of the expensive steps on this machine, as ratios from one run.

use super::common::progress;
use clap::{Args as ClapArgs, Subcommand};
use skyloop::measure::{Report, frames, orbits};
use skyloop_firmware_sim::console::say;

/// The benchmark and the format of its report.
#[derive(ClapArgs)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    of: Option<Of>,
    #[command(flatten)]
    form: Form,
}

#[derive(Subcommand)]
enum Of {
    /// Frames (the default): noise and whole frames against their slow reference, on two threads
    Frame(Form),
    /// Orbits of a catalogue: vector instructions against the sgp4 crate, threads, tracks, one step
    /// of a camera
    Orbit(Form),
}

#[derive(ClapArgs)]
struct Form {
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    match args.of.unwrap_or(Of::Frame(args.form)) {
        Of::Frame(form) => measure::<frames::Report>(form),
        Of::Orbit(form) => measure::<orbits::Report>(form),
    }
}

fn measure<R: Report>(form: Form) -> anyhow::Result<()> {
    let bar = progress(R::PARTS, "parts");
    let report = R::measure(|part| {
        bar.set_message(part.to_string());
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    say(format_args!("{}", form.text(&report)?))?;
    Ok(())
}

impl Form {
    fn text<R: Report>(&self, report: &R) -> serde_json::Result<String> {
        Ok(if self.json {
            format!("{}\n", serde_json::to_string_pretty(report)?)
        } else {
            report.to_string()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use skyloop::measure::{Machine, Row};

    fn row(work: &str, [least, most]: [Option<f64>; 2]) -> Row {
        Row {
            work: work.to_string(),
            against: "another",
            time: 2.0,
            against_time: 20.5,
            ratio: 10.25,
            spread: [10.0, 11.0],
            least,
            most,
        }
    }

    fn machine() -> Machine {
        Machine {
            cpu: "made up".to_string(),
            threads: 2,
            load: Some(0.5),
            level: "portable".to_string(),
        }
    }

    fn parsed<R: Report>(report: &R) -> Value {
        let text = Form { json: true }.text(report).unwrap();
        assert!(text.ends_with("}\n"), "{text}");
        serde_json::from_str(&text).unwrap()
    }

    fn frame_report() -> frames::Report {
        frames::Report {
            machine: machine(),
            noise: vec![row("noise", [Some(10.0), None])],
            frames: vec![row("frame", [None, None]), row("smear", [None, Some(4.0)])],
        }
    }

    #[test]
    fn json_of_frames_has_the_machine_and_all_values_of_rows() {
        let row = |work, least: Value, most: Value| {
            json!({
                "work": work, "against": "another", "time": 2.0, "against_time": 20.5,
                "ratio": 10.25, "spread": [10.0, 11.0], "least": least, "most": most
            })
        };
        assert_eq!(
            parsed(&frame_report()),
            json!({
                "cpu": "made up", "threads": 2, "load": 0.5, "level": "portable",
                "noise": [row("noise", json!(10.0), Value::Null)],
                "frames": [
                    row("frame", Value::Null, Value::Null),
                    row("smear", Value::Null, json!(4.0))
                ]
            })
        );
        let unknown = frames::Report {
            machine: Machine {
                load: None,
                ..machine()
            },
            ..frame_report()
        };
        assert_eq!(parsed(&unknown)["load"], Value::Null);
    }

    #[test]
    fn json_of_orbits_has_rows_step_and_scale() {
        let report = orbits::Report {
            machine: machine(),
            rows: vec![row("batch", [None, None])],
            step: orbits::Step {
                objects: 1,
                frames: 2,
                p50_ms: 3.0,
                p99_ms: 4.0,
                first_ms: 5.0,
                exact_p50_ms: 6.0,
                found: [7.0, 8.0, 9.0],
                bytes: 10.0,
            },
            scale: vec![orbits::Scale {
                objects: 11,
                exact_ns: 12.0,
                tracked_ns: 13.0,
            }],
        };
        let json = parsed(&report);
        assert_eq!(json["cpu"], "made up");
        assert_eq!(json["rows"][0]["work"], "batch");
        assert_eq!(
            json["step"],
            json!({
                "objects": 1, "frames": 2, "p50_ms": 3.0, "p99_ms": 4.0, "first_ms": 5.0,
                "exact_p50_ms": 6.0, "found": [7.0, 8.0, 9.0], "octets": 10.0
            })
        );
        assert_eq!(
            json["scale"],
            json!([{"objects": 11, "exact_ns": 12.0, "tracked_ns": 13.0}])
        );
    }

    #[test]
    fn table_has_the_same_content_and_marks_missed_limits() {
        let text = Form { json: false }.text(&frame_report()).unwrap();
        for words in [
            "made up, 2 threads, load 0.50, portable",
            "ns a pixel",
            "noise",
            "10.2 x",
        ] {
            assert!(text.contains(words), "no {words:?} in\n{text}");
        }
        let broken: Vec<&str> = text
            .lines()
            .filter(|line| line.ends_with("NOT met"))
            .collect();
        assert!(
            broken.len() == 1 && broken[0].starts_with("smear"),
            "{text}"
        );
        assert_eq!(frame_report().broken().len(), 1);
    }
}
