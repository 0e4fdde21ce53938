//! Clients that do not read, grant or prove their address are reported, and delay no other link.

use crate::proof::Silent;
use crate::support::client::Client;
use crate::support::line::{Line, MemoryLine, PtyLine, UdpLine};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, later, on_pty, options, quick, udp_client,
};
use crate::withheld::{balance, with_frame_link};
use skyloop::config::Clock;
use skyloop::link::{self, Roles};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Withheld};
use std::time::{Duration, Instant};

/// A frame is abandoned after 2 s (ICD, section 5.3), whatever its client sends. The next frames do
/// not wait.
#[test]
fn blocked_clients_delay_the_other_link_once() {
    let udp = || {
        let wire = link::open("udp://127.0.0.1:0", &options(3600.0)).unwrap();
        let line: Box<dyn Line> = Box::new(Silent(UdpLine::to(&wire.address)));
        (wire, line)
    };
    // Labels of some 30 kB: pseudo-terminal and queue take three.
    let (wire, _folder, name) = on_pty(&options(3600.0), 3_000_000);
    let pty: (_, Box<dyn Line>) = (wire, Box::new(PtyLine::at(&name)));
    for ((wire, line), command, cause) in [
        (udp(), None, "address not proved"),
        (udp(), Some(Command::Ping), "address not proved"),
        (pty, None, "client does not read"),
    ] {
        let (truth, port) = link::loopback("memory", &options(5.0)).unwrap();
        let links = [(truth, "truth+pixels"), (wire, "labels")];
        let links = links.map(|(wire, roles)| (wire, Roles::parse(roles).unwrap()));
        let emulator = Running::at(quick(1.0), Clock::Stepped, links.into());
        let mut client = Client::new(MemoryLine(port)).unpaced();
        let mut other = Client::new(line).unpaced();
        other.send(Command::Ping);
        await_that("the other client is known", || {
            client.counters().commands >= 2
        });
        let (begun, mut requested, mut packets) = (Instant::now(), 0, 1 << 20);
        // The queue takes three of twelve frames. 2 s for each of the others would be 18 s.
        await_that("all frames have ended", || {
            let counters = client.counters();
            let ended = counters.frames_delivered + counters.frames_abandoned;
            if ended == requested && requested < 12 {
                client.point(attitude(requested), later(EPOCH, f64::from(requested)));
                requested += 1;
            }
            packets += 10;
            other.send(command.unwrap_or(Command::Credit { packets }));
            std::thread::sleep(Duration::from_millis(100));
            ended == 12
        });
        let took = begun.elapsed();
        assert!(
            took < Duration::from_secs(8),
            "{cause} {command:?}: {took:?}"
        );
        let frame_counters = &emulator.measured().0.frame_counters[1].1;
        assert!(
            frame_counters.withheld[cause] >= 5,
            "{command:?}: {frame_counters:?}"
        );
    }
}

/// Frames entirely in the queue of a link that is not read.
#[test]
fn unread_queues_are_reported() {
    let (wire, _folder, name) = on_pty(&options(3600.0), 3_000_000);
    let (emulator, mut client) = with_frame_link(quick(1.0), Clock::Stepped, wire, &NATIVE);
    let mut other = Client::new(PtyLine::at(&name)).unpaced();
    other.status();
    client.point(attitude(0), EPOCH);
    await_that("Status reports it", || {
        client.status().withheld == Withheld::NotRead
    });
    assert_eq!(client.counters().frames_abandoned, 0);
    // A client that reads later gets the whole frame.
    other.parcel();
    await_that("Status is clear", || {
        client.status().withheld == Withheld::None
    });
    balance("read late", emulator, 1, &[(1, &[])]);
}

/// Wall clock: frames are dropped because the client does not read; the link is not reported as
/// slow.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_unread_fast_links_are_not_reported_as_slow() {
    // The pseudo-terminal takes 20 kB in 0.07 s. Two of the large frames fill the queue: the fourth
    // is dropped within 0.1 s of the last byte.
    for (side, rate_hz) in [(64, 5.0), (256, 20.0)] {
        let (wire, _folder, name) = on_pty(&options(3600.0), 3_000_000);
        let mut config = quick(rate_hz);
        (config.camera.detector.width, config.camera.detector.height) = (side, side);
        let emulator = Running::start(config, Clock::Wall, wire);
        let mut client = Client::new(PtyLine::at(&name)).unpaced();
        client.point(attitude(0), EPOCH);
        std::thread::sleep(Duration::from_secs(4));
        let (stats, _) = emulator.measured();
        let frame_counters = &stats.frame_counters[0].1;
        assert!(
            frame_counters.withheld["client does not read"] > 5,
            "{frame_counters:?}"
        );
        assert!(
            !frame_counters.withheld.contains_key("link too slow"),
            "{frame_counters:?}"
        );
    }
}

/// A slow link does not carry the frame before the end, with credit from the start or later.
#[test]
fn frames_on_a_slow_link_end_with_the_run() {
    for waits_for_credit in [false, true] {
        let wire = link::open("udp://127.0.0.1:0?rate_mbit=0.1", &options(3600.0)).unwrap();
        let mut client = Client::new(UdpLine::to(&wire.address));
        let emulator = Running::start(quick(1.0), Clock::Stepped, wire);
        client.window = None;
        client.status();
        if waits_for_credit {
            client.send(Command::Credit { packets: 2 });
        }
        client.point(attitude(0), EPOCH);
        if waits_for_credit {
            await_that("no credit is reported", || {
                client.status().withheld == Withheld::NoCredit
            });
            // No Status here: its reply may follow the whole frame.
            client.forget();
            client.send(Command::Credit { packets: 1 << 20 });
        }
        client.next(true);
        let name = format!("{waits_for_credit}");
        balance(&name, emulator, 1, &[(0, &[("run ended", 1)])]);
    }
}

/// A refused attitude withholds no frame if frames follow from an earlier one.
#[test]
fn late_attitudes_withhold_no_wall_clock_frame() {
    let (_emulator, mut client) = udp_client(quick(20.0), Clock::Wall, 3600.0);
    client.send(Command::Credit { packets: 1 << 30 });
    client.point(attitude(0), later(EPOCH, 10.0));
    await_that("frames arrive", || client.counters().frames_delivered > 0);
    client.point(attitude(1), later(EPOCH, 9.9));
    client.nack();
    let begun = Instant::now();
    let before = client.counters().frames_delivered;
    assert_eq!(client.status().withheld, Withheld::None);
    await_that("frames continue", || {
        assert!(begun.elapsed() < TIMEOUT);
        client.counters().frames_delivered > before
    });
}
