//! `skyloop soak`: what it measures, what it writes, where it fails.

#[cfg(unix)]
use crate::run::Process;
use crate::{repository, skyloop};
use serde_json::Value;
use std::path::Path;

/// A run file with a camera of 64 x 64 pixels at 20 Hz, and more keys of `[run]`.
pub fn files(at: &Path, run: &str) {
    let camera = std::fs::read_to_string(repository("configs/cameras/fai-nir.toml")).unwrap();
    let set = |text: String, key: &str, value: &str| -> String {
        let line = |line: &str| match line.starts_with(key) {
            true => format!("{key} = {value}"),
            false => line.to_string(),
        };
        text.lines().map(|one| line(one) + "\n").collect()
    };
    let camera = set(camera, "width_px", "64");
    let camera = set(camera, "height_px", "64");
    let camera = set(camera, "exposure_s", "0.01");
    let camera = set(camera, "rate_hz", "20.0");
    std::fs::write(at.join("camera.toml"), camera).unwrap();
    let text = format!(
        "camera = \"camera.toml\"\n[sequence]\nepoch = \"2026-12-01T00:00:00Z\"\nframes = 2\nperiod_s = 0.1\n\
         attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n[run]\n{run}\n"
    );
    std::fs::write(at.join("run.toml"), text).unwrap();
}

fn soak(at: &Path, words: &str) -> std::process::Output {
    let mut command = skyloop(at);
    command.args(words.split_whitespace()).output().unwrap()
}

fn read(at: &Path, name: &str) -> String {
    std::fs::read_to_string(at.join(name)).unwrap()
}

#[test]
fn a_run_is_measured_and_told_in_every_form() {
    let here = tempfile::tempdir().unwrap();
    files(
        here.path(),
        "clock = \"wall\"\ncpus = [1023]\n[[heads]]\nname = \"B\"\ncamera = \"camera.toml\"\nlink = \"udp://127.0.0.1:1\"",
    );
    // However busy the machine is: nothing is asked of it.
    let words = "soak --config run.toml --minutes 0.05 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    let output = soak(here.path(), words);
    let (said, log) = [output.stdout, output.stderr]
        .map(|text| String::from_utf8(text).unwrap())
        .into();
    assert!(output.status.success(), "{said}{log}");
    for row in [
        "to the last octet",
        "deadlines missed",
        "context switches",
        // Two for each frame of the first camera at 20 Hz; it alone is told of the vehicle.
        "a second, of 40 requested",
        // No machine that runs this has as many.
        "CPU 1023 not granted (run.cpus: ",
        "start to the first frame",
        "drift of the clocks",
        "memory",
        "kept: fai-nir: deadlines missed",
        "kept: B: deadlines missed",
    ] {
        assert!(said.contains(row), "no {row:?} in {said}");
    }
    let report: Value = serde_json::from_str(&read(here.path(), "verdict.json")).unwrap();
    assert_eq!(report["passed"], true);
    // X-Val: a fifth of 3 s.
    assert_eq!(report["memory"]["warm_s"], 0.6);
    assert!(report["memory"]["end"].as_u64() > Some(1 << 20));
    assert!(report["first_frame_s"].as_f64() > Some(0.0));
    for (camera, name) in [(0, "fai"), (1, "B")] {
        let camera = &report["cameras"][camera];
        let latencies = &camera["latencies"];
        assert!(camera["name"].as_str().unwrap().contains(name));
        let frames = latencies["frames"].as_u64().unwrap();
        assert!(frames > 0, "{frames}");
        // None, where a busy machine left one of the fifths without a frame.
        assert!(camera.as_object().unwrap().contains_key("drift_s"));
        assert!(
            latencies["last_octet"]["count"].as_u64().unwrap() > 0,
            "{latencies}"
        );
    }
    let junit = read(here.path(), "verdict.xml");
    assert!(
        junit.contains("<testsuite") && junit.contains("failures=\"0\""),
        "{junit}"
    );
}

/// By the client's time, and with a limit of memory that is far off.
#[test]
fn a_run_by_the_clients_clock_is_measured_likewise() {
    let here = tempfile::tempdir().unwrap();
    files(here.path(), "clock = \"external\"");
    let words = "soak --config run.toml --minutes 0.04 --max-miss-rate 1 --max-growth 1000 --rate 50 --link memory --json verdict.json";
    let output = soak(here.path(), words);
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{log}");
    let said = String::from_utf8(output.stdout).unwrap();
    for row in ["of 50 requested", "kept: memory"] {
        assert!(said.contains(row), "no {row:?} in {said}");
    }
    let report: Value = serde_json::from_str(&read(here.path(), "verdict.json")).unwrap();
    let frames = report["cameras"][0]["latencies"]["frames"].as_u64();
    assert!(frames > Some(0), "{report}");
}

#[test]
fn a_limit_that_is_broken_fails_the_run_and_names_the_first_frame() {
    let here = tempfile::tempdir().unwrap();
    // No frame leaves within a microsecond.
    files(here.path(), "clock = \"wall\"\nlatency_s = 1e-6");
    let words = "soak --config run.toml --minutes 0.02 --max-p99-ms 0.001 --junit verdict.xml --link memory";
    let output = soak(here.path(), words);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).unwrap();
    for words in [
        "deadlines missed:",
        "is above 1e-3: frame 0 was the first",
        "is above 0.001 ms:",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    // Of both limits, whether or not a busy machine let it come whole.
    let first = said.matches("frame 0 was the first (").count();
    assert_eq!(first, 2, "{said}");
    let junit = read(here.path(), "verdict.xml");
    assert!(
        junit.contains("failures=\"2\"") && junit.contains("<failure"),
        "{junit}"
    );
}

/// What was measured until then is told, and it is no pass.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_soak_with_what_it_has_and_fails_it() {
    let here = tempfile::tempdir().unwrap();
    files(here.path(), "clock = \"wall\"");
    let words = "soak --config run.toml --minutes 60 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skyloop"));
    command
        .args(words.split_whitespace())
        .current_dir(here.path())
        .stderr(std::process::Stdio::piped());
    let process = Process::spawned(&mut command, "fai-nir ");
    std::thread::sleep(std::time::Duration::from_millis(500));
    // There is no verdict yet.
    let verdict = read(here.path(), "verdict.xml");
    assert!(verdict.contains("failures=\"2\""), "{verdict}");
    assert!(read(here.path(), "verdict.json").contains("\"passed\": false"));
    process.signal("-INT");
    let (code, table, log) = process.end_with_log();
    assert_eq!(code, Some(1), "{table}{log}");
    assert!(table.contains("kept: deadlines missed"), "{table}");
    for text in [&table, &log, &read(here.path(), "verdict.xml")] {
        assert!(text.contains("stopped after 0."), "{text}");
        assert!(text.contains("of 60 min"), "{text}");
    }
    let report: Value = serde_json::from_str(&read(here.path(), "verdict.json")).unwrap();
    assert_eq!(report["passed"], false);
}

#[test]
fn what_cannot_be_soaked_is_told_before() {
    let here = tempfile::tempdir().unwrap();
    let refused = |run: &str, words: &str, says: &[&str]| {
        files(here.path(), run);
        let words = format!("soak --config run.toml {words}");
        let output = soak(here.path(), &words);
        assert!(!output.status.success(), "{words}");
        let said = String::from_utf8(output.stderr).unwrap();
        for word in says {
            assert!(said.contains(word), "{words}: no {word:?} in {said}");
        }
    };
    let wall = "clock = \"wall\"";
    refused("", "", &["run.clock is \"stepped\"", "\"wall\""]);
    refused(
        "clock = \"external\"\ntrigger = \"packet\"",
        "",
        &["run.trigger is \"packet\"", "leave it out"],
    );
    refused(
        "clock = \"wall\"\ntrigger = \"packet\"",
        "",
        &["run.trigger", "SingleShot"],
    );
    refused(wall, "--minutes 0", &["--minutes", "0.001 to 100000"]);
    refused(wall, "--max-miss-rate 2", &["--max-miss-rate", "0 to 1"]);
    refused(
        wall,
        "--junit no/such/folder.xml",
        &["no/such/folder.xml", "name another file"],
    );
    for (words, option) in [
        ("--junit both.out --json both.out", "--json both.out"),
        ("--junit run.toml", "--junit run.toml"),
    ] {
        refused(wall, words, &[option, "names the same file"]);
    }
    refused(
        "clock = \"wall\"\n[[heads]]\nname = \"B\"\ncamera = \"camera.toml\"\nlink = \"udp://127.0.0.1:1\"",
        "--link can",
        &["--link can", "2 cameras", "--link udp"],
    );
    refused(
        wall,
        "--rate 100000 --minutes 100000",
        &["--minutes 100000", "ask for less"],
    );
    refused(wall, "--metrics nowhere", &["metrics at nowhere"]);
    refused(
        "clock = \"wall\"\npriority = 100",
        "",
        &["run.priority", "1 to 99"],
    );
    refused(
        "clock = \"wall\"\ndelay_s = 10",
        "",
        &["run.delay_s", "at most 16"],
    );
}

/// A level that the line can carry at the camera's rate, where the file's cannot.
#[test]
#[cfg(target_os = "linux")]
fn a_soak_takes_the_level_that_it_is_given() {
    let here = tempfile::tempdir().unwrap();
    files(here.path(), "clock = \"wall\"");
    let words = "soak --config run.toml --minutes 0.02 --max-miss-rate 1 --link pty?baud=921600";
    for (level, code) in [
        ("", Some(1)),
        (" --output labels", Some(0)),
        (" --output x", Some(2)),
    ] {
        let output = soak(here.path(), &format!("{words}{level}"));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), code, "{level}: {said}");
    }
}
