//! The external clock: attitudes carry the time, and frames follow the camera's period in it.

use super::{EXPOSURE_S, TIMEOUT, mid_s, quick, rest, seconds, shows, turned, turning};
use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, on_memory};
use skyloop::config::Clock;
use skyloop_protocols::{Command, Mode, Reason, SyncState, WireTime};
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 20.0;
/// Interval of the client's attitudes.
const TICK: Duration = Duration::from_millis(20);

/// A client whose clock runs `pace` times as fast as real time.
struct Pilot {
    client: Client<MemoryLine>,
    pace: f64,
    /// A reading of the client's clock, and its instant.
    set: (WireTime, Instant),
    sequence: u32,
    last_sent: Instant,
    /// Whether a pause exceeded [`STANDSTILL`].
    had_pause: bool,
}

/// After a pause this long, the emulator may assume a clock step or a silent client.
const STANDSTILL: Duration = Duration::from_millis(200);

impl Pilot {
    fn of(line: MemoryLine, pace: f64) -> Pilot {
        let client = Client::new(line).unpaced();
        Pilot {
            client,
            pace,
            set: (EPOCH, Instant::now()),
            sequence: 0,
            last_sent: Instant::now(),
            had_pause: false,
        }
    }

    fn time(&self) -> WireTime {
        let (time, at) = self.set;
        later(time, at.elapsed().as_secs_f64() * self.pace)
    }

    /// Sets the client's clock, and sends an attitude for `time`, the origin of the grid of
    /// periods.
    fn set(&mut self, time: WireTime) {
        self.set = (time, Instant::now());
        self.last_sent = Instant::now();
        self.send_for(time);
    }

    fn send_now(&mut self) {
        self.send_for(self.time());
    }

    /// Sends the attitude for a time of the client's clock.
    fn send_for(&mut self, time: WireTime) {
        self.sequence += 1;
        let q = turned(seconds(EPOCH, time));
        self.client.point(turning(self.sequence, q), time);
        self.had_pause |= self.last_sent.elapsed() > STANDSTILL;
        self.last_sent = Instant::now();
    }

    /// Requires exposures to end on the grid of periods from `zero` on, in the client's time.
    fn on_the_grid(&mut self, frames: &[Received], zero: WireTime) {
        // A paused emulator misses exposures.
        self.had_pause |= self.client.counters().exposures_missed > 0;
        let grow = |two: &[Received]| two[0].time < two[1].time;
        assert!(self.had_pause || frames.windows(2).all(grow));
        for frame in frames {
            let periods = (seconds(zero, frame.time) + EXPOSURE_S / 2.0) * RATE_HZ;
            let off = (periods - periods.round()).abs();
            let fits = off < 1e-4 && periods > 0.5;
            assert!(self.had_pause || fits, "{periods}");
        }
    }

    /// Sends attitudes until `done`.
    fn send_until(&mut self, what: &str, mut done: impl FnMut(&mut Client<MemoryLine>) -> bool) {
        let began = Instant::now();
        while !done(&mut self.client) {
            assert!(began.elapsed() < TIMEOUT, "waited too long for: {what}");
            self.send_now();
            std::thread::sleep(TICK);
        }
    }

    /// Sends attitudes until the emulator has delivered `more` frames. Returns these.
    fn frames(&mut self, more: u32) -> Vec<Received> {
        let made = |client: &mut Client<MemoryLine>| client.counters().frames_delivered;
        let before = made(&mut self.client);
        self.send_until("frames", |client| made(client) >= before + more);
        (0..more).map(|_| self.client.frame()).collect()
    }
}

/// Repeats a test until a run has no pause, because a pause invalidates the checks of a steady
/// clock. The tests of `serve/clock/paced.rs` make these checks at simulated instants.
fn undisturbed(test: impl Fn() -> Pilot) {
    let is_clean = |_| !test().had_pause;
    if !(0..10).any(is_clean) {
        println!(
            "each of ten runs had a pause of {STANDSTILL:?}: only the order of exposures was checked"
        );
    }
}

fn run(pace: f64, holdover_s: f64) -> (Running, Pilot) {
    let mut config = quick(RATE_HZ);
    config.run.holdover_s = holdover_s;
    let (emulator, line) = on_memory(config, Clock::External);
    let mut pilot = Pilot::of(line, pace);
    // The emulator must run before the client's clock is set.
    pilot.client.status();
    (emulator, pilot)
}

#[test]
fn frames_follow_the_clients_time_and_continue_in_a_silence() {
    undisturbed(|| {
        let (emulator, mut pilot) = run(1.0, 1.0);
        let status = pilot.client.status();
        assert_eq!(status.mode, Mode::External);
        assert_eq!(status.sync, SyncState::Waiting);
        assert_eq!(status.clock_offset_s, 0.0);
        // X-Val: four periods.
        assert!(pilot.client.recv(Duration::from_millis(200)).is_none());
        let began = Instant::now();
        pilot.set(EPOCH);
        let frames = pilot.frames(8);
        let followed = |pilot: &Pilot, sync| sync == SyncState::Locked || pilot.had_pause;
        // Not early, except for clock corrections: X-Val: 8 periods.
        assert!(began.elapsed() >= Duration::from_secs_f64(7.5 / RATE_HZ));
        pilot.on_the_grid(&frames, EPOCH);
        for frame in &frames {
            assert!(followed(&pilot, frame.end.sync));
            assert!(shows(frame, turned(mid_s(frame))));
            let word = frame.end.sync.name().to_lowercase();
            assert_eq!(frame.label()["timing"]["sync"], word);
        }
        // In a silence the clock continues, and reports holdover.
        let client = &mut pilot.client;
        await_that("holdover", || client.status().sync == SyncState::Holdover);
        let mut alone: Vec<Received> = Vec::new();
        let is_alone = |frame: &Received| frame.end.sync == SyncState::Holdover;
        await_that("frames in holdover", || {
            alone.push(client.frame());
            alone.iter().filter(|frame| is_alone(frame)).count() == 3
        });
        pilot.on_the_grid(&alone, EPOCH);
        assert_eq!(alone[alone.len() - 1].label()["timing"]["sync"], "holdover");
        assert!(shows(&alone[0], turned(mid_s(&alone[0]))));
        // Attitudes end the holdover.
        pilot.last_sent = Instant::now();
        pilot.send_until("lock", |client| client.status().sync == SyncState::Locked);
        let rested = rest(&emulator, &mut pilot.client);
        assert!(rested.iter().all(|frame| frame.header.frame > 7));
        pilot
    });
}

#[test]
fn fast_clocks_are_followed() {
    undisturbed(|| {
        const FAST: f64 = 0.05;
        let (emulator, mut pilot) = run(1.0 + FAST, 10.0);
        pilot.set(EPOCH);
        let began = Instant::now();
        let offset = |client: &mut Client<MemoryLine>| {
            let offset_s = client.status().clock_offset_s;
            (began.elapsed().as_secs_f64(), offset_s)
        };
        // Time of the estimation window.
        pilot.send_until("the window", |client| offset(client).0 > 0.4);
        let (first_s, first) = offset(&mut pilot.client);
        // A pause of the machine makes the clock look slow for a while.
        pilot.send_until("the rate", |client| {
            let (now_s, now) = offset(client);
            let gain = (now - first) / (now_s - first_s);
            now_s - first_s > 0.8 && (0.6 * FAST..1.4 * FAST).contains(&gain)
        });
        let frames = pilot.frames(3);
        let rested = rest(&emulator, &mut pilot.client);
        let all = [frames, rested].concat();
        pilot.on_the_grid(&all, EPOCH);
        let last = &all[all.len() - 1];
        let label_s = last.label()["timing"]["clock_offset_s"].as_f64().unwrap();
        assert!((label_s - last.end.clock_offset_s).abs() < 1e-6 && label_s > 0.0);
        // No exposure is in the client's future.
        assert!(seconds(last.time, pilot.time()) > 0.0);
        pilot
    });
}

#[test]
fn clock_steps_of_an_hour_are_followed_without_missed_exposures() {
    undisturbed(|| {
        let (emulator, mut pilot) = run(1.0, 10.0);
        pilot.set(EPOCH);
        let frames = pilot.frames(3);
        pilot.on_the_grid(&frames, EPOCH);
        for hours in [1.0, -1.0] {
            let to = later(EPOCH, hours * 3600.0);
            let before = pilot.client.status();
            let began = Instant::now();
            pilot.set(to);
            let mut refused = Vec::new();
            pilot.send_until("the step is accepted", |client| {
                let more = client.refusals();
                refused.extend_from_slice(&more);
                more.is_empty()
            });
            // X-Val: ICD, section 5.5: a new time is followed after 0.25 s.
            assert!(began.elapsed() >= Duration::from_millis(250));
            let expected = if hours > 0.0 {
                Reason::ValueOutOfRange
            } else {
                Reason::TimeBackwards
            };
            let is_expected = |reason: &Reason| *reason == expected;
            assert!(
                !refused.is_empty() && refused.iter().all(is_expected),
                "{refused:?}"
            );
            // Of the old time are at most the one in rendering and the one that waits.
            let next_frame = pilot.client.status().next_frame;
            pilot.send_until("frames of the new time", |client| {
                client.status().next_frame >= next_frame + 5
            });
            let mut frames = rest(&emulator, &mut pilot.client);
            pilot.client.done(Command::FrameRate { hz: RATE_HZ });
            // The old time, then only the new time.
            let is_of_it = |frame: &Received| {
                let since_s = seconds(to, frame.time);
                (0.0..TIMEOUT.as_secs_f64()).contains(&since_s)
            };
            let first = frames.iter().position(is_of_it).unwrap();
            frames.drain(..first);
            for frame in &frames {
                assert!(is_of_it(frame), "{}", seconds(to, frame.time));
                assert!(shows(frame, turned(mid_s(frame))));
            }
            // The grid starts at the time accepted after the step. An exposure that waits for its
            // frame at the step has the new time, and is not on this grid.
            let zero = later(frames[1].time, EXPOSURE_S / 2.0 - 1.0 / RATE_HZ);
            pilot.on_the_grid(&frames[1..], zero);
            let after = pilot.client.status();
            let off = after.clock_offset_s - before.clock_offset_s;
            let set_s = if hours > 0.0 { 3600.0 } else { -7200.0 };
            assert!((off - set_s).abs() < TIMEOUT.as_secs_f64(), "{off}");
            // X-Val: an hour has 72,000 periods; pauses of the machine may miss some.
            let missed = after.counters.exposures_missed - before.counters.exposures_missed;
            assert!(missed < 72_000 / 100, "{missed}");
            let counters = after.counters;
            assert_eq!(
                counters.attitudes + counters.bad_value + counters.time_backwards,
                pilot.sequence
            );
        }
        pilot
    });
}

/// Delayed and wrong attitudes are no clock steps.
#[test]
fn late_attitudes_change_neither_time_nor_frames() {
    undisturbed(|| {
        let mut config = quick(RATE_HZ);
        config.run.out_of_order = skyloop::config::OutOfOrder::Use;
        let (emulator, line) = on_memory(config, Clock::External);
        let mut pilot = Pilot::of(line, 1.0);
        pilot.client.status();
        pilot.set(EPOCH);
        let mut frames = pilot.frames(2);
        let offset_s = pilot.client.status().clock_offset_s;
        let mut refused = Vec::new();
        for n in 0..40_u32 {
            pilot.send_now();
            // In turn: 0.3 s late, a year ahead, two seconds late.
            let off_s = [-0.3, 3e7, -2.0][n as usize % 3];
            let wrong = later(pilot.time(), off_s);
            pilot.client.point(attitude(1_000_000 + n), wrong);
            // Also receives the frames: a client that reads nothing for 2 s loses one.
            refused.extend(pilot.client.refusals());
            std::thread::sleep(TICK);
        }
        // X-Val: one in three of 40 is ahead; late ones are used, as configured.
        assert_eq!(refused, [Reason::ValueOutOfRange; 13]);
        let status = pilot.client.status();
        let moved_s = (status.clock_offset_s - offset_s).abs();
        assert!(pilot.had_pause || moved_s < 0.05, "{moved_s}");
        frames.extend(rest(&emulator, &mut pilot.client));
        pilot.on_the_grid(&frames, EPOCH);
        let counters = status.counters;
        // Two in three are earlier than a previous one, and are counted.
        assert!(pilot.had_pause || counters.time_backwards == 27);
        assert_eq!(counters.bad_value, 13);
        // Each exposure is made once, or counted as missed.
        let first = frames[0].time;
        let last = frames[frames.len() - 1].time;
        let due = (seconds(first, last) * RATE_HZ).round() as u32 + 1;
        let end = pilot.client.counters();
        let had = frames.len() as u32 + end.exposures_missed + end.frames_dropped;
        let is_counted = due <= had && frames.len() as u32 <= due;
        assert!(is_counted, "{due} due, {had} had or counted");
        pilot
    });
}

#[test]
fn triggered_cameras_refuse_rate_and_single_shot() {
    let mut config = quick(RATE_HZ);
    config.run.trigger = skyloop::config::Trigger::Packet;
    let (_emulator, mut client) = memory_client(config, Clock::External);
    client.point(attitude(1), EPOCH);
    for command in [Command::SingleShot, Command::FrameRate { hz: 5.0 }] {
        client.send(command);
        client.refused(Reason::NotSupported, &["rigger"]);
    }
    // X-Val: a period is 0.05 s, which does not limit triggered exposures.
    client.done(Command::Exposure { seconds: 0.2 });
    client.done(Command::Exposure { seconds: 0.02 });
    super::trigger(&mut client, 1, 0.05);
    let frame = client.frame();
    let open_s = seconds(frame.header.exposure_start, frame.header.exposure_end);
    assert!((open_s - 0.02).abs() < 2e-9);
}
