//! How much work images are, before they are made: what prices of effects are told by.

use super::{Body, View};
use crate::fidelity::Fidelity;

/// Places of a track that are looked at.
const PLACES: usize = 9;
/// Sources that are looked at; the others are taken to be like them.
const SOURCES: usize = 48;

/// The images of a view, counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Sources near the detector at some time.
    pub sources: f64,
    /// Panels of their tracks.
    pub panels: f64,
    /// Pixels that tracks reach beyond those of images that stand still.
    pub wider: f64,
    /// Pixels of one sample.
    pub stamp: f64,
    /// Rows of one sample.
    pub rows: f64,
}

impl View {
    /// How often, about, a source is looked at for its image to stand still.
    pub fn looks(&self) -> f64 {
        4.0 * self.candidates.len() as f64
    }

    /// The work of moving images over `seconds`.
    pub fn work(&self, seconds: f64, fidelity: &Fidelity) -> Work {
        let (camera, psf) = (&self.camera, &self.camera.optics.psf);
        let side = 2.0 * psf.reach_px(fidelity.psf_loss) + 1.0;
        let step = fidelity.track_step_sigma * psf.core_px();
        let every = self.candidates.len().div_ceil(SOURCES).max(1);
        let detector = &camera.detector;
        let mut work = Work {
            stamp: side * side,
            rows: side,
            ..Work::default()
        };
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
            work.panels += share * (way / step).max(2.0);
            work.wider += share * way * side;
        }
        work
    }
}
