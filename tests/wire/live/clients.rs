//! Clients that leave, and clients that read nothing: the next client gets its frames.

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

/// Silence after which another client is accepted, s.
const IDLE_S: f64 = 0.2;

/// A new client after one that has left, accepted after its silence.
fn next_client<L: Line>(line: L) -> Client<L> {
    let mut client = Client::new(line).unpaced();
    client.await_answer();
    // After a Reset, no frame follows from earlier commands.
    client.send(Command::Reset);
    client.start_anew();
    client.window = None;
    client
}

/// Requires whole frames of the client's own attitude.
fn assert_served<L: Line>(client: &mut Client<L>) {
    client.point(attitude(77), later(EPOCH, 9000.0));
    for _ in 0..2 {
        whole_frame(client);
    }
    frame_of(client, 77);
}

#[test]
fn udp_clients_killed_within_a_frame_lose_only_that_frame() {
    for clock in [Clock::Wall, Clock::External, Clock::Stepped] {
        let (_emulator, line) = on_udp(quick(20.0), clock, IDLE_S);
        let another = line.another();
        let mut first = Client::new(line).unpaced();
        // Credit for the beginning of the frame, not for its end.
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
            _ => assert_served(&mut second),
        }
        let counters = second.counters();
        // One frame was in transmission; others may have waited behind it.
        assert!(
            counters.frames_abandoned > counters.frames_dropped,
            "{clock:?}"
        );
        // An incomplete frame misses its deadline, if there are deadlines.
        let had_deadline = clock != Clock::Stepped;
        assert_eq!(counters.deadlines_missed > 0, had_deadline, "{clock:?}");
    }
}

#[test]
fn udp_clients_without_credit_are_dropped_and_the_next_one_is_served() {
    let (emulator, line) = on_udp(quick(20.0), Clock::Wall, IDLE_S);
    let another = line.another();
    let mut first = Client::new(line).unpaced();
    first.send(Command::Credit { packets: 1 });
    first.point(attitude(1), EPOCH);
    // Nothing is read: the emulator sends within the credit, then waits for 2 s.
    await_that("the frame is abandoned", || emulator.exposed().number == 0);
    let mut second = next_client(another);
    assert_served(&mut second);
    let counters = second.counters();
    assert!(counters.frames_abandoned > counters.frames_dropped);
    assert!(counters.frames_dropped > 0, "frames went on meanwhile");
}

#[cfg(target_os = "linux")]
mod terminals {
    use super::*;
    use crate::support::line::PtyLine;
    use crate::support::on_pty;

    /// An emulator on its own pseudo-terminal, and the path for clients.
    fn served() -> (Running, tempfile::TempDir, String) {
        let (wire, folder, name) = on_pty(&options(5.0), 3_000_000);
        (Running::start(quick(10.0), Clock::Wall, wire), folder, name)
    }

    #[test]
    fn serial_clients_that_close_within_a_frame_are_followed_by_the_next() {
        let (_emulator, _folder, name) = served();
        let mut first = Client::new(PtyLine::at(&name)).unpaced();
        first.point(attitude(1), EPOCH);
        first.next(true);
        first.next(true);
        drop(first);
        // A port reopened within 50 ms counts as the same client.
        std::thread::sleep(Duration::from_secs(1));
        let mut second = next_client(PtyLine::at(&name));
        assert_served(&mut second);
        let counters = second.counters();
        assert!(counters.reconnects >= 1, "{counters:?}");
        // Packets for the first client were not sent, or too late.
        assert!(counters.lost_outbound + counters.frames_abandoned + counters.frames_dropped >= 1);
    }

    #[test]
    fn serial_clients_that_do_not_read_block_no_frame_and_are_served_later() {
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

/// A flight computer that starts before the emulator sends attitudes for the time of sending.
#[test]
fn attitudes_after_a_wait_for_the_emulator_are_current() {
    const WAIT: Duration = Duration::from_millis(300);
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let zero = Instant::now();
    let start = Epoch::now().unwrap();
    let mission = super::mission(start, 3, TIMEOUT);
    let mut config = quick(20.0);
    config.objects.clear();
    std::thread::scope(|scope| {
        let running = scope.spawn(|| {
            let computer = FlightComputer::new(port, mission).with_start_instant(Some(zero));
            let mut sent_s = Vec::new();
            let report = computer.without_detection().run(|event| {
                if let Event::Frame { frame, .. } = event {
                    let mid_s = (to_epoch(frame.mid_exposure) - start).to_seconds();
                    sent_s.push(mid_s - f64::from(frame.end.timing.attitude_age_s));
                }
                ControlFlow::Continue(())
            });
            assert_eq!(report.unwrap().frames, 3);
            sent_s
        });
        std::thread::sleep(WAIT);
        let _emulator = Running::start(config, Clock::Wall, wire);
        for sent_s in running.join().unwrap() {
            assert!(sent_s >= WAIT.as_secs_f64(), "{sent_s}");
        }
    });
}
