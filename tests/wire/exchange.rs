//! Whom the emulator answers, and how an exchange changes hands.

use crate::support::client::Client;
use crate::support::line::Line;
use crate::support::{EPOCH, PATIENCE, attitude, await_that, later, on_udp, scene};
use skyloop::config::Clock;
use skyloop_protocols::{Command, Reply, apid};
use std::time::Duration;

#[test]
fn reset_lets_time_start_anew() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 5.0);
    let mut client = Client::new(line);
    client.good_frame(1);
    client.done(Command::Reset);
    client.point(attitude(2), later(EPOCH, -100.0));
    assert_eq!(client.frame().time, later(EPOCH, -100.0));
    assert_eq!(
        client.status().packets_sent,
        client.taken,
        "counted from the Reset"
    );
}

#[test]
fn a_second_client_is_ignored_until_the_first_falls_silent() {
    const IDLE_S: f64 = 2.0;
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, IDLE_S);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    // The first answer waits for the emulator to start; after the second one the client has just been heard.
    first.status();
    let before = first.status().counters;
    second.send(Command::Ping);
    second.point(attitude(5), EPOCH);
    // A Ping, and an Attitude with the Credit that goes before it.
    await_that("foreign packets are counted", || {
        first.status().counters.foreign_packets == before.foreign_packets + 3
    });
    let after = first.status().counters;
    assert_eq!(after.attitudes, before.attitudes, "nothing of it was taken");
    first.good_frame(1);
    assert!(second.has_nothing_left(), "it got no answer");
    // The first falls silent; in the end the second has the emulator, and a new exchange.
    await_that("the second client takes over", || {
        second.send(Command::Ping);
        second.recv(Duration::from_millis(20)).is_some()
    });
    second.start_anew();
    second.point(attitude(6), later(EPOCH, -1000.0));
    assert_eq!(
        second.frame().header.attitude_sequence,
        6,
        "its time starts anew"
    );
    let before = second.status().counters;
    first.send(Command::Ping);
    await_that("the first is the stranger now", || {
        second.status().counters.foreign_packets == before.foreign_packets + 1
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
    await_that("the second client takes over", || {
        second.send(Command::Ping);
        second.recv(Duration::from_millis(20)).is_some()
    });
    second.start_anew();
    let status = second.status();
    assert_eq!(
        (status.gain_e_per_dn, status.packets_sent),
        (12.0, 0),
        "as configured"
    );
    second.good_frame(1);
    assert!(first.has_nothing_left());
}

#[test]
fn where_nobody_is_the_client_bad_packets_are_answered() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 3600.0);
    let mut second = line.another();
    let mut first = Client::new(line);
    second.send(b"hello, are you an emulator?");
    let answer = second.recv(PATIENCE).expect("he is told what is wrong");
    let (header, _) = Reply::decode(&answer).unwrap();
    assert_eq!(header.apid, apid::NACK);
    // An hour of silence is not needed: the exchange is free, and so it is after a Reset.
    first.good_frame(1);
    first.done(Command::Reset);
    await_that("the exchange is free", || {
        second.send(b"hello?");
        second.recv(Duration::from_millis(50)).is_some()
    });
    first.start_anew();
    first.good_frame(2);
    let foreign = first.status().counters.foreign_packets;
    let bad = first.status().counters.bad_length;
    second.send(b"hello?");
    await_that("the stranger is one", || {
        first.status().counters.foreign_packets == foreign + 1
    });
    assert!(second.recv(Duration::from_millis(5)).is_none());
    assert_eq!(first.status().counters.bad_length, bad);
}
