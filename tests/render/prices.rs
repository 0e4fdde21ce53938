//! Prices of effects against measured processor time, on any machine.
#![cfg(target_os = "linux")]

use crate::fixtures::Frames;
use skyloop::measure::Bench;

/// Shorter times (ms) are below the resolution of clock and caches.
const MIN_MS: f64 = 0.02;
/// These effects only slow down tracks: their times are differences of much longer times.
const ONLY_TRACKS: [&str; 2] = ["distortion", "vignetting"];
/// Maximum factor between a price and the median of its frame.
const MAX_RATIO: f64 = 5.0;
/// Prices hold for an optimised build on a common core; this is the permitted range of the median.
const MACHINES: std::ops::Range<f64> = 0.05..4.0;

/// Ratios of price and time of a frame's measurable effects: (name, price / time).
fn ratios(scene: &str) -> Vec<(&'static str, f64)> {
    let frames = Frames::of(crate::fixtures::scene(scene));
    let emulator = &frames.emulator;
    let bench = Bench {
        emulator,
        camera: emulator.camera(),
        vehicle: frames.vehicle(frames.mission.frames / 2),
    };
    let verdicts = bench.verdicts(&emulator.choice).unwrap().into_iter();
    let costs = bench.costs(&emulator.choice).unwrap().into_iter();
    let priced = verdicts.zip(costs).filter_map(|(verdict, cost)| {
        let is_measurable = cost.ms >= MIN_MS && !ONLY_TRACKS.contains(&verdict.effect);
        let price = verdict.price_ms.filter(|_| is_measurable)?;
        Some((verdict.effect, price / cost.ms))
    });
    priced.collect()
}

/// `benches/plan.rs` limits prices to a factor of two on a quiet machine. Build, processor and load
/// of this test are unknown, but slow all effects down about equally. So each price is compared
/// with the median of its frame. Times are thread times.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_prices_agree_within_a_frame() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let mut seen = Vec::new();
    for scene in [
        "bright-star.toml",
        "fine-pointing.toml",
        "rolling-slew.toml",
    ] {
        let ratios = pool.as_ref().unwrap().install(|| ratios(scene));
        let mut sorted: Vec<f64> = ratios.iter().map(|(_, ratio)| *ratio).collect();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        assert!(MACHINES.contains(&median), "{scene}: {median}");
        for (effect, ratio) in ratios {
            let off = ratio / median;
            let what = format!("{scene}, {effect}: {off:.2} of the others' {median:.2}");
            println!("{what}");
            assert!((1.0 / MAX_RATIO..=MAX_RATIO).contains(&off), "{what}");
            seen.push(effect);
        }
    }
    for effect in [
        "smear",
        "rolling shutter",
        "stars",
        "full well",
        "non-linearity",
        "read noise",
    ] {
        assert!(seen.contains(&effect), "{effect} is not among {seen:?}");
    }
}
