//! For continuous integration: limits of a loopback, and what `run` offers scripts.
#![cfg(unix)]

use crate::run::Process;
use crate::skyloop;
use crate::support::client::Client;
use crate::support::line::UdpLine;
use crate::support::{EPOCH, attitude};
use serde_json::Value;
use skyloop_protocols::Command as Packet;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Exit code and all that a command printed.
fn say(at: &Path, words: &str) -> (Option<i32>, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

#[test]
fn a_loopback_keeps_its_limits_or_fails() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    for (limits, code, failures, says) in [
        (
            "--max-centroid-rms 0.5 --max-missed 0 --max-false 50 --max-latency-p99-ms 60000",
            Some(0),
            "tests=\"5\" failures=\"0\"",
            "kept: centroids: rms 0.",
        ),
        (
            "--max-centroid-rms 0.001",
            Some(1),
            "tests=\"2\" failures=\"1\"",
            "broken: centroids: rms 0.",
        ),
        (
            "--max-latency-p99-ms 0.001",
            Some(1),
            "failures=\"1\"",
            "broken: latency p99: ",
        ),
        // No pixels: nothing was compared, and no limit is kept by that.
        (
            "--output labels --max-missed 9 --max-false 9 --max-centroid-rms 9",
            Some(1),
            "tests=\"4\" failures=\"3\"",
            "not known: 0 of 2 frames brought both pixels and readable labels",
        ),
    ] {
        let (found, text) = say(at, &format!("loopback --frames 2 --junit v.xml {limits}"));
        assert_eq!(found, code, "{limits}: {text}");
        assert!(text.contains(says), "{limits}: {text}");
        let junit = std::fs::read_to_string(at.join("v.xml")).unwrap();
        assert!(junit.contains(failures), "{limits}: {junit}");
    }
    // What has not begun has not passed.
    let (_, text) = say(at, "loopback --frames 2 --junit v.xml --link pigeon");
    let junit = std::fs::read_to_string(at.join("v.xml")).unwrap();
    assert!(junit.contains("failures=\"2\""), "{text}{junit}");
    let (code, text) = say(at, "loopback --junit no/such/v.xml");
    assert!(
        code == Some(1) && text.contains("name another file"),
        "{text}"
    );
}

/// A link, and a fault of it: direction, kind, value, `at_s`, and further keys.
type Stopping = (
    &'static str,
    &'static str,
    &'static str,
    f64,
    f64,
    &'static str,
);

const STOPPING: [Stopping; 18] = [
    ("memory", "out", "stuck", 1.0, 0.0, ""),
    ("memory", "in", "stuck", 1.0, 0.2, ""),
    ("udp", "in", "drop", 1.0, 0.2, ""),
    ("pty", "out", "down", 1.0, 0.2, ""),
    ("memory", "in", "bit_flips", 1.0, 0.0, ""),
    ("memory", "in", "bit_flips", 0.01, 0.0, ""),
    ("memory", "out", "bit_flips", 0.01, 0.0, ""),
    ("serial", "out", "bit_flips", 0.001, 0.2, ""),
    ("memory", "in", "delay", 60.0, 0.0, ""),
    ("udp", "out", "delay", 31.0, 0.2, ""),
    ("memory", "in", "jitter", 60.0, 0.0, ""),
    ("udp", "out", "jitter", 60.0, 0.0, ""),
    ("slcan", "out", "duplicate", 1.0, 0.0, ""),
    ("slcan", "in", "bit_flips", 0.01, 0.0, ""),
    ("slcan", "in", "bus_off", 1.0, 0.3, ""),
    ("slcan", "out", "bus_off", 1.0, 0.0, ""),
    // So long that a client gives up before: README.md, `skyloop loopback`.
    ("memory", "out", "stuck", 1.0, 0.2, "for_s = 100000.0"),
    ("memory", "in", "delay", 60.0, 0.0, "for_s = 100000.0"),
];

#[test]
fn a_line_that_a_fault_has_stopped_ends_a_loopback_in_seconds() {
    // They wait most of the time.
    for together in STOPPING.chunks(9) {
        std::thread::scope(|scope| {
            for stopping in together {
                scope.spawn(|| ends_in_seconds(stopping));
            }
        });
    }
}

fn ends_in_seconds((link, direction, kind, value, at_s, further): &Stopping) {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let fault = format!(
        "[[faults]]\ndirection = {direction:?}\nkind = {kind:?}\nvalue = {value:?}\nat_s = {at_s:?}\n{further}\n"
    );
    std::fs::write(at.join("faults.toml"), fault).unwrap();
    let started = Instant::now();
    let command = format!("loopback --link {link} --faults faults.toml --junit v.xml");
    let (code, text) = say(at, &command);
    let took = started.elapsed();
    assert_eq!(code, Some(1), "{text}");
    let (lasts, remedy) = match *further {
        "" => ("has no end", "give it a for_s, a lower value"),
        _ => ("lasts 9", " s longer and has met "),
    };
    let reported =
        format!("{link}: nothing passes any more: the fault {kind}, {direction} {lasts}");
    for words in [&reported, " packet", remedy] {
        assert!(text.contains(words), "no {words:?} in {text}");
    }
    // 5 s without a frame; a busy machine needs time for the frames before.
    assert!(took < Duration::from_secs(60), "{took:?}: {text}");
    let junit = std::fs::read_to_string(at.join("v.xml")).unwrap();
    assert!(
        junit.contains("<testcase name=\"run\"") && junit.contains(&reported),
        "{junit}"
    );
}

/// The emulator of a run file with a free port, in a folder.
fn process(at: &Path, flags: &[&str]) -> Process {
    std::fs::write(at.join("run.toml"), "[run]\nlink = \"udp://127.0.0.1:0\"\n").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let command = command.args(["run", "--config", "run.toml"]).args(flags);
    let command = command.current_dir(at).stderr(std::process::Stdio::piped());
    Process::spawned(command, "listening on ")
}

#[test]
fn a_run_waits_for_a_client_and_for_its_end_only_so_long() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let (code, _, log) = process(at, &["--wait-for-client", "0.2"]).end_with_log();
    assert!(
        code == Some(1) && log.contains("no client has come within 0.2 s"),
        "{log}"
    );
    // What is no packet of the wire is no client.
    let stranger = process(at, &["--wait-for-client", "1"]);
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = stranger.address.strip_prefix("udp://").unwrap();
    socket.send_to(b"hello, is anybody there?", to).unwrap();
    assert_eq!(stranger.end().0, Some(1));
    let (code, _, log) = process(at, &["--timeout", "0.2"]).end_with_log();
    assert_eq!(code, Some(0), "{log}");
    let (code, _, log) = process(at, &["--timeout", "0.2", "--frames", "2"]).end_with_log();
    let says = "stopped after 0.2 s (--timeout) with 0 of 2 frames";
    assert!(code == Some(1) && log.contains(says), "{log}");
    // A frame that its client does not grant is given up after 2 s; one that a slow link still carries ends with the time: 5 kB at 1.25 kB/s.
    for (rate, packets, timeout_s, least_s) in [("", 0, "60", 0), ("?rate_mbit=0.01", 1000, "3", 3)]
    {
        let link = format!("udp://127.0.0.1:0{rate}");
        let begun = Instant::now();
        let served = process(
            at,
            &[
                "--timeout",
                timeout_s,
                "--frames",
                "1",
                "--output",
                "windows",
                "--link",
                &link,
            ],
        );
        let mut client = Client::new(UdpLine::to(&served.address));
        client.window = None;
        client.send(Packet::Credit { packets });
        client.status();
        client.point(attitude(0), EPOCH);
        let (code, table, log) = served.end_with_log();
        let says = "0 of 1 frame sent";
        assert!(code == Some(1) && log.contains(says), "{table}{log}");
        assert!(!log.contains("does not read"), "{log}");
        let took = begun.elapsed().as_secs();
        assert!((least_s..least_s + 20).contains(&took), "{took} s");
    }
    let served = process(
        at,
        &["--wait-for-client", "5", "--timeout", "60", "--frames", "2"],
    );
    let mut client = Client::new(UdpLine::to(&served.address));
    client.good_frame(1);
    client.good_frame(2);
    let (code, table, log) = served.end_with_log();
    assert_eq!(code, Some(0), "{table}{log}");
}

#[test]
fn the_ready_file_says_where_links_listen_and_goes_with_the_run() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let file = at.join("ready.json");
    // A killed run has left one.
    std::fs::write(&file, "{ \"pid\": 1, \"links\": [] }").unwrap();
    let flags = ["--ready-file", "ready.json", "--metrics", "127.0.0.1:0"];
    let running = process(at, &flags);
    crate::support::await_that("the file is there", || {
        std::thread::sleep(Duration::from_millis(5));
        std::fs::read_to_string(&file).is_ok_and(|text| !text.contains("\"pid\": 1,"))
    });
    let ready: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    assert_eq!(ready["pid"], running.id());
    assert_eq!(ready["links"], serde_json::json!([running.address]));
    assert_eq!(ready["heads"], serde_json::json!([]));
    let metrics = ready["metrics"].as_str().unwrap().parse().unwrap();
    assert!(!crate::support::fetched(metrics).is_empty());
    running.signal("-INT");
    assert_eq!(running.end().0, Some(0));
    assert_eq!(crate::names(at), ["run.toml"]);
    std::fs::write(&file, "{}").unwrap();
    let (code, text) = say(at, "run --config run.toml --ready-file ready.json");
    assert!(
        code == Some(1) && text.contains("did not make this file"),
        "{text}"
    );
    let (code, text) = say(at, "run --config run.toml --ready-file no/such");
    assert!(
        code == Some(1) && text.contains("--ready-file no/such: "),
        "{text}"
    );
}
