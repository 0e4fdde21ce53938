//! Interfaces that are missing, wrong, down, recreated or full; controllers that report errors.

use crate::support::client::moved;
use crate::support::line::Line;
use crate::support::{await_that, options};
use crate::tools::{cansend, run};
use crate::{CLASSIC, FD, VCAN0, VCAN1, client, emulator};
use skyloop::link;
use skyloop_protocols::Command;
use std::time::Duration;

fn refused(url: &str) -> String {
    let error = link::open(url, &options(5.0)).err().unwrap().to_string();
    println!("{error}");
    assert!(error.contains(url) && !error.contains('\n'), "{error}");
    error
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn open_errors_state_the_command_to_run() {
    let error = refused("can://nosuchcan0");
    assert!(error.contains("there is no CAN interface \"nosuchcan0\""));
    assert!(error.contains("ip link add dev nosuchcan0 type vcan"));
    assert!(refused("can://vcan1?fd=8000000").contains("ip link set vcan1 mtu 72"));
    assert!(refused("can://lo").contains("lo is no CAN interface"));
    run("ip link set vcan1 down");
    let error = refused("can://vcan1");
    run("ip link set vcan1 up");
    assert!(error.contains("Network is down") && error.contains("run `ip link set vcan1 up`"));
}

/// Waits until the emulator answers a Ping again.
fn answers(client: &mut crate::Client<crate::MemoryLine>) {
    await_that("the emulator answers again", || {
        client.send(Command::Ping);
        client.line.recv(Duration::from_millis(500)).is_some()
    });
    while client.line.recv(Duration::from_millis(500)).is_some() {}
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn interfaces_are_reused_after_down_and_up() {
    let emulator = emulator(VCAN0, FD);
    let mut client = client(VCAN0, FD);
    assert_eq!(client.counters().reconnects, 0);
    for _ in 0..2 {
        run("ip link set vcan0 down");
        std::thread::sleep(Duration::from_millis(700));
        run("ip link set vcan0 up");
        answers(&mut client);
    }
    assert_eq!(emulator.end().reconnects, 2);
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn recreated_interfaces_are_reused() {
    let make = || {
        run("ip link add dev vcan2 type vcan");
        run("ip link set vcan2 up");
    };
    make();
    let emulator = emulator("vcan2", CLASSIC);
    let mut client = client("vcan2", CLASSIC);
    client.done(Command::Reset);
    run("ip link del vcan2");
    std::thread::sleep(Duration::from_millis(700));
    make();
    answers(&mut client);
    assert_eq!(emulator.end().reconnects, 1);
    run("ip link del vcan2");
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn error_frames_are_counted() {
    let emulator = emulator(VCAN0, FD);
    let mut client = client(VCAN0, FD);
    client.done(Command::Reset);
    // X-Val: linux/can/error.h: CAN_ERR_FLAG 0x20000000 with CAN_ERR_BUSERROR, CAN_ERR_BUSOFF,
    // CAN_ERR_RESTARTED.
    for class in ["20000080", "20000040", "20000100"] {
        cansend(VCAN0, &format!("{class}#0000000000000000"));
    }
    await_that("the errors are counted", || {
        let counters = client.status().counters;
        (counters.bus_errors, counters.bus_off) == (2, 1)
    });
    drop(client);
    assert_eq!(emulator.end().bus_off, 1);
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn only_wrong_frames_on_our_identifiers_are_counted() {
    let emulator = emulator(VCAN1, CLASSIC);
    let mut client = client(VCAN1, CLASSIC);
    let before = client.status().counters;
    // Other identifiers, and ours with 29 bits.
    for frame in ["0FF#00", "111#00000000000000", "7FF#R", "00000110#00"] {
        cansend(VCAN1, frame);
    }
    assert_eq!(moved(&before, &client.status().counters), []);
    // A truncated short command and attitude frame, single frames without data, remote frames.
    for frame in [
        "110#0600", "100#00", "120#", "120#0000", "100#R", "110#R7", "120#R",
    ] {
        let before = client.status().counters;
        cansend(VCAN1, frame);
        let mut found = Vec::new();
        await_that("it is counted", || {
            found = moved(&before, &client.status().counters);
            !found.is_empty()
        });
        assert_eq!(found, [("bad_framing", 1)], "{frame}");
    }
    drop(client);
    emulator.end();
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn full_transmit_queues_are_retried() {
    // A queue of 10 frames (16 bytes each in the kernel) that drains at 780 frames a second; 7,400
    // are sent.
    run("tc qdisc add dev vcan1 root tbf rate 100kbit burst 160 limit 160");
    let emulator = emulator(VCAN1, CLASSIC);
    let mut client = client(VCAN1, CLASSIC);
    for _ in 0..20 {
        let none = ["incomplete", "lost_outbound", "sequence_gaps"];
        client.has_counted(&none.map(|name| (name, 0)));
    }
    let statistics = run("tc -s qdisc show dev vcan1");
    run("tc qdisc del dev vcan1 root");
    println!("{statistics}");
    let dropped = statistics.split("dropped ").nth(1).unwrap();
    let dropped: u32 = dropped.split(',').next().unwrap().parse().unwrap();
    assert!(dropped > 0, "the queue has been full");
    assert_eq!(emulator.end().reconnects, 0);
}
