//! `skyloop run` as a process when something breaks: signals, a full disk, a port that others hold, clients without end.
#![cfg(target_os = "linux")]

use crate::run::Process;
use crate::skyloop;
use crate::support::client::Client;
use crate::support::line::UdpLine;
use crate::support::{PATIENCE, await_that};
use skyloop::link::capture::pcapng;
use skyloop_protocols::Reply;
use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Frames of a few packets: what is drilled is not how long pixels take.
const RUN: &str = "[run]\nlink = \"udp://127.0.0.1:0\"\noutput = \"windows\"\nidle_s = 60.0\n";

/// A run of the file `run.toml` in `at` with these flags, listening.
fn started(at: &Path, flags: &[&str]) -> Process {
    let config = at.join("run.toml");
    if !config.exists() {
        std::fs::write(&config, RUN).unwrap();
    }
    let config = config.display().to_string();
    Process::of(
        &[&["run", "--config", &config], flags].concat(),
        "listening on ",
    )
}

fn client_of(process: &Process) -> Client<UdpLine> {
    Client::new(UdpLine::to(&process.address))
}

/// A frame of this attitude, of windows and objects.
fn frame(client: &mut Client<UdpLine>, sequence: u32) -> u32 {
    client.point(crate::support::attitude(sequence), crate::support::EPOCH);
    let (header, packets, _) = client.parcel();
    assert_eq!(header.attitude_sequence, sequence);
    packets.len() as u32 + 2
}

/// The packets of a recording, and how many of them end a frame.
fn recorded(file: &Path) -> (usize, usize) {
    let octets = std::fs::read(file).unwrap();
    let packets = pcapng::read(file, &octets.into()).unwrap().records;
    let ends = packets.iter().filter(|record| {
        let reply = Reply::decode(&record.item);
        matches!(reply, Ok((_, Reply::FrameEnd(_))))
    });
    (packets.len(), ends.count())
}

/// What `skyloop replay` says of a recording, and its exit code.
fn replayed(at: &Path, file: &str) -> (Option<i32>, String) {
    let replay = ["replay", file, "--config", "run.toml"];
    let output = skyloop(at).args(replay).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

#[test]
fn a_run_that_is_told_to_end_leaves_a_recording_that_is_whole() {
    let here = tempfile::tempdir().unwrap();
    let file = here.path().join("run.pcapng").display().to_string();
    let process = started(here.path(), &["--capture", &file]);
    let mut client = client_of(&process);
    for sequence in 1..=3 {
        frame(&mut client, sequence);
    }
    process.signal("-TERM");
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    assert!(table.contains("frames_delivered 3"), "{table}");
    assert_eq!(recorded(Path::new(&file)).1, 3);
    let (code, text) = replayed(here.path(), &file);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("the same: 3 frames"), "{text}");
}

#[test]
fn a_run_that_is_killed_leaves_what_it_had_recorded() {
    let here = tempfile::tempdir().unwrap();
    let file = here.path().join("run.pcapng");
    let process = started(here.path(), &["--capture", &file.display().to_string()]);
    let mut client = client_of(&process);
    for sequence in 1..=3 {
        frame(&mut client, sequence);
    }
    // The file is brought up to date once a second.
    await_that("three frames are on disk", || {
        std::thread::sleep(Duration::from_millis(20));
        recorded(&file).1 == 3
    });
    // More of them, of which the last ones are cut off.
    for sequence in 4..=6 {
        frame(&mut client, sequence);
    }
    process.signal("-KILL");
    let (code, _) = process.end();
    assert_eq!(code, None, "killed");
    let (_, frames) = recorded(&file);
    assert!((3..=6).contains(&frames), "{frames}");
    // Wherever within a record the end lies.
    let octets = std::fs::read(&file).unwrap();
    let cut = here.path().join("cut.pcapng");
    for less in [1, 5, 30, 100] {
        std::fs::write(&cut, &octets[..octets.len() - less]).unwrap();
        assert!(recorded(&cut).1 >= 2, "{less}");
    }
    let (code, text) = replayed(here.path(), "cut.pcapng");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("the same: "), "{text}");
}

/// A disk that is full while the run records: no octet beyond the first 64 KiB.
#[test]
fn a_run_whose_disk_is_full_goes_on_and_tells_what_is_missing() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("run.toml"), RUN).unwrap();
    let log = here.path().join("log");
    let mut command = Command::new("sh");
    // The signal that comes with it is not for us; blocks are of 512 octets.
    let script = "trap '' XFSZ; ulimit -f 128; exec \"$0\" run --config run.toml --capture run.pcapng 2> /dev/stderr";
    command
        .args(["-c", script, env!("CARGO_BIN_EXE_skyloop")])
        .current_dir(here.path())
        .stderr(std::fs::File::create(&log).unwrap());
    let process = Process::spawned(&mut command, "listening on ");
    let mut client = client_of(&process);
    let mut sent = 0;
    for sequence in 1..=30 {
        // Its packets, and the attitude; and credit after every eight.
        sent += frame(&mut client, sequence);
    }
    let taken = client.status().counters;
    process.signal("-INT");
    let (code, table) = process.end();
    let log = std::fs::read_to_string(&log).unwrap();
    assert_eq!(code, Some(1), "{table}{log}");
    assert!(table.contains("frames_delivered 30"), "{table}");
    assert_eq!(log.matches("the run goes on").count(), 1, "{log}");
    for word in [
        "capture run.pcapng",
        "is not whole",
        "make room and run again",
    ] {
        assert!(log.contains(word), "no {word:?} in {log}");
    }
    // All that was taken and sent is in the file, or told as missing: what came, frames, an Ack and a Status.
    let (packets, _) = recorded(&here.path().join("run.pcapng"));
    let (_, missing) = log.rsplit_once("is not whole, ").unwrap();
    let missing: u32 = missing.split(' ').next().unwrap().parse().unwrap();
    let all = taken.attitudes + taken.commands + sent + 2;
    assert_eq!(packets as u32 + missing, all, "{packets} and {missing}");
    let (code, text) = replayed(here.path(), "run.pcapng");
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn a_disk_that_is_full_from_the_start_is_refused_with_what_to_do() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("run.toml"), RUN).unwrap();
    let run = ["run", "--config", "run.toml", "--capture", "/dev/full"];
    let output = skyloop(here.path()).args(run).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("capture /dev/full") && text.contains("has room"),
        "{text}"
    );
}

/// A limit of 0 bytes a file stands for a full disk: files can be made, and not one byte can be written into them.
#[test]
fn a_full_disk_leaves_no_file_behind() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    std::fs::write(at.join("run.toml"), RUN).unwrap();
    let run = "run --config run.toml";
    for (command, names) in [
        (format!("{run} --ready-file ready.json"), "--ready-file ready.json"),
        (
            format!("{run} --ready-file ready.json --capture c.pcapng --fault-log f.jsonl"),
            "--ready-file ready.json",
        ),
        (
            format!("{run} --fault-log f.jsonl --capture c.pcapng"),
            "--capture c.pcapng",
        ),
        (
            "loopback --frames 1 --junit v.xml --out out".to_string(),
            "cannot write v.xml",
        ),
        (
            "loopback --frames 1 --out .".to_string(),
            "cannot write ./frame_00000.fits",
        ),
        (
            "render --epoch 2026-07-12T03:04:05 --radec 10,20,0 --out .".to_string(),
            "cannot write ./frame_00000.fits",
        ),
        (
            "camera new c.toml --size 64x64 --pixel 5 --focal 16 --aperture 8 --exposure 0.1 --full-well 10000".to_string(),
            "c.toml",
        ),
    ] {
        let mut sh = Command::new("sh");
        sh.args(["-c", "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\""]);
        sh.arg(env!("CARGO_BIN_EXE_skyloop")).args(command.split(' '));
        let output = sh.current_dir(at).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{command}: {text}");
        // X-Val: EFBIG of Linux, errno(3).
        let says = [names, "File too large (os error 27)"];
        assert!(says.iter().all(|says| text.contains(says)), "{text}");
        let left: Vec<_> = std::fs::read_dir(at).unwrap().map(|file| file.unwrap().file_name()).collect();
        assert_eq!(left, ["run.toml"], "{command}");
    }
}

/// Blocks of 512 bytes a file. 1500: the files of a frame fit, a log of its CAN frames as text does not. 100: no picture of 131,072 bytes fits.
#[test]
fn a_recording_that_is_cut_short_fails_the_junit_file_too() {
    const CUT: &str = "the recording is not whole";
    const LOG: &str = "--fault-log /dev/full: No space left on device";
    for (blocks, fault, flags, failures, says) in [
        (1500, "", "--link slcan --capture c.log", 1, &[CUT][..]),
        // What could not be written beside the frames is reported with them.
        (
            100,
            "direction = \"in\"\nkind = \"delay\"\nvalue = 0.001",
            "--faults f.toml --fault-log /dev/full",
            2,
            &["writing the frames", LOG],
        ),
        (
            1500,
            "direction = \"in\"\nkind = \"delay\"\nvalue = 0.001",
            "--link slcan --capture c.log --faults f.toml --fault-log /dev/full",
            1,
            &[LOG, CUT],
        ),
        // The frame is missing, too.
        (
            1500,
            "direction = \"out\"\nkind = \"stuck\"\nvalue = 1.0",
            "--link memory --faults f.toml --fault-log /dev/full",
            2,
            &[
                "nothing passes any more: the fault stuck, out has no end",
                LOG,
            ],
        ),
    ] {
        let here = tempfile::tempdir().unwrap();
        let at = here.path();
        std::fs::write(at.join("f.toml"), format!("[[faults]]\n{fault}\n")).unwrap();
        let mut sh = Command::new("sh");
        let limited = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
        sh.args(["-c", &limited]);
        let command = format!("loopback --frames 1 --junit v.xml {flags}");
        sh.arg(env!("CARGO_BIN_EXE_skyloop"))
            .args(command.split(' '));
        let output = sh.current_dir(at).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{text}");
        let error = text.lines().rfind(|line| line.starts_with("error: "));
        let junit = std::fs::read_to_string(at.join("v.xml")).unwrap();
        for text in [error.unwrap(), &junit] {
            let is_said = says.iter().all(|says| text.contains(says));
            assert!(is_said, "{command}: {text}");
        }
        let failures = format!("failures=\"{failures}\"");
        assert!(junit.contains(&failures), "{command}: {junit}");
    }
}

#[test]
fn packets_that_a_fault_delays_are_not_blamed_on_the_client() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let faults = "[[faults]]\ndirection = \"out\"\nkind = \"delay\"\nvalue = 60\n";
    std::fs::write(at.join("faults.toml"), faults).unwrap();
    std::fs::write(at.join("run.toml"), RUN).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let run = "run --config run.toml --frames 1 --faults faults.toml";
    let command = command.args(run.split(' ')).current_dir(at);
    let command = command.stderr(std::process::Stdio::piped());
    let process = Process::spawned(command, "listening on ");
    let mut client = client_of(&process);
    client.point(crate::support::attitude(1), crate::support::EPOCH);
    // Challenges are not delayed: it returns them.
    client.recv(Duration::from_secs(1));
    let (code, table, log) = process.end_with_log();
    assert_eq!(code, Some(0), "{table}{log}");
    let row = "1 (1 held back by a fault); 1 requested, 0 delivered\n";
    assert!(table.contains(row), "{table}");
    for says in [
        "waiting for packets that a fault holds back",
        "(lost_outbound): a fault holds packets back",
    ] {
        assert!(log.contains(says), "{log}");
    }
    assert!(!log.contains("client"), "{log}");
}

/// A fault stops the Credit of a client that grants 2 packets at a time: the log names it, with the direction.
#[test]
fn a_fault_that_stops_credit_is_the_remedy_in_the_log() {
    use skyloop_protocols::{Command, Direction, Fault, FaultKind};
    const NO_CREDIT: &str = "(no credit): frame 0 waits: 2 packets are sent, and Credit grants 2; ";
    const LOST: &str = "(packets lost on the way): frame 0 waits: 4 packets are sent, and the client grants as if 2 of them had come; ";
    const DELAYS: &str = "a fault (--faults, Fault) delays packets on the way in: end it first";
    const LOSES: &str = "a fault (--faults, Fault) has lost or damaged packets on the way in: end it, if it lasts; else enlarge";
    for (kind, value, grants, says, remedy, injected) in [
        (
            FaultKind::Delay,
            9.0,
            &[2][..],
            NO_CREDIT,
            DELAYS,
            "delay 1",
        ),
        (FaultKind::Delay, 9.0, &[2, 4], LOST, DELAYS, "delay 1"),
        (FaultKind::Drop, 1.0, &[2, 4], LOST, LOSES, "drop 1"),
    ] {
        let here = tempfile::tempdir().unwrap();
        std::fs::write(here.path().join("run.toml"), RUN).unwrap();
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skyloop"));
        let command = command.args("run --config run.toml --fault-log log.jsonl".split(' '));
        let command = command.current_dir(here.path());
        let command = command.stderr(std::process::Stdio::piped());
        let process = Process::spawned(command, "listening on ");
        let mut client = client_of(&process);
        client.window = None;
        // What faults lose counts from the begin of the exchange.
        client.status();
        for packets in grants {
            client.send(Command::Credit { packets: *packets });
        }
        client.point(crate::support::attitude(1), crate::support::EPOCH);
        client.send(Command::Fault(Fault {
            kind,
            direction: Direction::In,
            value,
            seconds: 0.0,
        }));
        client.send(Command::Credit { packets: 6 });
        // It proves its address, and is given up after 2 s.
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(1500) {
            client.recv(Duration::from_millis(100));
        }
        process.signal("-INT");
        let (_, table, log) = process.end_with_log();
        assert!(log.contains(&format!("{says}{remedy}")), "{table}{log}");
        let row = format!("in: {injected}; out: none\n");
        assert!(table.contains(&row), "{table}");
    }
}

#[test]
fn a_port_that_another_holds_is_told_and_one_that_is_given_back_serves() {
    let here = tempfile::tempdir().unwrap();
    let first = started(here.path(), &[]);
    let address = first.address.clone();
    let refused = || {
        let run = ["run", "--config", "run.toml", "--link", &address];
        let output = skyloop(here.path()).args(run).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{text}");
        for word in [&address, "choose a free port"] {
            assert!(text.contains(word), "no {word:?} in {text}");
        }
    };
    refused();
    // The one that holds it has noticed nothing.
    frame(&mut client_of(&first), 1);
    first.signal("-INT");
    assert_eq!(first.end().0, Some(0));
    // A stranger takes it, and gives it back.
    let stranger = UdpSocket::bind(address.strip_prefix("udp://").unwrap()).unwrap();
    refused();
    drop(stranger);
    let second = started(here.path(), &["--link", &address]);
    assert_eq!(second.address, address);
    frame(&mut client_of(&second), 1);
    second.signal("-INT");
    assert_eq!(second.end().0, Some(0));
}

/// What a process holds: open files, threads, resident memory (kB).
fn held(id: u32) -> [usize; 3] {
    let entries = |of: &str| {
        std::fs::read_dir(format!("/proc/{id}/{of}"))
            .unwrap()
            .count()
    };
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let resident = resident.unwrap().trim().trim_end_matches(" kB");
    [entries("fd"), entries("task"), resident.parse().unwrap()]
}

/// Pings until an answer comes, and takes all answers: up to those to one more Ping.
fn be_heard(client: &mut Client<UdpLine>) {
    await_that("the client is heard", || {
        client.send(skyloop_protocols::Command::Ping);
        client.recv(PATIENCE / 400).is_some()
    });
    let last = client.send(skyloop_protocols::Command::Ping);
    let is_last = |packet: Vec<u8>| match Reply::decode(&packet).unwrap().1 {
        Reply::Ack(ack) => ack.sequence_count == last,
        _ => false,
    };
    while !is_last(client.next(false)) {}
    let status = client.next(false);
    assert!(matches!(
        Reply::decode(&status).unwrap().1,
        Reply::Status(_)
    ));
}

#[test]
fn a_thousand_clients_leave_nothing_behind() {
    /// Clients that come before what is held is looked at: the first frame's memory among them.
    const FIRST: u32 = 100;
    let here = tempfile::tempdir().unwrap();
    let process = started(here.path(), &[]);
    let mut before = [0; 3];
    for number in 0..1000 {
        let mut client = client_of(&process);
        client.window = None;
        // The one before is let go of when its Reset has reached the link, which may be after this one's first word.
        be_heard(&mut client);
        // The first has many: until all threads have worked on one, memory grows.
        let frames = if number == 0 {
            60
        } else {
            u32::from(number % 50 == 0)
        };
        for i in 0..frames {
            frame(&mut client, number + i);
        }
        client.done(skyloop_protocols::Command::Reset);
        if number == FIRST {
            before = held(process.id());
        }
    }
    let after = held(process.id());
    // X-Val: 900 clients that leave a file, a thread or 50 kB each; the runtime's idle threads come and go, and memory is taken by the megabyte.
    assert_eq!(after[0], before[0], "files: {before:?} {after:?}");
    assert!(after[1] < before[1] + 9, "threads: {before:?} {after:?}");
    assert!(after[2] < before[2] + 45_000, "{before:?} {after:?} kB");
    let mut client = client_of(&process);
    client.window = None;
    be_heard(&mut client);
    frame(&mut client, 7);
    process.signal("-TERM");
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    assert!(table.contains("frames_delivered 80"), "{table}");
}
