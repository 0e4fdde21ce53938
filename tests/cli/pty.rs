//! Named pseudo-terminals: `skyloop pty`, and the emulator at one.
#![cfg(target_os = "linux")]

use crate::run::{Process, serves_until};
use crate::support::PATIENCE;
use crate::support::line::{PtyLine, open_port};
use serialport::SerialPort;
use std::io::{Read, Write};

#[test]
fn a_pair_carries_octets_both_ways_until_ctrl_c() {
    let here = tempfile::tempdir().unwrap();
    let names = ["a", "b"].map(|name| here.path().join(name).display().to_string());
    let process = Process::of(
        &["pty", &names[0], &names[1], "--baud", "921600"],
        &format!("{} <-> {} at ", names[0], names[1]),
    );
    assert_eq!(process.address, "921600 baud, 92160 octets/s each way");
    for _ in 0..2 {
        let mut ends = names.each_ref().map(|name| {
            let mut port = open_port(name, 921_600);
            port.set_timeout(PATIENCE).unwrap();
            port
        });
        let text: Vec<u8> = (0..=255).collect();
        for (from, to) in [(0, 1), (1, 0)] {
            ends[from].write_all(&text).unwrap();
            let mut heard = [0; 256];
            ends[to].read_exact(&mut heard).unwrap();
            assert_eq!(heard[..], text, "every octet passes as it is");
        }
    }
    process.signal("-INT");
    assert_eq!(process.end().0, Some(0));
    for name in &names {
        let name = std::path::Path::new(name);
        assert!(name.symlink_metadata().is_err(), "the names are gone");
    }
}

#[test]
fn a_client_opens_the_emulators_own_port() {
    let here = tempfile::tempdir().unwrap();
    let name = here.path().join("tracker").display().to_string();
    let link = format!("pty://{name}?baud=3000000");
    let process = Process::of(
        &[
            "run",
            "--config",
            &crate::repository("configs/run.toml"),
            "--link",
            &link,
        ],
        "listening on ",
    );
    assert_eq!(process.address, link);
    serves_until("-INT", process, PtyLine::at(&name));
    let name = std::path::Path::new(&name);
    assert!(name.symlink_metadata().is_err(), "the name is gone");
}

/// A name that leads to the terminal of whoever got the killed one's number.
#[test]
fn the_names_of_a_run_that_was_killed_are_taken_over() {
    let here = tempfile::tempdir().unwrap();
    let names = ["a", "b"].map(|name| here.path().join(name).display().to_string());
    let start = |names: [&String; 2]| {
        let shown = format!("{} <-> {} at ", names[0], names[1]);
        Process::of(&["pty", names[0], names[1]], &shown)
    };
    let first = start([&names[0], &names[1]]);
    // While it lives nobody else gets them.
    let again = crate::skyloop(here.path())
        .args(["pty", &names[0], "c"])
        .output();
    let again = again.unwrap();
    let text = String::from_utf8(again.stderr).unwrap();
    assert!(
        text.contains("a running skyloop has it; choose another name"),
        "{text}"
    );
    assert!(again.status.code() == Some(1) && text.trim().lines().count() == 1);
    first.signal("-KILL");
    let _ = first.end();
    assert!(here.path().join("a").symlink_metadata().is_ok(), "killed");
    // The other way round: the numbers of both are in use again while their names are given.
    let second = start([&names[1], &names[0]]);
    for name in &names {
        open_port(name, 115_200);
    }
    second.signal("-INT");
    assert_eq!(second.end().0, Some(0));
    assert!(here.path().read_dir().unwrap().next().is_none());
}

#[test]
fn one_name_for_both_ends_is_refused_in_a_line() {
    let here = tempfile::tempdir().unwrap();
    for other in ["a", "./a"] {
        let output = crate::skyloop(here.path())
            .args(["pty", "a", other])
            .output();
        let output = output.unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1));
        let told = text.contains("the other end has it; choose another name");
        assert!(told && text.trim().lines().count() == 1, "{text}");
        assert!(here.path().read_dir().unwrap().next().is_none());
    }
}

/// A client that opens the port, asks for frames and reads nothing; faults stand between.
#[test]
fn a_client_that_reads_nothing_keeps_no_name_alive() {
    let here = tempfile::tempdir().unwrap();
    let name = here.path().join("tracker").display().to_string();
    let log = here.path().join("log.jsonl").display().to_string();
    let link = format!("pty://{name}?baud=3000000");
    let config = crate::repository("configs/run.toml");
    let run = [
        "run",
        "--config",
        &config,
        "--link",
        &link,
        "--fault-log",
        &log,
    ];
    let process = Process::of(&run, "listening on ");
    let mut client = crate::support::client::Client::new(PtyLine::at(&name));
    client.window = None;
    for sequence in 0..3 {
        client.point(crate::support::attitude(sequence), crate::support::EPOCH);
    }
    std::thread::sleep(std::time::Duration::from_secs(1));
    process.signal("-INT");
    assert_eq!(process.end().0, Some(0));
    let name = std::path::Path::new(&name);
    assert!(name.symlink_metadata().is_err(), "the name is gone");
}
