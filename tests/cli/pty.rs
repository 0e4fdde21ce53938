//! Named pseudo-terminals: `skyloop pty`, and the emulator at one.
#![cfg(target_os = "linux")]

use crate::run::{Process, serves_until};
use crate::support::TIMEOUT;
use crate::support::line::{PtyLine, open_port};
use crate::{Folder, repository};
use serialport::SerialPort;
use std::io::{Read, Write};

/// The path of a name in the folder.
fn path(here: &Folder, name: &str) -> String {
    here.join(name).display().to_string()
}

/// Whether the folder has neither files nor links.
fn is_empty(here: &Folder) -> bool {
    here.read_dir().unwrap().next().is_none()
}

/// The emulator at a pseudo-terminal called `tracker`, and its path.
fn emulator(here: &Folder, flags: &str) -> (Process, String) {
    let (name, config) = (path(here, "tracker"), repository("configs/run.toml"));
    let link = format!("pty://{name}?baud=3000000");
    let process = Process::listening(
        here,
        &format!("run --config {config} --link {link} {flags}"),
    );
    assert_eq!(process.address, link);
    (process, name)
}

#[test]
fn a_pair_carries_bytes_in_both_directions_until_ctrl_c() {
    let here = Folder::new();
    let names = ["a", "b"].map(|name| path(&here, name));
    let begin = format!("{} <-> {} at ", names[0], names[1]);
    let words = format!("pty {} {} --baud 921600", names[0], names[1]);
    let process = Process::printing(&here, &words, &begin);
    assert_eq!(
        process.address,
        "921600 baud, 92160 bytes/s in each direction"
    );
    for _ in 0..2 {
        let mut ends = names.each_ref().map(|name| {
            let mut port = open_port(name, 921_600);
            port.set_timeout(TIMEOUT).unwrap();
            port
        });
        let text: Vec<u8> = (0..=255).collect();
        for (from, to) in [(0, 1), (1, 0)] {
            ends[from].write_all(&text).unwrap();
            let mut received = [0; 256];
            ends[to].read_exact(&mut received).unwrap();
            assert_eq!(received[..], text, "every byte passes unchanged");
        }
    }
    process.end_by("-INT").exits(0);
    assert!(is_empty(&here), "the names are gone");
}

#[test]
fn a_client_opens_the_emulators_own_port() {
    let here = Folder::new();
    let (process, name) = emulator(&here, "");
    serves_until("-INT", process, PtyLine::at(&name));
    assert!(is_empty(&here), "the name is gone");
}

/// A remaining name may lead to a new terminal with the number of the killed run's terminal.
#[test]
fn the_names_of_a_killed_run_are_reused() {
    let here = Folder::new();
    let [a, b] = ["a", "b"].map(|name| path(&here, name));
    let start = |a: &str, b: &str| {
        Process::printing(&here, &format!("pty {a} {b}"), &format!("{a} <-> {b} at "))
    };
    let first = start(&a, &b);
    // No other run gets the names before it ends.
    let again = here.run(&format!("pty {a} c")).exits(1).logs_lines(1);
    again.logs(&["a running skyloop has it; choose another name"]);
    first.end_by("-KILL");
    assert!(here.join("a").symlink_metadata().is_ok(), "killed");
    // In reverse order: both numbers are in use again when the names are created.
    let second = start(&b, &a);
    for name in [&a, &b] {
        open_port(name, 115_200);
    }
    second.end_by("-INT").exits(0);
    assert!(is_empty(&here));
}

#[test]
fn one_name_for_both_ends_is_refused_in_a_line() {
    let here = Folder::new();
    for other in ["a", "./a"] {
        let refused = here.run(&format!("pty a {other}")).exits(1).logs_lines(1);
        refused.logs(&["the other end has it; choose another name"]);
        assert!(is_empty(&here));
    }
}

/// A client that opens the port, requests frames and reads nothing, with injected faults.
#[test]
fn a_client_that_reads_nothing_does_not_block_the_end() {
    let here = Folder::new();
    let (process, name) = emulator(&here, "--fault-log log.jsonl");
    let mut client = crate::support::client::Client::new(PtyLine::at(&name));
    client.window = None;
    for sequence in 0..3 {
        client.point(crate::support::attitude(sequence), crate::support::EPOCH);
    }
    std::thread::sleep(std::time::Duration::from_secs(1));
    process.end_by("-INT").exits(0);
    assert!(!here.join("tracker").is_symlink(), "the name is gone");
}
