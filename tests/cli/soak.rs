//! `skyloop soak`: measurements, reports, failures.

#[cfg(unix)]
use crate::run::Process;
use crate::{Folder, camera, has, rows, still, with_keys};

/// A run file with a camera of 64 x 64 pixels at 20 Hz, and more keys of `[run]`.
pub fn files(run: &str) -> Folder {
    let small = [
        ("width_px", "64"),
        ("height_px", "64"),
        ("exposure_s", "0.01"),
        ("rate_hz", "20.0"),
    ];
    let sequence = [("frames", "2"), ("period_s", "0.1")];
    let sequence = with_keys(&still("2026-12-01T00:00:00Z"), &sequence);
    Folder::with(&[
        ("camera.toml", &camera("fai-nir", &small)),
        (
            "run.toml",
            &format!("camera = \"camera.toml\"\n{sequence}[run]\n{run}\n"),
        ),
    ])
}

const WALL: &str = "clock = \"wall\"";
const HEAD: &str =
    "[[heads]]\nname = \"B\"\ncamera = \"camera.toml\"\nlink = \"udp://127.0.0.1:1\"";

#[test]
fn a_run_is_measured_and_reported_in_every_format() {
    let here = files(&format!("{WALL}\ncpus = [1023]\n{HEAD}"));
    // Passes on a busy machine: all deadlines may be missed.
    let words = "soak --config run.toml --minutes 0.05 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    // 40 attitudes/s: two for each frame of the first camera at 20 Hz, the only one with attitudes.
    // No test machine has processor 1023.
    here.run(words).exits(0).prints(&[
        "to the last octet",
        "deadlines missed",
        "context switches",
        "a second, of 40 requested",
        "CPU 1023 not granted (run.cpus: ",
        "start to the first frame",
        "drift of the clocks",
        "memory",
        "passed: fai-nir: deadlines missed",
        "passed: B: deadlines missed",
    ]);
    let report = here.json("verdict.json");
    assert_eq!(report["passed"], true);
    // X-Val: a fifth of 3 s.
    assert_eq!(report["memory"]["warm_s"], 0.6);
    assert!(report["memory"]["end"].as_u64() > Some(1 << 20));
    assert!(report["first_frame_s"].as_f64() > Some(0.0));
    for (camera, name) in [(0, "fai"), (1, "B")] {
        let camera = &report["cameras"][camera];
        assert!(camera["name"].as_str().unwrap().contains(name));
        // Null if a fifth of the run had no frame on a busy machine.
        assert!(camera.as_object().unwrap().contains_key("drift_s"));
        let latencies = &camera["latencies"];
        assert!(latencies["frames"].as_u64() > Some(0), "{latencies}");
        assert!(
            latencies["last_octet"]["count"].as_u64() > Some(0),
            "{latencies}"
        );
    }
    has(&here.read("verdict.xml"), &["<testsuite", "failures=\"0\""]);
}

/// With the client's clock, and a high limit of memory growth.
#[test]
fn a_run_by_the_clients_clock_is_measured() {
    let here = files("clock = \"external\"");
    let words = "soak --config run.toml --minutes 0.04 --max-miss-rate 1 --max-growth 1000 --rate 50 --link memory --json verdict.json";
    here.run(words)
        .exits(0)
        .prints(&["of 50 requested", "passed: memory"]);
    let report = here.json("verdict.json");
    let frames = report["cameras"][0]["latencies"]["frames"].as_u64();
    assert!(frames > Some(0), "{report}");
}

#[test]
fn a_broken_limit_fails_the_run_and_names_the_first_frame() {
    // No frame is sent within a microsecond.
    let here = files(&format!("{WALL}\nlatency_s = 1e-6"));
    let words = "soak --config run.toml --minutes 0.02 --max-p99-ms 0.001 --junit verdict.xml --link memory";
    let failed = here.run(words).exits(1).logs(&[
        "deadlines missed:",
        "is above 1e-3: frame 0 was the first",
        "is above 0.001 ms:",
    ]);
    // For both limits, whether or not the frame was complete on a busy machine.
    let first = failed.log.matches("frame 0 was the first (").count();
    assert_eq!(first, 2, "{}", failed.log);
    has(&here.read("verdict.xml"), &["failures=\"2\"", "<failure"]);
}

/// The measurements so far are reported, and the run has not passed.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_soak_with_its_report_and_fails_it() {
    let here = files(WALL);
    let words = "soak --config run.toml --minutes 60 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    let process = Process::printing(&here, words, "fai-nir ");
    std::thread::sleep(std::time::Duration::from_millis(500));
    // There is no verdict yet.
    has(&here.read("verdict.xml"), &["failures=\"2\""]);
    assert_eq!(here.json("verdict.json")["passed"], false);
    let ended = process.end_by("-INT").exits(1);
    has(&ended.out, &["passed: deadlines missed"]);
    for text in [&ended.out, &ended.log, &here.read("verdict.xml")] {
        has(text, &["stopped after 0.", "of 60 min"]);
    }
    assert_eq!(here.json("verdict.json")["passed"], false);
}

#[test]
fn unsuitable_runs_are_refused_before_the_start() {
    let refuses = |run: &str, table: &str| files(run).refuses("soak --config run.toml", table);
    for (run, says) in rows(
        "STEPPED              | run.clock is \"stepped\" | \"wall\"
         EXTERNAL; PACKET      | run.trigger is \"packet\" | leave it out
         WALL; PACKET          | run.toml | run.trigger | \"external\" | SingleShot
         WALL; priority = 100  | run.priority | 1 to 99
         WALL; delay_s = 10    | run.delay_s | at most 16",
    ) {
        let run = run
            .replace("STEPPED", "")
            .replace("WALL", WALL)
            .replace("; ", "\n");
        let run = run.replace("EXTERNAL", "clock = \"external\"");
        let run = run.replace("PACKET", "trigger = \"packet\"");
        refuses(&run, &format!("--minutes 1 | {}", says.join(" | ")));
    }
    let two_cameras = "--link can | --link can | 2 cameras | --link udp";
    refuses(&format!("{WALL}\n{HEAD}"), two_cameras);
    refuses(
        WALL,
        "--minutes 0       | --minutes | 0.001 to 100000
         --max-miss-rate 2 | --max-miss-rate | 0 to 1
         --junit no/such/folder.xml        | no/such/folder.xml | name another file
         --junit both.out --json both.out  | --json both.out | names the same file
         --junit run.toml                  | --junit run.toml | names the same file
         --rate 100000 --minutes 100000    | --minutes 100000 | ask for less
         --metrics nowhere | metrics at nowhere",
    );
}

/// At the camera's rate, the line can carry the level `labels` but not that of the run file.
#[test]
#[cfg(target_os = "linux")]
fn the_output_option_sets_the_level_of_a_soak() {
    let here = files(WALL);
    let words = "soak --config run.toml --minutes 0.02 --max-miss-rate 1 --link pty?baud=921600";
    for (level, code) in [("", 1), ("--output labels", 0), ("--output x", 2)] {
        here.run(&format!("{words} {level}")).exits(code);
    }
}
