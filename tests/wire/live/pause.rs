//! Pause and Resume: no clock exposes during a pause, and time continues afterwards.

use super::{in_flight, mid_s, quick, seconds, trigger, whole_periods};
use crate::support::client::{Client, Received};
use crate::support::line::{Line, MemoryLine};
use crate::support::{
    EPOCH, Running, attitude, await_that, later, memory_client, on_memory, options,
};
use skyloop::config::{Clock, Trigger};
use skyloop::link;
use skyloop_firmware_sim::flight_computer::{FlightComputer, Pause};
use skyloop_orbit::time::parse_utc;
use skyloop_protocols::{Command, Reason, Status, SyncState, WireTime};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 50.0;
/// X-Val: ten periods.
const PAUSE_TIME: Duration = Duration::from_millis(200);

/// An emulator and its client with full credit and one sent attitude.
fn started(clock: Clock) -> (Running, Client<MemoryLine>) {
    let (emulator, mut client) = memory_client(quick(RATE_HZ), clock);
    client.window = None;
    client.send(Command::Credit { packets: 1 << 20 });
    client.point(attitude(1), EPOCH);
    (emulator, client)
}

/// Periods from `from` to the end of a frame's exposure: a whole number.
fn periods(from: WireTime, frame: &Received) -> f64 {
    whole_periods(from, frame, RATE_HZ)
}

/// Pauses and receives the frames in flight. Returns them with the status of the pause.
fn paused<L: Line>(emulator: &Running, client: &mut Client<L>) -> (Vec<Received>, Status) {
    client.done(Command::Pause);
    let frames = in_flight(emulator, client);
    (frames, client.status())
}

/// Requires that no frame has been rendered or missed between two states.
#[track_caller]
fn assert_unchanged(before: &Status, after: &Status) {
    let exposures = |status: &Status| {
        let counters = status.counters;
        (counters.frames_rendered, counters.exposures_missed)
    };
    assert_eq!(exposures(before), exposures(after));
}

#[test]
fn wall_clock_exposures_and_time_stop_during_a_pause() {
    let (emulator, mut client) = started(Clock::Wall);
    let mut frames = vec![client.frame()];
    let (more, before) = paused(&emulator, &mut client);
    frames.extend(more);
    assert_eq!(before.sync, SyncState::Paused);
    // A second Pause changes nothing; a rate applies later; a single shot is refused.
    client.done(Command::Pause);
    client.done(Command::FrameRate { hz: 25.0 });
    client.send(Command::SingleShot);
    client.refused(Reason::Busy, &["send Resume first"]);
    std::thread::sleep(PAUSE_TIME);
    assert_unchanged(&before, &client.status());
    let last_s = mid_s(&frames[frames.len() - 1]);

    client.done(Command::Resume);
    let first = client.frame();
    // X-Val: at most two exposures of 1/50 s were in flight, and missed ones are counted; then one
    // period of 1/25 s. The pause was ten times longer.
    let missed = f64::from(client.counters().exposures_missed);
    let elapsed_s = mid_s(&first) - last_s;
    assert!(
        (0.04..0.04 + (3.0 + missed) / RATE_HZ).contains(&elapsed_s),
        "{elapsed_s} s, {missed} missed"
    );
    assert_eq!(client.status().sync, SyncState::Free);
    client.done(Command::Resume);
    // An attitude sets the time, whatever was extrapolated.
    let to = later(EPOCH, 500.0);
    client.point(attitude(2), to);
    let frame = super::frame_of(&mut client, 2);
    // X-Val: one period less half an exposure, and whole periods.
    whole_periods(to, &frame, 25.0);
}

#[test]
fn attitudes_during_a_pause_set_the_time() {
    let (emulator, mut client) = started(Clock::Wall);
    client.frame();
    paused(&emulator, &mut client);
    let to = later(EPOCH, 300.0);
    client.point(attitude(2), to);
    std::thread::sleep(PAUSE_TIME);
    let counters = client.counters();
    assert_eq!(counters.attitudes, 2);
    client.done(Command::Resume);
    let frame = client.frame();
    assert_eq!(frame.header.attitude_sequence, 2);
    let periods = periods(to, &frame);
    // The pause does not count, but a paused machine may have missed some exposures.
    assert!(
        periods < 1.5 + f64::from(client.counters().exposures_missed),
        "{periods}"
    );
}

#[test]
fn stepped_attitudes_wait_during_a_pause() {
    let (_emulator, mut client) = memory_client(quick(RATE_HZ), Clock::Stepped);
    client.good_frame(1);
    client.done(Command::Pause);
    // X-Val: protocols/docs/icd.md, section 5.10: 64 wait.
    for sequence in 2..66 {
        client.point(attitude(sequence), later(EPOCH, f64::from(sequence)));
    }
    client.point(attitude(66), later(EPOCH, 66.0));
    client.refused(Reason::Busy, &[]);
    assert!(client.recv(PAUSE_TIME).is_none());
    let status = client.status();
    assert_eq!((status.sync, status.next_frame), (SyncState::Paused, 1));
    client.done(Command::Resume);
    for sequence in 2..66 {
        let frame = client.frame();
        assert_eq!(frame.header.attitude_sequence, sequence);
        assert_eq!(frame.end.sync, SyncState::Free);
    }
    client.point(attitude(67), later(EPOCH, 67.0));
    assert_eq!(client.frame().header.attitude_sequence, 67);
}

#[test]
fn a_reset_ends_a_pause() {
    for clock in [Clock::Stepped, Clock::Wall, Clock::External] {
        let (_emulator, mut client) = memory_client(quick(RATE_HZ), clock);
        client.done(Command::Pause);
        client.point(attitude(1), EPOCH);
        assert!(client.recv(PAUSE_TIME).is_none(), "{clock:?}");
        client.done(Command::Reset);
        assert_ne!(client.status().sync, SyncState::Paused);
        client.good_frame(2);
    }
}

#[test]
fn pauses_are_refused_during_a_single_shot() {
    let (_emulator, mut client) = memory_client(quick(1e-3), Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.done(Command::Exposure { seconds: 0.3 });
    client.done(Command::SingleShot);
    client.send(Command::Pause);
    let nack = client.nack();
    assert_eq!(nack.reason, Reason::Busy);
    assert!(
        nack.detail.starts_with("Pause: a single shot"),
        "{}",
        nack.detail
    );
    client.frame();
    // The cadence stays off after the single shot, and after the pause.
    client.done(Command::Pause);
    client.done(Command::Resume);
    client.done(Command::SingleShot);
    assert_eq!(client.frame().header.frame, 1);
}

#[test]
fn external_clock_pauses_may_have_any_length() {
    let (emulator, mut client) = started(Clock::External);
    client.frame();
    let (_, before) = paused(&emulator, &mut client);
    // Neither a stopped client clock nor a step of an hour counts as a jump.
    for (sequence, s) in [(2, 0.05), (3, 0.05), (4, 3600.0)] {
        client.point(attitude(sequence), later(EPOCH, s));
        std::thread::sleep(PAUSE_TIME);
    }
    let status = client.status();
    assert_eq!(status.sync, SyncState::Paused);
    assert_unchanged(&before, &status);
    client.done(Command::Resume);
    let to = later(EPOCH, 3600.0);
    client.point(attitude(5), to);
    let frame = super::frame_of(&mut client, 5);
    periods(to, &frame);
    assert_eq!(client.status().clock_offset_s, 0.0);
}

#[test]
fn clocks_set_back_during_a_pause_are_followed() {
    for clock in [Clock::Wall, Clock::External] {
        let (emulator, mut client) = started(clock);
        client.frame();
        paused(&emulator, &mut client);
        // An earlier time during the pause, and one after it.
        let back = later(EPOCH, -300.0);
        client.point(attitude(2), later(back, 10.0));
        client.done(Command::Resume);
        client.point(attitude(3), back);
        let frame = super::frame_of(&mut client, 3);
        let since_s = seconds(back, frame.time);
        assert!((0.0..10.0).contains(&since_s), "{clock:?}: {since_s}");
        client.has_counted(&[("attitudes", 3), ("time_backwards", 0)]);
    }
}

#[test]
fn triggers_wait_during_a_pause() {
    let mut config = quick(RATE_HZ);
    config.run.trigger = Trigger::Packet;
    // X-Val: less than the pause, which does not count as lateness.
    const LONG: Duration = Duration::from_secs(3);
    config.run.latency_s = Some(2.5);
    let (_emulator, line) = on_memory(config, Clock::External);
    let mut client = Client::<MemoryLine>::new(line);
    client.point(attitude(1), EPOCH);
    trigger(&mut client, 7, 0.1);
    client.done(Command::Pause);
    trigger(&mut client, 8, -5.0);
    let began = std::time::Instant::now();
    // X-Val: the trigger's exposure would have ended after 0.11 s.
    assert!(client.recv(LONG).is_none() || began.elapsed() > LONG);
    client.done(Command::Resume);
    // A trigger of the past is exposed at once.
    let frame = client.frame();
    assert_eq!((frame.end.trigger, frame.end.in_time), (8, true));
    let frame = client.frame();
    assert_eq!(frame.end.trigger, 7);
    assert!((mid_s(&frame) - 0.105).abs() < 1e-6);
}

#[test]
fn triggers_of_a_clock_set_back_are_missed() {
    let mut config = quick(RATE_HZ);
    config.run.trigger = Trigger::Packet;
    let (_emulator, line) = on_memory(config, Clock::External);
    let mut client = Client::<MemoryLine>::new(line);
    client.point(attitude(1), EPOCH);
    client.done(Command::Pause);
    // The time of the pause, however long the machine took to reach it.
    client.point(attitude(2), later(EPOCH, 100.0));
    trigger(&mut client, 7, 100.1);
    // Late within the tolerance of a wire, twice, then set back by an hour.
    client.point(attitude(3), later(EPOCH, 99.9));
    client.point(attitude(4), later(EPOCH, 99.8));
    assert_eq!(client.counters().triggers_missed, 0);
    client.point(attitude(5), later(EPOCH, -3600.0));
    assert_eq!(client.counters().triggers_missed, 1);
    client.done(Command::Resume);
    trigger(&mut client, 8, -3599.9);
    assert_eq!(client.frame().end.trigger, 8);
}

#[test]
fn the_flight_computer_loses_nothing_in_a_pause() {
    // X-Val: 20 Hz for 0.4 s are at most 9 attitudes without the pause, and for 0.98 s 20.
    await_that("attitudes are sent during the pause", || {
        attitudes_with_a_pause().is_some_and(|attitudes| attitudes > 10)
    });
}

/// Runs 20 frames with a pause. Returns the number of attitudes sent, or none if a thread was
/// delayed.
fn attitudes_with_a_pause() -> Option<u32> {
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let mut config = quick(RATE_HZ);
    config.objects.clear();
    let emulator = Running::start(config, Clock::Wall, wire);
    let lasts = Duration::from_millis(600);
    let start = parse_utc("2019-06-15T23:35:50").unwrap();
    // The time-out is shorter than the pause: no frame counts as lost in it.
    let mission = super::mission(start, 20, Duration::from_millis(500));
    let after = Duration::from_millis(100);
    let computer = FlightComputer::new(port, mission)
        .with_pause(Some(Pause { after, lasts }))
        .without_detection();
    let began = Instant::now();
    let report = computer.run(|_| ControlFlow::Continue(())).ok()?;
    assert_eq!(report.refused, 0);
    if (report.frames, report.lost) != (20, 0) {
        return None;
    }
    // X-Val: 20 periods of 20 ms, and the pause.
    assert!(began.elapsed() >= Duration::from_millis(980));
    Some(emulator.end().attitudes)
}
