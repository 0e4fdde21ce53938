//! `--faults`, `--fault-log`, `--capture` and `skyloop replay` on the command line.

use crate::support::always;
use crate::{Folder, has, still, with_keys};

#[test]
fn a_recorded_loopback_is_replayed() {
    let here = Folder::new();
    here.run("loopback --frames 2 --capture run.pcapng")
        .exits(0);
    let replay = here.run("-v replay run.pcapng").exits(0);
    replay.says(&[
        "frame     1  attitude     1",
        "crc32 ",
        "the same: 2 frames",
    ]);

    // Changes one pixel, in the middle of the file.
    let mut bytes = std::fs::read(here.join("run.pcapng")).unwrap();
    let block = b"\x0a\x02\xc0\x37";
    let place = bytes.windows(4).position(|window| window == block);
    bytes[place.expect("PixelBlock 55") + 500] ^= 4;
    here.write("spoilt.pcapng", bytes);
    here.run("replay spoilt.pcapng").exits(1).says(&[
        "PixelBlock 55 of frame 0",
        "pixel (column ",
        "recorded ",
        "replayed ",
        "files and settings are those of the recording",
    ]);
}

/// A replay names each changed input file.
#[test]
fn a_replay_with_other_inputs_reports_the_differences() {
    let scene = |seed: u32| {
        let sequence = still("2026-01-01T00:00:00Z");
        format!("seed = {seed}\ncamera = \"camera.toml\"\n{sequence}")
    };
    let camera = crate::camera("fai-nir", &[]);
    let slow = with_keys(&camera, &[("exposure_s", "0.2")]);
    let here = Folder::with(&[("camera.toml", &camera), ("scene.toml", &scene(1))]);
    here.run("loopback --scene scene.toml --frames 1 --capture run.pcapng")
        .exits(0);
    let same = "--scene scene.toml";
    let replay = here.run(&format!("replay run.pcapng {same}"));
    replay.exits(0).lacks("not as recorded");
    const CAMERA: &str = "camera.toml: changed since the recording";
    for (seed, camera, flags, says) in [
        (2, &camera, same, "scene.toml: changed since the recording"),
        (1, &slow, same, CAMERA),
        // The frame would have arrived.
        (1, &slow, "--scene scene.toml --patience 0.0001", CAMERA),
        (
            1,
            &camera,
            "--scene scene.toml --output labels",
            "--output: recorded frame, now labels",
        ),
        // The built-in scene.
        (
            1,
            &camera,
            "",
            "scene.toml: read for the recording, not now",
        ),
    ] {
        here.write("scene.toml", scene(seed));
        here.write("camera.toml", camera);
        let replay = here.run(&format!("replay run.pcapng {flags}")).exits(1);
        let replay = replay.lacks("give it longer");
        let error = replay.log.lines().last().unwrap();
        assert!(error.starts_with("error: "), "{error}");
        has(error, &[says]);
    }
}

/// Frames over the bus, recorded as CAN frames. Frames have few packets: on a busy machine a
/// message may exceed its time-out, and the client requests it again a limited number of times.
#[test]
#[cfg(unix)]
fn a_log_of_can_frames_is_replayed() {
    let here = Folder::new();
    here.run("loopback --link slcan --output windows --frames 3 --capture run.log")
        .exits(0);
    has(&here.read("run.log"), &[" can0 220##5", " can0 100##5"]);
    let replay = here.run("replay run.log --output windows").exits(0);
    replay.says(&["the same: 3 frames"]).lacks("not compared");
}

/// Frames take longer to render than this timeout.
#[test]
fn a_replay_has_a_timeout_for_frames() {
    let here = Folder::new();
    here.run("loopback --frames 20 --capture run.pcapng")
        .exits(0);
    // If the thread wakes up late, the frame may have arrived.
    let mut tries = (0..10).map(|_| here.run("replay run.pcapng --patience 0.001"));
    let refused = tries.find(|replay| replay.code == Some(1));
    let refused = refused.expect("one of ten times out");
    refused.says(&["run.pcapng", "more than 0.001 s", "--patience"]);
    for wrong in ["0", "-1", "nan", "soon", "1e300"] {
        let refused = here.run(&format!("replay run.pcapng --patience {wrong}"));
        refused.exits(2).says(&["--patience", "seconds, above 0"]);
    }
}

#[test]
fn faults_are_logged() {
    let faults = always("out", "duplicate", 0.1) + &always("in", "delay", 0.001);
    let here = Folder::with(&[("faults.toml", &faults)]);
    let flags = "--faults faults.toml --fault-log log.jsonl --capture run.pcapng";
    let ended = here.run(&format!("loopback --frames 2 {flags}")).exits(0);
    let ended = ended.says(&["faults injected  ", "in: delay ", "; out: duplicate "]);
    let log = here.read("log.jsonl");
    let lines = log.lines().map(|line| serde_json::from_str(line).unwrap());
    let lines: Vec<serde_json::Value> = lines.collect();
    for (kind, direction, replies, later_s) in [
        ("duplicate", "out", true, None),
        ("delay", "in", false, Some(0.001)),
    ] {
        let of_kind = || lines.iter().filter(|line| line["kind"] == kind);
        assert!(of_kind().any(|line| line["event"] == "begins"));
        let injected = || of_kind().filter(|line| line["event"] == "injected");
        assert_ne!(injected().count(), 0);
        has(&ended.out, &[&format!("{kind} {}", injected().count())]);
        for line in injected() {
            assert_eq!(line["direction"], direction);
            assert!(line["unix_s"].as_f64() > Some(1.7e9), "{line}");
            assert!(line["t_s"].as_f64().unwrap() < 60.0, "{line}");
            assert_eq!(line["apid"].as_u64().unwrap() & 0x200 != 0, replies);
            assert_eq!(line["later_s"].as_f64(), later_s);
        }
    }
    here.run("replay run.pcapng").exits(0);
}

#[test]
fn wrong_inputs_are_refused_in_a_line() {
    let here = Folder::with(&[
        (
            "off.toml",
            "[[faults]]\ndirection = \"in\"\nkind = \"bus_off\"\n",
        ),
        ("key.toml", "[[fault]]\n"),
        ("wall.toml", "[run]\nclock = \"wall\"\n"),
        ("scene.toml", &still("2026-01-01T00:00:00Z")),
        ("text", "hello\n"),
        ("bad.log", "(1.000000) can0 123\n"),
        ("empty.log", "(1.000000) can0 7FF#00\n"),
    ]);
    here.run("loopback --frames 20 --capture run.pcapng")
        .exits(0);
    here.refuses(
        "",
        "loopback --faults none.toml       | none.toml
         loopback --faults key.toml        | key.toml | unknown key | did you mean `faults`?
         loopback --faults off.toml        | : faults[0].kind | CAN | use down
         loopback --fault-log no/log | --fault-log no/log: | check that its folder exists
         loopback --faults off.toml --fault-log ./off.toml
         | --fault-log ./off.toml: --faults names the same file
         loopback --scene scene.toml --capture scene.toml
         | --capture scene.toml: --scene names the same file | another
         loopback --capture run --fault-log run
         | --capture run: --fault-log names the same file | another
         loopback --capture no/run.pcapng  | no/run.pcapng | folder
         replay none.pcapng                | none.pcapng | check the path
         replay text                       | text: neither pcapng nor | --capture
         replay bad.log                    | bad.log: line 1
         replay empty.log                  | nothing was received
         replay text --config none.toml    | neither pcapng
         replay run.pcapng --config wall.toml | wall.toml | run.clock | stepped",
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_reported_and_the_run_continues() {
    let here = Folder::with(&[("faults.toml", &always("in", "delay", 0.001))]);
    let ended = here.run("loopback --frames 1 --faults faults.toml --fault-log /dev/full");
    ended
        .exits(1)
        .says(&["frames  ", "--fault-log /dev/full", "make room"]);
    let ended = here.run("loopback --frames 1 --capture /dev/full");
    ended.exits(1).says(&["capture /dev/full"]);
}

#[test]
fn a_recording_is_replayed_at_its_output_level() {
    let here = Folder::new();
    here.run("loopback --output labels --frames 2 --capture run.pcapng")
        .exits(0);
    here.run("replay run.pcapng --output labels").exits(0);
    here.run("replay run.pcapng").exits(1).says(&[
        "pixel_level",
        "recorded None",
        "replayed Frame",
        "not as recorded: --output: recorded labels, now frame",
    ]);
}

#[test]
#[cfg(unix)]
fn ctrl_c_ends_a_loopback_with_its_table_and_a_complete_recording() {
    let here = Folder::new();
    let words = "loopback --frames 50 --link pty?baud=9600 --output labels --capture run.pcapng --junit v.xml";
    let file = here.join("run.pcapng");
    let child = crate::run::Process::printing(&here, words, "");
    crate::support::await_that("a frame is recorded", || {
        std::thread::sleep(std::time::Duration::from_millis(20));
        file.metadata().is_ok_and(|file| file.len() > 4000)
    });
    let ended = child.end_by("-INT").exits(1);
    let ended = ended.prints(&["frames   ", "wrote "]);
    // The number of the client's frames: the emulator may have rendered one more.
    let (_, came) = ended.log.split_once("stopped: ").unwrap();
    let (came, _) = came.split_once(" of 50 frames were complete").unwrap();
    let came = format!("{came} of 50 frames were complete");
    has(&here.read("v.xml"), &[&came]);
    here.run("replay run.pcapng --output labels").exits(0);
}
