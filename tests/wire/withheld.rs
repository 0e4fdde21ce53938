//! Frames that a client does not get: each is counted under its cause, and none is missing from the sum.

use crate::support::client::{self, Client};
use crate::support::line::{Line, MemoryLine};
use crate::support::{
    EPOCH, Running, attitude, await_that, later, on_serial, on_udp, options, quick, scene,
};
use skyloop::config::{Clock, Config, Trigger};
use skyloop::link::{self, Roles, Wire};
use skyloop_protocols::packet::reseal;
use skyloop_protocols::personality::{NATIVE, Personality};
use skyloop_protocols::{Command, EncodeError, Reply, Withheld};
use std::time::Duration;

/// Ends a run; the frames rendered, delivered and withheld, which add up.
fn balance(emulator: Running) -> (u32, u32, Vec<(&'static str, usize)>) {
    let (stats, counters) = emulator.measured();
    let withheld: Vec<_> = stats.withheld.into_iter().collect();
    let sum: usize = withheld.iter().map(|(_, frames)| frames).sum();
    let (rendered, delivered) = (counters.frames_rendered, counters.frames_delivered);
    assert_eq!(
        rendered,
        delivered + sum as u32,
        "{withheld:?} {counters:?}"
    );
    assert_eq!(counters.frames_abandoned, sum as u32, "{counters:?}");
    (rendered, delivered, withheld)
}

/// A client whose first frame, in step, waits for credit after 3 packets.
fn waiting(line: impl Line) -> Client<impl Line> {
    let mut client = Client::new(line);
    client.window = None;
    client.send(Command::Credit { packets: 3 });
    client.point(attitude(0), EPOCH);
    await_that("the frame waits for credit", || {
        let status = client.status();
        (status.packets_sent, status.counters.frames_rendered) == (3, 1)
    });
    client
}

#[test]
fn frames_rendered_are_those_delivered_and_those_withheld_by_cause() {
    let frames = |name| vec![(name, 1)];
    let stepped = || on_udp(scene(), Clock::Stepped, 60.0);

    let (emulator, line) = stepped();
    let mut client = waiting(line);
    client.done(Command::Reset);
    client.forget();
    client.window = Some(32);
    client.good_frame(1);
    assert_eq!(balance(emulator), (2, 1, frames("client sent Reset")));

    let (emulator, line) = stepped();
    let mut client = waiting(line);
    await_that("the frame is given up", || {
        client.status().counters.frames_abandoned == 1
    });
    assert_eq!(balance(emulator), (1, 0, frames("no credit")));

    // After 1 s of silence another may have its place, before the frame is given up.
    let (emulator, line) = on_udp(scene(), Clock::Stepped, 1.0);
    let mut second = Client::new(line.another());
    drop(waiting(line));
    await_that("the second client is answered", || {
        second.send(Command::Ping);
        second.recv(Duration::from_millis(20)).is_some()
    });
    assert_eq!(balance(emulator), (1, 0, frames("client gone")));

    let (emulator, line) = stepped();
    let _client = waiting(line);
    assert_eq!(balance(emulator), (1, 0, frames("run ended")));

    // Each frame has some 40 kB, of which the pseudo-terminal takes 20 in all; the queue of the link takes the others.
    let (emulator, line) = on_serial(quick(1.0), Clock::Stepped);
    let mut client = Client::new(line);
    client.window = None;
    for sequence in 0..3 {
        client.point(attitude(sequence), later(EPOCH, f64::from(sequence)));
    }
    (0..3).for_each(|_| drop(emulator.shot()));
    assert_eq!(balance(emulator), (3, 0, vec![("client does not read", 3)]));
}

/// A refused packet that asks for no frame withholds none; a damaged attitude does.
#[test]
fn status_tells_of_refused_packets_that_ask_for_frames_alone() {
    for (command, octet, value, cause) in [
        (Command::Ping, 15, 99, Withheld::None),
        (Command::Exposure { seconds: -1.0 }, 15, 1, Withheld::None),
        (Command::Attitude(attitude(5)), 2, 0, Withheld::Refused),
    ] {
        let (_emulator, line) = on_udp(scene(), Clock::Stepped, 60.0);
        let mut client = Client::new(line);
        client.point(attitude(0), EPOCH);
        client.good_frame(0);
        let mut packet = client::packet(&command, 5, EPOCH);
        packet[octet] = value;
        reseal(&mut packet);
        client.line.send(&packet);
        client.nack();
        assert_eq!(client.status().withheld, cause, "{command:?}");
    }
}

/// Its encoder has no room for labels.
static SHORT: Personality = Personality {
    encode_reply: |reply, count, time, buffer| match reply {
        Reply::Labels(_) => Err(EncodeError::TooLong {
            what: "labels",
            found: 2,
            limit: 1,
        }),
        _ => reply.encode(count, time, buffer),
    },
    ..NATIVE
};

/// An emulator whose client tells of the vehicle over one link, `frames` brings the frames.
fn beside(
    config: Config,
    clock: Clock,
    frames: Wire,
    personality: &'static Personality,
) -> (Running, Client<MemoryLine>) {
    let (truth, port) = link::loopback("memory", &options(5.0)).unwrap();
    let roles = |text| Roles::parse(text).unwrap();
    let links = vec![(truth, roles("truth")), (frames, roles("pixels+labels"))];
    let emulator = Running::speaking(personality, config, clock, links, |_| {});
    (emulator, Client::new(MemoryLine(port)))
}

/// The causes that no client brings about on a link that also answers it: they are told over the link of the truth.
#[test]
fn status_tells_of_links_that_have_no_client_are_slow_or_cannot_encode() {
    for (link, speaks, personality, clock, cause, name) in [
        (
            "memory",
            false,
            &NATIVE,
            Clock::Stepped,
            Withheld::NoClient,
            "no client",
        ),
        (
            "memory",
            true,
            &SHORT,
            Clock::Stepped,
            Withheld::TooLong,
            "cannot be encoded",
        ),
        // 10 bits a byte: 1,400 bytes take 1.5 s, and frames come 10 times a second.
        (
            "pty?baud=9600",
            true,
            &NATIVE,
            Clock::Wall,
            Withheld::SlowLink,
            "link too slow",
        ),
    ] {
        let (frames, port) = link::loopback(link, &options(5.0)).unwrap();
        let (emulator, mut client) = beside(quick(10.0), clock, frames, personality);
        let mut other = Client::new(MemoryLine(port));
        if speaks {
            other.send(Command::Credit { packets: 1 << 30 });
        }
        await_that("the other client is heard", || {
            client.status().counters.commands > u32::from(speaks)
        });
        client.point(attitude(1), EPOCH);
        await_that(&format!("Status tells {cause:?}"), || {
            client.status().withheld == cause
        });
        await_that(&format!("a frame is counted under {name}"), || {
            let counters = client.status().counters;
            counters.frames_abandoned + counters.frames_dropped > 0
        });
        let (stats, _) = emulator.measured();
        assert!(stats.withheld.contains_key(name), "{:?}", stats.withheld);
    }
}

#[test]
fn status_says_that_attitudes_come_and_no_trigger() {
    for (trigger, is_reported) in [(Trigger::Packet, true), (Trigger::Own, false)] {
        let mut config = scene();
        config.run.trigger = trigger;
        let (_emulator, line) = on_udp(config, Clock::Stepped, 60.0);
        let mut client = Client::new(line);
        client.point(attitude(0), EPOCH);
        std::thread::sleep(Duration::from_secs(3));
        let says = client.status().withheld == Withheld::NoTrigger;
        assert_eq!(says, is_reported, "{trigger:?}");
    }
}
