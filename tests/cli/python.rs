//! The Python client of the README: with every built-in camera, with loss, and at a camera's full rate.
#![cfg(unix)]

use crate::run::Process;
use crate::{EPOCH, Q, repository, skyloop};
use skyloop::load::CAMERAS;
use std::path::Path;
use std::process::{Command, Output};

/// The state that the client sends, km and km/s.
const STATE: &str = "-4340.768444,848.975278,-5362.534303,5.544406469,-3.022740430,-4.386550226";

/// The emulator of a run file whose keys before `[run]` are `keys`.
fn emulator(at: &Path, keys: &str, run: &str, flags: &[&str]) -> Process {
    let text = format!("{keys}\n[run]\nlink = \"udp://127.0.0.1:0\"\n{run}\n");
    std::fs::write(at.join("run.toml"), text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let command = command.args(["run", "--config", "run.toml"]).args(flags);
    Process::spawned(command.current_dir(at), "listening on ")
}

/// Whether the client succeeds, and what it prints.
fn client_at(at: &Path, address: &str, flags: &[&str]) -> (bool, String) {
    let mut command = Command::new("python3");
    let command = command
        .arg(repository("examples/client.py"))
        .current_dir(at);
    let output = command.args(["--address", address]).args(flags).output();
    let Output {
        status,
        stdout,
        stderr,
    } = output.expect("python3 runs: apt-get install python3-minimal");
    let text = String::from_utf8([stdout, stderr].concat()).unwrap();
    (status.success(), text)
}

/// Whether the client of an emulator succeeds, and what it prints.
fn ended(at: &Path, process: &Process, flags: &[&str]) -> (bool, String) {
    let address = process.address.strip_prefix("udp://").unwrap();
    client_at(at, address, flags)
}

/// What the client prints; it exits with 0.
fn client(at: &Path, process: &Process, flags: &[&str]) -> String {
    let (is_success, text) = ended(at, process, flags);
    assert!(is_success, "{text}");
    text
}

#[test]
fn the_client_gets_whole_frames_at_every_output_level() {
    for level in ["frame", "compressed", "windows", "labels"] {
        let here = tempfile::tempdir().unwrap();
        let at = here.path();
        let process = emulator(at, "camera = \"fai-nir\"", "", &["--output", level]);
        let text = client(at, &process, &["--frames", "2"]);
        process.signal("-INT");
        process.end();
        assert_eq!(text.matches(" bits, ").count(), 2, "{level}: {text}");
        assert!(!text.contains("lost"), "{level}: {text}");
    }
}

#[test]
fn the_client_refuses_wrong_addresses_in_one_line() {
    let here = tempfile::tempdir().unwrap();
    for address in [
        "127.0.0.1",
        "127.0.0.1:",
        "127.0.0.1:x",
        "127.0.0.1:70000",
        "foo.invalid:1",
    ] {
        let (is_success, text) = client_at(here.path(), address, &[]);
        assert!(!is_success && text.lines().count() == 1, "{text}");
        assert!(
            text.contains(address) && text.contains("HOST:PORT"),
            "{text}"
        );
    }
    let (is_success, text) = client_at(here.path(), "127.0.0.1:1", &["--help"]);
    assert!(
        is_success && text.contains("HOST:PORT") && text.contains("127.0.0.1:4810"),
        "{text}"
    );
}

/// Columns, rows and pixels of a PGM picture with two bytes a pixel.
fn pgm(file: &Path) -> (u32, u32, Vec<u16>) {
    let bytes = std::fs::read(file).unwrap();
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
    let head = std::str::from_utf8(&bytes[..end]).unwrap();
    let numbers: Vec<u32> = head
        .split(' ')
        .skip(1)
        .map(|n| n.parse().unwrap())
        .collect();
    let (pairs, rest) = bytes[end + 1..].as_chunks();
    assert!(rest.is_empty());
    let pixels = pairs.iter().map(|pair| u16::from_be_bytes(*pair));
    (numbers[0], numbers[1], pixels.collect())
}

/// Against `skyloop render`, which knows no wire.
#[test]
fn the_client_gets_the_frames_of_every_built_in_camera() {
    for &camera in CAMERAS {
        let here = tempfile::tempdir().unwrap();
        let at = here.path();
        let process = emulator(at, &format!("camera = {camera:?}"), "", &[]);
        let printed = client(at, &process, &["--out", "got-"]);
        assert!(printed.starts_with("got-00000: "), "{printed}");
        process.signal("-INT");
        let (code, table) = process.end();
        assert_eq!(code, Some(0), "{table}");
        skyloop(at)
            .args(["render", "--camera", camera, "--epoch", EPOCH])
            .arg(format!("--attitude={Q}"))
            .arg(format!("--state={STATE}"))
            .args(["--out", "rendered"])
            .assert()
            .success();
        let rendered = image::open(at.join("rendered/frame_00000.png")).unwrap();
        let rendered = rendered.into_luma16();
        let (width, height, pixels) = pgm(&at.join("got-00000.pgm"));
        assert_eq!((width, height), rendered.dimensions(), "{camera}");
        let same = pixels.iter().zip(rendered.as_raw()).all(|(a, b)| a == b);
        assert!(same && pixels.len() == rendered.as_raw().len(), "{camera}");
    }
}

#[test]
fn the_client_requests_again_what_is_lost_damaged_or_late() {
    // How many of the 3,900 packets are requested again at least, and come damaged.
    for (faults, again, damaged) in [
        (&[("in", "drop", 0.05), ("out", "drop", 0.05)][..], 20, 0),
        // 1,400 bytes: one packet in 9 to the client is damaged, one in 50 to the emulator.
        (
            &[("in", "bit_flips", 1e-4), ("out", "bit_flips", 1e-5)],
            100,
            100,
        ),
        (
            &[
                ("out", "reorder", 0.02),
                ("out", "jitter", 0.05),
                ("out", "truncate", 0.02),
            ],
            1,
            20,
        ),
    ] {
        let here = tempfile::tempdir().unwrap();
        let at = here.path();
        let fault = |(direction, kind, value): &(&str, &str, f64)| {
            format!("[[faults]]\ndirection = {direction:?}\nkind = {kind:?}\nvalue = {value}\n")
        };
        let text: String = faults.iter().map(fault).collect();
        std::fs::write(at.join("faults.toml"), text).unwrap();
        let process = emulator(at, "camera = \"rigel-l\"", "", &["--faults", "faults.toml"]);
        let printed = client(at, &process, &["--frames", "3"]);
        process.signal("-INT");
        let (_, table) = process.end();
        // It checks the pixels itself against the checksum of each frame.
        let frames = printed.matches("1024 x 1024 pixels of 12 bits").count();
        assert_eq!(frames, 3, "{faults:?}: {printed}{table}");
        assert!(table.contains("resent_blocks"), "{table}");
        // Printed each second where it has changed, and at the end: a frame can follow the last one.
        let losses = printed
            .lines()
            .rfind(|line| line.contains("requested again"));
        let numbers = losses.unwrap_or_default().split(' ');
        let numbers: Vec<i64> = numbers.filter_map(|word| word.parse().ok()).collect();
        let [found_again, found_damaged, _] = numbers[..] else {
            panic!("{printed}");
        };
        // Differences of counters do not wrap: no more than all packets, once a frame.
        assert!(
            (again..20_000).contains(&found_again),
            "{faults:?}: {printed}"
        );
        assert!((damaged..20_000).contains(&found_damaged), "{printed}");
    }
}

/// Whatever the reason, it leaves so that nothing waits for it: the emulator ends without a warning about what was not read.
#[test]
fn the_client_ends_with_the_reason_where_it_gets_no_frame() {
    for (run, flags, says) in [
        (
            "clock = \"wall\"\noutput = \"labels\"\nlink = \"udp://127.0.0.1:0?rate_mbit=1\"",
            &[][..],
            "whole frames with label text (Output) are refused",
        ),
        (
            "trigger = \"packet\"",
            &["--timeout", "6"],
            "Status gives as the reason (withheld): no Trigger, and run.trigger is packet",
        ),
    ] {
        let here = tempfile::tempdir().unwrap();
        let at = here.path();
        let text = format!("camera = \"fai-nir\"\n[run]\n{run}\n");
        let link = "link = \"udp://127.0.0.1:0\"\n";
        let text = if run.contains("link = ") {
            text
        } else {
            text + link
        };
        std::fs::write(at.join("run.toml"), text).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
        let command = command
            .args(["run", "--config", "run.toml"])
            .current_dir(at);
        let command = command.stderr(std::process::Stdio::piped());
        let process = Process::spawned(command, "listening on ");
        let (is_success, printed) = ended(at, &process, flags);
        assert!(!is_success && printed.contains(says), "{printed}");
        process.signal("-INT");
        let (code, table, log) = process.end_with_log();
        assert_eq!(code, Some(0), "{table}{log}");
        assert!(!log.contains("has not read"), "{log}");
        assert!(!table.contains("lost_outbound"), "{table}");
    }
}

/// 24,000 packets a second.
#[test]
fn the_client_takes_large_frames_at_four_a_second() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let camera = std::fs::read_to_string(repository("configs/cameras/rigel-l.toml")).unwrap();
    let camera = camera
        .replace("width_px = 1024", "width_px = 2048")
        .replace("height_px = 1024", "height_px = 2048")
        .replace("rate_hz = 10.0", "rate_hz = 4.0");
    std::fs::write(at.join("large.toml"), camera).unwrap();
    let run = "clock = \"wall\"";
    let process = emulator(at, "camera = \"large.toml\"\nfidelity = \"fast\"", run, &[]);
    let printed = client(at, &process, &["--frames", "4", "--wall", "4"]);
    process.signal("-INT");
    process.end();
    assert_eq!(
        printed.matches("2048 x 2048 pixels").count(),
        4,
        "{printed}"
    );
}

/// The README shows the first part of the file.
#[test]
fn the_readme_shows_the_client() {
    let readme = std::fs::read_to_string(repository("README.md")).unwrap();
    let file = std::fs::read_to_string(repository("examples/client.py")).unwrap();
    let mut blocks = readme.split("```python\n").skip(1);
    let (block, rest) = blocks.next().unwrap().split_once("```").unwrap();
    assert!(file.contains(block) && block.lines().count() > 10);
    assert!(blocks.next().is_none() && rest.contains("examples/client.py"));
}
