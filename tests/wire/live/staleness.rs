//! Attitudes that are too old, of the future, or out of order.

use super::{EXPOSURE_S, mid_s, quick, rest, shows, trigger, turned, turning};
use crate::support::client::{Client, Received, counted};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, on_memory};
use nalgebra::UnitQuaternion;
use skyloop::config::{Clock, Config, OnStale, OutOfOrder, Staleness, Trigger};
use skyloop_protocols::{AttitudeSource, Counters, Reason};

/// What is told of a frame: by its end, in its label, and which counters it moves (stale, future).
type Told = (AttitudeSource, &'static str, [u32; 2]);

const EXTRAPOLATED: Told = (AttitudeSource::Extrapolated, "extrapolated", [0, 0]);
const FUTURE: Told = (AttitudeSource::Future, "future", [0, 1]);

/// Limit of an attitude's age, s.
const LIMIT_S: f64 = 0.5;

/// In step, where ages are exact: frames come at triggers.
fn in_step(then: OnStale, out_of_order: OutOfOrder) -> (Running, Client<MemoryLine>) {
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

/// Sends this attitude, turning at [`RATES`], for the time `s` after [`EPOCH`].
fn point(client: &mut Client<MemoryLine>, sequence: u32, s: f64, q: UnitQuaternion<f64>) {
    client.point(turning(sequence, q), later(EPOCH, s));
}

/// The frame of an exposure around `mid_s` after [`EPOCH`]. It says this of its attitude.
fn frame_at(client: &mut Client<MemoryLine>, mid_s: f64, told: Told) -> Received {
    let before = client.counters();
    trigger(client, 1, mid_s - EXPOSURE_S / 2.0);
    let frame = client.frame();
    let after = client.counters();
    let moved = |of: fn(&Counters) -> u32| of(&after) - of(&before);
    let counted = [moved(|c| c.attitudes_stale), moved(|c| c.attitudes_future)];
    let label = frame.label();
    assert_eq!(frame.end.attitude_source, told.0, "{mid_s}");
    assert_eq!(label["timing"]["attitude"], told.1, "{mid_s}");
    assert_eq!(counted, told.2, "{mid_s}");
    frame
}

#[test]
fn within_the_limit_an_attitude_is_carried_by_its_rates_whatever_the_policy() {
    for then in [OnStale::Extrapolate, OnStale::Hold, OnStale::Invalid] {
        let (_emulator, mut client) = in_step(then, OutOfOrder::Refuse);
        point(&mut client, 1, 0.0, turned(0.0));
        for (mid_s, told) in [
            (LIMIT_S - 0.01, EXTRAPOLATED),
            // An exposure before the only attitude has that one, carried back.
            (-LIMIT_S, FUTURE),
        ] {
            let frame = frame_at(&mut client, mid_s, told);
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

/// The frame in whose middle the attitude is.
fn frame_at_exactly(client: &mut Client<MemoryLine>, told: Told) -> Received {
    client.done(skyloop_protocols::Command::Exposure { seconds: 0.25 });
    trigger(client, 1, -0.125);
    let frame = client.frame();
    assert_eq!(frame.end.attitude_source, told.0);
    assert_eq!(frame.label()["timing"]["attitude"], told.1);
    frame
}

/// After a gap an attitude counts where it is near. Between two that are far, nothing is
/// interpolated.
#[test]
fn across_a_gap_no_exposure_is_interpolated() {
    const GAP_S: f64 = 10.0;
    let (_emulator, mut client) = in_step(OnStale::Extrapolate, OutOfOrder::Refuse);
    point(&mut client, 1, 0.0, turned(0.0));
    // Not where the rates of the first would have taken it.
    let jumped = turned(3.0);
    point(&mut client, 2, GAP_S, jumped);
    let after = |s: f64| turned(3.0 + s - GAP_S);
    for (mid_s, told, shown) in [
        (LIMIT_S - 0.01, EXTRAPOLATED, turned(LIMIT_S - 0.01)),
        (5.0, FUTURE, after(5.0)),
        (GAP_S - 0.1, FUTURE, after(GAP_S - 0.1)),
    ] {
        let frame = frame_at(&mut client, mid_s, told);
        assert!(shows(&frame, shown), "{mid_s}");
    }
    // Within the limit of both they are interpolated.
    point(&mut client, 3, GAP_S + LIMIT_S, after(GAP_S + LIMIT_S));
    let interpolated = (AttitudeSource::Interpolated, "interpolated", [0, 0]);
    let frame = frame_at(&mut client, GAP_S + 0.2, interpolated);
    assert!(shows(&frame, after(GAP_S + 0.2)));
}

#[test]
fn beyond_the_limit_each_policy_shows_and_says_what_it_does() {
    // Who turns on, and who stands still where it was at the limit.
    let carried: fn(f64) -> f64 = |s| s;
    let held: fn(f64) -> f64 = |s| s.clamp(-LIMIT_S, LIMIT_S);
    use AttitudeSource::{Future, Held, Invalid, Stale};
    for (then, at, source, word, is_future) in [
        (OnStale::Extrapolate, carried, Stale, "stale", false),
        (OnStale::Extrapolate, carried, Future, "future", true),
        (OnStale::Hold, held, Held, "held", false),
        (OnStale::Hold, held, Held, "held", true),
        (OnStale::Invalid, held, Invalid, "invalid", false),
        (OnStale::Invalid, held, Invalid, "invalid", true),
    ] {
        let (_emulator, mut client) = in_step(then, OutOfOrder::Refuse);
        point(&mut client, 1, 0.0, turned(0.0));
        for apart_s in [LIMIT_S + 0.02, 7.0] {
            let (mid_s, counted) = match is_future {
                true => (-apart_s, [0, 1]),
                false => (apart_s, [1, 0]),
            };
            let frame = frame_at(&mut client, mid_s, (source, word, counted));
            assert!(shows(&frame, turned(at(mid_s))), "{then:?} {mid_s}");
            // Wherever the body points, the observer moves on.
            assert!((super::mid_s(&frame) - mid_s).abs() < 1e-8);
            let age_s = f64::from(frame.end.timing.attitude_age_s);
            assert!((age_s - mid_s).abs() < 1e-6, "{age_s}");
        }
    }
}

#[test]
fn an_attitude_before_the_last_one_is_refused() {
    let (_emulator, mut client) = in_step(OnStale::Extrapolate, OutOfOrder::Refuse);
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
fn an_attitude_before_the_last_one_takes_its_place_where_that_is_allowed() {
    let (_emulator, mut client) = in_step(OnStale::Extrapolate, OutOfOrder::Use);
    // The one in between says that the body was elsewhere.
    point(&mut client, 1, 0.0, turned(0.0));
    point(&mut client, 3, 0.4, turned(0.4));
    let elsewhere = turned(1.0);
    point(&mut client, 2, 0.2, elsewhere);
    let interpolated = (AttitudeSource::Interpolated, "interpolated", [0, 0]);
    let frame = frame_at(&mut client, 0.2 + 1e-8, interpolated);
    assert_eq!(frame.header.attitude_sequence, 2);
    assert_eq!(frame.label()["timing"]["out_of_order"], true);
    assert!(super::shown(&frame).angle_to(&elsewhere) < 1e-7);
    // X-Val: halfway between two messages each counts as much, carried there by its rates.
    let halfway = turned(0.1).slerp(&turned(0.9), 0.5);
    let frame = frame_at(&mut client, 0.1, interpolated);
    assert_eq!(frame.header.attitude_sequence, 1);
    assert!(frame.label()["timing"].get("out_of_order").is_none());
    assert!(super::shown(&frame).angle_to(&halfway) < 1e-7);
    client.has_counted(&[("attitudes", 3), ("time_backwards", 1)]);
    // The last one by its time stays the last.
    let frame = frame_at(&mut client, 0.5, EXTRAPOLATED);
    assert_eq!(frame.header.attitude_sequence, 3);
    assert!(shows(&frame, turned(0.5)));
}

/// By the wall clock: a client that falls silent.
#[test]
fn frames_go_on_after_the_last_attitude_and_are_flagged() {
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
    await_that("three that are held", || {
        frames.push(client.frame());
        frames.iter().filter(|frame| is_held(frame)).count() == 3
    });
    frames.extend(rest(&mut client));
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

/// One attitude of a time far ahead is not believed while there are good ones.
#[test]
fn a_stray_from_the_future_does_not_hide_the_good_ones() {
    for out_of_order in [OutOfOrder::Refuse, OutOfOrder::Use] {
        a_stray_is_not_believed(out_of_order);
    }
}

fn a_stray_is_not_believed(out_of_order: OutOfOrder) {
    let mut config = quick(20.0);
    config.run.out_of_order = out_of_order;
    // X-Val: a machine that stands still for less makes no good one stale.
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
    // Nor does it take over when the client falls silent.
    await_that("the last good one is stale", || {
        let frame = client.frame();
        assert_eq!(frame.header.attitude_sequence, 11);
        assert_ne!(frame.end.attitude_source, AttitudeSource::Future);
        frame.end.attitude_source == AttitudeSource::Stale
    });
}
