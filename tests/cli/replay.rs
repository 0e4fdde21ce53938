//! `--faults`, `--fault-log`, `--capture` and `skyloop replay`, as a user has them.

use crate::skyloop;
use crate::support::await_that;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Exit code and all that a command printed.
fn say(at: &Path, words: &str) -> (Option<i32>, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

fn has(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in\n{text}");
    }
}

#[test]
fn a_recorded_loopback_is_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, text) = say(at, "loopback --frames 2 --capture run.pcapng");
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = say(at, "-v replay run.pcapng");
    assert_eq!(code, Some(0), "{text}");
    has(
        &text,
        &[
            "frame     1  attitude     1",
            "crc32 ",
            "the same: 2 frames",
        ],
    );

    // One digit of one pixel, in the middle of the file.
    let mut octets = std::fs::read(at.join("run.pcapng")).unwrap();
    let block = b"\x0a\x02\xc0\x37";
    let place = octets.windows(4).position(|window| window == block);
    octets[place.expect("PixelBlock 55") + 500] ^= 4;
    std::fs::write(at.join("spoilt.pcapng"), octets).unwrap();
    let (code, text) = say(at, "replay spoilt.pcapng");
    assert_eq!(code, Some(1), "{text}");
    has(
        &text,
        &[
            "PixelBlock 55 of frame 0",
            "pixel (column ",
            "recorded ",
            "replayed ",
            "files and settings are those of the recording",
        ],
    );
}

/// Whatever of its files has changed, a replay names it.
#[test]
fn a_replay_of_another_input_says_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = |seed: u32| {
        let text = format!(
            "seed = {seed}\ncamera = \"camera.toml\"\n[sequence]\nepoch = \"2026-01-01T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\n\
             attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n"
        );
        std::fs::write(at.join("scene.toml"), text).unwrap();
    };
    let camera = std::fs::read_to_string(crate::repository("configs/cameras/fai-nir.toml"));
    let camera = camera.unwrap();
    std::fs::write(at.join("camera.toml"), &camera).unwrap();
    scene(1);
    let record = "loopback --scene scene.toml --frames 1 --capture run.pcapng";
    let (code, text) = say(at, record);
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = say(at, "replay run.pcapng --scene scene.toml");
    assert!(
        code == Some(0) && !text.contains("not as recorded"),
        "{text}"
    );
    scene(2);
    let slow = camera.replace("exposure_s = 0.1 ", "exposure_s = 0.2 ");
    for (change, words, says) in [
        ("scene", "", "scene.toml: changed since the recording"),
        ("camera", "", "camera.toml: changed since the recording"),
        // The frame would have come.
        (
            "camera",
            "--patience 0.0001",
            "camera.toml: changed since the recording",
        ),
        (
            "none",
            "--output labels",
            "--output: recorded frame, now labels",
        ),
        (
            "built-in",
            "",
            "scene.toml: read for the recording, not now",
        ),
    ] {
        scene(if change == "scene" { 2 } else { 1 });
        let text = if change == "camera" { &slow } else { &camera };
        std::fs::write(at.join("camera.toml"), text).unwrap();
        let scene = if change == "built-in" {
            ""
        } else {
            "--scene scene.toml"
        };
        let (code, text) = say(at, &format!("replay run.pcapng {scene} {words}"));
        assert_eq!(code, Some(1), "{change}: {text}");
        let error = text.lines().last().unwrap();
        assert!(
            error.starts_with("error: ") && error.contains(says),
            "{change}: {text}"
        );
        assert!(!text.contains("give it longer"), "{text}");
    }
}

/// Frames over the bus, recorded there. Few packets a frame: a machine that is busy for a second delays one message of the
/// bus beyond its time-out, and the client asks for it again; it does not so for ever.
#[test]
#[cfg(unix)]
fn a_log_of_can_frames_is_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = "loopback --link slcan --output windows --frames 3 --capture run.log";
    let (code, text) = say(at, run);
    assert_eq!(code, Some(0), "{text}");
    let log = std::fs::read_to_string(at.join("run.log")).unwrap();
    has(&log, &[" can0 220##5", " can0 100##5"]);
    let (code, text) = say(at, "replay run.log --output windows");
    assert_eq!(code, Some(0), "{text}");
    has(&text, &["the same: 3 frames"]);
    assert!(!text.contains("not compared"), "{text}");
}

/// Frames take longer to render than is allowed here.
#[test]
fn a_replay_waits_for_a_frame_as_long_as_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, text) = say(at, "loopback --frames 20 --capture run.pcapng");
    assert_eq!(code, Some(0), "{text}");
    // A machine that wakes a thread late may find the frame there.
    let mut tries = (0..10).map(|_| say(at, "replay run.pcapng --patience 0.001"));
    let refused = tries.find(|(code, _)| *code == Some(1));
    let (_, text) = refused.expect("one of ten is too impatient");
    has(&text, &["run.pcapng", "more than 0.001 s", "--patience"]);
    for wrong in ["0", "-1", "nan", "soon", "1e300"] {
        let (code, text) = say(at, &format!("replay run.pcapng --patience {wrong}"));
        assert_eq!(code, Some(2), "{text}");
        has(&text, &["--patience", "seconds, above 0"]);
    }
}

#[test]
fn faults_are_written_down() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let faults = "[[faults]]\ndirection = \"out\"\nkind = \"duplicate\"\nvalue = 0.1\n\
                  [[faults]]\ndirection = \"in\"\nkind = \"delay\"\nvalue = 0.001\n";
    std::fs::write(at.join("faults.toml"), faults).unwrap();
    let (code, text) = say(
        at,
        "loopback --frames 2 --faults faults.toml --fault-log log.jsonl --capture run.pcapng",
    );
    assert_eq!(code, Some(0), "{text}");
    has(
        &text,
        &["faults injected  ", "in: delay ", "; out: duplicate "],
    );
    let log = std::fs::read_to_string(at.join("log.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = log
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    for (kind, direction, replies) in [("duplicate", "out", true), ("delay", "in", false)] {
        let of_kind = lines.iter().filter(|line| line["kind"] == kind);
        let injected = of_kind.filter(|line| line["event"] == "injected");
        let count = injected.clone().count();
        assert!(
            count > 0 && text.contains(&format!("{kind} {count}")),
            "{text}"
        );
        for line in injected {
            assert_eq!(line["direction"], direction);
            let unix_s = line["unix_s"].as_f64().unwrap();
            assert!(unix_s > 1.7e9 && line["t_s"].as_f64().unwrap() < 60.0);
            assert_eq!(line["apid"].as_u64().unwrap() & 0x200 != 0, replies);
            let later_s = (kind == "delay").then_some(0.001);
            assert_eq!(line["later_s"].as_f64(), later_s);
        }
    }
    let begins = |kind: &str| {
        lines
            .iter()
            .any(|l| l["kind"] == kind && l["event"] == "begins")
    };
    assert!(begins("duplicate") && begins("delay"));
    let (code, text) = say(at, "replay run.pcapng");
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(
        at.join("off.toml"),
        "[[faults]]\ndirection = \"in\"\nkind = \"bus_off\"\n",
    )
    .unwrap();
    std::fs::write(at.join("key.toml"), "[[fault]]\n").unwrap();
    std::fs::write(at.join("wall.toml"), "[run]\nclock = \"wall\"\n").unwrap();
    let scene = "[sequence]\nepoch = \"2026-01-01T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\n\
                 attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
    std::fs::write(at.join("text"), "hello\n").unwrap();
    std::fs::write(at.join("bad.log"), "(1.000000) can0 123\n").unwrap();
    std::fs::write(at.join("empty.log"), "(1.000000) can0 7FF#00\n").unwrap();
    for (words, says) in [
        ("loopback --faults none.toml", vec!["none.toml"]),
        (
            "loopback --faults key.toml",
            vec!["key.toml", "unknown key", "did you mean `faults`?"],
        ),
        (
            "loopback --faults off.toml",
            vec![": faults[0].kind", "CAN", "use down"],
        ),
        (
            "loopback --fault-log no/log",
            vec!["--fault-log no/log: ", "check that its folder exists"],
        ),
        (
            "loopback --faults off.toml --fault-log ./off.toml",
            vec!["--fault-log ./off.toml: --faults names the same file"],
        ),
        (
            "loopback --scene scene.toml --capture scene.toml",
            vec![
                "--capture scene.toml: --scene names the same file",
                "another",
            ],
        ),
        (
            "loopback --capture run --fault-log run",
            vec!["--capture run: --fault-log names the same file", "another"],
        ),
        (
            "loopback --capture no/run.pcapng",
            vec!["no/run.pcapng", "folder"],
        ),
        ("replay none.pcapng", vec!["none.pcapng", "check the path"]),
        ("replay text", vec!["text: neither pcapng nor", "--capture"]),
        ("replay bad.log", vec!["bad.log: line 1"]),
        ("replay empty.log", vec!["nothing was received"]),
        ("replay text --config none.toml", vec!["neither pcapng"]),
    ] {
        let (code, text) = say(at, words);
        assert_eq!(code, Some(1), "{words}: {text}");
        // TOML's own errors show the place.
        let lines = text.trim().lines().count();
        assert!(
            lines == 1 || text.contains("TOML") || text.contains(" faults:\n"),
            "{words}: {text}"
        );
        has(&text, &says);
    }
    let (code, text) = say(at, "loopback --frames 20 --capture run.pcapng");
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = say(at, "replay run.pcapng --config wall.toml");
    assert_eq!(code, Some(1));
    has(&text, &["wall.toml", "run.clock", "stepped"]);
}

/// A disk without room.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told_and_the_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let delay = "[[faults]]\ndirection = \"in\"\nkind = \"delay\"\nvalue = 0.001\n";
    std::fs::write(at.join("faults.toml"), delay).unwrap();
    let (code, text) = say(
        at,
        "loopback --frames 1 --faults faults.toml --fault-log /dev/full",
    );
    assert_eq!((code, text.contains("frames  ")), (Some(1), true), "{text}");
    has(&text, &["--fault-log /dev/full", "make room"]);
    let (code, text) = say(at, "loopback --frames 1 --capture /dev/full");
    assert_eq!(code, Some(1), "{text}");
    has(&text, &["capture /dev/full"]);
}

#[test]
fn a_run_at_another_output_level_is_replayed_at_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = "loopback --output labels --frames 2 --capture run.pcapng";
    let (code, text) = say(at, run);
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = say(at, "replay run.pcapng --output labels");
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = say(at, "replay run.pcapng");
    assert_eq!(code, Some(1), "{text}");
    has(&text, &["pixel_level", "recorded None", "replayed Frame"]);
    has(
        &text,
        &["not as recorded: --output: recorded labels, now frame"],
    );
}

#[test]
fn ctrl_c_ends_a_loopback_with_its_table_and_a_recording_that_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let file = at.join("run.pcapng");
    let mut child = Command::new(env!("CARGO_BIN_EXE_skyloop"))
        .args(
            "loopback --frames 50 --link pty?baud=9600 --output labels --capture run.pcapng --junit v.xml"
                .split(' '),
        )
        .current_dir(at)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    await_that("a frame is recorded", || {
        std::thread::sleep(Duration::from_millis(20));
        file.metadata().is_ok_and(|file| file.len() > 4000)
    });
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    await_that("it ends", || child.try_wait().unwrap().is_some());
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(1));
    let table = String::from_utf8(ended.stdout).unwrap();
    has(&table, &["frames   ", "wrote "]);
    // Both of the frames that the client has: the emulator may have made one more.
    let log = String::from_utf8(ended.stderr).unwrap();
    let (_, came) = log.split_once("stopped: ").unwrap();
    let (came, _) = came.split_once(" of 50 frames came whole").unwrap();
    let junit = std::fs::read_to_string(at.join("v.xml")).unwrap();
    has(&junit, &[&format!("{came} of 50 frames came whole")]);
    let (code, text) = say(at, "replay run.pcapng --output labels");
    assert_eq!(code, Some(0), "{text}");
}
