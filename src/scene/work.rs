//! How much work images are, before they are made: what prices of effects are told by.

use super::{Body, Scene, Source, View};
use crate::fidelity::Fidelity;

/// Places of a track that are looked at.
const PLACES: usize = 5;
/// Sources that are looked at; the others are taken to be like them.
const SOURCES: usize = 32;

/// ns of a look at a source: its pointing, its line and its projection.
const LOOK_NS: f64 = 90.0;
/// ns of a source whose image stands still, beside its pixels.
const SOURCE_NS: f64 = 500.0;
/// ns of a pixel of a footprint: its two terms of signal-to-noise ratios, its part in bounds.
const FOOTPRINT_NS: f64 = 7.0;
/// ns of a pixel of a footprint when it is drawn.
const DRAWN_NS: f64 = 1.0;

/// The images of a view, counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Sources near the detector at some time.
    pub sources: f64,
    /// Panels of their tracks.
    pub panels: f64,
    /// Pixels that tracks reach beyond those of images that stand still.
    pub wider: f64,
    /// Rows (and columns) of one sample, on average.
    pub rows: f64,
}

impl View {
    /// How often, about, sources are looked at, still or moving.
    pub fn looks(&self, fidelity: &Fidelity) -> f64 {
        let still = 3.0 * self.candidates.len() as f64;
        if self.longest_track_px(self.exposure.duration_s) <= fidelity.skip_px {
            return still;
        }
        let moving = self.work(self.exposure.duration_s, fidelity).looks();
        if self.rolls(fidelity) {
            still + moving + self.work(self.open_s, fidelity).rolling_looks()
        } else {
            still + moving
        }
    }

    /// Whether images move while rows are told apart.
    fn rolls(&self, fidelity: &Fidelity) -> bool {
        let readout_s = self.camera.readout_s();
        readout_s > 0.0 && self.longest_track_px(readout_s) / 2.0 > fidelity.skip_px
    }

    /// What it takes to tell rows apart, ms; 0 where nothing calls for it.
    pub fn rolling_ms(&self, fidelity: &Fidelity) -> f64 {
        if self.rolls(fidelity) {
            self.work(self.open_s, fidelity).rolling_ms(self)
        } else {
            0.0
        }
    }

    /// The work of moving images over `seconds`.
    pub fn work(&self, seconds: f64, fidelity: &Fidelity) -> Work {
        let camera = &self.camera;
        let every = self.candidates.len().div_ceil(SOURCES).max(1);
        let detector = &camera.detector;
        let mut work = Work::default();
        let looked = self.candidates.iter().step_by(every);
        let share = self.candidates.len() as f64 / looked.len().max(1) as f64;
        for candidate in looked {
            let places = (0..PLACES).filter_map(|i| {
                let dt_s = (i as f64 / (PLACES - 1) as f64 - 0.5) * seconds;
                let part = 0.5 + dt_s / self.open_s.max(f64::MIN_POSITIVE);
                let line = match &candidate.body {
                    Body::Star(star) => star.direction,
                    Body::Rso(_) => candidate.line(part),
                };
                camera.optics.project(&self.pointing(dt_s).rotate(&line))
            });
            let places: Vec<[f64; 2]> = places.collect();
            let side = places
                .get(places.len() / 2)
                .map_or(0.0, |at| side_px(self, *at, candidate.clear_e, fidelity));
            let inside = |at: &[f64; 2]| {
                let near = |x: f64, pixels: usize| x > -side && x < pixels as f64 + side;
                near(at[0], detector.width) && near(at[1], detector.height)
            };
            let lit = places.iter().filter(|at| inside(at)).count();
            if lit == 0 {
                continue;
            }
            let ways = places
                .windows(2)
                .map(|ends| (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]));
            let way = ways.sum::<f64>() * lit as f64 / PLACES as f64;
            work.sources += share;
            work.panels += share * (way / self.step_px(candidate, fidelity)).max(2.0);
            work.wider += share * way * side;
            work.rows += share * side;
        }
        work.rows /= work.sources.max(1.0);
        work
    }
}

impl Work {
    /// Looks at sources that move: at two samples a panel, and at the pieces of each track.
    fn looks(&self) -> f64 {
        2.0 * self.panels + 7.0 * self.sources
    }

    /// Samples for rows that are told apart: two at two edges of each row of an image.
    fn rolling_samples(&self) -> f64 {
        4.0 * self.rows * self.sources
    }

    /// Looks beside: the ends of panels, and the search for the instants at which the image's own row opens and closes.
    fn rolling_looks(&self) -> f64 {
        self.rolling_samples() + 2.0 * self.panels + 100.0 * self.sources
    }

    /// What it takes to move images, ms: the panels of their tracks, and the pixels that they reach.
    pub fn moving_ms(&self, view: &View) -> f64 {
        let stamps_ns = 2.0 * self.panels * view.camera.optics.psf.stamp_ns(self.rows);
        (stamps_ns + self.looks() * LOOK_NS + self.wider * FOOTPRINT_NS) * 1e-6
    }

    /// What it takes to tell rows apart, ms: each sample is spread for what is collected, and half of it for the image.
    fn rolling_ms(&self, view: &View) -> f64 {
        let stamp_ns = view.camera.optics.psf.stamp_ns(self.rows);
        (1.5 * self.rolling_samples() * stamp_ns + self.rolling_looks() * LOOK_NS) * 1e-6
    }
}

/// What the still images of `sources` take, and drawing them as they are, ms.
pub fn still_ms(scene: &Scene, sources: &[&Source], fidelity: &Fidelity) -> f64 {
    let (view, psf) = (&scene.view, &scene.view.camera.optics.psf);
    let moves = scene.simulated.smear || scene.simulated.aberration_drift;
    let still = sources.iter().map(|source| {
        let drawn = source.footprint.shares().len() as f64;
        let side = if moves {
            side_px(view, source.centroid, source.clear_e, fidelity)
        } else {
            drawn.sqrt()
        };
        // Some of its kind stand near the field and are looked at in vain.
        SOURCE_NS
            + 5.0 * LOOK_NS
            + psf.stamp_ns(side)
            + side * side * FOOTPRINT_NS
            + drawn * DRAWN_NS
    });
    still.sum::<f64>() * 1e-6
}

/// Rows and columns of the spread of a source of that light at `at` (px).
fn side_px(view: &View, at: [f64; 2], electrons: f64, fidelity: &Fidelity) -> f64 {
    let psf = view.camera.optics.psf_at(at, 1.0);
    2.0 * psf.drawn_px(fidelity, electrons) + 1.0
}
