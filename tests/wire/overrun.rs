//! Frames that would be late: the policies, and their reports.

use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, memory_client, scene};
use serde_json::{Value, json};
use skyloop::config::{Clock, Config, OnOverrun};
use skyloop::fidelity::{Coarser, Fidelity};
use skyloop::load::Folder;
use skyloop::stats::RunStats;
use skyloop_protocols::{Command, Counters};

/// A rate at which every frame is late, Hz: none is rendered within 10 us.
const EXCESSIVE_HZ: f64 = 1e5;
/// A rate at which none is late: a second is hundreds of times what a frame of 64 x 64 pixels
/// takes.
const SLOW_HZ: f64 = 1.0;
const FRAMES: usize = 6;

fn steps(coarsen: &str) -> Vec<Coarser> {
    let text = format!("[run]\ncoarsen = {coarsen}");
    let config = Config::parse("run.toml", &text, &Folder::current());
    config.unwrap().run.coarsen
}

/// An emulator of the built-in scene with 64 x 64 pixels, and a client that has sent its attitude.
fn start(policy: OnOverrun, rate_hz: f64) -> (Running, Client<MemoryLine>) {
    let steps = steps("[\"fast\", \"wing_e = 1\"]");
    start_with(Fidelity::REALTIME, steps, policy, rate_hz)
}

/// The same with these tolerances and coarsening steps.
fn start_with(
    fidelity: Fidelity,
    steps: Vec<Coarser>,
    policy: OnOverrun,
    rate_hz: f64,
) -> (Running, Client<MemoryLine>) {
    let mut config = scene();
    // Set after the file is read, like a time budget.
    config.fidelity = fidelity;
    config.camera.detector.width = 64;
    config.camera.detector.height = 64;
    config.camera.exposure_s = 5e-6;
    config.camera.rate_hz = rate_hz;
    config.run.on_overrun = policy;
    config.run.coarsen = steps;
    let (emulator, mut client) = memory_client(config, Clock::Wall);
    // The cadence starts with the attitude: the emulator must run by then.
    client.status();
    client.point(attitude(1), EPOCH);
    (emulator, client)
}

/// Overrun and fidelity in the label of a frame.
fn overrun_and_fidelity(frame: &Received) -> (Value, Value) {
    let label = frame.label();
    // The end agrees with the label; an unpredicted late frame is late only in its end.
    let unpredicted = if frame.end.in_time { "none" } else { "late" };
    let overrun = label["overrun"].as_str().unwrap_or(unpredicted);
    assert_eq!(frame.end.overrun.name().to_lowercase(), overrun);
    (label["overrun"].clone(), label["fidelity"].clone())
}

/// Overrun and fidelity of the first frames at a rate that is too high. Then the rate is lowered
/// until a frame is as configured. Also returns statistics and counters.
fn run_too_fast(policy: OnOverrun) -> (Vec<(Value, Value)>, RunStats, Counters) {
    let (emulator, mut client) = start(policy, EXCESSIVE_HZ);
    let first: Vec<_> = (0..FRAMES)
        .map(|_| overrun_and_fidelity(&client.frame()))
        .collect();
    client.done(Command::FrameRate { hz: SLOW_HZ });
    let configured = (Value::Null, json!({"preset": "realtime"}));
    assert_eq!(first[0], configured, "the first frame has no prediction");
    await_that("a frame in time", || {
        overrun_and_fidelity(&client.frame()) == configured
    });
    let (stats, counters) = emulator.measured();
    let late = stats.latencies.missed as u32;
    assert!(late >= FRAMES as u32 && stats.frames > late);
    assert_eq!(row(&stats, "frames late"), late);
    assert_eq!(counters.deadlines_missed, late);
    (first, stats, counters)
}

/// A number of the table at the end of a run; 0 without a row.
fn row(stats: &RunStats, name: &str) -> u32 {
    let rows = stats.rows();
    let row = rows.iter().find(|(row, _)| row == name);
    row.map_or(0, |(_, value)| value.parse().unwrap())
}

#[test]
fn late_frames_follow_the_policy_and_are_reported() {
    let realtime = || json!({"preset": "realtime"});
    let coarsest = || json!({"preset": "fast", "wing_e": 1.0});
    let all = |overrun| vec![(json!(overrun), realtime()); FRAMES - 1];
    let coarsened = vec![
        (json!("coarsen"), json!({"preset": "fast"})),
        (json!("coarsen"), coarsest()),
        (json!("late"), coarsest()),
        (json!("late"), coarsest()),
        // X-Val: docs/how-to/accuracy-and-time.md: what was too slow is tried again after four.
        (Value::Null, realtime()),
    ];
    // X-Val: docs/how-to/accuracy-and-time.md: after four exposures, and twice as many each time.
    let dropped: u32 = (1..FRAMES as u32).map(|trial| 4 << (trial - 1)).sum();
    for (policy, expected, min_coarsened, min_dropped) in [
        (OnOverrun::Late, all("late"), 0, 0),
        (OnOverrun::Drop, all("drop"), 0, dropped),
        (OnOverrun::Coarsen, coarsened, 2, 0),
    ] {
        let (first, stats, counters) = run_too_fast(policy);
        assert_eq!(first[1..], expected, "{policy:?}");
        for (name, count, min) in [
            ("frames coarsened", stats.coarsened, min_coarsened),
            ("exposures dropped", stats.dropped, min_dropped),
        ] {
            assert!(
                count >= min && (count == 0) == (min == 0),
                "{policy:?}: {count} {name}"
            );
            assert_eq!(row(&stats, name), count, "{policy:?}: {name}");
        }
        assert!(counters.exposures_missed >= stats.dropped, "{policy:?}");
    }
}

#[test]
fn coarsening_starts_from_the_settings_of_the_run() {
    let fast = json!({"preset": "fast"});
    let coarser = json!({"preset": "fast", "wing_e": 0.5});
    let without_effect = vec![(json!("late"), fast.clone()); FRAMES - 1];
    for (coarsen, expected) in [
        (
            "[\"wing_e = 0.5\"]",
            vec![
                (json!("coarsen"), coarser.clone()),
                (json!("late"), coarser),
            ],
        ),
        ("[\"fast\"]", without_effect.clone()),
        ("[\"reference\", \"wing_e = 0.1\"]", without_effect.clone()),
    ] {
        let steps = steps(coarsen);
        let (emulator, mut client) =
            start_with(Fidelity::FAST, steps, OnOverrun::Coarsen, EXCESSIVE_HZ);
        let frames = (0..FRAMES).map(|_| overrun_and_fidelity(&client.frame()));
        let first: Vec<_> = frames.collect();
        assert_eq!(first[0], (Value::Null, fast.clone()), "{coarsen}");
        assert_eq!(first[1..][..expected.len()], expected, "{coarsen}");
        let coarsened = emulator.measured().0.coarsened;
        assert_eq!(coarsened == 0, expected == without_effect, "{coarsen}");
    }
}

#[test]
fn with_enough_time_nothing_changes() {
    for policy in [OnOverrun::Drop, OnOverrun::Coarsen] {
        let (emulator, mut client) = start(policy, SLOW_HZ);
        for _ in 0..2 {
            let label = client.frame().label();
            assert_eq!(label["overrun"], Value::Null);
            assert_eq!(label["fidelity"], json!({"preset": "realtime"}));
        }
        let (stats, counters) = emulator.measured();
        assert_eq!(
            (stats.latencies.missed, stats.coarsened, stats.dropped),
            (0, 0, 0)
        );
        assert_eq!(counters.exposures_missed, 0);
        for name in ["frames late", "frames coarsened", "exposures dropped"] {
            assert_eq!(row(&stats, name), 0);
        }
    }
}
