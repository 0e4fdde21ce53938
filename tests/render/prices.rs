//! Prices against the processor's time that effects take, wherever the tests run.
#![cfg(target_os = "linux")]

use crate::fixtures::Frames;
use skyloop::measure::Bench;

/// What takes less than this (ms) is below what a clock and its caches can tell.
const MIN_MS: f64 = 0.02;
/// These only add to tracks: differences of times that are much longer.
const ONLY_TRACKS: [&str; 2] = ["distortion", "vignetting"];
/// A price is within this of what the frame's others say, either way.
const MAX_OFF: f64 = 5.0;
/// Prices are those of an optimised build on a common core; so much dearer or cheaper may all of them be together.
const MACHINES: std::ops::Range<f64> = 0.05..4.0;

/// Prices and times of a frame's effects, where these can be told: (name, price / time).
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
        let told = cost.ms >= MIN_MS && !ONLY_TRACKS.contains(&verdict.effect);
        let price = verdict.price_ms.filter(|_| told)?;
        Some((verdict.effect, price / cost.ms))
    });
    priced.collect()
}

/// `benches/plan.rs` holds prices to a factor of two on a quiet machine. Here the build, the processor and what else it does are anyone's: they
/// slow all effects down alike, about, so that each price is held to the median of its frame. Times are those of the thread.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_no_price_is_far_from_what_the_others_say() {
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
            assert!((1.0 / MAX_OFF..=MAX_OFF).contains(&off), "{what}");
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
