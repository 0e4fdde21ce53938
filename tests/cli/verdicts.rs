//! For continuous integration: limits of a loopback, and options of `run` for scripts.
#![cfg(unix)]

use crate::run::Process;
use crate::support::{EPOCH, attitude};
use crate::{Folder, has, rows};
use skyloop_protocols::Command as Packet;
use std::time::{Duration, Instant};

#[test]
fn a_loopback_meets_its_limits_or_fails() {
    let here = Folder::new();
    // Output without pixels is not compared, so it meets no limit. A run that did not start has not
    // passed.
    for (limits, says) in rows(
        "--max-centroid-rms 0.5 --max-missed 0 --max-false 50 --max-latency-p99-ms 60000
         | tests=\"5\" failures=\"0\" | passed: centroids: rms 0.
         --max-centroid-rms 0.001 | tests=\"2\" failures=\"1\" | failed: centroids: rms 0.
         --max-latency-p99-ms 0.001 | failures=\"1\" | failed: latency p99:
         --output labels --max-missed 9 --max-false 9 --max-centroid-rms 9
         | tests=\"4\" failures=\"3\"
         | not known: 0 of 2 frames brought both pixels and readable labels
         --link pigeon | failures=\"2\" | pigeon",
    ) {
        let ended = here.run(&format!("loopback --frames 2 --junit v.xml {limits}"));
        let passes = says[0].ends_with("failures=\"0\"");
        ended.exits(i32::from(!passes)).says(&says[1..]);
        has(&here.read("v.xml"), &says[..1]);
    }
    here.refuses("loopback", "--junit no/such/v.xml | name another file");
}

/// Links with a fault: direction, kind, value, `at_s`, and `for_s` unless endless. The last two
/// last longer than a client waits: docs/how-to/run.md.
const STOPPING: &str = "
    memory out stuck 1.0 0.0
    memory in stuck 1.0 0.2
    udp in drop 1.0 0.2
    pty out down 1.0 0.2
    memory in bit_flips 1.0 0.0
    memory in bit_flips 0.01 0.0
    memory out bit_flips 0.01 0.0
    serial out bit_flips 0.001 0.2
    memory in delay 60.0 0.0
    udp out delay 31.0 0.2
    memory in jitter 60.0 0.0
    udp out jitter 60.0 0.0
    slcan out duplicate 1.0 0.0
    slcan in bit_flips 0.01 0.0
    slcan in bus_off 1.0 0.3
    slcan out bus_off 1.0 0.0
    memory out stuck 1.0 0.2 100000.0
    memory in delay 60.0 0.0 100000.0";

#[test]
fn a_line_stopped_by_a_fault_ends_a_loopback_in_seconds() {
    let rows: Vec<&str> = STOPPING.trim().lines().collect();
    // In parallel, since they mostly wait.
    for together in rows.chunks(9) {
        std::thread::scope(|scope| {
            for stopping in together {
                scope.spawn(|| ends_in_seconds(stopping));
            }
        });
    }
}

fn ends_in_seconds(stopping: &str) {
    let words: Vec<&str> = stopping.split_whitespace().collect();
    let [link, direction, kind, value, at_s, ref for_s @ ..] = words[..] else {
        panic!("{stopping}");
    };
    let mut fault = format!(
        "[[faults]]\ndirection = {direction:?}\nkind = {kind:?}\nvalue = {value}\nat_s = {at_s}\n"
    );
    for_s
        .iter()
        .for_each(|s| fault += &format!("for_s = {s}\n"));
    let here = Folder::with(&[("faults.toml", &fault)]);
    let started = Instant::now();
    let command = format!("loopback --link {link} --faults faults.toml --junit v.xml");
    let ended = here.run(&command).exits(1);
    let took = started.elapsed();
    let (lasts, remedy) = match for_s {
        [] => ("has no end", "give it a for_s, a lower value"),
        _ => ("lasts 9", " s longer and has affected "),
    };
    let reported =
        format!("{link}: a fault blocks the link: the fault {kind}, {direction} {lasts}");
    let ended = ended.says(&[&reported, " packet", remedy]);
    // 5 s without a frame, and a margin for the frames before on a busy machine.
    assert!(took < Duration::from_secs(60), "{took:?}: {}", ended.all());
    has(&here.read("v.xml"), &["<testcase name=\"run\"", &reported]);
}

/// A folder with a run file that uses a free port.
fn folder() -> Folder {
    Folder::with(&[("run.toml", "[run]\nlink = \"udp://127.0.0.1:0\"\n")])
}

fn started(here: &Folder, flags: &str) -> Process {
    Process::listening(here, &format!("run --config run.toml {flags}"))
}

#[test]
fn a_run_has_timeouts_for_its_client_and_its_end() {
    let here = folder();
    for (flags, says) in rows(
        "--wait-for-client 0.2    | no client has come within 0.2 s
         --timeout 0.2
         --timeout 0.2 --frames 2 | stopped after 0.2 s (--timeout) with 0 of 2 frames",
    ) {
        let ended = started(&here, flags).end();
        ended.exits(i32::from(!says.is_empty())).logs(&says);
    }
    // The sender of an invalid packet is no client.
    let process = started(&here, "--wait-for-client 1");
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = process.address.strip_prefix("udp://").unwrap();
    socket.send_to(b"hello, is anybody there?", to).unwrap();
    process.end().exits(1);
    // A frame without credit is abandoned after 2 s; a frame on a slow link at the timeout: 5 kB at
    // 1.25 kB/s.
    for (rate, packets, timeout_s, min_s) in [("", 0, 60, 0), ("?rate_mbit=0.01", 1000, 3, 3)] {
        let link = format!("--link udp://127.0.0.1:0{rate} --output windows");
        let begun = Instant::now();
        let served = started(&here, &format!("--timeout {timeout_s} --frames 1 {link}"));
        let mut client = served.udp_client().unpaced();
        client.send(Packet::Credit { packets });
        client.status();
        client.point(attitude(0), EPOCH);
        let ended = served.end().exits(1).logs(&["0 of 1 frame sent"]);
        assert!(!ended.log.contains("does not read"), "{}", ended.log);
        let took = begun.elapsed().as_secs();
        assert!((min_s..min_s + 20).contains(&took), "{took} s");
    }
    let served = started(&here, "--wait-for-client 5 --timeout 60 --frames 2");
    let mut client = served.udp_client();
    client.good_frame(1);
    client.good_frame(2);
    served.end().exits(0);
}

#[test]
fn the_ready_file_has_the_addresses_until_the_end_of_the_run() {
    let here = folder();
    // A file of a killed run.
    here.write("ready.json", "{ \"pid\": 1, \"links\": [] }");
    let running = started(&here, "--ready-file ready.json --metrics 127.0.0.1:0");
    crate::support::await_that("the file is there", || {
        std::thread::sleep(Duration::from_millis(5));
        let text = std::fs::read_to_string(here.join("ready.json"));
        text.is_ok_and(|text| !text.contains("\"pid\": 1,"))
    });
    let ready = here.json("ready.json");
    assert_eq!(ready["pid"], running.id());
    assert_eq!(ready["links"], serde_json::json!([running.address]));
    assert_eq!(ready["heads"], serde_json::json!([]));
    let metrics = ready["metrics"].as_str().unwrap().parse().unwrap();
    assert!(!crate::support::fetched(metrics).is_empty());
    running.end_by("-INT").exits(0);
    assert_eq!(here.names(""), ["run.toml"]);
    here.write("ready.json", "{}");
    here.refuses(
        "run --config run.toml --ready-file",
        "ready.json | did not make this file
         no/such    | --ready-file no/such: ",
    );
}
