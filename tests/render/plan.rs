//! The planner's promises, on every scene of `configs/scenes/`. The skipped part lies below the
//! declared error. The declared error is near the true one. A disabled effect removes its own
//! contribution and no more.

use std::path::Path;

use skyloop::attitude::VehicleState;
use skyloop::config::Config;
use skyloop::effect::{EFFECTS, Effect, Stage};
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::label::EffectLabel;
use skyloop::measure::Bench;
use skyloop::scene::EffectSet;

use crate::fixtures::Frames;

use crate::scenes::scenes;

/// An emulator of a scene, and the vehicle in its first frame and in the middle one.
fn load(path: &Path) -> (Emulator, [VehicleState; 2]) {
    let frames = Frames::of(Config::load(path).unwrap());
    let vehicles = [0, frames.mission.frames / 2].map(|number| frames.vehicle(number));
    (frames.emulator, vehicles)
}

fn scene(name: &str) -> (Emulator, [VehicleState; 2]) {
    let path = scenes().into_iter().find(|path| path.ends_with(name));
    load(&path.unwrap())
}

fn bench<'a>(emulator: &'a Emulator, vehicle: &VehicleState) -> Bench<'a> {
    Bench {
        emulator,
        camera: emulator.camera(),
        vehicle: vehicle.clone(),
    }
}

/// Calls `check` with the name and a frame of every scene.
fn each_scene(mut check: impl FnMut(&str, &Bench<'_>)) {
    for path in scenes() {
        let (emulator, [_, middle]) = load(&path);
        check(&path.display().to_string(), &bench(&emulator, &middle));
    }
}

fn quiet() -> Choice {
    Choice {
        noise: false,
        ..Choice::default()
    }
}

/// All effects, whether needed or not.
fn all(noise: bool) -> Choice {
    Choice {
        all: true,
        noise,
        ..Choice::default()
    }
}

/// The effects with their labels in a plan of `choice`.
fn verdicts(bench: &Bench<'_>, choice: &Choice) -> Vec<(&'static Effect, EffectLabel)> {
    let verdicts = bench.verdicts(choice).unwrap();
    EFFECTS.iter().zip(verdicts).collect()
}

pub fn without(choice: &Choice, effect: &Effect) -> Choice {
    let mut choice = choice.clone();
    choice.off.push(effect.name);
    choice
}

fn charge(bench: &Bench<'_>, choice: &Choice) -> Vec<f32> {
    bench.frame(choice, 0).unwrap().charge_e.unwrap()
}

/// Maximum difference of two frames' charge, and the maximum charge.
fn difference(a: &[f32], b: &[f32]) -> (f64, f64) {
    let pairs = a.iter().zip(b);
    let apart = pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    let max = a.iter().chain(b).copied().fold(0.0, f32::max);
    (apart.fold(0.0, f64::max), f64::from(max))
}

/// Rounding error of f32 sums, relative to the brightest pixel.
const ROUNDING: f64 = 1e-6;

#[test]
fn skipped_effects_stay_below_their_declared_error() {
    each_scene(|name, bench| {
        let skipped = verdicts(bench, &quiet()).into_iter();
        let skipped = skipped.filter(|(effect, verdict)| !verdict.run && !effect.random);
        let declared: f64 = skipped.map(|(_, verdict)| verdict.error_e.unwrap()).sum();
        let (apart, max) = difference(&charge(bench, &quiet()), &charge(bench, &all(false)));
        let what = format!("{name}: {apart} e- apart, {declared} e- declared");
        assert!(apart <= declared + ROUNDING * max, "{what}");
    });
}

#[test]
#[ignore = "long: minutes of work; tests/run all runs it"]
fn long_declared_errors_are_bounds_and_near_the_measured() {
    let mut wrong = String::new();
    each_scene(|name, bench| {
        let all = all(true);
        // The rms of many large frames takes long and equals that of small ones.
        let small = bench.camera.detector.pixels() < 100_000;
        let max = f64::from(charge(bench, &quiet()).iter().copied().fold(0.0, f32::max));
        let effects = verdicts(bench, &all).into_iter();
        for (effect, verdict) in
            effects.filter(|(effect, _)| small || !effect.random || effect.name == "radiation")
        {
            let measured = bench.error_e(effect, &all).unwrap();
            let declared = verdict.error_e.unwrap();
            // An rms over 12 frames is some 20 % uncertain.
            let slack = if effect.random { 1.6 } else { 1.0 };
            let is_bound = measured <= slack * declared + ROUNDING * max.max(measured);
            let is_near = measured <= 1e-3 || declared <= 10.0 * measured;
            if !(is_bound && is_near) {
                let effect = effect.name;
                wrong += &format!("{name}, {effect}: {measured} e- of {declared} declared\n");
            }
        }
        for (effect, verdict) in verdicts(bench, &all).into_iter() {
            if effect.stage != Stage::Images {
                continue;
            }
            let measured = bench.error_px(effect, &all).unwrap();
            let declared = verdict.error_px.unwrap();
            let is_bound = measured <= declared + 1e-6;
            let is_near = measured <= 1e-6 || declared <= 10.0 * measured;
            if !(is_bound && is_near) {
                let effect = effect.name;
                wrong += &format!("{name}, {effect}: {measured} px of {declared} declared\n");
            }
        }
    });
    assert!(wrong.is_empty(), "{wrong}");
}

/// Where an effect changes no expectation, the noise of a pixel is the same with and without it.
#[test]
#[ignore = "long: minutes of work; tests/run all runs it"]
fn long_a_disabled_effect_removes_only_its_contribution() {
    each_scene(|name, bench| {
        // Large frames take long and give the same result.
        if bench.camera.detector.pixels() > 300_000 {
            return;
        }
        // Contributions do not add up where charge is clipped, bloomed or compressed.
        let choice = Choice {
            off: vec!["full well", "non-linearity"],
            ..Choice::default()
        };
        let noisy: Vec<f32> = charge(bench, &choice);
        let expected = |choice: &Choice| {
            let mut quiet = choice.clone();
            quiet.noise = false;
            charge(bench, &quiet)
        };
        let with = expected(&choice);
        let effects = EFFECTS.iter();
        for effect in effects.filter(|effect| !choice.off.contains(&effect.name)) {
            let what = format!("{name}, {}", effect.name);
            let off = without(&choice, effect);
            let (noisy_without, without) = (charge(bench, &off), expected(&off));
            if effect.random {
                // Its contribution is the same with any other effects.
                let alone = |choice: &Choice| {
                    let others = EFFECTS.iter();
                    let others = others.filter(|of| of.random && of.name != effect.name);
                    let mut only = choice.clone();
                    only.off.extend(others.map(|other| other.name));
                    charge(bench, &only)
                };
                let (drawn, none) = (alone(&choice), alone(&off));
                for (i, drawn) in drawn.iter().enumerate() {
                    let own = f64::from(*drawn) - f64::from(none[i]);
                    let difference_e = f64::from(noisy[i]) - f64::from(noisy_without[i]);
                    let is_same =
                        (own - difference_e).abs() <= 1e-3 + 3e-7 * f64::from(noisy[i].abs());
                    assert!(
                        is_same,
                        "{what}: pixel {i}: {own} e- alone, {difference_e} among others"
                    );
                }
            } else {
                let untouched = (0..with.len()).filter(|i| with[*i] == without[*i]);
                for i in untouched {
                    let apart = f64::from(noisy[i]) - f64::from(noisy_without[i]);
                    let rounding = 1e-5 + ROUNDING * f64::from(noisy[i].abs());
                    assert!(apart.abs() <= rounding, "{what}: pixel {i}: {apart} e-");
                }
            }
        }
    });
}

#[test]
fn every_effect_runs_in_some_scene_and_is_skipped_in_another() {
    let mut seen = vec![[false; 2]; EFFECTS.len()];
    for path in scenes() {
        let (mut emulator, [first, _]) = load(&path);
        let label = emulator.expose(&first, 0).unwrap().label;
        for (seen, verdict) in seen.iter_mut().zip(&label.effects) {
            seen[usize::from(verdict.run)] = true;
        }
    }
    for (effect, [skipped, run]) in EFFECTS.iter().zip(seen) {
        assert!(run, "no scene of configs/scenes needs {}", effect.name);
        let always = ["readout", "stars", "shot noise", "read noise"];
        let is_right = skipped || always.contains(&effect.name);
        assert!(
            is_right,
            "every scene of configs/scenes needs {}",
            effect.name
        );
    }
}

#[test]
fn complete_and_noise_free_plans_run_the_expected_effects() {
    each_scene(|name, bench| {
        for (effect, verdict) in verdicts(bench, &all(true)) {
            assert!(verdict.run, "{name}, {}", effect.name);
        }
        for (effect, verdict) in verdicts(bench, &quiet()) {
            assert!(!(effect.random && verdict.run), "{name}, {}", effect.name);
            assert_eq!(effect.name, verdict.effect);
        }
    });
    let last = EFFECTS.last().map(|effect| effect.stage);
    assert_eq!(last, Some(Stage::Dn));
}

/// An effect that is switched off has no declared error in the label, but the planner estimates it
/// as if the frame had the effect, or noise.
#[test]
fn a_disabled_effect_keeps_its_estimated_error() {
    let particles = "radiation";
    let (mut emulator, [vehicle, _]) = scene("south-atlantic-anomaly.toml");
    let bench = bench(&emulator, &vehicle);
    let usual = bench.verdicts(&Choice::default()).unwrap();
    let silent = bench.verdicts(&quiet()).unwrap();
    let errors = |of: &EffectLabel| (of.error_e, of.error_px);
    for ((effect, usual), silent) in EFFECTS.iter().zip(usual).zip(silent) {
        let choice = without(&Choice::default(), effect);
        let off = bench.verdicts(&choice).unwrap();
        let off = off
            .iter()
            .find(|label| label.effect == effect.name)
            .unwrap();
        assert_eq!((off.run, off.price_ms), (false, None));
        assert_eq!(off.why, "it is switched off");
        assert_eq!(errors(off), errors(&usual), "{}", effect.name);
        if effect.random {
            assert_eq!(silent.why, "noise is switched off");
            assert_eq!(errors(&silent), errors(&usual), "{}", effect.name);
        }
        if effect.name == particles {
            let declared = off.error_e.unwrap();
            let measured = bench.error_e(effect, &choice).unwrap();
            let bounds = declared / (10.0 * (1.0 + ROUNDING))..=declared * (1.0 + ROUNDING);
            assert!(bounds.contains(&measured), "{measured} e- of {declared}");
        }
    }
    emulator.choice.off = vec![particles];
    let label = emulator.expose(&vehicle, 0).unwrap().label;
    let mut effects = label.effects.iter();
    let off = effects.find(|of| of.effect == particles).unwrap();
    assert_eq!((off.run, off.error_e, off.error_px), (false, None, None));
    let mut artifacts = label.objects.artifacts.iter();
    assert!(artifacts.all(|artifact| artifact.kind != particles));
}

#[test]
fn effects_without_input_are_skipped() {
    each_scene(|name, bench| {
        let off = |names: &[&'static str]| {
            let choice = Choice {
                off: names.to_vec(),
                ..Choice::default()
            };
            bench.verdicts(&choice).unwrap()
        };
        let shapes = EFFECTS.iter().filter(|e| e.stage == Stage::Images).count();
        // Without motion, rows exposed in turn see the same.
        let still = off(&["smear", "aberration drift"]);
        let rolling = still.iter().find(|v| v.effect == "rolling shutter");
        assert!(rolling.is_some_and(|verdict| !verdict.run), "{name}");
        // No light, no image.
        let lights = EFFECTS
            .iter()
            .filter(|effect| EffectSet::LIGHTS.has(effect.id));
        let lights: Vec<&'static str> = lights.map(|effect| effect.name).collect();
        for verdict in &off(&lights)[..shapes] {
            let price = verdict.price_ms.unwrap_or(0.0);
            assert!(price < 1e-6, "{name}, {}: {price} ms", verdict.effect);
        }
    });
}

/// However thinly light is spread, its electrons are whole: a label's signal is in the frame.
#[test]
fn light_too_thin_for_any_pixel_is_drawn() {
    let (emulator, [vehicle, _]) = scene("fast-slew.toml");
    let mut camera = (*emulator.camera()).clone();
    camera.optics.transmission *= 1e-6;
    let mut bench = bench(&emulator, &vehicle);
    bench.camera = std::sync::Arc::new(camera);
    let choice = Choice::default();
    let skip_e = emulator.fidelity().skip_e;
    let verdicts = bench.verdicts(&choice).unwrap();
    let stars = verdicts.iter().find(|v| v.effect == "stars").unwrap();
    let error_e = stars.error_e.unwrap();
    assert!(error_e < skip_e, "{error_e} e- a pixel");
    let scene = emulator.scene(&bench.camera, &bench.vehicle, 0, &choice);
    let sources = scene.unwrap().sources;
    let all: f64 = sources.iter().map(|source| source.electrons).sum();
    assert!(all > skip_e && stars.run, "{all} e- in all");
    assert!(stars.why.ends_with("e- in all"), "{}", stars.why);
}
