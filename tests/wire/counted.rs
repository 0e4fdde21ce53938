//! Counters of `Status` without a refusal: objects without a state, records refused at the start,
//! lost packets.

use crate::support::client::{Client, moved};
#[cfg(target_os = "linux")]
use crate::support::line::PtyLine;
use crate::support::line::{Line, MemoryLine};
use crate::support::{EPOCH, Running, TIMEOUT, attitude, memory_client, on_pty, options, scene};
use skyloop::config::{Clock, Config};
use skyloop::link;
use skyloop::load::Folder;
use skyloop_protocols::{Command, Counters, Reply};

/// The defaults, with the objects of one orbit file.
fn showing(orbits: &str) -> Config {
    with(orbits, "[objects]\nfiles = [\"orbits\"]")
}

/// A configuration with these `keys` and a file `orbits`.
fn with(orbits: &str, keys: &str) -> Config {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("orbits"), orbits).unwrap();
    let folder = Folder::Disk(folder.path().to_path_buf());
    Config::parse("run.toml", keys, &folder).unwrap()
}

#[test]
fn objects_without_a_state_are_counted_in_every_frame() {
    let whole = include_str!("../../configs/scenes/rcm-2019-06-15/rcm-2-B.oem");
    // The same ephemeris, ending a second before the first epoch.
    let (before, _) = whole.split_once("\n2019-06-15T23:35:50.000 ").unwrap();
    let ended = before.replace(
        "STOP_TIME = 2019-06-15T23:36:30.000",
        "STOP_TIME = 2019-06-15T23:35:49.000",
    );
    for (oem, shown, counted) in [(whole, 1, [0, 0]), (&ended, 0, [1, 2])] {
        let (_emulator, mut client) = memory_client(showing(oem), Clock::Stepped);
        for count in counted {
            let label = client.good_frame(1).label();
            let objects = label["objects"].as_array().unwrap();
            let rsos = objects.iter().filter(|object| object["kind"] == "rso");
            assert_eq!(rsos.count(), shown);
            assert!(objects.len() > 100, "the stars are there");
            assert_eq!(client.counters().objects_without_state, count);
        }
    }
}

#[test]
fn refused_records_are_counted() {
    // X-Val: Vallado et al. 2006, AIAA 2006-6753, verification sets 00005 and 06251; the first
    // checksum of the second set is 5 there.
    let elements = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
        2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n\
        1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3986\n\
        2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";
    let both = "objects.files = [\"orbits\"]\nobserver.orbit = \"orbits:5\"";
    // The file counts once, although two keys read it.
    for (config, count) in [
        (showing(elements), 1),
        (with(elements, both), 1),
        (scene(), 0),
    ] {
        let (_emulator, mut client) = memory_client(config, Clock::Stepped);
        assert_eq!(client.counters().rejected_records, count);
    }
}

#[test]
fn lost_packets_are_counted_and_the_next_one_is_handled() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    assert_eq!(client.counters().sequence_gaps, 0);
    client.prepare(&Command::Ping, EPOCH);
    assert_eq!(client.counters().sequence_gaps, 1);
    // Each kind of packet has its own sequence counts.
    client.good_frame(1);
    for sequence in [2, 3] {
        client.prepare(&Command::Attitude(attitude(sequence)), EPOCH);
    }
    client.good_frame(4);
    assert_eq!(client.counters().sequence_gaps, 3);
    // A Reset restarts the counts.
    for _ in 0..10 {
        client.prepare(&Command::Ping, EPOCH);
    }
    client.done(Command::Reset);
    assert_eq!(client.counters().sequence_gaps, 3);
}

#[test]
fn floods_lose_their_oldest_attitudes() {
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let mut client = Client::new(MemoryLine(port));
    for sequence in 0..300 {
        client.send(Command::Attitude(attitude(sequence)));
    }
    client.send(Command::Ping);
    // Wall clock: attitudes need not wait for frames.
    let _emulator = Running::start(scene(), Clock::Wall, wire);
    client.line.recv(TIMEOUT).expect("the Ack");
    let status = client.line.recv(TIMEOUT).expect("the Status");
    let Ok((_, Reply::Status(status))) = Reply::decode(&status) else {
        panic!("no Status");
    };
    // 256 positions (ICD, 5.2) for 301 packets; the remaining ones have no gap.
    let expected = [("attitudes", 255), ("overflows", 45)];
    assert_eq!(moved(&Counters::default(), &status.counters), expected);
}

#[test]
#[cfg(target_os = "linux")]
fn closed_ports_free_the_emulator_for_the_next_client() {
    let (wire, _folder, name) = on_pty(&options(5.0), 921_600);
    let _emulator = Running::start(scene(), Clock::Stepped, wire);
    let counters = || {
        let counters = Client::new(PtyLine::at(&name)).counters();
        // A client that opens the port at once continues the previous exchange.
        std::thread::sleep(TIMEOUT / 20);
        counters
    };
    let (first, second, third) = (counters(), counters(), counters());
    assert_eq!(moved(&first, &second), [("reconnects", 1)]);
    assert_eq!(moved(&second, &third), [("reconnects", 1)]);
}
