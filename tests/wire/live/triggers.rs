//! Triggers: one exposure at a time chosen by the client.

use super::{EXPOSURE_S, mid_s, quick, seconds, shows, trigger, turned, turning, xyzw};
use crate::support::client::{Client, counted};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, on_memory};
use skyloop::config::{Clock, Trigger};
use skyloop_protocols::{Attitude, AttitudeSource, Command, Mode, Reason, SyncState};
use std::time::{Duration, Instant};

/// Maximum number of waiting triggers and attitudes.
// X-Val: protocols/docs/icd.md, section 5.4: 64 attitudes wait; triggers likewise.
const MAX_WAITING: u32 = 64;

/// An emulator whose frames are triggered, and its client.
fn triggered(clock: Clock) -> (Running, Client<MemoryLine>) {
    let mut config = quick(20.0);
    config.run.trigger = Trigger::Packet;
    let (emulator, line) = on_memory(config, clock);
    (emulator, Client::new(line))
}

/// Sends the attitude of a body with [`RATES`], `s` after [`EPOCH`].
fn point(client: &mut Client<MemoryLine>, sequence: u32, s: f64) {
    client.point(turning(sequence, turned(s)), later(EPOCH, s));
}

#[test]
fn each_stepped_trigger_gives_a_frame_at_its_time() {
    let (_emulator, mut client) = triggered(Clock::Stepped);
    assert_eq!(client.status().mode, Mode::Stepped);
    for (sequence, s) in [(1, 0.0), (2, 0.4), (3, 0.8)] {
        point(&mut client, sequence, s);
    }
    assert_eq!(client.counters().frames_rendered, 0, "not requested");
    // Any order, any number but 0; the same time twice gives two frames.
    let requested = [(70, 0.1), (71, 0.5), (9, 0.3), (4_000_000_000, 0.3)];
    for (number, start_s) in requested {
        trigger(&mut client, number, start_s);
    }
    for (frame, (number, start_s)) in (0..).zip(requested) {
        let got = client.frame();
        assert_eq!((got.header.frame, got.end.trigger), (frame, number));
        // The last message before the middle of the exposure.
        let sequence = if start_s < 0.4 { 1 } else { 2 };
        assert_eq!(got.header.attitude_sequence, sequence);
        // X-Val: both times are whole nanoseconds.
        let start = seconds(later(EPOCH, start_s), got.header.exposure_start);
        assert!(start.abs() < 2e-9, "{start}");
        let mid_s = start_s + EXPOSURE_S / 2.0;
        assert!((super::mid_s(&got) - mid_s).abs() < 2e-9);
        assert_eq!(got.end.attitude_source, AttitudeSource::Interpolated);
        assert!(shows(&got, turned(mid_s)), "{number}");
        let label = got.label();
        assert_eq!(label["timing"]["trigger"], number);
        assert_eq!(label["timing"]["attitude"], "interpolated");
        // Stepped frames are reproducible to the byte.
        assert_eq!(label["timing"]["first_pixel_ms"], serde_json::Value::Null);
        let age_s = label["timing"]["attitude_age_s"].as_f64().unwrap();
        let sent_s = if sequence == 1 { 0.0 } else { 0.4 };
        assert!((age_s - (mid_s - sent_s)).abs() < 1e-6, "{age_s}");
        assert!((f64::from(got.end.timing.attitude_age_s) - age_s).abs() < 1e-6);
    }
    let counters = client.counters();
    counted(&counters, &[("triggers", 4), ("triggers_missed", 0)]);
    assert_eq!(counters.frames_delivered, 4);
}

/// Two attitudes at rest: the body rotates along the shorter arc, with smooth acceleration.
#[test]
fn attitudes_at_rest_are_interpolated_smoothly() {
    let (_emulator, mut client) = triggered(Clock::Stepped);
    let ends = [turned(0.0), turned(3.0)];
    for (sequence, q) in (1..).zip(ends) {
        let still = Attitude {
            q_icrf_to_body: xyzw(q),
            ..attitude(sequence)
        };
        client.point(still, later(EPOCH, f64::from(sequence - 1)));
    }
    for mid_s in [0.5, 0.25, 0.75] {
        trigger(&mut client, 1, mid_s - EXPOSURE_S / 2.0);
        // X-Val: Hermite's cubic at rest at both ends, by hand: 3 u^2 - 2 u^3.
        let share: f64 = 3.0 * mid_s * mid_s - 2.0 * mid_s * mid_s * mid_s;
        let frame = client.frame();
        // The trigger's time has units of 2^-32 s, the frame's of nanoseconds.
        let off = super::label_attitude(&frame).angle_to(&ends[0].slerp(&ends[1], share));
        assert!(off < 1e-8, "{mid_s}: {off}");
    }
}

/// Stepped mode: an exposure uses the attitudes around it, however late the last one is.
#[test]
fn late_triggers_use_the_attitudes_around_their_time() {
    let (_emulator, mut client) = triggered(Clock::Stepped);
    for n in 0..30 {
        point(&mut client, n, f64::from(n) * 0.2);
    }
    trigger(&mut client, 1, 1.1 - EXPOSURE_S / 2.0);
    let frame = client.frame();
    assert_eq!(frame.end.attitude_source, AttitudeSource::Interpolated);
    assert_eq!(frame.header.attitude_sequence, 5);
    assert!(shows(&frame, turned(1.1)));
    assert_eq!(client.counters().attitudes_future, 0);
}

#[test]
fn triggers_use_the_exposure_time_at_their_arrival() {
    for clock in [Clock::Stepped, Clock::External] {
        let (_emulator, mut client) = triggered(clock);
        client.window = None;
        point(&mut client, 1, 0.0);
        trigger(&mut client, 1, 0.3);
        client.send(Command::Exposure { seconds: 0.04 });
        trigger(&mut client, 2, 0.5);
        for (number, start_s, exposure_s) in [(1, 0.3, EXPOSURE_S), (2, 0.5, 0.04)] {
            let frame = client.frame();
            assert_eq!(frame.end.trigger, number);
            let header = &frame.header;
            let start = seconds(later(EPOCH, start_s), header.exposure_start);
            let open = seconds(header.exposure_start, header.exposure_end);
            assert!(start.abs() < 2e-9, "{clock:?} {number}: {start}");
            assert!((open - exposure_s).abs() < 2e-9, "{clock:?}: {open}");
        }
    }
}

#[test]
fn triggers_without_an_attitude_are_missed() {
    for clock in [Clock::Stepped, Clock::External] {
        let (_emulator, mut client) = triggered(clock);
        let start = later(EPOCH, -1.0);
        client.send(Command::Trigger { number: 5, start });
        await_that("the trigger is missed", || {
            client.counters().triggers_missed == 1
        });
        let status = client.status();
        counted(&status.counters, &[("triggers", 1), ("frames_rendered", 0)]);
        // The time in the packet is used nevertheless.
        let followed = match clock {
            Clock::External => SyncState::Locked,
            _ => SyncState::Free,
        };
        assert_eq!(status.sync, followed);
        // The next trigger, with an attitude, gives a frame.
        point(&mut client, 1, 0.0);
        trigger(&mut client, 6, 0.0);
        assert_eq!(client.frame().end.trigger, 6);
    }
}

#[test]
fn external_clock_triggers_give_frames_in_the_order_of_their_times() {
    let (_emulator, mut client) = triggered(Clock::External);
    // While the emulator has no time, all triggers wait.
    for (number, start_s) in [(3, 0.6), (1, 0.2), (2, 0.4), (4, 0.6)] {
        trigger(&mut client, number, start_s);
    }
    let status = client.status();
    assert_eq!(
        (status.mode, status.sync),
        (Mode::External, SyncState::Waiting)
    );
    assert_eq!(status.counters.triggers, 4);
    let began = Instant::now();
    point(&mut client, 1, 0.0);
    for (number, start_s) in [(1, 0.2), (2, 0.4), (3, 0.6), (4, 0.6)] {
        let frame = client.frame();
        assert_eq!(frame.end.trigger, number);
        let start = seconds(later(EPOCH, start_s), frame.header.exposure_start);
        assert!(start.abs() < 2e-9, "{start}");
        assert!(shows(&frame, turned(mid_s(&frame))));
        let ended = Duration::from_secs_f64(start_s + EXPOSURE_S);
        assert!(began.elapsed() >= ended, "never early");
    }
    // There is no cadence. X-Val: four periods.
    assert!(client.recv(Duration::from_millis(200)).is_none());
    client.has_counted(&[("triggers_missed", 0), ("exposures_missed", 0)]);
}

#[test]
fn triggers_above_the_limit_are_refused_as_busy() {
    let (_emulator, mut client) = triggered(Clock::External);
    // An hour ahead of the client's time, in reverse order.
    point(&mut client, 1, 0.0);
    for number in (1..=MAX_WAITING).rev() {
        trigger(&mut client, number, 3600.0 + f64::from(number));
    }
    trigger(&mut client, 1000, 0.0);
    client.refused(Reason::Busy, &["64 triggers"]);
    let counters = client.counters();
    counted(&counters, &[("triggers", MAX_WAITING), ("refused", 1)]);
    assert_eq!(counters.triggers_missed, 0);
    // A Reset drops them, so further triggers are accepted.
    client.done(Command::Reset);
    assert_eq!(client.counters().frames_abandoned, MAX_WAITING);
    point(&mut client, 2, 0.0);
    trigger(&mut client, 7, 0.01);
    assert_eq!(client.frame().end.trigger, 7);
}

#[test]
fn triggers_far_ahead_are_refused() {
    let (_emulator, mut client) = triggered(Clock::External);
    point(&mut client, 1, 0.0);
    // X-Val: protocols/docs/icd.md, section 5.5: more than a day ahead is refused.
    trigger(&mut client, 1, 86_500.0);
    client.refused(Reason::ValueOutOfRange, &["at most 86400 s"]);
    trigger(&mut client, 2, 86_300.0);
    trigger(&mut client, 3, 0.01);
    assert_eq!(client.frame().end.trigger, 3);
    client.has_counted(&[("triggers", 2), ("bad_value", 1)]);
}

/// After a clock step, earlier triggers refer to the old clock.
#[test]
fn triggers_before_a_clock_step_are_missed() {
    let (_emulator, mut client) = triggered(Clock::External);
    point(&mut client, 1, 0.0);
    for number in 1..=MAX_WAITING {
        trigger(&mut client, number, 60.0 + f64::from(number));
    }
    // An hour back; otherwise the triggers would wait for an hour.
    let began = Instant::now();
    await_that("the step is accepted", || {
        point(&mut client, 2, -3600.0 + began.elapsed().as_secs_f64());
        std::thread::sleep(Duration::from_millis(20));
        let refused = client.refusals();
        assert!(
            refused
                .iter()
                .all(|reason| *reason == Reason::TimeBackwards)
        );
        refused.is_empty()
    });
    let now_s = -3600.0 + began.elapsed().as_secs_f64();
    trigger(&mut client, 100, now_s + 0.2);
    let frame = client.frame();
    assert_eq!(
        (frame.end.trigger, frame.header.attitude_sequence),
        (100, 2)
    );
    let counters = client.counters();
    counted(
        &counters,
        &[
            ("triggers", MAX_WAITING + 1),
            ("triggers_missed", MAX_WAITING),
        ],
    );
    assert_eq!(counters.refused, 0);
}

#[test]
fn triggers_are_refused_at_other_trigger_settings() {
    for clock in [Clock::Stepped, Clock::Wall, Clock::External] {
        // A rate so low that no frame follows the cadence.
        let (_emulator, mut client) = memory_client(quick(1e-3), clock);
        client.point(attitude(1), EPOCH);
        if clock == Clock::Stepped {
            client.frame();
        }
        let before = client.counters();
        trigger(&mut client, 1, 0.0);
        client.refused(Reason::NotSupported, &["run.trigger"]);
        let after = client.counters();
        assert_eq!((after.triggers, after.refused), (0, 1));
        assert_eq!(after.frames_rendered, before.frames_rendered);
    }
}
