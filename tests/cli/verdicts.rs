//! For continuous integration: limits of a loopback, and what `run` offers scripts.
#![cfg(unix)]

use crate::run::Process;
use crate::support::{EPOCH, attitude};
use crate::{Folder, has, rows};
use skyloop_protocols::Command as Packet;
use std::time::{Duration, Instant};

#[test]
fn a_loopback_keeps_its_limits_or_fails() {
    let here = Folder::new();
    // Labels have no pixels: nothing was compared, and no limit is kept by that. What has not begun
    // has not passed.
    for (limits, says) in rows(
        "--max-centroid-rms 0.5 --max-missed 0 --max-false 50 --max-latency-p99-ms 60000
         | tests=\"5\" failures=\"0\" | kept: centroids: rms 0.
         --max-centroid-rms 0.001 | tests=\"2\" failures=\"1\" | broken: centroids: rms 0.
         --max-latency-p99-ms 0.001 | failures=\"1\" | broken: latency p99:
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

/// A link, and a fault of it: direction, kind, value, `at_s`, and `for_s` where it has one. The last
/// two are so long that a client gives up before: docs/how-to/run.md.
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
fn a_line_that_a_fault_has_stopped_ends_a_loopback_in_seconds() {
    let rows: Vec<&str> = STOPPING.trim().lines().collect();
    // They wait most of the time.
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
        _ => ("lasts 9", " s longer and has met "),
    };
    let reported =
        format!("{link}: nothing passes any more: the fault {kind}, {direction} {lasts}");
    let ended = ended.says(&[&reported, " packet", remedy]);
    // 5 s without a frame; a busy machine needs time for the frames before.
    assert!(took < Duration::from_secs(60), "{took:?}: {}", ended.all());
    has(&here.read("v.xml"), &["<testcase name=\"run\"", &reported]);
}

/// A folder with a run file with a free port.
fn folder() -> Folder {
    Folder::with(&[("run.toml", "[run]\nlink = \"udp://127.0.0.1:0\"\n")])
}

fn started(here: &Folder, flags: &str) -> Process {
    Process::listening(here, &format!("run --config run.toml {flags}"))
}

#[test]
fn a_run_waits_for_a_client_and_for_its_end_only_so_long() {
    let here = folder();
    for (flags, says) in rows(
        "--wait-for-client 0.2    | no client has come within 0.2 s
         --timeout 0.2
         --timeout 0.2 --frames 2 | stopped after 0.2 s (--timeout) with 0 of 2 frames",
    ) {
        let ended = started(&here, flags).end();
        ended.exits(i32::from(!says.is_empty())).logs(&says);
    }
    // What is no packet of the wire is no client.
    let stranger = started(&here, "--wait-for-client 1");
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = stranger.address.strip_prefix("udp://").unwrap();
    socket.send_to(b"hello, is anybody there?", to).unwrap();
    stranger.end().exits(1);
    // A frame that its client does not grant is given up after 2 s; one that a slow link still carries
    // ends with the time: 5 kB at 1.25 kB/s.
    for (rate, packets, timeout_s, least_s) in [("", 0, 60, 0), ("?rate_mbit=0.01", 1000, 3, 3)] {
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
        assert!((least_s..least_s + 20).contains(&took), "{took} s");
    }
    let served = started(&here, "--wait-for-client 5 --timeout 60 --frames 2");
    let mut client = served.udp_client();
    client.good_frame(1);
    client.good_frame(2);
    served.end().exits(0);
}

#[test]
fn the_ready_file_says_where_links_listen_and_goes_with_the_run() {
    let here = folder();
    // A killed run has left one.
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
