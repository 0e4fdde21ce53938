//! Causes of withheld frames in Status.

use crate::support::client::{self, Client};
use crate::support::line::{Line, MemoryLine};
use crate::support::{
    EPOCH, attitude, await_that, bad_attitude, later, options, quick, scene, udp_client,
};
use crate::withheld::{SHORT, with_frame_link};
use skyloop::config::{Clock, Trigger};
use skyloop::link;
use skyloop_protocols::packet::reseal;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Withheld};
use std::time::Duration;

/// A refused packet that requests no frame withholds none; a damaged attitude does.
#[test]
fn status_reports_only_refused_packets_that_request_frames() {
    for (command, byte, value, cause) in [
        (Command::Ping, 15, 99, Withheld::None),
        (Command::Exposure { seconds: -1.0 }, 15, 1, Withheld::None),
        // An unknown APID may be an attitude, but there is a valid one.
        (Command::Ping, 1, 0x66, Withheld::None),
        (Command::Attitude(attitude(5)), 2, 0, Withheld::Refused),
    ] {
        let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 60.0);
        client.point(attitude(0), EPOCH);
        client.good_frame(0);
        let mut packet = client::packet(&command, 5, EPOCH);
        packet[byte] = value;
        reseal(&mut packet);
        client.line.send(&packet);
        client.nack();
        assert_eq!(client.status().withheld, cause, "{command:?}");
    }
}

/// Causes on a link without replies of its own: Status reports them on the truth link.
#[test]
fn status_reports_links_without_client_too_slow_or_unable_to_encode() {
    // 10 bits a byte: on the slow line 1,400 bytes take 1.5 s, at 10 frames a second.
    const SLOW: &str = "pty?baud=9600";
    const MEMORY: &str = "memory";
    for (link, sends, personality, cause, name) in [
        (MEMORY, false, &NATIVE, Withheld::NoClient, "no client"),
        (MEMORY, true, &SHORT, Withheld::TooLong, "cannot be encoded"),
        (SLOW, true, &NATIVE, Withheld::SlowLink, "link too slow"),
    ] {
        let is_slow = link == SLOW;
        let clock = if is_slow { Clock::Wall } else { Clock::Stepped };
        let (frames, port) = link::loopback(link, &options(5.0)).unwrap();
        let (emulator, mut client) = with_frame_link(quick(10.0), clock, frames, personality);
        let mut other = Client::new(MemoryLine(port));
        if sends {
            other.send(Command::Credit { packets: 1 << 30 });
        }
        let mut known = u32::from(sends);
        await_that("the other client is known", || {
            // This client's Pings count, too.
            known += 1;
            client.counters().commands == known
        });
        client.point(attitude(1), EPOCH);
        await_that(&format!("Status reports {cause:?}"), || {
            client.status().withheld == cause
        });
        await_that(&format!("a frame is counted under {name}"), || {
            let counters = client.counters();
            counters.frames_abandoned + counters.frames_dropped > 0
        });
        let (stats, _) = emulator.measured();
        let frame_counters = &stats.frame_counters[0].1;
        assert!(
            frame_counters.withheld.contains_key(name),
            "{frame_counters:?}"
        );
    }
}

/// Status holds a refusal until it has been sent. A refused Trigger counts as received.
#[test]
fn refusals_precede_missing_triggers_in_status() {
    let bad = bad_attitude(1);
    let start = later(EPOCH, f64::from(1u32 << 30));
    let cases = [
        (Command::Attitude(bad), "before", 3),
        (Command::Trigger { number: 1, start }, "after", 0),
        (Command::Trigger { number: 1, start }, "after", 1),
    ];
    // Each mostly waits.
    std::thread::scope(|scope| {
        for (refused, when, after_s) in cases {
            scope.spawn(move || refusal_precedes(&refused, when, after_s));
        }
    });
}

/// A command refused "before" or "after" the first attitude, and Status `after_s` later.
fn refusal_precedes(refused: &Command, when: &str, after_s: u64) {
    let mut config = scene();
    config.run.trigger = Trigger::Packet;
    let (_emulator, mut client) = udp_client(config, Clock::External, 60.0);
    if when == "after" {
        client.point(attitude(0), EPOCH);
        std::thread::sleep(Duration::from_secs(3));
    }
    // The client's time continues.
    let time = later(EPOCH, if when == "after" { 3.0 } else { 0.0 });
    client.send_alone(refused, time);
    client.nack();
    if when == "before" {
        client.point(attitude(0), EPOCH);
    }
    std::thread::sleep(Duration::from_secs(after_s));
    let case = format!("{refused:?} {when}");
    assert_eq!(client.status().withheld, Withheld::Refused, "{case}");
    await_that(&case, || client.status().withheld == Withheld::NoTrigger);
}

#[test]
fn status_reports_attitudes_without_triggers() {
    for (trigger, is_reported) in [(Trigger::Packet, true), (Trigger::Own, false)] {
        let mut config = scene();
        config.run.trigger = trigger;
        let (_emulator, mut client) = udp_client(config, Clock::Stepped, 60.0);
        client.point(attitude(0), EPOCH);
        let mut is_reported_now = || client.status().withheld == Withheld::NoTrigger;
        if is_reported {
            await_that("it is reported", is_reported_now);
        } else {
            assert!(!is_reported_now());
            std::thread::sleep(Duration::from_secs(3));
            assert!(!is_reported_now(), "{trigger:?}");
        }
    }
}
