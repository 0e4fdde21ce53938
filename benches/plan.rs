//! Estimated times of the planner against measured ones, on every scene of `configs/scenes/`.
//!
//! `cargo bench --bench plan`. All on one core, medians of thread time.

use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::label::EffectLabel;
use skyloop::measure::{Bench, thread_ms};
use skyloop::plan::Plan;
use std::path::Path;

#[path = "../tests/support/scenes.rs"]
mod scenes;

use scenes::scenes;

/// Largest ratio of estimated and measured time, or its inverse.
const MAX_RATIO: f64 = 2.0;
/// Times below this (ms) are not resolved by the clock.
const MIN_MS: f64 = 0.02;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let all_met = pool.unwrap().install(|| {
        scenes()
            .iter()
            .map(|path| report(path))
            .fold(true, |a, b| a & b)
    });
    println!(
        "{}",
        if all_met {
            "all promises kept"
        } else {
            "NOT all promises kept"
        }
    );
    std::process::exit(i32::from(!all_met));
}

/// Prints the statistics of a scene; returns whether its estimates are within the limit.
fn report(path: &Path) -> bool {
    let mut config = Config::load(path).unwrap();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = Emulator::new(&mut config);
    let vehicle = flight::vehicle(&mission, mission.frames / 2).unwrap();
    let mut frames: Vec<f64> = (0..9)
        .map(|_| {
            let started = thread_ms();
            emulator.expose(&vehicle, 0).unwrap();
            thread_ms() - started
        })
        .collect();
    frames.sort_by(f64::total_cmp);
    let (frame_ms, spread) = (frames[4], frames[6] - frames[2]);

    let bench = Bench {
        camera: emulator.camera(),
        emulator: &emulator,
        vehicle,
    };
    let choice = &emulator.choice;
    let scene = emulator
        .scene(&bench.camera, &bench.vehicle, 0, choice)
        .unwrap();
    let plan = Plan::new(&scene, emulator.fidelity(), choice);
    let verdicts: Vec<EffectLabel> = plan
        .steps
        .iter()
        .map(|step| EffectLabel::new(&plan, step))
        .collect();
    let mut all_met = true;
    println!(
        "{}, {}: {frame_ms:.2} ms a frame (quartiles {spread:.2} apart)",
        path.file_name().unwrap_or_default().to_string_lossy(),
        bench.camera.name
    );
    for (verdict, measured) in verdicts.iter().zip(bench.costs(choice).unwrap()) {
        let Some(price) = verdict.price_ms else {
            continue;
        };
        let ratio = price / measured.ms;
        let fair =
            (1.0 / MAX_RATIO..=MAX_RATIO).contains(&ratio) || price.max(measured.ms) < MIN_MS;
        all_met &= fair;
        println!(
            "  {:<18} price {price:8.3} ms, measured {:8.3} +- {:.3} ms, ratio {ratio:5.2}{}",
            verdict.effect,
            measured.ms,
            measured.error_ms,
            if fair { "" } else { "  <-- off by more than 2" }
        );
    }
    all_met
}
