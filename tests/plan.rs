//! The planner's promises, on every scene of `configs/scenes/`: what it leaves out lies below what it declares, what it
//! declares is near the truth, and an effect that is switched off takes its own contribution with it and no more.

use skyloop::config::Config;
use skyloop::effect::{EFFECTS, Effect, Stage};
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::flight;
use skyloop::label::EffectLabel;
use skyloop::measure::Bench;
use skyloop::scene::Simulated;

#[path = "support/scenes.rs"]
mod scenes;

use scenes::scenes;

/// Calls `check` with the name and a frame of every scene.
fn each_scene(check: impl Fn(&str, &Bench<'_>)) {
    for path in scenes() {
        let name = path.display().to_string();
        let mut config = Config::load(&path).unwrap();
        let mission = flight::mission(&config).unwrap();
        let emulator = Emulator::new(&mut config);
        let bench = Bench {
            emulator: &emulator,
            camera: emulator.camera(),
            vehicle: flight::vehicle(&mission, mission.frames / 2).unwrap(),
        };
        check(&name, &bench);
    }
}

fn quiet() -> Choice {
    Choice {
        noise: false,
        ..Choice::default()
    }
}

fn without(choice: &Choice, effect: &Effect) -> Choice {
    let mut choice = choice.clone();
    choice.off.push(effect.name);
    choice
}

fn charge(bench: &Bench<'_>, choice: &Choice) -> Vec<f32> {
    bench.frame(choice, 0).unwrap().charge_e.unwrap()
}

/// Greatest difference of two frames' charge, and the greatest charge.
fn difference(a: &[f32], b: &[f32]) -> (f64, f64) {
    let apart = a
        .iter()
        .zip(b)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    let most = a.iter().chain(b).copied().fold(0.0, f32::max);
    (apart.fold(0.0, f64::max), f64::from(most))
}

/// Whether it is a source of light.
fn is_light(effect: &Effect) -> bool {
    let mut alone = Simulated::default();
    (effect.mark)(&mut alone);
    alone.lights() != Simulated::default()
}

/// What sums of f32 may round by, of the brightest pixel.
const ROUNDING: f64 = 1e-6;

#[test]
fn what_is_skipped_changes_less_than_was_declared() {
    each_scene(|name, bench| {
        let all = Choice {
            all: true,
            ..quiet()
        };
        let skipped = bench
            .verdicts(&quiet())
            .unwrap()
            .into_iter()
            .filter(|verdict| !verdict.run);
        let declared: f64 = skipped
            .filter(|verdict| {
                EFFECTS
                    .iter()
                    .any(|e| e.name == verdict.effect && !e.random)
            })
            .map(|verdict| verdict.error_e.unwrap())
            .sum();
        let (apart, most) = difference(&charge(bench, &quiet()), &charge(bench, &all));
        assert!(
            apart <= declared + ROUNDING * most,
            "{name}: {apart} e- apart, {declared} e- declared"
        );
    });
}

#[test]
fn declared_errors_are_bounds_and_near_the_measured() {
    let wrong = std::sync::Mutex::new(String::new());
    each_scene(|name, bench| {
        let all = Choice {
            all: true,
            ..Choice::default()
        };
        // The rms of many large frames takes long, and would be that of small ones.
        let small = bench.camera.detector.pixels() < 100_000;
        let effects = EFFECTS.iter().zip(bench.verdicts(&all).unwrap());
        let most = f64::from(charge(bench, &quiet()).iter().copied().fold(0.0, f32::max));
        for (effect, verdict) in
            effects.filter(|(effect, _)| small || !effect.random || effect.name == "radiation")
        {
            let measured = bench.error_e(effect, &all).unwrap();
            let declared = verdict.error_e.unwrap();
            // An rms over 12 frames is some 20 % uncertain.
            let slack = if effect.random { 1.6 } else { 1.0 };
            let is_bound = measured <= slack * declared + ROUNDING * most.max(measured);
            let is_near = measured <= 1e-3 || declared <= 10.0 * measured;
            if !(is_bound && is_near) {
                let effect = effect.name;
                let line =
                    format!("{name}, {effect}: measured {measured} e-, declared {declared}\n");
                wrong.lock().unwrap().push_str(&line);
            }
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn declared_displacements_are_bounds_and_near_the_measured() {
    let wrong = std::sync::Mutex::new(String::new());
    each_scene(|name, bench| {
        let all = Choice {
            all: true,
            ..quiet()
        };
        let shaping = EFFECTS
            .iter()
            .zip(bench.verdicts(&all).unwrap())
            .filter(|(effect, _)| effect.stage == Stage::Images);
        for (effect, verdict) in shaping {
            let measured = bench.error_px(effect, &all).unwrap();
            let declared = verdict.error_px.unwrap();
            let is_bound = measured <= declared + 1e-6;
            let is_near = measured <= 1e-6 || declared <= 10.0 * measured;
            if !(is_bound && is_near) {
                let line = format!(
                    "{name}, {}: measured {measured} px, declared {declared}\n",
                    effect.name
                );
                wrong.lock().unwrap().push_str(&line);
            }
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{wrong}");
}

/// Where an effect changes no expectation, the noise of a pixel is the same with and without it.
#[test]
fn an_effect_takes_nothing_but_its_own_with_it() {
    each_scene(|name, bench| {
        // Large frames take long, and do what small ones do.
        if bench.camera.detector.pixels() > 300_000 {
            return;
        }
        // Where charge is clipped, spilt or compressed, contributions do not add up.
        let choice = Choice {
            off: vec!["full well", "non-linearity"],
            ..Choice::default()
        };
        let noisy: Vec<f32> = charge(bench, &choice);
        let expected = |choice: &Choice| {
            charge(
                bench,
                &Choice {
                    noise: false,
                    ..choice.clone()
                },
            )
        };
        let with = expected(&choice);
        for effect in EFFECTS
            .iter()
            .filter(|effect| !choice.off.contains(&effect.name))
        {
            let off = without(&choice, effect);
            let (noisy_without, without) = (charge(bench, &off), expected(&off));
            if effect.random {
                // What it drew: the same, whatever else there is.
                let alone = |choice: &Choice| {
                    let only = Choice {
                        off: EFFECTS
                            .iter()
                            .filter(|other| other.random && other.name != effect.name)
                            .map(|other| other.name)
                            .chain(choice.off.iter().copied())
                            .collect(),
                        ..Choice::default()
                    };
                    charge(bench, &only)
                };
                let (drawn, none) = (alone(&choice), alone(&off));
                for (i, drawn) in drawn.iter().enumerate() {
                    let own = f64::from(*drawn) - f64::from(none[i]);
                    let here = f64::from(noisy[i]) - f64::from(noisy_without[i]);
                    let rounding = 1e-3 + 3e-7 * f64::from(noisy[i].abs());
                    assert!(
                        (own - here).abs() <= rounding,
                        "{name}, {}: pixel {i}: {own} e- alone, {here} among others",
                        effect.name
                    );
                }
            } else {
                let untouched = (0..with.len()).filter(|i| with[*i] == without[*i]);
                for i in untouched {
                    let apart = f64::from(noisy[i]) - f64::from(noisy_without[i]);
                    assert!(
                        apart.abs() <= 1e-5 + ROUNDING * f64::from(noisy[i].abs()),
                        "{name}, {}: pixel {i}: {apart} e-",
                        effect.name
                    );
                }
            }
        }
    });
}

#[test]
fn every_effect_runs_in_some_scene_and_is_skipped_in_another() {
    let mut seen = vec![[false; 2]; EFFECTS.len()];
    for path in scenes() {
        let mut config = Config::load(&path).unwrap();
        let mission = flight::mission(&config).unwrap();
        let mut emulator = Emulator::new(&mut config);
        let vehicle = flight::vehicle(&mission, 0).unwrap();
        let label = emulator.shoot(&vehicle, 0).unwrap().label;
        for (seen, verdict) in seen.iter_mut().zip(&label.effects) {
            seen[usize::from(verdict.run)] = true;
        }
    }
    for (effect, [skipped, run]) in EFFECTS.iter().zip(seen) {
        assert!(run, "no scene of configs/scenes needs {}", effect.name);
        let always = ["readout", "stars", "shot noise", "read noise"];
        assert!(
            skipped || always.contains(&effect.name),
            "every scene of configs/scenes needs {}",
            effect.name
        );
    }
}

#[test]
fn a_plan_that_leaves_nothing_out_runs_everything_and_one_without_noise_draws_nothing() {
    each_scene(|name, bench| {
        let all = Choice {
            all: true,
            ..Choice::default()
        };
        assert!(
            bench
                .verdicts(&all)
                .unwrap()
                .iter()
                .all(|verdict| verdict.run),
            "{name}"
        );
        let drawn = bench.verdicts(&quiet()).unwrap();
        for (effect, verdict) in EFFECTS.iter().zip(drawn) {
            assert!(!(effect.random && verdict.run), "{name}, {}", effect.name);
            assert_eq!(effect.name, verdict.effect);
        }
    });
    assert_eq!(
        EFFECTS.last().map(|effect| effect.stage),
        Some(Stage::Digits)
    );
}

/// What is not in a frame because nobody wants it there is not in its label, but the plan has it: as if the frame had it, or had noise.
#[test]
fn switching_an_effect_off_costs_what_a_frame_that_has_it_says() {
    let is_meant = |path: &std::path::PathBuf| path.ends_with("south-atlantic-anomaly.toml");
    let (path, particles) = (scenes().into_iter().find(is_meant).unwrap(), "radiation");
    let mut config = Config::load(&path).unwrap();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = Emulator::new(&mut config);
    let vehicle = flight::vehicle(&mission, 0).unwrap();
    let bench = Bench {
        emulator: &emulator,
        camera: emulator.camera(),
        vehicle: vehicle.clone(),
    };
    let usual = bench.verdicts(&Choice::default()).unwrap();
    let silent = bench.verdicts(&quiet()).unwrap();
    let errors = |of: &EffectLabel| (of.error_e, of.error_px);
    for ((effect, usual), silent) in EFFECTS.iter().zip(usual).zip(silent) {
        let choice = without(&Choice::default(), effect);
        let told = bench.verdicts(&choice).unwrap();
        let told = told.iter().find(|told| told.effect == effect.name).unwrap();
        assert_eq!((told.run, told.price_ms), (false, None));
        assert_eq!(told.why, "it is switched off");
        assert_eq!(errors(told), errors(&usual), "{}", effect.name);
        if effect.random {
            assert_eq!(silent.why, "noise is switched off");
            assert_eq!(errors(&silent), errors(&usual), "{}", effect.name);
        }
        if effect.name == particles {
            let declared = told.error_e.unwrap();
            let measured = bench.error_e(effect, &choice).unwrap();
            let bounds = declared / (10.0 * (1.0 + ROUNDING))..=declared * (1.0 + ROUNDING);
            assert!(bounds.contains(&measured), "{measured} e- of {declared}");
        }
    }
    emulator.choice.off = vec![particles];
    let label = emulator.shoot(&vehicle, 0).unwrap().label;
    let mut effects = label.effects.iter();
    let off = effects.find(|of| of.effect == particles).unwrap();
    assert_eq!((off.run, off.error_e, off.error_px), (false, None, None));
    let mut spots = label.objects.spots.iter();
    assert!(spots.all(|spot| spot.kind != particles));
}

#[test]
fn what_has_nothing_to_work_on_is_not_called_for() {
    each_scene(|name, bench| {
        let off = |names: &[&'static str]| {
            let choice = Choice {
                off: names.to_vec(),
                ..Choice::default()
            };
            bench.verdicts(&choice).unwrap()
        };
        let shapes = EFFECTS.iter().filter(|e| e.stage == Stage::Images).count();
        // Rows that are exposed in turn see the same where nothing moves.
        let still = off(&["smear", "aberration drift"]);
        let rolling = still.iter().find(|v| v.effect == "rolling shutter");
        assert!(rolling.is_some_and(|verdict| !verdict.run), "{name}");
        // No light, no image.
        let lights = EFFECTS.iter().filter(|effect| is_light(effect));
        let lights: Vec<&'static str> = lights.map(|effect| effect.name).collect();
        for verdict in &off(&lights)[..shapes] {
            let price = verdict.price_ms.unwrap_or(0.0);
            assert!(price < 1e-6, "{name}, {}: {price} ms", verdict.effect);
        }
    });
}

/// However thinly light is spread, its electrons come whole: a label's signal is in the frame.
#[test]
fn light_too_thin_for_any_pixel_is_drawn() {
    let path = scenes()
        .into_iter()
        .find(|path| path.ends_with("fast-slew.toml"));
    let mut config = Config::load(&path.unwrap()).unwrap();
    let mission = flight::mission(&config).unwrap();
    let emulator = Emulator::new(&mut config);
    let mut camera = (*emulator.camera()).clone();
    camera.optics.transmission *= 1e-6;
    let bench = Bench {
        emulator: &emulator,
        camera: std::sync::Arc::new(camera),
        vehicle: flight::vehicle(&mission, 0).unwrap(),
    };
    let choice = Choice::default();
    let skip_e = emulator.fidelity().skip_e;
    let verdicts = bench.verdicts(&choice).unwrap();
    let stars = verdicts.iter().find(|v| v.effect == "stars").unwrap();
    assert!(
        stars.error_e.unwrap() < skip_e,
        "{} e- a pixel",
        stars.error_e.unwrap()
    );
    let scene = emulator
        .scene(&bench.camera, &bench.vehicle, 0, &choice)
        .unwrap();
    let all: f64 = scene.sources.iter().map(|source| source.electrons).sum();
    assert!(all > skip_e && stars.run, "{all} e- in all");
    assert!(stars.why.ends_with("e- in all"), "{}", stars.why);
}
