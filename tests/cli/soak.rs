//! `skyloop soak`: what it measures, what it writes, where it fails.

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
fn a_run_is_measured_and_told_in_every_form() {
    let here = files(&format!("{WALL}\ncpus = [1023]\n{HEAD}"));
    // However busy the machine is: nothing is asked of it.
    let words = "soak --config run.toml --minutes 0.05 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    // Two attitudes for each frame of the first camera at 20 Hz, which alone gets them. No machine that
    // runs this has as many processors.
    here.run(words).exits(0).prints(&[
        "to the last octet",
        "deadlines missed",
        "context switches",
        "a second, of 40 requested",
        "CPU 1023 not granted (run.cpus: ",
        "start to the first frame",
        "drift of the clocks",
        "memory",
        "kept: fai-nir: deadlines missed",
        "kept: B: deadlines missed",
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
        // Null, where a busy machine left one of the fifths without a frame.
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

/// By the client's time, and with a limit of memory that is far off.
#[test]
fn a_run_by_the_clients_clock_is_measured_likewise() {
    let here = files("clock = \"external\"");
    let words = "soak --config run.toml --minutes 0.04 --max-miss-rate 1 --max-growth 1000 --rate 50 --link memory --json verdict.json";
    here.run(words)
        .exits(0)
        .prints(&["of 50 requested", "kept: memory"]);
    let report = here.json("verdict.json");
    let frames = report["cameras"][0]["latencies"]["frames"].as_u64();
    assert!(frames > Some(0), "{report}");
}

#[test]
fn a_limit_that_is_broken_fails_the_run_and_names_the_first_frame() {
    // No frame leaves within a microsecond.
    let here = files(&format!("{WALL}\nlatency_s = 1e-6"));
    let words = "soak --config run.toml --minutes 0.02 --max-p99-ms 0.001 --junit verdict.xml --link memory";
    let failed = here.run(words).exits(1).logs(&[
        "deadlines missed:",
        "is above 1e-3: frame 0 was the first",
        "is above 0.001 ms:",
    ]);
    // Of both limits, whether or not a busy machine let it come whole.
    let first = failed.log.matches("frame 0 was the first (").count();
    assert_eq!(first, 2, "{}", failed.log);
    has(&here.read("verdict.xml"), &["failures=\"2\"", "<failure"]);
}

/// What was measured until then is told, and it is no pass.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_soak_with_what_it_has_and_fails_it() {
    let here = files(WALL);
    let words = "soak --config run.toml --minutes 60 --max-miss-rate 1 --junit verdict.xml --json verdict.json";
    let process = Process::printing(&here, words, "fai-nir ");
    std::thread::sleep(std::time::Duration::from_millis(500));
    // There is no verdict yet.
    has(&here.read("verdict.xml"), &["failures=\"2\""]);
    assert_eq!(here.json("verdict.json")["passed"], false);
    let ended = process.end_by("-INT").exits(1);
    has(&ended.out, &["kept: deadlines missed"]);
    for text in [&ended.out, &ended.log, &here.read("verdict.xml")] {
        has(text, &["stopped after 0.", "of 60 min"]);
    }
    assert_eq!(here.json("verdict.json")["passed"], false);
}

#[test]
fn what_cannot_be_soaked_is_told_before() {
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

/// A level that the line can carry at the camera's rate, where the file's cannot.
#[test]
#[cfg(target_os = "linux")]
fn a_soak_takes_the_level_that_it_is_given() {
    let here = files(WALL);
    let words = "soak --config run.toml --minutes 0.02 --max-miss-rate 1 --link pty?baud=921600";
    for (level, code) in [("", 1), ("--output labels", 0), ("--output x", 2)] {
        here.run(&format!("{words} {level}")).exits(code);
    }
}
