//! Measured cost of effects: the time of each, and the error without it, on one frame.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod clock;
pub mod cost;
pub mod frames;
pub mod orbits;
mod population;
mod ratio;
mod sample;
pub mod smear;

pub use clock::thread_ms;
pub use ratio::{Machine, Report, Row};
pub use sample::Cost;

use clock::{cost, rounds};
use rayon::prelude::*;
use sample::Sample;
use skyloop_orbit::sgp4_batch::Level;
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::effect::{Decision, EFFECTS, Effect, ErrorBound, Pass, Stage, three_digits};
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::Choice;
use skyloop_render::frame::{Charge, Frame, Memory};
use skyloop_render::label::EffectLabel;
use skyloop_render::plan::{Plan, Step};
use skyloop_render::render::{render, tiles};
use skyloop_render::scene::{
    EffectId, EffectSet, Scene, Source, Unobservable, build_scene, track_all,
};
use std::collections::HashMap;
use std::hint::black_box;
use std::sync::Arc;

/// Number of frames for the rms errors of random effects.
const REPEATS: u32 = 12;

/// A frame to measure.
pub struct Bench<'a> {
    /// The camera under its sky.
    pub emulator: &'a Emulator,
    /// The camera.
    pub camera: Arc<Camera>,
    /// State of the vehicle.
    pub vehicle: VehicleState,
}

impl Bench<'_> {
    /// The frame, rendered with the effects that `choice` allows; DN, expectation and charge.
    pub fn frame(&self, choice: &Choice, repeat: u32) -> Result<Frame, Unobservable> {
        let scene = self.scene(choice, repeat)?;
        let plan = Plan::new(&scene, self.emulator.fidelity(), choice);
        Ok(rendered(&plan, &scene))
    }

    fn scene(&self, choice: &Choice, repeat: u32) -> Result<Scene, Unobservable> {
        let emulator = self.emulator;
        emulator.scene(&self.camera, &self.vehicle, repeat, choice)
    }

    /// The decisions of the frame's plan by `choice`, with the error bound without each effect. For
    /// effects that are switched off, the bound comes from a plan that includes them.
    pub fn verdicts(&self, choice: &Choice) -> Result<Vec<EffectLabel>, Unobservable> {
        let scene = self.scene(choice, 0)?;
        let plan = Plan::new(&scene, self.emulator.fidelity(), choice);
        let full = |step: &Step<'_>| {
            let ErrorBound { e, px } = match plan.error(step) {
                Some(error) => error,
                None => self.error_of(step.effect, choice)?,
            };
            let mut label = EffectLabel::new(&plan, step);
            if let Some(all_e) = plan.needed_for_e(step) {
                label.why += &format!(", {} e- in all", three_digits(all_e));
            }
            Ok(EffectLabel {
                error_e: Some(e),
                error_px: Some(px),
                ..label
            })
        };
        plan.steps.iter().map(full).collect()
    }

    /// Error bound of an effect that `choice` switches off.
    fn error_of(&self, effect: &Effect, choice: &Choice) -> Result<ErrorBound, Unobservable> {
        let with = Choice {
            noise: choice.noise || effect.random,
            ..with(effect, choice)
        };
        let scene = self.scene(&with, 0)?;
        let plan = Plan::new(&scene, self.emulator.fidelity(), &with);
        let mut steps = plan.steps.iter();
        let step = steps.find(|step| step.effect.id == effect.id);
        Ok(step.and_then(|step| plan.error(step)).unwrap_or_default())
    }

    /// Error without `effect`, relative to `choice`, as in [`ErrorBound`]: the greatest change (e-)
    /// of a pixel, after full wells and blooming. It is an rms for random effects, except for
    /// particles, which are those of this frame. Random effects are compared with noise, others
    /// without noise and particles; before digitisation, unless the effect follows it.
    pub fn error_e(&self, effect: &Effect, choice: &Choice) -> Result<f64, Unobservable> {
        let with = Choice {
            noise: effect.random,
            ..with(effect, choice)
        };
        let mut without = with.clone();
        without.off.push(effect.name);
        let change = |repeats: std::ops::Range<u32>| -> Result<Vec<f64>, Unobservable> {
            let mut squares = vec![0.0; self.camera.detector.pixels()];
            for repeat in repeats.clone() {
                let a = self.electrons(effect, self.frame(&with, repeat)?);
                let b = self.electrons(effect, self.frame(&without, repeat)?);
                for (square, (a, b)) in squares.iter_mut().zip(a.iter().zip(&b)) {
                    *square += (a - b).powi(2) / repeats.len() as f64;
                }
            }
            Ok(squares.into_iter().map(f64::sqrt).collect())
        };
        let worst =
            |change: &[f64]| (0..change.len()).max_by(|i, j| change[*i].total_cmp(&change[*j]));
        if !effect.random || effect.is_drawn_with_scene() {
            let change = change(0..1)?;
            return Ok(worst(&change).map_or(0.0, |pixel| change[pixel]));
        }
        // The pixel is selected on other frames than it is measured on: on the same frames chance
        // would raise the maximum.
        let (chosen, measured) = (change(0..REPEATS)?, change(REPEATS..2 * REPEATS)?);
        Ok(worst(&chosen).map_or(0.0, |pixel| measured[pixel]))
    }

    /// Greatest shift (px) of a centroid on the detector, or of the end of a track, without
    /// `effect`, relative to `choice`.
    pub fn error_px(&self, effect: &Effect, choice: &Choice) -> Result<f64, Unobservable> {
        let images = |off: &[&'static str]| -> Result<HashMap<_, _>, Unobservable> {
            let mut choice = with(effect, choice);
            choice.off.extend(off);
            let scene = self.scene(&choice, 0)?;
            let image = |source: &Source| {
                let body = source.body.identity();
                (body, [source.centroid, source.start, source.end])
            };
            Ok(scene.sources.iter().map(image).collect())
        };
        let inside = |at: &[f64; 2]| self.camera.detector.contains(*at);
        let apart = |[a, b]: [&[f64; 2]; 2]| {
            let both = inside(a) && inside(b);
            both.then(|| libm::hypot(a[0] - b[0], a[1] - b[1]))
        };
        let (with, without) = (images(&[])?, images(&[effect.name])?);
        let mut max = 0.0f64;
        for (body, places) in &with {
            let others = without.get(body).into_iter().flatten();
            let moved = places.iter().zip(others).filter_map(|(a, b)| apart([a, b]));
            max = moved.fold(max, f64::max);
        }
        if effect.id == EffectId::Smear {
            // Labels have the ends of true tracks: an image at rest differs by half a track.
            let tracks = images(&["aberration drift"])?;
            let halves = tracks
                .values()
                .filter_map(|[_, start, end]| apart([start, end]));
            max = halves.map(|px| px / 2.0).fold(max, f64::max);
        }
        Ok(max)
    }

    /// The quantity that `effect` changes, e-: the charge, or the DN in electrons.
    fn electrons(&self, effect: &Effect, frame: Frame) -> Vec<f64> {
        if effect.stage == Stage::Dn {
            let gain = self.camera.detector.gain_e_per_dn;
            let dn = frame.dn.into_iter().map(|dn| f64::from(dn) * gain);
            return dn.collect();
        }
        let charge = frame.charge_e.unwrap_or_default().into_iter();
        charge.map(f64::from).collect()
    }

    /// Time of each effect of the plan by `choice`, in the plan's order; 0 if it does not run. Call
    /// it in a pool of one thread.
    pub fn costs(&self, choice: &Choice) -> Result<Vec<Cost>, Unobservable> {
        let scene = self.scene(choice, 0)?;
        let plan = Plan::new(&scene, self.emulator.fidelity(), choice);
        let pixels = self.camera.detector.pixels();
        let (mut electrons, mut dn) = (vec![0.0f32; pixels], vec![0u16; pixels]);
        let mut time = |step: &Step<'_>| {
            let Decision::Run { pass, .. } = &step.decision else {
                return Cost::default();
            };
            let take = |mut charge: Vec<f32>| {
                match pass {
                    Pass::Images => {}
                    Pass::Tile(pass) | Pass::Pixels(pass) => {
                        tiles(&scene, Some(Level::best()), &mut charge, &mut dn)
                            .for_each(|mut tile| pass(&mut tile));
                    }
                    Pass::Frame(pass) => pass(&mut Charge {
                        width: self.camera.detector.width,
                        electrons: &mut charge,
                    }),
                }
                charge
            };
            let (in_pixels, charge) = cost(|| electrons.clone(), take);
            electrons = charge;
            let imaging = self.imaging(step.effect, &scene);
            Cost {
                ms: in_pixels.ms + imaging.ms,
                error_ms: in_pixels.error_ms + imaging.error_ms,
            }
        };
        Ok(plan.steps.iter().map(&mut time).collect())
    }

    /// Time that `effect` adds to imaging: for a kind of source, its images at rest; for effects on
    /// images, with all effects before it in [`EFFECTS`].
    fn imaging(&self, effect: &Effect, scene: &Scene) -> Cost {
        let fidelity = self.emulator.fidelity();
        let alone = EffectSet::default().with(effect.id);
        let (with, without) = if effect.stage == Stage::Images {
            let before = EFFECTS.iter().take_while(|other| other.id != effect.id);
            let before = before.filter(|other| scene.simulated.has(other.id));
            let without = before.fold(scene.simulated.lights(), |set, other| set.with(other.id));
            (without.with(effect.id), without)
        } else if EffectSet::LIGHTS.has(effect.id) {
            let with = if scene.simulated.has(EffectId::Distortion) {
                alone.with(EffectId::Distortion)
            } else {
                alone
            };
            (with, EffectSet::default())
        } else {
            return Cost::default();
        };
        // Effects on position and light of images only change tracks.
        let only_tracks = matches!(effect.id, EffectId::Distortion | EffectId::Vignetting);
        let time = |simulated: EffectSet| {
            let view = scene.view.clone();
            let started = thread_ms();
            if only_tracks {
                black_box(track_all(&view, &simulated, fidelity));
                return thread_ms() - started;
            }
            let images = build_scene(view, simulated, fidelity);
            let took = thread_ms() - started;
            drop(images);
            took
        };
        // Alternating, so that other load slows both alike.
        let difference = || time(with) - time(without);
        let Cost { ms, error_ms } = Sample::new(rounds(difference)).median();
        Cost {
            ms: ms.max(0.0),
            error_ms,
        }
    }
}

/// A frame with its DN, its expectation and its charge.
fn rendered(plan: &Plan<'_>, scene: &Scene) -> Frame {
    let (level, memory) = (Some(Level::best()), &mut Memory::default());
    render(plan, scene, level, true, memory, &|_, _| {})
}

/// `choice` without a switch-off of `effect`.
fn with(effect: &Effect, choice: &Choice) -> Choice {
    let mut with = choice.clone();
    with.off.retain(|name| *name != effect.name);
    with
}
