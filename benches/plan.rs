//! The planner's promises about time, on every scene of `configs/scenes/`: estimated times against measured ones.
//!
//! `cargo bench --bench plan`. All on one core, medians of its own time.

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

/// Most that a price may be off, either way.
const MAX_OFF: f64 = 2.0;
/// Prices below this (ms) are below what a clock and its caches can tell.
const MIN_MS: f64 = 0.02;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let kept = pool.unwrap().install(|| {
        scenes()
            .iter()
            .map(|path| report(path))
            .fold(true, |a, b| a & b)
    });
    println!(
        "{}",
        if kept {
            "all promises kept"
        } else {
            "NOT all promises kept"
        }
    );
    std::process::exit(i32::from(!kept));
}

/// Prints one scene's figures; whether its promises are kept.
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
    let mut kept = true;
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
        let fair = (1.0 / MAX_OFF..=MAX_OFF).contains(&ratio) || price.max(measured.ms) < MIN_MS;
        kept &= fair;
        println!(
            "  {:<18} price {price:8.3} ms, measured {:8.3} +- {:.3} ms, ratio {ratio:5.2}{}",
            verdict.effect,
            measured.ms,
            measured.error_ms,
            if fair { "" } else { "  <-- off by more than 2" }
        );
    }
    kept
}
