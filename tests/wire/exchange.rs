//! Whom the emulator answers, and how an exchange changes hands.

use crate::support::client::Client;
use crate::support::line::{Line, MemoryLine, UdpLine};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, later, on_udp, options, scene, udp_client,
};
use skyloop::config::Clock;
use skyloop::engine::Emulator;
use skyloop::frame::Frame;
use skyloop::link::fault::{Book, Plan, wrap};
use skyloop::link::{self, Roles};
use skyloop::serve::{Ended, Server};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Output, Reply, apid};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn reset_lets_time_start_anew() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    client.good_frame(1);
    client.done(Command::Reset);
    client.point(attitude(2), later(EPOCH, -100.0));
    assert_eq!(client.frame().time, later(EPOCH, -100.0));
    let sent = client.status().packets_sent;
    assert_eq!(sent, client.taken, "counted from the Reset");
}

#[test]
fn a_second_client_is_ignored_until_the_first_falls_silent() {
    const IDLE_S: f64 = 2.0;
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, IDLE_S);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    // The first answer waits for the emulator to start; then the client has just been heard.
    first.status();
    let before = first.counters();
    second.send(Command::Ping);
    second.point(attitude(5), EPOCH);
    // A Ping, and an Attitude with the Credit that goes before it.
    await_that("foreign packets are counted", || {
        first.counters().foreign_packets == before.foreign_packets + 3
    });
    let after = first.counters();
    assert_eq!(after.attitudes, before.attitudes, "nothing of it was taken");
    first.good_frame(1);
    assert!(second.has_nothing_left(), "it got no answer");
    // The first falls silent; in the end the second has the emulator, and a new exchange.
    second.await_answer();
    second.start_anew();
    second.point(attitude(6), later(EPOCH, -1000.0));
    let frame = second.frame();
    assert_eq!(frame.header.attitude_sequence, 6, "its time starts anew");
    let before = second.counters();
    first.send(Command::Ping);
    await_that("the first is the stranger now", || {
        second.counters().foreign_packets == before.foreign_packets + 1
    });
    assert!(first.has_nothing_left());
}

#[test]
fn reset_hands_the_exchange_over_at_once() {
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
fn where_nobody_is_the_client_bad_packets_are_answered() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 3600.0);
    let mut second = line.another();
    let mut first = Client::new(line);
    second.send(b"hello, are you an emulator?");
    let answer = second.recv(TIMEOUT).expect("he is told what is wrong");
    let (header, _) = Reply::decode(&answer).unwrap();
    assert_eq!(header.apid, apid::NACK);
    // An hour of silence is not needed: the exchange is free.
    first.good_frame(1);
    let bad = first.counters().bad_length;
    // Junk takes the place of no client, after its Reset neither.
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
fn what_comes_late_from_the_last_client_is_ignored() {
    // Packets of the first second are late by up to 9 s, with this seed by 7.8 s.
    let plan = "[[faults]]\ndirection = \"in\"\nkind = \"jitter\"\nvalue = 9.0\nfor_s = 1.0\n";
    let plan = Plan::parse("faults.toml", plan, false).unwrap();
    let book = Arc::new(Mutex::new(Book::default()));
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
fn frames_are_made_in_the_memory_of_those_before() {
    // More than a frame takes: a new one would have no more than it needs.
    const ROOM: usize = 1 << 20;
    let mut config = scene();
    let mut emulator = Emulator::new(&mut config);
    emulator.recycle(Frame {
        dn: Vec::with_capacity(ROOM),
        ..Frame::default()
    });
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let links = [(wire, Roles::ALL)];
    let output = config.run.output;
    let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
    let (stop, mut rooms) = (AtomicBool::new(false), Vec::new());
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| {
            server.run(&stop, Some(3), |exposed| {
                rooms.push(exposed.frame.dn.capacity())
            })
        });
        let mut client = Client::new(MemoryLine(port));
        (1..=3).for_each(|sequence| drop(client.good_frame(sequence)));
        assert_eq!(serving.join().unwrap(), Ended::AsRequested);
    });
    assert!(rooms.iter().all(|room| *room >= ROOM), "{rooms:?}");
    assert_eq!(rooms.len(), 3);
}
