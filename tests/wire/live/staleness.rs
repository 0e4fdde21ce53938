//! Attitudes that are too old, of the future, or out of order.

use super::{EXPOSURE_S, mid_s, quick, rest, shows, trigger, turned, turning};
use crate::support::client::{Client, Received, counted};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, on_memory};
use nalgebra::UnitQuaternion;
use skyloop::config::{Clock, Config, OnStale, OutOfOrder, Staleness, Trigger};
use skyloop_protocols::{AttitudeSource, Counters, Reason};

/// Source of a frame's attitude: in its end, in its label, and the counters (stale, future).
type Source = (AttitudeSource, &'static str, [u32; 2]);

const EXTRAPOLATED: Source = (AttitudeSource::Extrapolated, "extrapolated", [0, 0]);
const FUTURE: Source = (AttitudeSource::Future, "future", [0, 1]);

/// Limit of an attitude's age, s.
const LIMIT_S: f64 = 0.5;

/// A stepped emulator, with exact ages: frames come at triggers.
fn stepped(then: OnStale, out_of_order: OutOfOrder) -> (Running, Client<MemoryLine>) {
    let mut config: Config = quick(20.0);
    config.run.trigger = Trigger::Packet;
    config.run.out_of_order = out_of_order;
    config.run.staleness = Staleness {
        limit_s: LIMIT_S,
        then,
    };
    let (emulator, line) = on_memory(config, Clock::Stepped);
    (emulator, Client::new(line))
}

/// Sends this attitude, with rates [`RATES`], for the time `s` after [`EPOCH`].
fn point(client: &mut Client<MemoryLine>, sequence: u32, s: f64, q: UnitQuaternion<f64>) {
    client.point(turning(sequence, q), later(EPOCH, s));
}

/// The frame of an exposure around `mid_s` after [`EPOCH`], which must have this attitude source.
fn frame_at(client: &mut Client<MemoryLine>, mid_s: f64, source: Source) -> Received {
    let before = client.counters();
    trigger(client, 1, mid_s - EXPOSURE_S / 2.0);
    let frame = client.frame();
    let after = client.counters();
    let moved = |of: fn(&Counters) -> u32| of(&after) - of(&before);
    let counted = [moved(|c| c.attitudes_stale), moved(|c| c.attitudes_future)];
    let label = frame.label();
    assert_eq!(frame.end.attitude_source, source.0, "{mid_s}");
    assert_eq!(label["timing"]["attitude"], source.1, "{mid_s}");
    assert_eq!(counted, source.2, "{mid_s}");
    frame
}

#[test]
fn within_the_limit_attitudes_are_extrapolated_at_any_policy() {
    for then in [OnStale::Extrapolate, OnStale::Hold, OnStale::Invalid] {
        let (_emulator, mut client) = stepped(then, OutOfOrder::Refuse);
        point(&mut client, 1, 0.0, turned(0.0));
        for (mid_s, source) in [
            (LIMIT_S - 0.01, EXTRAPOLATED),
            // Before the only attitude, it is extrapolated backwards.
            (-LIMIT_S, FUTURE),
        ] {
            let frame = frame_at(&mut client, mid_s, source);
            assert!(shows(&frame, turned(mid_s)), "{then:?} {mid_s}");
            let age_s = f64::from(frame.end.timing.attitude_age_s);
            assert!((age_s - mid_s).abs() < 1e-6, "{age_s}");
        }
        let exact = (AttitudeSource::Exact, "exact", [0, 0]);
        // X-Val: an eighth of a second is exact in units of 2^-32 s and of nanoseconds.
        let frame = frame_at_exactly(&mut client, exact);
        assert!(shows(&frame, turned(0.0)));
    }
}

/// The frame with the attitude exactly in its middle.
fn frame_at_exactly(client: &mut Client<MemoryLine>, source: Source) -> Received {
    client.done(skyloop_protocols::Command::Exposure { seconds: 0.25 });
    trigger(client, 1, -0.125);
    let frame = client.frame();
    assert_eq!(frame.end.attitude_source, source.0);
    assert_eq!(frame.label()["timing"]["attitude"], source.1);
    frame
}

/// After a gap, an attitude is used near its time. Distant attitudes are not interpolated.
#[test]
fn exposures_in_a_gap_are_not_interpolated() {
    const GAP_S: f64 = 10.0;
    let (_emulator, mut client) = stepped(OnStale::Extrapolate, OutOfOrder::Refuse);
    point(&mut client, 1, 0.0, turned(0.0));
    // Different from the first attitude extrapolated by its rates.
    let jumped = turned(3.0);
    point(&mut client, 2, GAP_S, jumped);
    let after = |s: f64| turned(3.0 + s - GAP_S);
    for (mid_s, source, expected) in [
        (LIMIT_S - 0.01, EXTRAPOLATED, turned(LIMIT_S - 0.01)),
        (5.0, FUTURE, after(5.0)),
        (GAP_S - 0.1, FUTURE, after(GAP_S - 0.1)),
    ] {
        let frame = frame_at(&mut client, mid_s, source);
        assert!(shows(&frame, expected), "{mid_s}");
    }
    // Within the limit of both, they are interpolated.
    point(&mut client, 3, GAP_S + LIMIT_S, after(GAP_S + LIMIT_S));
    let interpolated = (AttitudeSource::Interpolated, "interpolated", [0, 0]);
    let frame = frame_at(&mut client, GAP_S + 0.2, interpolated);
    assert!(shows(&frame, after(GAP_S + 0.2)));
}

#[test]
fn beyond_the_limit_each_policy_sets_its_attitude_and_source() {
    // Extrapolated, or held at the limit.
    let extrapolated: fn(f64) -> f64 = |s| s;
    let held: fn(f64) -> f64 = |s| s.clamp(-LIMIT_S, LIMIT_S);
    use AttitudeSource::{Future, Held, Invalid, Stale};
    for (then, at, source, word, is_future) in [
        (OnStale::Extrapolate, extrapolated, Stale, "stale", false),
        (OnStale::Extrapolate, extrapolated, Future, "future", true),
        (OnStale::Hold, held, Held, "held", false),
        (OnStale::Hold, held, Held, "held", true),
        (OnStale::Invalid, held, Invalid, "invalid", false),
        (OnStale::Invalid, held, Invalid, "invalid", true),
    ] {
        let (_emulator, mut client) = stepped(then, OutOfOrder::Refuse);
        point(&mut client, 1, 0.0, turned(0.0));
        for apart_s in [LIMIT_S + 0.02, 7.0] {
            let (mid_s, counted) = if is_future {
                (-apart_s, [0, 1])
            } else {
                (apart_s, [1, 0])
            };
            let frame = frame_at(&mut client, mid_s, (source, word, counted));
            assert!(shows(&frame, turned(at(mid_s))), "{then:?} {mid_s}");
            // The observer's position does not depend on the attitude.
            assert!((super::mid_s(&frame) - mid_s).abs() < 1e-8);
            let age_s = f64::from(frame.end.timing.attitude_age_s);
            assert!((age_s - mid_s).abs() < 1e-6, "{age_s}");
        }
    }
}

#[test]
fn earlier_attitudes_are_refused() {
    let (_emulator, mut client) = stepped(OnStale::Extrapolate, OutOfOrder::Refuse);
    point(&mut client, 1, 0.0, turned(0.0));
    point(&mut client, 3, 0.4, turned(0.4));
    point(&mut client, 2, 0.2, turned(1.0));
    let nack = client.nack();
    assert_eq!(nack.reason, Reason::TimeBackwards);
    let interpolated = (AttitudeSource::Interpolated, "interpolated", [0, 0]);
    let frame = frame_at(&mut client, 0.2, interpolated);
    assert_eq!(frame.header.attitude_sequence, 1);
    assert!(shows(&frame, turned(0.2)));
    client.has_counted(&[("attitudes", 2), ("time_backwards", 1)]);
}

#[test]
fn earlier_attitudes_are_inserted_if_allowed() {
    let (_emulator, mut client) = stepped(OnStale::Extrapolate, OutOfOrder::Use);
    // The attitude in between differs from the interpolation.
    point(&mut client, 1, 0.0, turned(0.0));
    point(&mut client, 3, 0.4, turned(0.4));
    let elsewhere = turned(1.0);
    point(&mut client, 2, 0.2, elsewhere);
    let interpolated = (AttitudeSource::Interpolated, "interpolated", [0, 0]);
    let frame = frame_at(&mut client, 0.2 + 1e-8, interpolated);
    assert_eq!(frame.header.attitude_sequence, 2);
    assert_eq!(frame.label()["timing"]["out_of_order"], true);
    assert!(super::label_attitude(&frame).angle_to(&elsewhere) < 1e-7);
    // X-Val: halfway between two messages, each has half the weight, extrapolated by its rates.
    let halfway = turned(0.1).slerp(&turned(0.9), 0.5);
    let frame = frame_at(&mut client, 0.1, interpolated);
    assert_eq!(frame.header.attitude_sequence, 1);
    assert!(frame.label()["timing"].get("out_of_order").is_none());
    assert!(super::label_attitude(&frame).angle_to(&halfway) < 1e-7);
    client.has_counted(&[("attitudes", 3), ("time_backwards", 1)]);
    // The attitude with the latest time stays the last.
    let frame = frame_at(&mut client, 0.5, EXTRAPOLATED);
    assert_eq!(frame.header.attitude_sequence, 3);
    assert!(shows(&frame, turned(0.5)));
}

/// Wall clock: a client that falls silent.
#[test]
fn frames_after_the_last_attitude_are_flagged() {
    let mut config = quick(20.0);
    config.run.staleness = Staleness {
        limit_s: 0.2,
        then: OnStale::Hold,
    };
    let (emulator, mut client) = memory_client(config, Clock::Wall);
    client.window = None;
    point(&mut client, 1, 0.0, turned(0.0));
    let mut frames = Vec::new();
    let is_held = |frame: &Received| frame.end.attitude_source == AttitudeSource::Held;
    await_that("three held frames", || {
        frames.push(client.frame());
        frames.iter().filter(|frame| is_held(frame)).count() == 3
    });
    frames.extend(rest(&emulator, &mut client));
    for frame in &frames {
        let mid_s = mid_s(frame);
        assert_eq!(is_held(frame), mid_s > 0.2, "{mid_s}");
        assert!(shows(frame, turned(mid_s.min(0.2))), "{mid_s}");
    }
    let flagged = frames.iter().filter(|frame| is_held(frame)).count() as u32;
    let counters = emulator.end();
    let dropped = counters.frames_dropped;
    assert_eq!(counters.frames_rendered, frames.len() as u32 + dropped);
    assert!((flagged..=flagged + dropped).contains(&counters.attitudes_stale));
    assert_eq!(counters.attitudes_future, 0);
}

/// A single attitude far in the future is ignored while there are current ones.
#[test]
fn far_future_attitudes_are_ignored() {
    for out_of_order in [OutOfOrder::Refuse, OutOfOrder::Use] {
        assert_far_future_ignored(out_of_order);
    }
}

fn assert_far_future_ignored(out_of_order: OutOfOrder) {
    let mut config = quick(20.0);
    config.run.out_of_order = out_of_order;
    // X-Val: shorter pauses of the machine do not make attitudes stale.
    config.run.staleness.limit_s = 5.0;
    let (_emulator, mut client) = memory_client(config, Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.frame();
    client.point(attitude(1000), later(EPOCH, 3600.0));
    let began = std::time::Instant::now();
    for sequence in 2..12 {
        let s = began.elapsed().as_secs_f64();
        client.point(attitude(sequence), later(EPOCH, s));
        let frame = client.frame();
        assert!(
            frame.header.attitude_sequence < 12,
            "{}",
            frame.header.attitude_sequence
        );
        assert_ne!(frame.end.attitude_source, AttitudeSource::Future);
    }
    let counters = client.counters();
    counted(&counters, &[("attitudes", 12), ("attitudes_future", 0)]);
    assert_eq!(counters.time_backwards, 0);
    // It is not used in a silence of the client either.
    await_that("the last current attitude is stale", || {
        let frame = client.frame();
        assert_eq!(frame.header.attitude_sequence, 11);
        assert_ne!(frame.end.attitude_source, AttitudeSource::Future);
        frame.end.attitude_source == AttitudeSource::Stale
    });
}
