//! The whole step: candidates of a catalogue, visible objects, and the label's text.

use super::{CATALOGUE, FRAMES, Step, WARM};
use crate::population::scene_with_population;
use crate::sample::Sample;
use hifitime::Unit;
use skyloop_base::load::ConfigError;
use skyloop_render::effect::{area_kinds, name_of};
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::{Choice, Orbits};
use skyloop_render::label::Label;
use skyloop_render::plan::Plan;
use skyloop_render::render_pool;
use skyloop_render::scene::{Unobservable, View};
use std::hint::black_box;
use std::time::Instant;

/// The built-in scene's camera at 10 Hz, with a synthetic catalogue.
pub(crate) fn measure() -> Result<Step, ConfigError> {
    let (tracked, first_ms, found, bytes) = frames(Orbits::Tracked)?;
    let (exact, ..) = frames(Orbits::Exact)?;
    Ok(Step {
        objects: CATALOGUE,
        frames: FRAMES,
        p50_ms: tracked.quantile(0.5),
        p99_ms: tracked.quantile(0.99),
        first_ms,
        exact_p50_ms: exact.quantile(0.5),
        found,
        bytes,
    })
}

/// Times (ms) of the frames, time of the first, mean numbers of found objects, and bytes per
/// object.
fn frames(orbits: Orbits) -> Result<(Sample, f64, [f64; 3], f64), ConfigError> {
    let (mut config, vehicle) = scene_with_population(CATALOGUE)?;
    config.fidelity.orbits = orbits;
    // Objects alone: other content of the sky takes its own time.
    let mut choice = Choice::default();
    choice.off.extend(["stars", "planets", "moon"]);
    choice
        .off
        .extend(area_kinds().map(|kind| name_of(kind.effect)));

    let emulator = Emulator::new(&mut config);
    let camera = emulator.camera();
    let mut found = [0.0; 3];
    let mut times = Vec::new();
    for frame in 0..WARM + FRAMES {
        let vehicle = vehicle.at(vehicle.epoch + Unit::Second * (0.1 * frame as f64));
        // As in the emulator: on the threads that share frames.
        let mut step = || -> Result<(), Unobservable> {
            let scene = emulator.scene(&camera, &vehicle, 0, &choice)?;
            let plan = Plan::new(&scene, emulator.fidelity(), &choice);
            let label = Label::new(0, &scene, &plan, emulator.world(), 1.0);
            black_box(label.to_json());
            let View {
                candidates, unseen, ..
            } = &scene.view;
            let seen = [candidates.len(), unseen.len(), label.objects.len()];
            for (sum, n) in found.iter_mut().zip(seen) {
                *sum += n as f64 / (WARM + FRAMES) as f64;
            }
            Ok(())
        };
        let started = Instant::now();
        render_pool::together(&mut step).map_err(|error| ConfigError::Orbit(error.to_string()))?;
        times.push(started.elapsed().as_secs_f64() * 1e3);
    }
    let bytes = emulator.world().population.bytes() as f64 / CATALOGUE as f64;
    let first_ms = times.first().copied().unwrap_or(f64::NAN);
    let later = times.split_off(WARM);
    Ok((Sample::new(later), first_ms, found, bytes))
}
