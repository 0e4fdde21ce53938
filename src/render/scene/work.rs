//! How much work images are, before they are made: what prices of effects are told by.

use super::view::Candidate;
use super::{EffectSet, Scene, Source, View};
use crate::fidelity::Fidelity;
use crate::footprint::{DOT_NS, LAID_NS, PIXEL_NS as FOOTPRINT_NS};
use crate::track::rule;

/// Places of a track that are looked at.
const PLACES: usize = 5;
/// Sources that are looked at, beside all that are much brighter than the mean; the others are taken to be like them.
const SOURCES: usize = 64;
/// How much brighter those are.
const BRIGHT: f64 = 4.0;

/// ns of a look at a source: its pointing, its line and its projection.
pub(super) const LOOK_NS: f64 = 90.0;
/// ns of a source whose image stands still, beside its pixels.
const SOURCE_NS: f64 = 500.0;
/// The same of a point of a disc, whose light is added to that of others.
const ADDED_NS: f64 = 1.0;
/// ns of a pixel of a footprint when it is drawn.
const DRAWN_NS: f64 = 1.0;
/// Looks at the way of one.
pub(super) const WAY_LOOKS: f64 = 7.0;
/// ns of a point of a panel in which rows open or close, and of each row there: weights, parts in light and centre.
pub(super) const POINT_NS: f64 = 800.0;
pub(super) const ROW_NS: f64 = 70.0;
/// Looks for the instants at which an image's own row opens and closes.
pub(super) const CROSSING: f64 = 100.0;

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

impl View {
    /// How often sources are looked at for images that stand still.
    pub fn looks(&self) -> f64 {
        3.0 * self.candidates.len() as f64
    }

    /// The work of moving images over `seconds`.
    pub fn work(&self, seconds: f64, fidelity: &Fidelity) -> Work {
        let all = self.candidates.len() as f64;
        let mean = self.candidates.iter().map(|c| c.clear_e).sum::<f64>() / all.max(1.0);
        let is_bright = |candidate: &&Candidate| candidate.clear_e > BRIGHT * mean;
        let mut work = Work::default();
        for candidate in self.candidates.iter().filter(is_bright) {
            let points = candidate.body.points() as f64;
            self.add_work(candidate, seconds, points, fidelity, &mut work);
        }
        let faint = || self.candidates.iter().filter(|c| !is_bright(c));
        let count = faint().count();
        let every = count.div_ceil(SOURCES).max(1);
        let share = count as f64 / count.div_ceil(every).max(1) as f64;
        for candidate in faint().step_by(every) {
            self.add_work(candidate, seconds, share, fidelity, &mut work);
        }
        work
    }

    /// Adds that of so many sources like `candidate`.
    fn add_work(
        &self,
        candidate: &Candidate,
        seconds: f64,
        share: f64,
        fidelity: &Fidelity,
        work: &mut Work,
    ) {
        let (camera, detector) = (&self.camera, &self.camera.detector);
        let places = (0..PLACES).filter_map(|i| {
            let dt_s = (i as f64 / (PLACES - 1) as f64 - 0.5) * seconds;
            let part = 0.5 + dt_s / self.open_s.max(f64::MIN_POSITIVE);
            camera
                .optics
                .project(&self.pointing(dt_s).rotate(&candidate.body.line(part)))
        });
        let places: Vec<[f64; 2]> = places.collect();
        let Some(middle) = places.get(places.len() / 2) else {
            return;
        };
        let reach = 2.0 * drawn_px(self, *middle, candidate.clear_e, fidelity) + 1.0;
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
        let [step_px, panel_px, point_px] = self.steps_px(candidate, fidelity);
        let least = match way <= panel_px {
            true => 1.0,
            false => 2.0,
        };
        let panels = (way / step_px).max(least);
        let points = match way <= point_px {
            true => 1.0,
            false => 2.0 * panels,
        };
        let stamp_ns = camera.optics.psf.stamp_ns(side);
        let looks = 2.0 * panels + 7.0;
        let (points_ns, moving_looks) = match self.even(candidate, &EffectSet::default()) {
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
        let rolling_ns =
            cut * (2.0 * stamp_ns + 4.0 * (POINT_NS + rows * ROW_NS)) + looks * LOOK_NS;
        // Where rows collect one after the other, panels stand for streaks of Gaussians too.
        let rolling_ns = rolling_ns + points * stamp_ns - points_ns;
        work.rolling_ms += share * rolling_ns * 1e-6;
    }
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
