//! What pixels show of a change: no more than they hold; and where charge spills along a column, also elsewhere.
//!
//! Of charge q >= 0 that is added to a column, a pixel shows its own, and what full pixels beside it pass on. A full run of pixels
//! passes on no more than was added to it, for it held no more than it holds now. So with n full pixels, each holding the full well W,
//!
//! ```text
//! change <= min(W + 1, q own + sum of q over n pixels),   n <= charge of the column / W
//! ```

use super::{Scene, Source};
use crate::camera::{Blooming, Detector};

/// What spills, and what pixels hold.
#[derive(Debug, Default)]
pub struct Spill {
    /// Most that a pixel holds, e-.
    pub most_e: f64,
    /// Full pixels of each column at most; empty where nothing spills.
    pub full: Vec<f64>,
    /// Charge of each column, e-; empty where nothing spills.
    pub charge_e: Vec<f64>,
}

impl Spill {
    /// That of a scene whose images are made.
    pub(super) fn of(scene: &Scene) -> Spill {
        let detector = &scene.view.camera.detector;
        let most_e = if scene.simulated.full_well {
            // Whole electrons spill: there may be one more.
            detector.full_well_e + 1.0
        } else {
            f64::INFINITY
        };
        if !scene.spills() {
            return Spill {
                most_e,
                full: Vec::new(),
                charge_e: Vec::new(),
            };
        }
        let response = |pixel| {
            if scene.simulated.response {
                detector.pattern.response_of(pixel)
            } else {
                1.0
            }
        };
        let mut charge_e = columns_e(detector, scene.sources.iter(), response);
        for pixel in 0..detector.pixels() {
            charge_e[pixel % detector.width] += scene.background_of(pixel);
        }
        for (pixel, e) in scene.events.iter().flat_map(|event| &event.pixels) {
            charge_e[*pixel as usize % detector.width] += f64::from(*e);
        }
        let full = charge_e.iter().map(|e| (e / detector.full_well_e).floor());
        Spill {
            most_e,
            full: full.collect(),
            charge_e,
        }
    }

    /// A bound (e-) of the change of what a pixel shows, where its charge changes by at most `e` in any pixel.
    pub fn shown_e(&self, e: f64) -> f64 {
        let full = self.full.iter().copied().fold(0.0, f64::max);
        self.held(e * (1.0 + full))
    }

    /// The same, where `e` is changed in any pixel and in all the pixels of a column together what `columns` says of it.
    pub fn shown_of(&self, e: f64, columns: impl Fn() -> Vec<f64>) -> f64 {
        if self.full.iter().all(|full| *full == 0.0) {
            return self.held(e);
        }
        let columns = columns();
        let spilt = self
            .full
            .iter()
            .zip(columns)
            .filter(|(full, _)| **full > 0.0);
        self.held(spilt.map(|(_, e)| e).fold(e, f64::max))
    }

    fn held(&self, e: f64) -> f64 {
        e.min(self.most_e)
    }
}

impl Scene {
    /// Whether a pixel may fill up and spill along its column.
    pub fn spills(&self) -> bool {
        let detector = &self.view.camera.detector;
        detector.blooming == Blooming::Column
            && self.simulated.full_well
            && self.brightest_e() + self.largest_event_e() > detector.full_well_e
    }
}

/// The light on each column, each pixel's times its `weight` (by row-major index), e-.
pub(super) fn columns_e<'a>(
    detector: &Detector,
    sources: impl Iterator<Item = &'a Source>,
    weight: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let mut columns = vec![0.0; detector.width];
    for source in sources.filter(|source| source.electrons > 0.0) {
        for (row, first, shares) in source.footprint.rows(0..detector.height) {
            let pixels = row * detector.width + first..;
            for ((column, share), pixel) in columns[first..].iter_mut().zip(shares).zip(pixels) {
                *column += source.electrons * f64::from(*share) * weight(pixel);
            }
        }
    }
    columns
}
