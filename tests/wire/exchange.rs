//! Clients of the emulator, and the handover of an exchange.

use crate::support::client::Client;
use crate::support::line::{Line, MemoryLine, UdpLine};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, later, on_udp, options, scene, udp_client,
};
use skyloop::config::Clock;
use skyloop::engine::Emulator;
use skyloop::frame::Frame;
use skyloop::link::fault::{FaultLog, Plan, wrap};
use skyloop::link::{self, Roles};
use skyloop::serve::{Ended, Server};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Output, Reply, apid};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn a_reset_restarts_time() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    client.good_frame(1);
    client.done(Command::Reset);
    client.point(attitude(2), later(EPOCH, -100.0));
    assert_eq!(client.frame().time, later(EPOCH, -100.0));
    let sent = client.status().packets_sent;
    assert_eq!(sent, client.taken, "counted from the Reset");
}

#[test]
fn second_clients_are_ignored_until_the_first_is_silent() {
    const IDLE_S: f64 = 2.0;
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, IDLE_S);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    // The first reply waits for the start of the emulator; after it the idle time begins.
    first.status();
    let before = first.counters();
    second.send(Command::Ping);
    second.point(attitude(5), EPOCH);
    // A Ping, and an Attitude with its Credit.
    await_that("foreign packets are counted", || {
        first.counters().foreign_packets == before.foreign_packets + 3
    });
    let after = first.counters();
    assert_eq!(after.attitudes, before.attitudes, "nothing was accepted");
    first.good_frame(1);
    assert!(second.has_nothing_left(), "no reply to the second");
    // When the first is silent, the second gets the emulator and a new exchange.
    second.await_answer();
    second.start_anew();
    second.point(attitude(6), later(EPOCH, -1000.0));
    let frame = second.frame();
    assert_eq!(frame.header.attitude_sequence, 6, "its time restarts");
    let before = second.counters();
    first.send(Command::Ping);
    await_that("the first client is the foreign one now", || {
        second.counters().foreign_packets == before.foreign_packets + 1
    });
    assert!(first.has_nothing_left());
}

#[test]
fn a_reset_hands_the_exchange_over_at_once() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 3600.0);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    first.done(Command::Gain { e_per_dn: 3.0 });
    first.good_frame(1);
    first.done(Command::Reset);
    second.await_answer();
    second.start_anew();
    let status = second.status();
    assert_eq!(status.gain_e_per_dn, 12.0, "as configured");
    assert_eq!(status.packets_sent, 0);
    second.good_frame(1);
    assert!(first.has_nothing_left());
}

#[test]
fn bad_packets_are_answered_without_a_client() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 3600.0);
    let mut second = line.another();
    let mut first = Client::new(line);
    second.send(b"hello, are you an emulator?");
    let answer = second.recv(TIMEOUT).expect("a Nack states the error");
    let (header, _) = Reply::decode(&answer).unwrap();
    assert_eq!(header.apid, apid::NACK);
    // The exchange is free, without an hour of silence.
    first.good_frame(1);
    let bad = first.counters().bad_length;
    // Invalid packets never start an exchange, not even after a Reset.
    for is_released in [false, true] {
        if is_released {
            first.done(Command::Reset);
            std::thread::sleep(Duration::from_millis(200));
        }
        second.send(b"hello?");
        assert!(second.recv(Duration::from_millis(200)).is_none());
        first.good_frame(2);
        assert_eq!(first.counters().bad_length, bad);
    }
    assert_eq!(first.counters().foreign_packets, 2);
}

#[test]
fn late_packets_of_an_earlier_client_are_ignored() {
    // Packets of the first second are delayed by up to 9 s, by 7.8 s with this seed.
    let plan = "[[faults]]\ndirection = \"in\"\nkind = \"jitter\"\nvalue = 9.0\nfor_s = 1.0\n";
    let plan = Plan::parse("faults.toml", plan, false).unwrap();
    let book = Arc::new(Mutex::new(FaultLog::default()));
    let wire = link::open("udp://127.0.0.1:0", &options(0.15)).unwrap();
    let wire = wrap(wire, &plan, &NATIVE, &book).unwrap();
    let line = UdpLine::to(&wire.address);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    let _emulator = Running::start(scene(), Clock::Stepped, wire);
    first.send(Command::Output(Output::preset("windows").unwrap()));
    std::thread::sleep(Duration::from_millis(1500));
    let labels = Output::preset("labels").unwrap();
    second.done(Command::Output(labels));
    await_that("the late packet has come", || {
        std::thread::sleep(Duration::from_millis(50));
        second.counters().foreign_packets == 1
    });
    assert_eq!(second.status().output, labels);
}

#[test]
fn frame_memory_is_reused() {
    // More than a frame needs; a new buffer would be smaller.
    const CAPACITY: usize = 1 << 20;
    let mut config = scene();
    let mut emulator = Emulator::new(&mut config);
    emulator.recycle(Frame {
        dn: Vec::with_capacity(CAPACITY),
        ..Frame::default()
    });
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let links = [(wire, Roles::ALL)];
    let output = config.run.output;
    let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
    let (stop, mut capacities) = (AtomicBool::new(false), Vec::new());
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| {
            server.run(&stop, Some(3), |exposed| {
                capacities.push(exposed.frame.dn.capacity())
            })
        });
        let mut client = Client::new(MemoryLine(port));
        (1..=3).for_each(|sequence| drop(client.good_frame(sequence)));
        assert_eq!(serving.join().unwrap(), Ended::AsRequested);
    });
    assert!(
        capacities.iter().all(|capacity| *capacity >= CAPACITY),
        "{capacities:?}"
    );
    assert_eq!(capacities.len(), 3);
}
