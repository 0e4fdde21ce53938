//! Measurement of each tolerance's error, in the unit of its stated bound.

use super::Lights;
use skyloop::effect::{Assess, Decision, Stage};
use skyloop::fidelity::{Choice, Fidelity};
use skyloop::measure::Bench;
use skyloop::plan::{Plan, Step};
use skyloop::scene::{EffectId, Scene, Source};
use std::collections::{HashMap, HashSet};

/// The measurement of one tolerance.
pub struct Case {
    pub tolerance: &'static str,
    /// Tolerances that must change with it to have an effect.
    pub also: &'static [&'static str],
    pub lights: Lights,
    pub measure: Measure,
}

pub enum Measure {
    /// By the scenes of the reference and of the changed tolerance.
    Scenes(fn(&Scene, &Scene, &Fidelity) -> f64),
    /// By the effects skipped with the changed tolerance.
    Skipped(fn(&Bench<'_>) -> f64),
}

const fn case(
    tolerance: &'static str,
    also: &'static [&'static str],
    lights: Lights,
    measure: Measure,
) -> Case {
    Case {
        tolerance,
        also,
        lights,
        measure,
    }
}

/// Errors of images, by the scenes of the reference and of the changed tolerance.
const fn points(tolerance: &'static str, measure: fn(&Scene, &Scene, &Fidelity) -> f64) -> Case {
    case(tolerance, &[], Lights::Points, Measure::Scenes(measure))
}

pub const CASES: &[Case] = &[
    points("psf_loss", |truth, coarse, _| lost(truth, coarse, |_| 1.0)),
    points("loss_e", |truth, coarse, _| {
        lost(truth, coarse, |of| of.clear_e)
    }),
    points("wing_e", |truth, coarse, _| {
        off(truth, coarse, |of, _| of.clear_e)
    }),
    points("track_step_sigma", |truth, coarse, _| {
        off(truth, coarse, |_, highest| 1.0 / highest)
    }),
    points("track_e", |truth, coarse, _| {
        off(truth, coarse, |of, _| of.clear_e)
    }),
    points("star_snr", |truth, coarse, _| missing_snr(truth, coarse)),
    points("orbits", |truth, coarse, _| moved(truth, coarse)),
    case(
        "area_e",
        &["area_part"],
        Lights::Areas,
        Measure::Scenes(area_e),
    ),
    case(
        "area_part",
        &["area_e"],
        Lights::Areas,
        Measure::Scenes(area_part),
    ),
    case("skip_e", &[], Lights::All, Measure::Skipped(skipped_e)),
    case(
        "skip_snr",
        &["skip_e"],
        Lights::All,
        Measure::Scenes(skipped_snr),
    ),
    case(
        "skip_px",
        &["skip_e"],
        Lights::All,
        Measure::Skipped(skipped_px),
    ),
];

type Pixels = HashMap<(usize, usize), f64>;

fn pixels(source: &Source, rows: usize) -> Pixels {
    let mut pixels = HashMap::new();
    for (row, column, shares) in source.footprint.rows(0..rows) {
        for (column, share) in (column..).zip(shares) {
            pixels.insert((row, column), f64::from(*share));
        }
    }
    pixels
}

/// Images in both scenes.
fn both<'s>(truth: &'s Scene, coarse: &'s Scene) -> impl Iterator<Item = [&'s Source; 2]> {
    let of = |source: &'s Source| (source.body.identity(), source);
    let coarse: HashMap<_, _> = coarse.sources.iter().map(of).collect();
    let found = truth.sources.iter();
    found.filter_map(move |source| Some([source, *coarse.get(&source.body.identity())?]))
}

/// Images in both scenes, whole on the detector.
fn whole<'s>(truth: &'s Scene, coarse: &'s Scene) -> impl Iterator<Item = [&'s Source; 2]> {
    let sides = truth.view.camera.detector.sides();
    both(truth, coarse).filter(move |[source, _]| {
        let reach = source.footprint.wings.drawn_px + 1.0;
        let inside = |at: &[f64; 2]| {
            let mut along = at.iter().zip(sides);
            along.all(|(at, side)| *at > reach && *at < side - 1.0 - reach)
        };
        [source.start, source.centroid, source.end]
            .iter()
            .all(inside)
    })
}

/// The maximum lost share of an image, times `scale` of the image.
fn lost(truth: &Scene, coarse: &Scene, scale: impl Fn(&Source) -> f64) -> f64 {
    let share = |source: &Source| -> f64 {
        let shares = source.footprint.shares().iter();
        shares.map(|share| f64::from(*share)).sum()
    };
    let lost = whole(truth, coarse)
        .map(|[source, coarse]| (share(source) - share(coarse)) * scale(source));
    lost.fold(0.0, f64::max)
}

/// Rounding error of f32 sums of as many panels as a long streak has, relative to all its light.
const ROUNDING: f64 = 1e-7;

/// The maximum difference of an image's share on a pixel, times `scale` of the image and of its
/// maximum share.
fn off(truth: &Scene, coarse: &Scene, scale: impl Fn(&Source, f64) -> f64) -> f64 {
    let rows = truth.view.camera.detector.height;
    let differences = whole(truth, coarse).map(|[source, other]| {
        if source.footprint == other.footprint {
            return 0.0;
        }
        let (a, b) = (pixels(source, rows), pixels(other, rows));
        let share = |of: &Pixels, at| of.get(at).copied().unwrap_or(0.0);
        let positions = a.keys().chain(b.keys());
        let max = positions.map(|at| (share(&a, at) - share(&b, at)).abs());
        let highest = a.values().copied().fold(f64::MIN_POSITIVE, f64::max);
        (max.fold(0.0, f64::max) - ROUNDING).max(0.0) * scale(source, highest)
    });
    differences.fold(0.0, f64::max)
}

/// The maximum displacement of an image, px.
fn moved(truth: &Scene, coarse: &Scene) -> f64 {
    let moves = both(truth, coarse).map(|[a, b]| {
        let ends = [(a.start, b.start), (a.centroid, b.centroid), (a.end, b.end)];
        let apart = ends.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        apart.into_iter().fold(0.0, f64::max)
    });
    moves.fold(0.0, f64::max)
}

/// The maximum error of a pixel's area light, in units of the sum of both tolerances. `of_parts`
/// selects the pixels where the relative tolerance dominates, else the others.
fn area(truth: &Scene, coarse: &Scene, by: &Fidelity, of_parts: bool) -> f64 {
    let mut max = 0.0f64;
    for (truth, coarse) in truth.areas.iter().zip(&coarse.areas) {
        for (e, other) in truth.e().iter().zip(coarse.e()) {
            let (e, other) = (f64::from(*e), f64::from(*other));
            let part_e = by.area_part * e;
            if (part_e > by.area_e) == of_parts {
                max = max.max((e - other).abs() / (by.area_e + part_e));
            }
        }
    }
    max
}

/// Of pixels where the absolute tolerance dominates, e-.
fn area_e(truth: &Scene, coarse: &Scene, by: &Fidelity) -> f64 {
    by.area_e * area(truth, coarse, by, false)
}

/// Of pixels where the relative tolerance dominates.
fn area_part(truth: &Scene, coarse: &Scene, by: &Fidelity) -> f64 {
    by.area_part * area(truth, coarse, by, true)
}

/// The maximum signal-to-noise ratio of an image that `coarse` lacks.
fn missing_snr(truth: &Scene, coarse: &Scene) -> f64 {
    let found = coarse.sources.iter().map(|source| source.body.identity());
    let found: HashSet<_> = found.collect();
    let missing = truth.sources.iter();
    let missing = missing.filter(|source| !found.contains(&source.body.identity()));
    missing.map(|source| source.clear_snr).fold(0.0, f64::max)
}

/// The same for objects, and for all light of a skipped area.
fn skipped_snr(truth: &Scene, coarse: &Scene, fidelity: &Fidelity) -> f64 {
    let skipped = |scene: &Scene, fidelity: &Fidelity| -> Vec<EffectId> {
        let plan = Plan::new(scene, fidelity, &Choice::default());
        let steps = plan.steps.iter();
        let skipped = steps.filter(|step| matches!(step.decision, Decision::Skip { .. }));
        skipped.map(|step| step.effect.id).collect()
    };
    let always = skipped(truth, &Fidelity::REFERENCE);
    let skipped = skipped(coarse, fidelity);
    let detector = &truth.view.camera.detector;
    let floor = detector.read_noise_e.powi(2) + detector.quantisation_variance();
    let areas = truth.areas.iter().filter(|area| {
        let effect = area.effect;
        skipped.contains(&effect) && !always.contains(&effect)
    });
    let snr = areas.map(|area| {
        let squares = area.e().iter().map(|e| {
            let e = f64::from(*e);
            e * e / (e + floor)
        });
        squares.sum::<f64>().sqrt()
    });
    snr.fold(missing_snr(truth, coarse), f64::max)
}

/// The effects that are skipped with the frame's own choice although they would change it.
fn skipped(bench: &Bench<'_>) -> Vec<&'static skyloop::effect::Effect> {
    let emulator = bench.emulator;
    let choice = Choice::default();
    let scene = emulator.scene(&bench.camera, &bench.vehicle, 0, &choice);
    let scene = scene.unwrap();
    let plan = Plan::new(&scene, emulator.fidelity(), &choice);
    let is_skipped = |step: &&Step<'_>| matches!(step.decision, Decision::Skip { .. });
    let loses = |step: &&Step<'_>| {
        let error = plan.error(step).unwrap();
        error.e > 0.0 || error.px > 0.0
    };
    let steps = plan.steps.iter().filter(is_skipped).filter(loses);
    steps.map(|step| step.effect).collect()
}

const ALL: Choice = Choice {
    noise: true,
    off: Vec::new(),
    all: true,
};

/// The maximum change of a pixel's expectation by a skipped effect.
fn skipped_e(bench: &Bench<'_>) -> f64 {
    let effects = skipped(bench).into_iter();
    // Random effects are the rms of many frames (tests/render/plan.rs). Effects on images are
    // measured in pixels.
    let effects = effects.filter(|effect| !effect.random && effect.stage != Stage::Images);
    let errors = effects.map(|effect| bench.error_e(effect, &ALL).unwrap());
    errors.fold(0.0, f64::max)
}

/// The maximum image displacement by a skipped effect.
fn skipped_px(bench: &Bench<'_>) -> f64 {
    let effects = skipped(bench).into_iter();
    let images = effects.filter(|effect| {
        effect.stage == Stage::Images && matches!(effect.assess, Assess::Images(..))
    });
    let errors = images.map(|effect| bench.error_px(effect, &ALL).unwrap());
    errors.fold(0.0, f64::max)
}
