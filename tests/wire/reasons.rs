//! What Status gives as the reason for frames that do not come.

use crate::support::client::{self, Client};
use crate::support::line::{Line, MemoryLine};
use crate::support::{
    EPOCH, attitude, await_that, bad_attitude, later, options, quick, scene, udp_client,
};
use crate::withheld::{SHORT, beside};
use skyloop::config::{Clock, Trigger};
use skyloop::link;
use skyloop_protocols::packet::reseal;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Withheld};
use std::time::Duration;

/// A refused packet that asks for no frame withholds none; a damaged attitude does.
#[test]
fn status_tells_of_refused_packets_that_ask_for_frames_alone() {
    for (command, byte, value, cause) in [
        (Command::Ping, 15, 99, Withheld::None),
        (Command::Exposure { seconds: -1.0 }, 15, 1, Withheld::None),
        // An unknown APID: it may have been an attitude, and there is one.
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

/// Causes on a link that has no answers of its own: Status gives them over the link of the truth.
#[test]
fn status_tells_of_links_that_have_no_client_are_slow_or_cannot_encode() {
    // 10 bits a byte: on the slow line 1,400 bytes take 1.5 s, and frames come 10 times a second.
    const SLOW: &str = "pty?baud=9600";
    const MEMORY: &str = "memory";
    for (link, speaks, personality, cause, name) in [
        (MEMORY, false, &NATIVE, Withheld::NoClient, "no client"),
        (MEMORY, true, &SHORT, Withheld::TooLong, "cannot be encoded"),
        (SLOW, true, &NATIVE, Withheld::SlowLink, "link too slow"),
    ] {
        let is_slow = link == SLOW;
        let clock = if is_slow { Clock::Wall } else { Clock::Stepped };
        let (frames, port) = link::loopback(link, &options(5.0)).unwrap();
        let (emulator, mut client) = beside(quick(10.0), clock, frames, personality);
        let mut other = Client::new(MemoryLine(port));
        if speaks {
            other.send(Command::Credit { packets: 1 << 30 });
        }
        await_that("the other client is heard", || {
            client.counters().commands > u32::from(speaks)
        });
        client.point(attitude(1), EPOCH);
        await_that(&format!("Status tells {cause:?}"), || {
            client.status().withheld == cause
        });
        await_that(&format!("a frame is counted under {name}"), || {
            let counters = client.counters();
            counters.frames_abandoned + counters.frames_dropped > 0
        });
        let (stats, _) = emulator.measured();
        let account = &stats.accounts[0].1;
        assert!(account.withheld.contains_key(name), "{account:?}");
    }
}

/// Status keeps a refusal until it has been sent. A refused Trigger counts as one that came.
#[test]
fn a_refusal_is_in_status_once_before_it_says_that_no_trigger_comes() {
    let bad = bad_attitude(1);
    let start = later(EPOCH, f64::from(1u32 << 30));
    for (refused, when, after_s) in [
        (Command::Attitude(bad), "before", 3),
        (Command::Trigger { number: 1, start }, "after", 0),
        (Command::Trigger { number: 1, start }, "after", 1),
    ] {
        let mut config = scene();
        config.run.trigger = Trigger::Packet;
        let (_emulator, mut client) = udp_client(config, Clock::External, 60.0);
        if when == "after" {
            client.point(attitude(0), EPOCH);
            std::thread::sleep(Duration::from_secs(3));
        }
        // The client's time goes on.
        let time = later(EPOCH, if when == "after" { 3.0 } else { 0.0 });
        client.send_alone(&refused, time);
        client.nack();
        if when == "before" {
            client.point(attitude(0), EPOCH);
        }
        std::thread::sleep(Duration::from_secs(after_s));
        let case = format!("{refused:?} {when}");
        assert_eq!(client.status().withheld, Withheld::Refused, "{case}");
        await_that(&case, || client.status().withheld == Withheld::NoTrigger);
    }
}

#[test]
fn status_says_that_attitudes_come_and_no_trigger() {
    for (trigger, is_reported) in [(Trigger::Packet, true), (Trigger::Own, false)] {
        let mut config = scene();
        config.run.trigger = trigger;
        let (_emulator, mut client) = udp_client(config, Clock::Stepped, 60.0);
        client.point(attitude(0), EPOCH);
        let mut says = || client.status().withheld == Withheld::NoTrigger;
        if is_reported {
            await_that("it is reported", says);
        } else {
            assert!(!says());
            std::thread::sleep(Duration::from_secs(3));
            assert!(!says(), "{trigger:?}");
        }
    }
}
