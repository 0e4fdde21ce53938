//! Clients that do not read, grant or prove their address are reported, and delay no other link.

use crate::proof::Silent;
use crate::support::client::Client;
use crate::support::line::{Line, MemoryLine, PtyLine, UdpLine};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, later, on_pty, options, quick, udp_client,
};
use crate::withheld::{balance, beside};
use skyloop::config::Clock;
use skyloop::link::{self, Roles};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Withheld};
use std::time::{Duration, Instant};

/// A frame is given up after 2 s (ICD, section 5.3), whatever its client sends meanwhile. The next
/// frames do not wait.
#[test]
fn a_client_that_goes_on_sending_holds_up_the_other_link_once() {
    let udp = || {
        let wire = link::open("udp://127.0.0.1:0", &options(3600.0)).unwrap();
        let line: Box<dyn Line> = Box::new(Silent(UdpLine::to(&wire.address)));
        (wire, line)
    };
    // Labels of some 30 kB: the pseudo-terminal and the queue of the link take three.
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
        await_that("it is heard", || client.counters().commands >= 2);
        let (begun, mut requested, mut packets) = (Instant::now(), 0, 1 << 20);
        // The queue of the link takes three of twelve frames. 2 s for each of the others are 18 s.
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
        let account = &emulator.measured().0.accounts[1].1;
        assert!(account.withheld[cause] >= 5, "{command:?}: {account:?}");
    }
}

/// Frames whose packets are all in the queue of a link that is not read.
#[test]
fn a_client_that_does_not_read_what_is_queued_is_reported() {
    let (wire, _folder, name) = on_pty(&options(3600.0), 3_000_000);
    let (emulator, mut client) = beside(quick(1.0), Clock::Stepped, wire, &NATIVE);
    let mut other = Client::new(PtyLine::at(&name)).unpaced();
    other.status();
    client.point(attitude(0), EPOCH);
    await_that("it is reported", || {
        client.status().withheld == Withheld::NotRead
    });
    assert_eq!(client.counters().frames_abandoned, 0);
    // One that reads then has all of it.
    other.parcel();
    await_that("Status says so", || {
        client.status().withheld == Withheld::None
    });
    balance("read late", emulator, 1, &[(1, &[])]);
}

/// By the wall clock frames are dropped because the client does not read: no slow link is reported.
#[test]
fn a_fast_link_that_is_not_read_is_not_called_slow() {
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
        let account = &stats.accounts[0].1;
        assert!(account.withheld["client does not read"] > 5, "{account:?}");
        assert!(
            !account.withheld.contains_key("link too slow"),
            "{account:?}"
        );
    }
}

/// A frame that a slow link does not carry before the end, with credit from the start or later.
#[test]
fn a_frame_of_a_slow_link_ends_with_the_run() {
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
            // No Status here: its reply may come behind the whole frame.
            client.forget();
            client.send(Command::Credit { packets: 1 << 20 });
        }
        client.next(true);
        let name = format!("{waits_for_credit}");
        balance(&name, emulator, 1, &[(0, &[("run ended", 1)])]);
    }
}

/// A refused attitude, and what cannot be an attitude, where frames come by the one before.
#[test]
fn a_late_attitude_withholds_no_frame_by_the_wall_clock() {
    let (_emulator, mut client) = udp_client(quick(20.0), Clock::Wall, 3600.0);
    client.send(Command::Credit { packets: 1 << 30 });
    client.point(attitude(0), later(EPOCH, 10.0));
    await_that("frames come", || client.counters().frames_delivered > 0);
    client.point(attitude(1), later(EPOCH, 9.9));
    client.nack();
    let begun = Instant::now();
    let before = client.counters().frames_delivered;
    assert_eq!(client.status().withheld, Withheld::None);
    await_that("frames go on", || {
        assert!(begun.elapsed() < TIMEOUT);
        client.counters().frames_delivered > before
    });
}
