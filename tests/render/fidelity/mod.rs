//! The promises of the tolerances of `Fidelity`, on every scene of `configs/scenes/` and some
//! additional ones. Each stated bound holds against `reference`, and somewhere is at most ten times
//! the measured error.

mod configured;
mod extra_scenes;
mod measured;

use crate::fixtures::Frames;
use measured::{CASES, Case, Measure};
use skyloop::config::Config;
use skyloop::effect::EFFECTS;
use skyloop::fidelity::{Choice, Fidelity, TOLERANCES, Tolerance, Value};
use skyloop::measure::Bench;
use skyloop::scene::{EffectId, EffectSet, Scene};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Mutex;

/// Light sources of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lights {
    Points,
    Areas,
    All,
}

impl Lights {
    /// All effects except the lights of the other kind.
    fn choice(self) -> Choice {
        use EffectId::{Moon, Planets, Rsos, Stars};
        let is_among = |light: EffectId| {
            let is_point = [Stars, Rsos, Planets, Moon].contains(&light);
            match self {
                Lights::Points => is_point,
                Lights::Areas => !is_point,
                Lights::All => true,
            }
        };
        let lights = EFFECTS
            .iter()
            .filter(|effect| EffectSet::LIGHTS.has(effect.id));
        let other = lights.filter(|light| !is_among(light.id));
        Choice {
            off: other.map(|effect| effect.name).collect(),
            ..Choice::default()
        }
    }
}

/// `base` with the case's tolerances set as in `preset`.
fn moved(base: Fidelity, case: &Case, preset: &Fidelity) -> Fidelity {
    let mut fidelity = base;
    for name in case.also.iter().chain([&case.tolerance]) {
        let tolerance = Tolerance::named(name).unwrap();
        (tolerance.set)(&mut fidelity, (tolerance.get)(preset));
    }
    fidelity
}

/// The stated bound of a tolerance's value.
fn bound(tolerance: &Tolerance, preset: &Fidelity) -> f64 {
    match (tolerance.get)(preset) {
        Value::Number(value) => (tolerance.bound)(value),
        Value::Word(_) => (tolerance.bound)(0.0),
    }
}

/// The maximum errors by tolerance and preset, each with its scene.
#[derive(Default)]
struct Worst(BTreeMap<(&'static str, &'static str), (f64, String)>);

const COARSE: [(&str, Fidelity); 2] = [("fast", Fidelity::FAST), ("realtime", Fidelity::REALTIME)];

impl Worst {
    fn see(&mut self, case: &Case, preset: &'static str, error: f64, scene: &str) {
        let worst = self.0.entry((case.tolerance, preset)).or_default();
        if error > worst.0 {
            *worst = (error, scene.to_string());
        }
    }

    /// Adds the errors of a frame in the middle of a scene.
    fn add(worst: &Mutex<Worst>, name: &str, config: Config) {
        let frames = Frames::of(config);
        let vehicle = frames.vehicle(frames.mission.frames / 2);
        let mut emulator = frames.emulator;
        for lights in [Lights::Points, Lights::Areas, Lights::All] {
            let choice = lights.choice();
            let mut truth: Option<Scene> = None;
            for case in CASES.iter().filter(|case| case.lights == lights) {
                let tolerance = Tolerance::named(case.tolerance).unwrap();
                let coarse = COARSE
                    .iter()
                    .filter(|(_, preset)| !tolerance.is_same(preset, &Fidelity::REFERENCE));
                for (preset, values) in coarse {
                    let error = match case.measure {
                        Measure::Scenes(measure) => {
                            let mut scene = |fidelity| {
                                emulator.set_fidelity(fidelity);
                                let camera = emulator.camera();
                                emulator.scene(&camera, &vehicle, 0, &choice).unwrap()
                            };
                            let fine = moved(Fidelity::REFERENCE, case, &Fidelity::REFERENCE);
                            let truth = truth.get_or_insert_with(|| scene(fine));
                            let moved = moved(Fidelity::REFERENCE, case, values);
                            measure(truth, &scene(moved), &moved)
                        }
                        Measure::Skipped(measure) => {
                            // The skipped part is the same for any accuracy of the rest.
                            emulator.set_fidelity(moved(Fidelity::REALTIME, case, values));
                            measure(&Bench {
                                emulator: &emulator,
                                camera: emulator.camera(),
                                vehicle: vehicle.clone(),
                            })
                        }
                    };
                    worst.lock().unwrap().see(case, preset, error, name);
                }
            }
        }
    }
}

#[test]
#[ignore = "long: minutes of work; tests/run all runs it"]
fn long_bounds_hold_and_are_near_the_truth() {
    let shipped = crate::scenes::scenes().into_iter();
    let mut waiting: Vec<(String, Config)> = shipped
        .map(|path| (path.display().to_string(), Config::load(&path).unwrap()))
        .collect();
    waiting.extend(extra_scenes::scenes());
    let (waiting, worst) = (Mutex::new(waiting), Mutex::new(Worst::default()));
    // One scene is too small for all threads.
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let next = waiting.lock().unwrap().pop();
                    let Some((name, config)) = next else { break };
                    Worst::add(&worst, &name, config);
                }
            });
        }
    });
    let worst = worst.into_inner().unwrap();
    let (mut wrong, mut report) = (String::new(), String::new());
    for ((name, preset), (error, scene)) in &worst.0 {
        let values = Fidelity::preset(preset).unwrap();
        let tolerance = Tolerance::named(name).unwrap();
        let bound = bound(tolerance, &values);
        let line = format!("{name} of {preset}: {error:.3e} of {bound:.3e}, {scene}\n");
        if *error > bound || bound > 10.0 * error {
            wrong.push_str(&line);
        }
        write!(report, "{line}").unwrap();
    }
    println!("{report}");
    assert!(wrong.is_empty(), "{wrong}");
}

/// Tolerances without an error per scene, measured in src/base/tests/words.rs.
const ELSEWHERE: &[&str] = &["poisson_tv"];

#[test]
fn every_tolerance_is_measured() {
    let tolerances = TOLERANCES
        .iter()
        .filter(|tolerance| !ELSEWHERE.contains(&tolerance.name));
    for tolerance in tolerances {
        let cases = CASES
            .iter()
            .filter(|case| case.tolerance == tolerance.name)
            .count();
        assert_eq!(cases, 1, "{}", tolerance.name);
    }
}
