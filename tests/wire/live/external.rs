//! The client's clock: its attitudes tell the time, and frames come at the camera's cadence of it.

use super::{EXPOSURE_S, TIMEOUT, mid_s, quick, rest, seconds, shows, turned, turning};
use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, on_memory};
use skyloop::config::Clock;
use skyloop_protocols::{Command, Mode, Reason, SyncState, WireTime};
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 20.0;
/// Between two attitudes of the client's.
const TICK: Duration = Duration::from_millis(20);

/// A flight computer whose clock runs `pace` times as fast as it should.
struct Pilot {
    client: Client<MemoryLine>,
    pace: f64,
    /// What its clock was at an instant.
    set: (WireTime, Instant),
    sequence: u32,
    /// When it last told an attitude.
    told: Instant,
    /// Whether it has stood still for longer than its clock is trusted.
    stood_still: bool,
}

/// A pilot that stands still for so long may seem to have set its clock, or to have fallen silent.
const STANDSTILL: Duration = Duration::from_millis(200);

impl Pilot {
    fn of(line: MemoryLine, pace: f64) -> Pilot {
        let client = Client::new(line).unpaced();
        Pilot {
            client,
            pace,
            set: (EPOCH, Instant::now()),
            sequence: 0,
            told: Instant::now(),
            stood_still: false,
        }
    }

    /// What its clock is.
    fn time(&self) -> WireTime {
        let (time, at) = self.set;
        later(time, at.elapsed().as_secs_f64() * self.pace)
    }

    /// Sets its clock; it begins with an attitude.
    ///
    /// The attitude is of `time` itself, to which the grid of periods refers.
    fn set(&mut self, time: WireTime) {
        self.set = (time, Instant::now());
        self.told = Instant::now();
        self.tell(time);
    }

    /// Tells the attitude of now.
    fn tick(&mut self) {
        self.tell(self.time());
    }

    /// Tells the attitude of an instant of its clock.
    fn tell(&mut self, time: WireTime) {
        self.sequence += 1;
        let q = turned(seconds(EPOCH, time));
        self.client.point(turning(self.sequence, q), time);
        self.stood_still |= self.told.elapsed() > STANDSTILL;
        self.told = Instant::now();
    }

    /// Middles of exposures lie on the grid of periods from `zero` on, by the client's time.
    fn on_the_grid(&mut self, frames: &[Received], zero: WireTime) {
        // An emulator that stands still misses exposures.
        self.stood_still |= self.client.counters().exposures_missed > 0;
        let grow = |two: &[Received]| two[0].time < two[1].time;
        assert!(self.stood_still || frames.windows(2).all(grow));
        for frame in frames {
            let periods = (seconds(zero, frame.time) + EXPOSURE_S / 2.0) * RATE_HZ;
            let off = (periods - periods.round()).abs();
            let fits = off < 1e-4 && periods > 0.5;
            assert!(self.stood_still || fits, "{periods}");
        }
    }

    /// Tells attitudes until `done`.
    fn fly_until(&mut self, what: &str, mut done: impl FnMut(&mut Client<MemoryLine>) -> bool) {
        let began = Instant::now();
        while !done(&mut self.client) {
            assert!(began.elapsed() < TIMEOUT, "waited too long for: {what}");
            self.tick();
            std::thread::sleep(TICK);
        }
    }

    /// Tells attitudes until the emulator has made so many frames more; the frames.
    fn frames(&mut self, more: u32) -> Vec<Received> {
        let made = |client: &mut Client<MemoryLine>| client.counters().frames_delivered;
        let before = made(&mut self.client);
        self.fly_until("frames", |client| made(client) >= before + more);
        (0..more).map(|_| self.client.frame()).collect()
    }
}

/// Flies a test until it has not stood still in it: what is asked of a steady clock counts only then. On a machine that never lets it, that is held at instants
/// that are made up alone: by the tests of `serve/clock/paced.rs`.
fn undisturbed(test: impl Fn() -> Pilot) {
    let is_clean = |_| !test().stood_still;
    if !(0..10).any(is_clean) {
        println!(
            "a thread stood still for {STANDSTILL:?} in each of ten flights: of exposures' times only their order was held"
        );
    }
}

fn flown(pace: f64, holdover_s: f64) -> (Running, Pilot) {
    let mut config = quick(RATE_HZ);
    config.run.holdover_s = holdover_s;
    let (emulator, line) = on_memory(config, Clock::External);
    let mut pilot = Pilot::of(line, pace);
    // The emulator is there when the clock begins.
    pilot.client.status();
    (emulator, pilot)
}

#[test]
fn frames_come_at_the_cadence_of_the_clients_time_and_on_when_it_falls_silent() {
    undisturbed(|| {
        let (_emulator, mut pilot) = flown(1.0, 1.0);
        let status = pilot.client.status();
        assert_eq!(status.mode, Mode::External);
        assert_eq!(status.sync, SyncState::Waiting);
        assert_eq!(status.clock_offset_s, 0.0);
        // X-Val: four periods.
        assert!(pilot.client.recv(Duration::from_millis(200)).is_none());
        let began = Instant::now();
        pilot.set(EPOCH);
        let frames = pilot.frames(8);
        let followed = |pilot: &Pilot, sync| sync == SyncState::Locked || pilot.stood_still;
        // Never early, but for what the clock was corrected: X-Val: 8 periods.
        assert!(began.elapsed() >= Duration::from_secs_f64(7.5 / RATE_HZ));
        pilot.on_the_grid(&frames, EPOCH);
        for frame in &frames {
            assert!(followed(&pilot, frame.end.sync));
            assert!(shows(frame, turned(mid_s(frame))));
            let word = frame.end.sync.name().to_lowercase();
            assert_eq!(frame.label()["timing"]["sync"], word);
        }
        // Without a word it runs on by itself, and says so.
        let client = &mut pilot.client;
        await_that("it is left alone", || {
            client.status().sync == SyncState::Holdover
        });
        let mut alone: Vec<Received> = Vec::new();
        let is_alone = |frame: &Received| frame.end.sync == SyncState::Holdover;
        await_that("frames all the same", || {
            alone.push(client.frame());
            alone.iter().filter(|frame| is_alone(frame)).count() == 3
        });
        pilot.on_the_grid(&alone, EPOCH);
        assert_eq!(alone[alone.len() - 1].label()["timing"]["sync"], "holdover");
        assert!(shows(&alone[0], turned(mid_s(&alone[0]))));
        // And follows again.
        pilot.told = Instant::now();
        pilot.fly_until("it is followed again", |client| {
            client.status().sync == SyncState::Locked
        });
        let rested = rest(&mut pilot.client);
        assert!(rested.iter().all(|frame| frame.header.frame > 7));
        pilot
    });
}

#[test]
fn a_clock_that_runs_fast_is_followed() {
    undisturbed(|| {
        const FAST: f64 = 0.05;
        let (_emulator, mut pilot) = flown(1.0 + FAST, 10.0);
        pilot.set(EPOCH);
        let began = Instant::now();
        let offset = |client: &mut Client<MemoryLine>| {
            let offset_s = client.status().clock_offset_s;
            (began.elapsed().as_secs_f64(), offset_s)
        };
        // What the window needs until it follows.
        pilot.fly_until("the window", |client| offset(client).0 > 0.4);
        let (first_s, first) = offset(&mut pilot.client);
        // A pause of the machine makes a clock look slow for a while, but not for long.
        pilot.fly_until("the rate", |client| {
            let (now_s, now) = offset(client);
            let gain = (now - first) / (now_s - first_s);
            now_s - first_s > 0.8 && (0.6 * FAST..1.4 * FAST).contains(&gain)
        });
        let frames = pilot.frames(3);
        let rested = rest(&mut pilot.client);
        let all = [frames, rested].concat();
        pilot.on_the_grid(&all, EPOCH);
        let last = &all[all.len() - 1];
        let told = last.label()["timing"]["clock_offset_s"].as_f64().unwrap();
        assert!((told - last.end.clock_offset_s).abs() < 1e-6 && told > 0.0);
        // Its exposures are of the client's time: none is of one that has not come.
        assert!(seconds(last.time, pilot.time()) > 0.0);
        pilot
    });
}

#[test]
fn a_clock_that_is_set_by_an_hour_is_followed_and_nothing_is_missed_for_it() {
    undisturbed(|| {
        let (_emulator, mut pilot) = flown(1.0, 10.0);
        pilot.set(EPOCH);
        let frames = pilot.frames(3);
        pilot.on_the_grid(&frames, EPOCH);
        for hours in [1.0, -1.0] {
            let to = later(EPOCH, hours * 3600.0);
            let before = pilot.client.status();
            pilot.set(to);
            // X-Val: ICD, section 5.5: a new time is followed after 0.25 s.
            let began = Instant::now();
            pilot.fly_until("it is sure", |_| {
                began.elapsed() > Duration::from_millis(400)
            });
            let doubted = if hours > 0.0 {
                Reason::ValueOutOfRange
            } else {
                Reason::TimeBackwards
            };
            let refused = pilot.client.refusals();
            let is_doubted = |reason: &Reason| *reason == doubted;
            assert!(
                !refused.is_empty() && refused.iter().all(is_doubted),
                "{refused:?}"
            );
            pilot.fly_until("frames of the other time", |client| {
                client.status().next_frame >= before.next_frame + 4
            });
            let mut frames = rest(&mut pilot.client);
            pilot.client.done(Command::FrameRate { hz: RATE_HZ });
            // After frames of the old time and one on the seam, all frames are of the new time.
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
            // Of the time that was told when it was sure.
            let zero = later(frames[0].time, EXPOSURE_S / 2.0 - 1.0 / RATE_HZ);
            pilot.on_the_grid(&frames, zero);
            let after = pilot.client.status();
            let off = after.clock_offset_s - before.clock_offset_s;
            let set_s = if hours > 0.0 { 3600.0 } else { -7200.0 };
            assert!((off - set_s).abs() < TIMEOUT.as_secs_f64(), "{off}");
            // X-Val: an hour has 72,000 periods; a machine that stands still may miss some.
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

/// A wire that holds some attitudes back, or brings one that is wrong, is no clock that was set.
#[test]
fn what_comes_late_moves_neither_time_nor_frames() {
    undisturbed(|| {
        let mut config = quick(RATE_HZ);
        config.run.out_of_order = skyloop::config::OutOfOrder::Use;
        let (_emulator, line) = on_memory(config, Clock::External);
        let mut pilot = Pilot::of(line, 1.0);
        pilot.client.status();
        pilot.set(EPOCH);
        let mut frames = pilot.frames(2);
        let offset_s = pilot.client.status().clock_offset_s;
        for n in 0..40_u32 {
            pilot.tick();
            // One after the other: 0.3 s late, a year ahead, two seconds late.
            let off_s = [-0.3, 3e7, -2.0][n as usize % 3];
            let wrong = later(pilot.time(), off_s);
            pilot.client.point(attitude(1_000_000 + n), wrong);
            std::thread::sleep(TICK);
        }
        let refused = pilot.client.refusals();
        // X-Val: one of three of 40 lies ahead; the others are used, as they are configured to be.
        assert_eq!(refused, [Reason::ValueOutOfRange; 13]);
        let status = pilot.client.status();
        let moved_s = (status.clock_offset_s - offset_s).abs();
        assert!(pilot.stood_still || moved_s < 0.05, "{moved_s}");
        frames.extend(rest(&mut pilot.client));
        pilot.on_the_grid(&frames, EPOCH);
        let counters = status.counters;
        // Two of three are earlier than one before them, and count.
        assert!(pilot.stood_still || counters.time_backwards == 27);
        assert_eq!(counters.bad_value, 13);
        // No exposure is made twice, and none is left out but for what a slow machine misses.
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
fn where_triggers_ask_for_frames_there_is_no_cadence_to_command() {
    let mut config = quick(RATE_HZ);
    config.run.trigger = skyloop::config::Trigger::Packet;
    let (_emulator, mut client) = memory_client(config, Clock::External);
    client.point(attitude(1), EPOCH);
    for command in [Command::SingleShot, Command::FrameRate { hz: 5.0 }] {
        client.send(command);
        client.refused(Reason::NotSupported, &["rigger"]);
    }
    // X-Val: a period is 0.05 s, which no exposure has to fit here.
    client.done(Command::Exposure { seconds: 0.2 });
    client.done(Command::Exposure { seconds: 0.02 });
    super::trigger(&mut client, 1, 0.05);
    let frame = client.frame();
    let open_s = seconds(frame.header.exposure_start, frame.header.exposure_end);
    assert!((open_s - 0.02).abs() < 2e-9);
}
