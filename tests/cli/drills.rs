//! `skyloop run` as a process under faults: signals, a full disk, a port in use, many clients.
#![cfg(target_os = "linux")]

use crate::run::Process;
use crate::support::client::Client;
use crate::support::line::UdpLine;
use crate::support::{EPOCH, TIMEOUT, always, attitude, await_that};
use crate::{Folder, has, rows};
use skyloop::link::capture::pcapng;
use skyloop_protocols::{Command, Reply};
use std::net::UdpSocket;
use std::path::Path;
use std::time::{Duration, Instant};

/// Frames of a few packets, since transmission time does not matter for these tests.
const RUN: &str = "[run]\nlink = \"udp://127.0.0.1:0\"\noutput = \"windows\"\nidle_s = 60.0\n";

fn folder() -> Folder {
    Folder::with(&[("run.toml", RUN)])
}

/// A listening run in such a folder with these flags.
fn started(here: &Folder, flags: &str) -> Process {
    Process::listening(here, &format!("run --config run.toml {flags}"))
}

/// Receives a frame of this attitude with windows and objects; returns the number of its packets.
fn frame(client: &mut Client<UdpLine>, sequence: u32) -> u32 {
    client.point(attitude(sequence), EPOCH);
    let (header, packets, _) = client.parcel();
    assert_eq!(header.attitude_sequence, sequence);
    packets.len() as u32 + 2
}

/// Numbers of packets and of frame ends in a recording.
fn recorded(file: &Path) -> (usize, usize) {
    let bytes = std::fs::read(file).unwrap();
    let packets = pcapng::read(file, &bytes.into()).unwrap().records;
    let ends = packets.iter().filter(|record| {
        let reply = Reply::decode(&record.item);
        matches!(reply, Ok((_, Reply::FrameEnd(_))))
    });
    (packets.len(), ends.count())
}

#[test]
fn a_terminated_run_leaves_a_complete_recording() {
    let here = folder();
    let process = started(&here, "--capture run.pcapng");
    let mut client = process.udp_client();
    for sequence in 1..=3 {
        frame(&mut client, sequence);
    }
    let ended = process.end_by("-TERM").exits(0);
    ended.prints(&["frames_delivered 3"]);
    assert_eq!(recorded(&here.join("run.pcapng")).1, 3);
    let replay = here.run("replay run.pcapng --config run.toml");
    replay.exits(0).says(&["the same: 3 frames"]);
}

#[test]
fn a_killed_run_leaves_a_partial_recording() {
    let here = folder();
    let file = here.join("run.pcapng");
    let process = started(&here, "--capture run.pcapng");
    let mut client = process.udp_client();
    for sequence in 1..=3 {
        frame(&mut client, sequence);
    }
    // The file is flushed once a second.
    await_that("three frames are on disk", || {
        std::thread::sleep(Duration::from_millis(20));
        recorded(&file).1 == 3
    });
    // Further frames, of which the last are cut off.
    for sequence in 4..=6 {
        frame(&mut client, sequence);
    }
    assert_eq!(process.end_by("-KILL").code, None, "killed");
    let (_, frames) = recorded(&file);
    assert!((3..=6).contains(&frames), "{frames}");
    // The end may be anywhere in a record.
    let bytes = std::fs::read(&file).unwrap();
    for less in [1, 5, 30, 100] {
        here.write("cut.pcapng", &bytes[..bytes.len() - less]);
        assert!(recorded(&here.join("cut.pcapng")).1 >= 2, "{less}");
    }
    let replay = here.run("replay cut.pcapng --config run.toml");
    replay.exits(0).says(&["the same: "]);
}

/// The disk becomes full during the run: no byte beyond the first 64 KiB.
#[test]
fn a_run_continues_on_a_full_disk_and_reports_missing_packets() {
    let here = folder();
    let mut command = crate::folder::limited_shell(128);
    command.args(["run", "--config", "run.toml", "--capture", "run.pcapng"]);
    let process = Process::spawned(command.current_dir(&here), "listening on ");
    let mut client = process.udp_client();
    let mut sent = 0;
    for sequence in 1..=30 {
        // The client also sends an attitude, and credit after every eight packets.
        sent += frame(&mut client, sequence);
    }
    let taken = client.status().counters;
    let ended = process.end_by("-INT").exits(1);
    let ended = ended.prints(&["frames_delivered 30"]);
    let log = &ended.log;
    assert_eq!(log.matches("the run continues").count(), 1, "{log}");
    has(
        log,
        &[
            "capture run.pcapng",
            "is incomplete",
            "make room and run again",
        ],
    );
    // All packets are either in the file or reported as missing: received ones, frames, an Ack and
    // a Status.
    let (packets, _) = recorded(&here.join("run.pcapng"));
    let (_, missing) = log.rsplit_once("is incomplete, ").unwrap();
    let missing: u32 = missing.split(' ').next().unwrap().parse().unwrap();
    let all = taken.attitudes + taken.commands + sent + 2;
    assert_eq!(packets as u32 + missing, all, "{packets} and {missing}");
    here.run("replay run.pcapng --config run.toml").exits(0);
}

/// A limit of 0 bytes a file simulates a full disk: files can be created, but no byte can be
/// written. /dev/full has no space either.
#[test]
fn a_full_disk_leaves_no_files() {
    let here = folder();
    let refused = here.run("run --config run.toml --capture /dev/full");
    refused.exits(1).logs(&["capture /dev/full", "has room"]);
    for (command, names) in rows(
        "run --config run.toml --ready-file ready.json | --ready-file ready.json
         run --config run.toml --ready-file ready.json --capture c.pcapng --fault-log f.jsonl
         | --ready-file ready.json
         run --config run.toml --fault-log f.jsonl --capture c.pcapng | --capture c.pcapng
         loopback --frames 1 --junit v.xml --out out | cannot write v.xml
         loopback --frames 1 --out .                 | cannot write ./frame_00000.fits
         render --epoch 2026-07-12T03:04:05 --radec 10,20,0 --out .
         | cannot write ./frame_00000.fits
         camera new c.toml --size 64x64 --pixel 5 --focal 16 --aperture 8 --exposure 0.1 --full-well 9000
         | c.toml",
    ) {
        let failed = here.run_limited(0, command).exits(1).logs(&names);
        // X-Val: EFBIG of Linux, errno(3).
        failed.logs(&["File too large (os error 27)"]);
        let left = std::fs::read_dir(&*here).unwrap();
        let left: Vec<_> = left.map(|file| file.unwrap().file_name()).collect();
        assert_eq!(left, ["run.toml"], "{command}");
    }
}

/// Limits in blocks of 512 bytes a file. 1500: the files of a frame fit, a text log of its CAN
/// frames does not. 100: no picture of 131,072 bytes fits.
#[test]
fn an_incomplete_recording_fails_the_junit_file_too() {
    let here = Folder::with(&[
        ("delay.toml", &always("in", "delay", 0.001)),
        ("stuck.toml", &always("out", "stuck", 1.0)),
    ]);
    // Blocks, number of failures, options. Further unwritten files are reported with the frames. In
    // the last row the frame is missing, too.
    for (row, says) in rows(
        "1500 1 --link slcan --capture c.log | the recording is incomplete
         100 2 --faults delay.toml --fault-log /dev/full
         | writing the frames | --fault-log /dev/full: No space left on device
         1500 1 --link slcan --capture c.log --faults delay.toml --fault-log /dev/full
         | the recording is incomplete | --fault-log /dev/full: No space left on device
         1500 2 --link memory --faults stuck.toml --fault-log /dev/full
         | a fault blocks the link: the fault stuck, out has no end
         | --fault-log /dev/full: No space left on device",
    ) {
        let mut words = row.splitn(3, ' ');
        let [blocks, failures, flags] = [(); 3].map(|()| words.next().unwrap());
        let blocks = blocks.parse().unwrap();
        let command = format!("loopback --frames 1 --junit v.xml --force {flags}");
        let failed = here.run_limited(blocks, &command).exits(1);
        let error = failed.log.lines().rfind(|line| line.starts_with("error: "));
        has(error.unwrap(), &says);
        let junit = here.read("v.xml");
        has(&junit, &says);
        has(&junit, &[&format!("failures=\"{failures}\"")]);
    }
}

#[test]
fn packets_delayed_by_a_fault_are_not_attributed_to_the_client() {
    let here = folder();
    here.write("faults.toml", always("out", "delay", 60.0));
    let process = started(&here, "--frames 1 --faults faults.toml");
    let mut client = process.udp_client();
    client.point(attitude(1), EPOCH);
    // Challenges are not delayed; the client returns them.
    client.recv(Duration::from_secs(1));
    let ended = process.end().exits(0);
    let ended = ended.prints(&["1 (1 held back by a fault); 1 requested, 0 delivered\n"]);
    let ended = ended.logs(&[
        "waiting for packets that a fault holds back",
        "(lost_outbound): a fault holds packets back",
    ]);
    assert!(!ended.log.contains("client"), "{}", ended.log);
}

/// A fault stops the Credit of a client that grants 2 packets at a time: the log names the fault
/// and its direction.
#[test]
fn a_fault_that_stops_credit_is_the_remedy_in_the_log() {
    use skyloop_protocols::{Direction, Fault, FaultKind};
    const NO_CREDIT: &str = "(no credit): frame 0 waits: 2 packets are sent, and Credit grants 2; ";
    const LOST: &str = "(packets lost on the way): frame 0 waits: 4 packets are sent, and the client's Credit counts 2 of them as received; ";
    const DELAYS: &str = "a fault (--faults, Fault) delays packets on the way in: end it first";
    const LOSES: &str = "a fault (--faults, Fault) has lost or damaged packets on the way in: end it, if it lasts; else enlarge";
    let (delay, drop) = (FaultKind::Delay, FaultKind::Drop);
    for (kind, value, grants, says, remedy, injected) in [
        (delay, 9.0, &[2][..], NO_CREDIT, DELAYS, "delay 1"),
        (delay, 9.0, &[2, 4], LOST, DELAYS, "delay 1"),
        (drop, 1.0, &[2, 4], LOST, LOSES, "drop 1"),
    ] {
        let here = folder();
        let process = started(&here, "--fault-log log.jsonl");
        let mut client = process.udp_client().unpaced();
        // Losses by faults count from the start of the exchange.
        client.status();
        for packets in grants {
            client.send(Command::Credit { packets: *packets });
        }
        client.point(attitude(1), EPOCH);
        client.send(Command::Fault(Fault {
            kind,
            direction: Direction::In,
            value,
            seconds: 0.0,
        }));
        client.send(Command::Credit { packets: 6 });
        // The client proves its address; the frame is abandoned after 2 s.
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(1500) {
            client.recv(Duration::from_millis(100));
        }
        let ended = process.end_by("-INT").logs(&[&format!("{says}{remedy}")]);
        ended.prints(&[&format!("in: {injected}; out: none\n")]);
    }
}

#[test]
fn a_port_in_use_is_refused_and_a_released_one_is_reused() {
    let here = folder();
    let first = started(&here, "");
    let address = first.address.clone();
    let link = format!("--link {address}");
    let refused = || {
        let refused = here.run(&format!("run --config run.toml {link}"));
        refused.exits(1).logs(&[&address, "choose a free port"]);
    };
    refused();
    // The first run still works.
    frame(&mut first.udp_client(), 1);
    first.end_by("-INT").exits(0);
    // Another socket takes and releases the port.
    let other = UdpSocket::bind(address.strip_prefix("udp://").unwrap()).unwrap();
    refused();
    drop(other);
    let second = started(&here, &link);
    assert_eq!(second.address, address);
    frame(&mut second.udp_client(), 1);
    second.end_by("-INT").exits(0);
}

/// Resources of a process: open files, threads, resident memory (kB).
fn resources(id: u32) -> [usize; 3] {
    let entries = |of: &str| {
        let entries = std::fs::read_dir(format!("/proc/{id}/{of}"));
        entries.unwrap().count()
    };
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let resident = resident.unwrap().trim().trim_end_matches(" kB");
    [entries("fd"), entries("task"), resident.parse().unwrap()]
}

/// Pings until an answer arrives, then receives all answers up to those to one more Ping.
fn connect(client: &mut Client<UdpLine>) {
    await_that("the client is answered", || {
        client.send(Command::Ping);
        client.recv(TIMEOUT / 400).is_some()
    });
    let last = client.send(Command::Ping);
    let is_last = |packet: Vec<u8>| match Reply::decode(&packet).unwrap().1 {
        Reply::Ack(ack) => ack.sequence_count == last,
        _ => false,
    };
    while !is_last(client.next(false)) {}
    let status = client.next(false);
    let (_, status) = Reply::decode(&status).unwrap();
    assert!(matches!(status, Reply::Status(_)));
}

#[test]
fn a_thousand_clients_leak_no_resources() {
    /// Clients before the first measurement, which includes the memory of the first frame.
    const FIRST: u32 = 100;
    let here = folder();
    let process = started(&here, "");
    let mut before = [0; 3];
    for number in 0..1000 {
        let mut client = process.udp_client().unpaced();
        // The previous client is released when its Reset reaches the link, which may be after the
        // first packet of this client.
        connect(&mut client);
        // The first client gets many frames: memory grows until all threads have rendered one.
        let frames = match number {
            0 => 60,
            _ => u32::from(number % 50 == 0),
        };
        for i in 0..frames {
            frame(&mut client, number + i);
        }
        client.done(Command::Reset);
        if number == FIRST {
            before = resources(process.id());
        }
    }
    let after = resources(process.id());
    // X-Val: 900 clients that leak a file, a thread or 50 kB each. The number of the runtime's idle
    // threads varies, and memory is allocated by the megabyte.
    assert_eq!(after[0], before[0], "files: {before:?} {after:?}");
    assert!(after[1] < before[1] + 9, "threads: {before:?} {after:?}");
    assert!(after[2] < before[2] + 45_000, "{before:?} {after:?} kB");
    let mut client = process.udp_client().unpaced();
    connect(&mut client);
    frame(&mut client, 7);
    let ended = process.end_by("-TERM").exits(0);
    ended.prints(&["frames_delivered 80"]);
}
