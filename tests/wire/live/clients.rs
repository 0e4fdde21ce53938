//! Clients that leave, and clients that take nothing: the next client gets its frames.

use super::{TIMEOUT, frame_of, quick, whole_frame};
use crate::support::client::Client;
use crate::support::line::Line;
use crate::support::{EPOCH, Running, attitude, await_that, later, on_udp, options};
use hifitime::Epoch;
use skyloop::config::Clock;
use skyloop::link;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_protocols::Command;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Silence after which another client may come, s.
const IDLE_S: f64 = 0.2;

/// A client after one that has left; the emulator hears it when that one has been silent.
fn next_client<L: Line>(line: L) -> Client<L> {
    let mut client = Client::new(line).unpaced();
    client.await_answer();
    // After a Reset no more frames come of what was said before.
    client.send(Command::Reset);
    client.start_anew();
    client.window = None;
    client
}

/// It gets whole frames of its own attitude.
fn is_served<L: Line>(client: &mut Client<L>) {
    client.point(attitude(77), later(EPOCH, 9000.0));
    for _ in 0..2 {
        whole_frame(client);
    }
    frame_of(client, 77);
}

#[test]
fn a_udp_client_that_is_killed_within_a_frame_loses_it_and_nobody_else_does() {
    for clock in [Clock::Wall, Clock::External, Clock::Stepped] {
        let (_emulator, line) = on_udp(quick(20.0), clock, IDLE_S);
        let another = line.another();
        let mut first = Client::new(line).unpaced();
        // So much that the frame begins, and not so much that it ends.
        first.send(Command::Credit { packets: 3 });
        first.point(attitude(1), EPOCH);
        for _ in 0..3 {
            first.next(true);
        }
        drop(first);
        let mut second = next_client(another);
        match clock {
            Clock::Stepped => {
                second.good_frame(5);
            }
            _ => is_served(&mut second),
        }
        let counters = second.counters();
        // It was under way when its client went; others may have waited behind it.
        assert!(
            counters.frames_abandoned > counters.frames_dropped,
            "{clock:?}"
        );
        // A frame that is not whole is one that missed its deadline, where there are any.
        let had_deadline = clock != Clock::Stepped;
        assert_eq!(counters.deadlines_missed > 0, had_deadline, "{clock:?}");
    }
}

#[test]
fn a_udp_client_that_grants_nothing_more_is_given_up_and_the_next_one_served() {
    let (emulator, line) = on_udp(quick(20.0), Clock::Wall, IDLE_S);
    let another = line.another();
    let mut first = Client::new(line).unpaced();
    first.send(Command::Credit { packets: 1 });
    first.point(attitude(1), EPOCH);
    // It is not read either: the emulator sends what it may, and waits for 2 s.
    await_that("it is given up", || emulator.exposed().number == 0);
    let mut second = next_client(another);
    is_served(&mut second);
    let counters = second.counters();
    assert!(counters.frames_abandoned > counters.frames_dropped);
    assert!(counters.frames_dropped > 0, "frames went on meanwhile");
}

#[cfg(target_os = "linux")]
mod terminals {
    use super::*;
    use crate::support::line::PtyLine;
    use crate::support::on_pty;

    /// An emulator at a pseudo-terminal of its own, and what clients open.
    fn served() -> (Running, tempfile::TempDir, String) {
        let (wire, folder, name) = on_pty(&options(5.0), 3_000_000);
        (Running::start(quick(10.0), Clock::Wall, wire), folder, name)
    }

    #[test]
    fn a_serial_client_that_closes_within_a_frame_is_followed_by_the_next() {
        let (_emulator, _folder, name) = served();
        let mut first = Client::new(PtyLine::at(&name)).unpaced();
        first.point(attitude(1), EPOCH);
        first.next(true);
        first.next(true);
        drop(first);
        // A port that is opened again at once is that of the same client: the emulator looks every 50 ms.
        std::thread::sleep(Duration::from_secs(1));
        let mut second = next_client(PtyLine::at(&name));
        is_served(&mut second);
        let counters = second.counters();
        assert!(counters.reconnects >= 1, "{counters:?}");
        // What was on its way to the first never left, or came too late for it.
        assert!(counters.lost_outbound + counters.frames_abandoned + counters.frames_dropped >= 1);
    }

    #[test]
    fn a_serial_client_that_does_not_read_holds_up_no_frame_and_is_served_when_it_does() {
        let (emulator, _folder, name) = served();
        let mut client = Client::new(PtyLine::at(&name)).unpaced();
        client.point(attitude(1), EPOCH);
        // More frames than terminal and queues hold: X-Val: 256 packets, some ten a frame.
        let mut last = 0;
        while last < 40 {
            last = emulator.exposed().number;
        }
        let frame = loop {
            let frame = whole_frame(&mut client);
            if frame > last {
                break frame;
            }
        };
        let counters = client.counters();
        assert!(counters.frames_dropped > 0 && frame > 40, "{counters:?}");
        client.forget();
    }
}

/// A flight computer that is there first: its attitudes are of the time that it is when they leave.
#[test]
fn who_waited_for_the_emulator_has_not_fallen_behind() {
    const WAIT: Duration = Duration::from_millis(300);
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let zero = Instant::now();
    let start = Epoch::now().unwrap();
    let mission = super::mission(start, 3, TIMEOUT);
    let mut config = quick(20.0);
    config.objects.clear();
    std::thread::scope(|scope| {
        let flying = scope.spawn(|| {
            let flown = FlightComputer::new(port, mission).with_zero(Some(zero));
            let mut told_s = Vec::new();
            let report = flown.taking_only().run(|event| {
                if let Event::Frame { frame, .. } = event {
                    let mid_s = (to_epoch(frame.mid_exposure) - start).to_seconds();
                    told_s.push(mid_s - f64::from(frame.end.timing.attitude_age_s));
                }
                ControlFlow::Continue(())
            });
            assert_eq!(report.unwrap().frames, 3);
            told_s
        });
        std::thread::sleep(WAIT);
        let _emulator = Running::start(config, Clock::Wall, wire);
        for told_s in flying.join().unwrap() {
            assert!(told_s >= WAIT.as_secs_f64(), "{told_s}");
        }
    });
}
