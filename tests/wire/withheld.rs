//! Frames withheld from a client, each counted under its cause.

use crate::abandoned::{during_a_long_frame, limited, turning};
use crate::support::client::{Client, counted};
use crate::support::line::{Line, MemoryLine, PtyLine, UdpLine};
use crate::support::{
    EPOCH, Running, attitude, await_that, bad_attitude, fetched, later, memory_client, on_pty,
    on_udp, options, quick, role_clients, scene, scene_at, serial_client, with_metrics,
};
use skyloop::config::{Clock, Config, Trigger};
use skyloop::link::{self, Roles, Wire};
use skyloop::stats::FrameCounters;
use skyloop_protocols::personality::{NATIVE, Personality};
use skyloop_protocols::{Command, Counters, EncodeError, Reply, Withheld};
use std::time::{Duration, Instant};

/// Expected counts of one link: frames delivered, and withheld by cause.
pub type Expected<'e> = (usize, &'e [(&'static str, usize)]);

/// Ends a run and checks the rule of docs/how-to/missing-frames.md: on each link, the requests are
/// the frames delivered plus those withheld by cause. The run's counters agree with all links
/// together.
#[track_caller]
pub fn balance(
    name: &str,
    emulator: Running,
    requested: usize,
    links: &[Expected<'_>],
) -> Counters {
    let (stats, counters) = emulator.measured();
    let found = &stats.frame_counters;
    assert_eq!(found.len(), links.len(), "{name}: {found:?}");
    for ((_, frame_counters), (delivered, withheld)) in found.iter().zip(links) {
        let expected = FrameCounters {
            requested,
            delivered: *delivered,
            withheld: withheld.iter().copied().collect(),
        };
        assert_eq!(*frame_counters, expected, "{name}: {found:?} {counters:?}");
        let sum: usize = frame_counters.withheld.values().sum();
        assert_eq!(requested, delivered + sum, "{name}");
    }
    if let [(_, frame_counters)] = &found[..] {
        let delivered = counters.frames_delivered as usize;
        assert_eq!(delivered, frame_counters.delivered, "{name}: {counters:?}");
    }
    let table = stats.rows();
    let rows = table.iter().filter(|(row, _)| row == "frames withheld");
    let some = links.iter().filter(|(_, withheld)| !withheld.is_empty());
    assert_eq!(rows.count(), some.count(), "{name}: {table:?}");
    counters
}

/// A stepped client whose first frame waits for credit after 3 packets.
fn waiting(line: impl Line) -> Client<impl Line> {
    let mut client = Client::new(line).unpaced();
    client.send(Command::Credit { packets: 3 });
    client.point(attitude(0), EPOCH);
    await_that("the frame waits for credit", || {
        let status = client.status();
        (status.packets_sent, status.counters.frames_rendered) == (3, 1)
    });
    client
}

/// Two links with frames, the first with the truth too, and a client at each. The second client is
/// silent.
fn two_links(config: Config, clock: Clock) -> (Running, [Client<UdpLine>; 2]) {
    role_clients(config, clock, ["truth+labels", "pixels"], 60.0)
}

/// Three attitudes after that of [`waiting`], which wait for its frame.
fn wait_behind<L: Line>(client: &mut Client<L>) {
    for n in 1..4 {
        client.point(attitude(n), later(EPOCH, f64::from(n)));
    }
    await_that("the attitudes are accepted", || {
        client.counters().attitudes == 4
    });
}

#[test]
fn requests_add_up_on_one_link() {
    let stepped = || on_udp(scene(), Clock::Stepped, 60.0);

    let (emulator, line) = stepped();
    let mut client = Client::new(line);
    (0..3).for_each(|n| drop(client.good_frame(n)));
    balance("all delivered", emulator, 3, &[(3, &[])]);

    let (emulator, line) = stepped();
    let mut client = waiting(line);
    wait_behind(&mut client);
    client.done(Command::Reset);
    client.forget();
    client.window = Some(32);
    // The waiting frames were never rendered.
    assert_eq!(client.good_frame(1).header.frame, 1);
    assert_eq!(client.counters().frames_abandoned, 4);
    balance("Reset", emulator, 5, &[(1, &[("client sent Reset", 4)])]);

    let (emulator, line) = stepped();
    let mut client = waiting(line);
    await_that("the frame is abandoned", || {
        client.counters().frames_abandoned == 1
    });
    balance("no credit", emulator, 1, &[(0, &[("no credit", 1)])]);

    // After 1 s of silence another client is accepted, before the frame is abandoned.
    let (emulator, line) = on_udp(scene(), Clock::Stepped, 1.0);
    let mut second = Client::new(line.another());
    let mut first = waiting(line);
    wait_behind(&mut first);
    drop(first);
    second.await_answer();
    balance("another client", emulator, 4, &[(0, &[("client gone", 4)])]);

    // The frame that waits for credit, and three that were never rendered.
    let (emulator, line) = stepped();
    let mut client = waiting(line);
    wait_behind(&mut client);
    let counters = balance("signal", emulator, 4, &[(0, &[("run ended", 4)])]);
    counted(
        &counters,
        &[("frames_rendered", 1), ("frames_abandoned", 4)],
    );

    // Each frame has 40 kB: the pseudo-terminal takes 20 kB of them, the queue the rest.
    let (emulator, mut client) = serial_client(quick(1.0), Clock::Stepped);
    client.window = None;
    for sequence in 0..3 {
        client.point(attitude(sequence), later(EPOCH, f64::from(sequence)));
    }
    (0..3).for_each(|_| drop(emulator.exposed()));
    balance("queue", emulator, 3, &[(0, &[("client does not read", 3)])]);
}

#[test]
fn requests_add_up_on_two_links_with_one_client() {
    let windows = || scene_at("windows");
    let (emulator, [mut truth, _silent]) = two_links(windows(), Clock::Stepped);
    for n in 0..2 {
        truth.point(attitude(n), later(EPOCH, f64::from(n)));
        truth.parcel();
    }
    // A refused attitude gives no frame on any link.
    truth.point(bad_attitude(2), EPOCH);
    truth.nack();
    let withheld: [Expected<'_>; 2] = [
        (2, &[("refused", 1)]),
        (0, &[("no client", 2), ("refused", 1)]),
    ];
    balance("no client", emulator, 3, &withheld);

    // The second client takes a part of the frame; a Reset of the first client does not affect it.
    let (emulator, [mut truth, mut pixels]) = two_links(windows(), Clock::Stepped);
    pixels.window = None;
    pixels.send(Command::Credit { packets: 1 });
    pixels.status();
    truth.point(attitude(0), EPOCH);
    truth.parcel();
    truth.point(attitude(1), later(EPOCH, 1.0));
    truth.status();
    truth.done(Command::Reset);
    let withheld: [Expected<'_>; 2] = [
        (1, &[("client sent Reset", 1)]),
        (0, &[("client sent Reset", 1), ("run ended", 1)]),
    ];
    balance("Reset on one of two links", emulator, 2, &withheld);
}

#[test]
fn requests_add_up_for_abandoned_and_refused_frames() {
    for (name, ends_by_reset, cause) in [
        ("Reset during a frame", true, "client sent Reset"),
        ("signal during a frame", false, "run ended"),
    ] {
        let (emulator, mut client, _) = during_a_long_frame(None);
        if ends_by_reset {
            client.done(Command::Reset);
        }
        let counters = balance(name, emulator, 1, &[(0, &[(cause, 1)])]);
        counted(
            &counters,
            &[("frames_rendered", 0), ("frames_abandoned", 1)],
        );
    }
    // The second exceeds the work limit, the third precedes the first.
    let (emulator, mut client) = memory_client(limited(0.3), Clock::Stepped);
    client.good_frame(0);
    client.point(turning(1), later(EPOCH, 1.0));
    client.nack();
    client.point(attitude(2), later(EPOCH, -1.0));
    client.nack();
    client.point(attitude(3), later(EPOCH, 2.0));
    client.frame();
    client.has_counted(&[("exposures_missed", 1), ("time_backwards", 1)]);
    balance("refused", emulator, 4, &[(2, &[("refused", 2)])]);
}

#[test]
fn requests_are_triggers_if_these_give_the_frames() {
    for clock in [Clock::Stepped, Clock::External] {
        let mut config = quick(20.0);
        config.run.trigger = Trigger::Packet;
        let (emulator, mut client) = memory_client(config, clock);
        let trigger = |client: &mut Client<_>, s| {
            let start = later(EPOCH, s);
            client.send(Command::Trigger { number: 1, start });
        };
        client.point(attitude(1), EPOCH);
        trigger(&mut client, 0.0);
        client.frame();
        // It waits for its time (external clock) or for the end of the pause (stepped).
        client.done(Command::Pause);
        trigger(&mut client, 1000.0);
        client.status();
        client.done(Command::Reset);
        trigger(&mut client, 1000.0);
        // There is no attitude since the Reset.
        let last = match clock {
            Clock::Stepped => "no attitude for the exposure",
            _ => "run ended",
        };
        client.status();
        let withheld = [("client sent Reset", 1), (last, 1)];
        balance(&format!("{clock:?}"), emulator, 3, &[(1, &withheld)]);
    }
}

/// A Trigger whose frame is in rendering counts as missed, whatever ends it. The frames of
/// [`turning`] take minutes.
#[test]
fn triggers_with_unfinished_frames_are_missed() {
    let config = || {
        let mut config = limited(1e6);
        config.run.trigger = Trigger::Packet;
        config
    };
    let trigger = |client: &mut Client<_>, clock| {
        client.point(turning(1), EPOCH);
        // The external clock renders only past exposures; in stepped mode the attitude is that of
        // the middle.
        let start = later(EPOCH, if clock == Clock::Stepped { -0.5 } else { -2.0 });
        client.send(Command::Trigger { number: 1, start });
        client.status();
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(client.counters().frames_abandoned, 0);
    };
    for (clock, cause) in [
        (Clock::Stepped, "client sent Reset"),
        (Clock::Stepped, "client gone"),
        (Clock::Stepped, "run ended"),
        (Clock::External, "client sent Reset"),
        (Clock::External, "run ended"),
    ] {
        let (emulator, line) = on_udp(config(), clock, 1.0);
        let mut second = Client::new(line.another());
        let mut client = Client::new(line);
        trigger(&mut client, clock);
        match cause {
            "client sent Reset" => client.done(Command::Reset),
            "client gone" => second.await_answer(),
            _ => {}
        }
        let (stats, counters) = emulator.measured();
        let withheld: Vec<_> = stats.frame_counters[0].1.withheld.iter().collect();
        assert_eq!(withheld, [(&cause, &1)], "{clock:?}");
        counted(&counters, &[("triggers", 1), ("triggers_missed", 1)]);
    }
}

/// With a clock, each completed exposure of the cadence is a request. The number of requests is
/// counted independently: each exposure has a number or is missed.
#[test]
fn requests_are_exposures_if_a_clock_gives_the_frames() {
    for clock in [Clock::Wall, Clock::External] {
        for silent in [false, true] {
            let (emulator, [mut truth, mut pixels]) = two_links(quick(50.0), clock);
            if !silent {
                // It takes a frame and a half.
                pixels.window = None;
                pixels.send(Command::Credit { packets: 10 });
                pixels.status();
            }
            // 1 s, and more on a busy machine that misses all exposures until then.
            for n in 0..300 {
                truth.point(attitude(n), later(EPOCH, 0.1 * f64::from(n)));
                let sent = Instant::now();
                while sent.elapsed() < Duration::from_millis(100) {
                    truth.recv(Duration::from_millis(10));
                }
                if n >= 9 && truth.counters().frames_rendered > 0 {
                    break;
                }
            }
            if silent {
                truth.done(Command::SingleShot);
            }
            let (stats, counters) = emulator.measured();
            let requested =
                counters.frames_delivered + counters.frames_abandoned + counters.exposures_missed;
            assert!(requested > 10, "{counters:?}");
            for (link, frame_counters) in &stats.frame_counters {
                let sum =
                    frame_counters.delivered + frame_counters.withheld.values().sum::<usize>();
                let case = format!("{clock:?} {link}: {frame_counters:?} {counters:?}");
                assert_eq!(
                    [frame_counters.requested, sum],
                    [requested as usize; 2],
                    "{case}"
                );
            }
            let of_silent = &stats.frame_counters[1].1;
            let has_no_client = of_silent.withheld.contains_key("no client");
            assert_eq!(has_no_client, silent, "{clock:?}: {of_silent:?}");
            assert!(!silent || of_silent.delivered == 0);
        }
    }
}

/// `/metrics` has the frame counters of the links during the run.
#[test]
fn metrics_have_the_frame_counters() {
    let wire = link::open("udp://127.0.0.1:0", &options(60.0)).unwrap();
    let mut client = Client::new(UdpLine::to(&wire.address));
    let (emulator, serving) = with_metrics(scene(), Clock::Stepped, wire);
    client.good_frame(0);
    for n in 1..3 {
        client.point(bad_attitude(n), EPOCH);
        client.nack();
    }
    await_that("the metrics", || {
        let found = fetched(serving.address());
        let is =
            |what, value: f64| found.get(&format!("skyloop_link_frames_{what}")) == Some(&value);
        is("requested_total", 3.0)
            && is("delivered_total", 1.0)
            && is("withheld_total{cause=\"refused\"}", 2.0)
    });
    client.has_counted(&[("frames_delivered", 1), ("bad_attitude", 2)]);
    balance("metrics", emulator, 3, &[(1, &[("refused", 2)])]);
}

/// A device that cannot encode labels.
pub static SHORT: Personality = Personality {
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

/// An emulator with the truth on one link and `frames` as the link for frames.
pub fn with_frame_link(
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

/// A client closes its socket (ICMP unreachable) or its pseudo-terminal while a frame is in
/// transmission. That frame may have been sent; no later one counts as unread.
#[test]
fn frames_for_a_closed_client_are_counted_as_client_gone() {
    let udp = link::open("udp://127.0.0.1:0", &options(3600.0)).unwrap();
    let udp_line: Box<dyn Line> = Box::new(UdpLine::to(&udp.address));
    let (pty, _folder, name) = on_pty(&options(3600.0), 115_200);
    let pty_line: Box<dyn Line> = Box::new(PtyLine::at(&name));
    for (url, wire, line) in [("udp", udp, udp_line), ("pty", pty, pty_line)] {
        let config = scene_at("windows");
        let (emulator, mut client) = with_frame_link(config, Clock::Stepped, wire, &NATIVE);
        let mut other = Client::new(line).unpaced();
        other.send(Command::Credit { packets: 1 << 30 });
        other.status();
        client.point(attitude(0), EPOCH);
        other.parcel();
        client.point(attitude(1), later(EPOCH, 1.0));
        client.status();
        drop(other);
        let mut last = 1;
        await_that("Status reports it, and all frames have ended", || {
            let status = client.status();
            let counters = status.counters;
            let is_over = counters.frames_delivered + counters.frames_abandoned == last + 1;
            let is_reported = status.withheld == Withheld::NoClient;
            if is_over && !is_reported {
                last += 1;
                client.point(attitude(last), later(EPOCH, f64::from(last)));
            }
            is_over && is_reported
        });
        let (stats, counters) = emulator.measured();
        let frame_counters = &stats.frame_counters[0].1;
        let requested = last as usize + 1;
        assert_eq!(frame_counters.requested, requested, "{url}");
        assert!(
            (1..requested).contains(&frame_counters.delivered),
            "{frame_counters:?}"
        );
        let withheld = [("client gone", requested - frame_counters.delivered)];
        assert_eq!(frame_counters.withheld, withheld.into(), "{url}");
        let delivered = counters.frames_delivered as usize;
        assert_eq!(delivered, frame_counters.delivered, "{url}");
    }
}
