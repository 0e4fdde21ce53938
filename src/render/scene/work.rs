//! Estimates of the work of forming images, before they are formed. Estimated times of effects are
//! made of them.

use super::area::motion::{AREA_LOOK_NS, panels};
use super::area::sampled::{STEPS_PX, most_steps};
use super::content::Scene;
use super::effect_set::EffectSet;
use super::imaging::{CROSSING, Imaging, LOOK_NS, POINT_NS, ROW_NS, WAY_LOOKS};
use super::source::{Candidate, Source};
use super::view::View;
use crate::fidelity::Fidelity;
use crate::footprint::{DOT_NS, LAID_NS, PIXEL_NS as FOOTPRINT_NS};
use crate::track::rule;

/// Places of a track that are looked at.
const PLACES: usize = 5;
/// Sources that are looked at, beside all that are much brighter than the mean; the others are taken to be like them.
const SOURCES: usize = 64;
/// How much brighter those are.
const BRIGHT: f64 = 4.0;

/// ns of a source whose image stands still, beside its pixels.
const SOURCE_NS: f64 = 500.0;
/// The same of a point of a disc, whose light is added to that of others.
const ADDED_NS: f64 = 1.0;
/// ns of a pixel of a footprint when it is drawn.
const DRAWN_NS: f64 = 1.0;
/// The work of moving images.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Looks at sources on their ways.
    pub looks: f64,
    /// What moving them takes, rows together, ms.
    pub moving_ms: f64,
    /// What telling rows apart takes, ms.
    pub rolling_ms: f64,
    /// Looks for that.
    pub rolling_looks: f64,
}

/// How often sources are looked at for images that stand still.
pub fn still_looks(view: &View) -> f64 {
    3.0 * view.candidates.len() as f64
}

/// The work of moving images over `seconds`.
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

/// Adds that of so many sources like `candidate`.
fn add_work(
    imaging: &Imaging<'_>,
    candidate: &Candidate,
    seconds: f64,
    share: f64,
    work: &mut Work,
) {
    let (view, fidelity) = (imaging.view, imaging.fidelity);
    let (camera, detector) = (&view.camera, &view.camera.detector);
    let places = (0..PLACES).filter_map(|i| {
        let dt_s = (i as f64 / (PLACES - 1) as f64 - 0.5) * seconds;
        let part = 0.5 + dt_s / view.open_s.max(f64::MIN_POSITIVE);
        camera
            .optics
            .project(&view.pointing(dt_s).rotate(&candidate.body.line(part)))
    });
    let places: Vec<[f64; 2]> = places.collect();
    let Some(middle) = places.get(places.len() / 2) else {
        return;
    };
    let reach = 2.0 * drawn_px(view, *middle, candidate.clear_e, fidelity) + 1.0;
    let inside = |at: &[f64; 2]| {
        let near = |x: f64, pixels: usize| x > -reach && x < pixels as f64 + reach;
        near(at[0], detector.width) && near(at[1], detector.height)
    };
    let lit = places.iter().filter(|at| inside(at)).count() as f64 / PLACES as f64;
    if lit == 0.0 {
        work.looks += share * 7.0;
        work.moving_ms += share * 7.0 * LOOK_NS * 1e-6;
        return;
    }
    let steps = places
        .windows(2)
        .map(|ends| [0, 1].map(|k| ends[1][k] - ends[0][k]));
    let (way, down) = steps.fold((0.0, 0.0), |(way, down), [x, y]: [f64; 2]| {
        (way + libm::hypot(x, y) * lit, down + y.abs() * lit)
    });
    if way <= fidelity.skip_px {
        // A track that short is a point.
        return;
    }
    let [across, rows] = detector.sides().map(|pixels| reach.min(pixels));
    let side = (across * rows).sqrt();
    let [step_px, panel_px, point_px] = imaging.steps_px(candidate);
    let least = if way <= panel_px { 1.0 } else { 2.0 };
    let panels = (way / step_px).max(least);
    let points = if way <= point_px { 1.0 } else { 2.0 * panels };
    let stamp_ns = camera.optics.psf.stamp_ns(side);
    let looks = 2.0 * panels + 7.0;
    let (points_ns, moving_looks) = match imaging.even(candidate) {
        Some(even) if points > 1.0 => {
            let length = way / even.sigma_px;
            let error = fidelity.streak_error(length, even.height_e) / 2.0;
            let dots = rule::count(length, error) as f64;
            (dots * (DOT_NS + side * side * LAID_NS), WAY_LOOKS)
        }
        _ => (points * stamp_ns, looks),
    };
    work.looks += share * moving_looks;
    let moving_ns = points_ns + moving_looks * LOOK_NS + way * side * FOOTPRINT_NS;
    work.moving_ms += share * moving_ns * 1e-6;

    // The rows of an image open during some of its panels, two at least, and close during as many.
    let panels = panels.max(2.0);
    let rows = rows + down;
    let opening_s = rows * camera.readout_s() / detector.height as f64;
    let cut = (2.0 * (1.0 + opening_s * panels / seconds)).min(panels);
    let looks = 2.0 * panels + 2.0 * cut + CROSSING;
    work.rolling_looks += share * looks;
    let rolling_ns = cut * (2.0 * stamp_ns + 4.0 * (POINT_NS + rows * ROW_NS)) + looks * LOOK_NS;
    // Where rows collect one after the other, panels stand for streaks of Gaussians too.
    let rolling_ns = rolling_ns + points * stamp_ns - points_ns;
    work.rolling_ms += share * rolling_ns * 1e-6;
}

/// What smearing area light takes, about, ms: edges are taken to run once across the field.
pub fn areas_smear_ms(view: &View) -> f64 {
    // What an edge crosses, and what is near it: of what moves by less than a pixel only the first is looked at again.
    const EDGE_PX: f64 = 1.5;
    const LIMB_PX: f64 = 8.0;
    const STEP_NS: f64 = 200.0;
    // Places a pixel at which even light is looked at.
    const PLACES: f64 = 0.01;
    // Looks at each pixel of light with details below FEW_PX, for each look that its panels begin with.
    const HALVED: f64 = 6.0;
    const FEW_PX: f64 = 32.0;
    let edged = view.areas.iter().filter(|area| area.has_edges());
    let px = view.longest_path_px();
    let pixels = view.camera.detector.pixels();
    let steps = (STEPS_PX * px + 1.0).min(most_steps(pixels) as f64);
    let [columns, rows] = view.camera.detector.sides();
    let near_px = if px > 1.0 { LIMB_PX } else { EDGE_PX };
    let smeared = ((near_px + px) * (columns + rows)).min(pixels as f64);
    let looks = view.areas.iter().map(|area| {
        let is_fine = !area.has_edges() && area.detail() * view.scale_and_corner_px.0 < FEW_PX;
        let panels = area.radiance.as_ref().map(|of| panels(of.as_ref(), px));
        // Two places a panel, beside the middle.
        (2 * panels.unwrap_or(0)) as f64 * if is_fine { HALVED } else { PLACES }
    });
    let looking = pixels as f64 * looks.sum::<f64>() * AREA_LOOK_NS;
    (edged.count() as f64 * smeared * steps * STEP_NS + looking) * 1e-6
}

/// What the still images of `sources` take, and drawing them as they are, ms.
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
        // A disc is made of points, each with a part of its pixels.
        let points = source.body.points() as f64;
        let side = if moves || points > 1.0 {
            let reach = 2.0 * drawn_px(view, source.centroid, source.clear_e, fidelity) + 1.0;
            let side = sides.map(|pixels| reach.min(pixels).sqrt());
            side.iter().product()
        } else {
            drawn.sqrt()
        };
        let kept_ns = if points > 1.0 { ADDED_NS } else { FOOTPRINT_NS };
        // Some of its kind stand near the field and are looked at in vain.
        points * (SOURCE_NS + 5.0 * LOOK_NS + psf.stamp_ns(side) + side * side * kept_ns)
            + drawn * DRAWN_NS
    });
    still.sum::<f64>() * 1e-6
}

/// How far the light of a source at `at` (px) is drawn.
fn drawn_px(view: &View, at: [f64; 2], electrons: f64, fidelity: &Fidelity) -> f64 {
    let psf = view.camera.optics.psf_at(at, 1.0);
    psf.drawn_px(fidelity, electrons)
}
