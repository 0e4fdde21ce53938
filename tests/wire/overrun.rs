//! Frames that would be late: what is done with them, and where that is told.

use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, memory_client, scene};
use serde_json::{Value, json};
use skyloop::config::{Clock, Config, OnOverrun};
use skyloop::fidelity::{Coarser, Fidelity};
use skyloop::load::Folder;
use skyloop::stats::RunStats;
use skyloop_protocols::{Command, Counters};

/// A cadence at which every frame is late, Hz: none is made within 10 us.
const HURRIED_HZ: f64 = 1e5;
/// And one at which none is: a second is hundreds of times what a frame of 64 x 64 pixels takes.
const PATIENT_HZ: f64 = 1.0;
/// Frames that are looked at.
const FRAMES: usize = 6;

/// The steps that a file with this key has.
fn steps(coarsen: &str) -> Vec<Coarser> {
    let text = format!("[run]\ncoarsen = {coarsen}");
    let config = Config::parse("run.toml", &text, &Folder::current());
    config.unwrap().run.coarsen
}

/// An emulator of the built-in scene with 64 x 64 pixels, and a client that has sent its attitude.
fn flown(policy: OnOverrun, rate_hz: f64) -> (Running, Client<MemoryLine>) {
    let steps = steps("[\"fast\", \"wing_e = 1\"]");
    flown_by(Fidelity::REALTIME, steps, policy, rate_hz)
}

/// Likewise with these tolerances and steps of coarsening.
fn flown_by(
    fidelity: Fidelity,
    steps: Vec<Coarser>,
    policy: OnOverrun,
    rate_hz: f64,
) -> (Running, Client<MemoryLine>) {
    let mut config = scene();
    // After the file was read, as a budget chooses them.
    config.fidelity = fidelity;
    config.camera.detector.width = 64;
    config.camera.detector.height = 64;
    config.camera.exposure_s = 5e-6;
    config.camera.rate_hz = rate_hz;
    config.run.on_overrun = policy;
    config.run.coarsen = steps;
    let (emulator, mut client) = memory_client(config, Clock::Wall);
    // The cadence starts with the attitude: the emulator must be there by then.
    client.status();
    client.point(attitude(1), EPOCH);
    (emulator, client)
}

/// Why a frame is not as configured, and by what it was rendered.
fn told(frame: &Received) -> (Value, Value) {
    let label = frame.label();
    // Its end says the same, and of a frame that nobody expected to be late that it is.
    let unforeseen = if frame.end.in_time { "none" } else { "late" };
    let overrun = label["overrun"].as_str().unwrap_or(unforeseen);
    assert_eq!(frame.end.overrun.name().to_lowercase(), overrun);
    (label["overrun"].clone(), label["fidelity"].clone())
}

/// The labels of the first frames at a hurried cadence: their overrun and their fidelity.
/// Then time is no longer short, and a frame comes as configured; what was measured and counted.
fn hurried(policy: OnOverrun) -> (Vec<(Value, Value)>, RunStats, Counters) {
    let (emulator, mut client) = flown(policy, HURRIED_HZ);
    let first: Vec<_> = (0..FRAMES).map(|_| told(&client.frame())).collect();
    client.done(Command::FrameRate { hz: PATIENT_HZ });
    let configured = (Value::Null, json!({"preset": "realtime"}));
    assert_eq!(first[0], configured, "nothing is known before the first");
    await_that("a frame in time", || told(&client.frame()) == configured);
    let (stats, counters) = emulator.measured();
    let late = stats.latencies.missed as u32;
    assert!(late >= FRAMES as u32 && stats.frames > late);
    assert_eq!(row(&stats, "frames late"), late);
    assert_eq!(counters.deadlines_missed, late);
    (first, stats, counters)
}

/// A number of the table at the end of a run; 0 where it has no row.
fn row(stats: &RunStats, name: &str) -> u32 {
    let rows = stats.rows();
    let row = rows.iter().find(|(row, _)| row == name);
    row.map_or(0, |(_, value)| value.parse().unwrap())
}

#[test]
fn late_frames_come_and_are_told() {
    let (first, stats, _) = hurried(OnOverrun::Late);
    for (overrun, fidelity) in &first[1..] {
        assert_eq!(overrun, "late");
        assert_eq!(fidelity, &first[0].1);
    }
    assert_eq!((stats.coarsened, stats.dropped), (0, 0));
}

#[test]
fn exposures_are_left_out_and_told() {
    let (first, stats, counters) = hurried(OnOverrun::Drop);
    for (overrun, fidelity) in &first[1..] {
        assert_eq!(overrun, "drop");
        assert_eq!(fidelity, &first[0].1);
    }
    // X-Val: docs/how-to/accuracy-and-time.md: after four exposures, and after twice as many each time.
    let least: u32 = (1..FRAMES as u32).map(|trial| 4 << (trial - 1)).sum();
    assert!(stats.dropped >= least, "{}", stats.dropped);
    assert!(counters.exposures_missed >= stats.dropped);
    assert_eq!(row(&stats, "exposures dropped"), stats.dropped);
    assert_eq!(stats.coarsened, 0);
}

#[test]
fn frames_are_coarsened_step_by_step_and_told() {
    let (first, stats, _) = hurried(OnOverrun::Coarsen);
    let fast = json!({"preset": "fast"});
    let coarsest = json!({"preset": "fast", "wing_e": 1.0});
    assert_eq!(first[1], (json!("coarsen"), fast));
    assert_eq!(first[2], (json!("coarsen"), coarsest.clone()));
    for told in &first[3..5] {
        assert_eq!(*told, (json!("late"), coarsest.clone()));
    }
    // X-Val: docs/how-to/accuracy-and-time.md: after four exposures what was too slow is tried again.
    assert_eq!(first[5], first[0]);
    assert!(stats.coarsened >= 2);
    assert_eq!(row(&stats, "frames coarsened"), stats.coarsened);
    assert_eq!(stats.dropped, 0);
}

/// What the first frames say that are all late, of a run by `fast`.
fn hurried_by_fast(coarsen: &str) -> (Vec<(Value, Value)>, RunStats) {
    let steps = steps(coarsen);
    let (emulator, mut client) = flown_by(Fidelity::FAST, steps, OnOverrun::Coarsen, HURRIED_HZ);
    let first = (0..FRAMES).map(|_| told(&client.frame())).collect();
    (first, emulator.measured().0)
}

#[test]
fn what_is_coarsened_is_the_setting_that_the_run_has() {
    let (first, _) = hurried_by_fast("[\"wing_e = 0.5\"]");
    let coarser = json!({"preset": "fast", "wing_e": 0.5});
    assert_eq!(first[0], (Value::Null, json!({"preset": "fast"})));
    assert_eq!(first[1], (json!("coarsen"), coarser.clone()));
    assert_eq!(first[2], (json!("late"), coarser));
}

#[test]
fn what_makes_nothing_coarser_is_not_told_as_coarsened() {
    for coarsen in ["[\"fast\"]", "[\"reference\", \"wing_e = 0.1\"]"] {
        let (first, stats) = hurried_by_fast(coarsen);
        for told in &first[1..] {
            assert_eq!(*told, (json!("late"), json!({"preset": "fast"})));
        }
        assert_eq!(stats.coarsened, 0);
    }
}

#[test]
fn with_time_enough_nothing_is_done() {
    for policy in [OnOverrun::Drop, OnOverrun::Coarsen] {
        let (emulator, mut client) = flown(policy, PATIENT_HZ);
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
