//! Estimated work of image formation, for the estimated times of effects.

use super::area::motion::{AREA_EVALUATION_NS, panels};
use super::area::sampled::{STEPS_PX, max_steps};
use super::content::Scene;
use super::effect_set::EffectSet;
use super::imaging::{
    CROSSING_EVALUATIONS, EVALUATION_NS, Imaging, PATH_EVALUATIONS, POINT_NS, ROW_NS,
};
use super::source::{Candidate, Source};
use super::view::View;
use crate::fidelity::Fidelity;
use crate::footprint::{DOT_NS, DOT_PIXEL_NS, PIXEL_NS as FOOTPRINT_NS};
use crate::track::rule;

/// Samples of a track.
const SAMPLES: usize = 5;
/// Number of faint sources that represent all others. Sources much brighter than the mean are all
/// evaluated.
const SOURCES: usize = 64;
/// Brightness above which a source counts as much brighter, in units of the mean.
const BRIGHT: f64 = 4.0;

/// Time of a source with a still image, without its pixels, ns.
const SOURCE_NS: f64 = 500.0;
/// Time of adding a pixel of a point of a disc, ns.
const ADDED_NS: f64 = 1.0;
/// Time of drawing a pixel of a footprint, ns.
const DRAWN_NS: f64 = 1.0;

/// The work of moving images.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Evaluations of sources along their paths.
    pub evaluations: f64,
    /// Time with all rows together, ms.
    pub moving_ms: f64,
    /// Further time with a rolling shutter, ms.
    pub rolling_ms: f64,
    /// Evaluations for a rolling shutter.
    pub rolling_evaluations: f64,
}

/// Number of evaluations of sources for still images.
pub fn still_evaluations(view: &View) -> f64 {
    3.0 * view.candidates.len() as f64
}

/// The work of images that move for `seconds`.
pub fn work(view: &View, seconds: f64, fidelity: &Fidelity) -> Work {
    let imaging = Imaging {
        view,
        simulated: &EffectSet::default(),
        fidelity,
    };
    let all = view.candidates.len() as f64;
    let mean = view.candidates.iter().map(|c| c.clear_e).sum::<f64>() / all.max(1.0);
    let is_bright = |candidate: &&Candidate| candidate.clear_e > BRIGHT * mean;
    let mut work = Work::default();
    for candidate in view.candidates.iter().filter(is_bright) {
        let points = candidate.body.points() as f64;
        add_work(&imaging, candidate, seconds, points, &mut work);
    }
    let faint = || view.candidates.iter().filter(|c| !is_bright(c));
    let count = faint().count();
    let every = count.div_ceil(SOURCES).max(1);
    let share = count as f64 / count.div_ceil(every).max(1) as f64;
    for candidate in faint().step_by(every) {
        add_work(&imaging, candidate, seconds, share, &mut work);
    }
    work
}

/// Positions of a source during `seconds`, those in front of the camera, px.
fn positions(view: &View, candidate: &Candidate, seconds: f64) -> Vec<[f64; 2]> {
    let positions = (0..SAMPLES).filter_map(|i| {
        let dt_s = (i as f64 / (SAMPLES - 1) as f64 - 0.5) * seconds;
        let part = 0.5 + dt_s / view.open_s.max(f64::MIN_POSITIVE);
        let direction = view.pointing(dt_s).rotate(&candidate.body.line(part));
        view.camera.optics.project(&direction)
    });
    positions.collect()
}

/// Adds the work of `share` sources like `candidate`.
fn add_work(
    imaging: &Imaging<'_>,
    candidate: &Candidate,
    seconds: f64,
    share: f64,
    work: &mut Work,
) {
    let (view, fidelity) = (imaging.view, imaging.fidelity);
    let (camera, detector) = (&view.camera, &view.camera.detector);
    let positions = positions(view, candidate, seconds);
    let Some(middle) = positions.get(positions.len() / 2) else {
        return;
    };
    let reach = 2.0 * drawn_px(view, *middle, candidate.clear_e, fidelity) + 1.0;
    let inside = |at: &[f64; 2]| {
        let near = |x: f64, pixels: usize| x > -reach && x < pixels as f64 + reach;
        near(at[0], detector.width) && near(at[1], detector.height)
    };
    let lit = positions.iter().filter(|at| inside(at)).count() as f64 / SAMPLES as f64;
    if lit == 0.0 {
        work.evaluations += share * 7.0;
        work.moving_ms += share * 7.0 * EVALUATION_NS * 1e-6;
        return;
    }
    let (mut path_px, mut down) = (0.0, 0.0);
    for ends in positions.windows(2) {
        let [x, y] = [0, 1].map(|k| ends[1][k] - ends[0][k]);
        path_px += libm::hypot(x, y) * lit;
        down += y.abs() * lit;
    }
    if path_px <= fidelity.skip_px {
        // So short a track is a point.
        return;
    }
    let [across, rows] = detector.sides().map(|pixels| reach.min(pixels));
    let side = (across * rows).sqrt();
    let [step_px, panel_px, point_px] = imaging.steps_px(candidate);
    let min_panels = if path_px <= panel_px { 1.0 } else { 2.0 };
    let panels = (path_px / step_px).max(min_panels);
    let points = if path_px <= point_px {
        1.0
    } else {
        2.0 * panels
    };
    let stamp_ns = camera.optics.psf.stamp_ns(side);
    let evaluations = 2.0 * panels + 7.0;
    let (points_ns, moving_evaluations) = match imaging.even(candidate) {
        Some(even) if points > 1.0 => {
            let length = path_px / even.sigma_px;
            let error = fidelity.streak_error(length, even.height_e) / 2.0;
            let dots = rule::count(length, error) as f64;
            (
                dots * (DOT_NS + side * side * DOT_PIXEL_NS),
                PATH_EVALUATIONS,
            )
        }
        _ => (points * stamp_ns, evaluations),
    };
    work.evaluations += share * moving_evaluations;
    let moving_ns = points_ns + moving_evaluations * EVALUATION_NS + path_px * side * FOOTPRINT_NS;
    work.moving_ms += share * moving_ns * 1e-6;

    // The rows of an image open during at least two of its panels, and close during as many.
    let panels = panels.max(2.0);
    let rows = rows + down;
    let opening_s = rows * camera.readout_s() / detector.height as f64;
    let cut = (2.0 * (1.0 + opening_s * panels / seconds)).min(panels);
    let evaluations = 2.0 * panels + 2.0 * cut + CROSSING_EVALUATIONS;
    work.rolling_evaluations += share * evaluations;
    let rolling_ns =
        cut * (2.0 * stamp_ns + 4.0 * (POINT_NS + rows * ROW_NS)) + evaluations * EVALUATION_NS;
    // With a rolling shutter, streaks of Gaussians are drawn by panels too.
    let rolling_ns = rolling_ns + points * stamp_ns - points_ns;
    work.rolling_ms += share * rolling_ns * 1e-6;
}

/// Estimated time of smearing area light, ms; assumes that edges cross the field once.
pub fn areas_smear_ms(view: &View) -> f64 {
    // Width of an edge on the pixels; and with pixels near it, for motion beyond a pixel.
    const EDGE_PX: f64 = 1.5;
    const LIMB_PX: f64 = 8.0;
    const STEP_NS: f64 = 200.0;
    // Evaluations of smooth light on a pixel for each initial evaluation: it is interpolated.
    const EVEN: f64 = 0.01;
    // The same of light with detail below FEW_PX.
    const HALVED: f64 = 6.0;
    const FEW_PX: f64 = 32.0;
    let edged = view.areas.iter().filter(|area| area.has_edges());
    let px = view.longest_path_px();
    let pixels = view.camera.detector.pixels();
    let steps = (STEPS_PX * px + 1.0).min(max_steps(pixels) as f64);
    let [columns, rows] = view.camera.detector.sides();
    let near_px = if px > 1.0 { LIMB_PX } else { EDGE_PX };
    let smeared = ((near_px + px) * (columns + rows)).min(pixels as f64);
    let evaluations = view.areas.iter().map(|area| {
        let is_fine = !area.has_edges() && area.detail() * view.scale_and_corner_px.0 < FEW_PX;
        let panels = area.radiance.as_ref().map(|of| panels(of.as_ref(), px));
        // Two evaluations a panel, besides the middle.
        (2 * panels.unwrap_or(0)) as f64 * if is_fine { HALVED } else { EVEN }
    });
    let evaluating_ns = pixels as f64 * evaluations.sum::<f64>() * AREA_EVALUATION_NS;
    (edged.count() as f64 * smeared * steps * STEP_NS + evaluating_ns) * 1e-6
}

/// Time of the still images of `sources`, and of drawing their present images, ms.
pub fn still_ms<'a>(
    scene: &Scene,
    sources: impl Iterator<Item = &'a Source>,
    fidelity: &Fidelity,
) -> f64 {
    let (view, psf) = (&scene.view, &scene.view.camera.optics.psf);
    let moves = scene.simulated.moves_images();
    let sides = view.camera.detector.sides();
    let still = sources.map(|source| {
        let drawn = source.footprint.shares().len() as f64;
        // A disc consists of points, each with a part of its pixels.
        let points = source.body.points() as f64;
        let side = if moves || points > 1.0 {
            let reach = 2.0 * drawn_px(view, source.centroid, source.clear_e, fidelity) + 1.0;
            let side = sides.map(|pixels| reach.min(pixels).sqrt());
            side.iter().product()
        } else {
            drawn.sqrt()
        };
        let pixel_ns = if points > 1.0 { ADDED_NS } else { FOOTPRINT_NS };
        // Further sources near the field are evaluated without an image.
        points * (SOURCE_NS + 5.0 * EVALUATION_NS + psf.stamp_ns(side) + side * side * pixel_ns)
            + drawn * DRAWN_NS
    });
    still.sum::<f64>() * 1e-6
}

/// Drawing radius of a source at `at` (px), px.
fn drawn_px(view: &View, at: [f64; 2], electrons: f64, fidelity: &Fidelity) -> f64 {
    let psf = view.camera.optics.psf_at(at, 1.0);
    psf.drawn_px(fidelity, electrons)
}
