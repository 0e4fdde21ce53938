//! Named pseudo-terminals: `skyloop pty`, and the emulator at one.
#![cfg(target_os = "linux")]

use crate::run::{Process, serves_until};
use crate::support::PATIENCE;
use crate::support::line::PtyLine;
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
            let port = serialport::new(name, 921_600).timeout(PATIENCE);
            port.open().unwrap()
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
