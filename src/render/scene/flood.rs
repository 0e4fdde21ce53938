//! Pixels that are full before any star or object adds its light.

use super::{EffectId, Scene, signal};
use rayon::prelude::*;

impl Scene {
    /// The effect that adds the most charge, where every pixel is full without a star or an object in it; none where a pixel is not full.
    pub fn flooded_by(&self) -> Option<EffectId> {
        if let Some(kind) = self.spill.flood {
            return Some(kind.effect);
        }
        let full_e = signal::full_e(&self.view.camera.detector, &self.simulated);
        // The least pixel has no more than the mean.
        if self.background_e() * self.responds() < full_e || self.full_part() < 1.0 {
            return None;
        }
        let pixels = self.view.camera.detector.pixels() as f64;
        let areas = self.areas.iter();
        let areas = areas.map(|area| (area.kind.effect, area.electrons / pixels));
        let others = [
            (EffectId::DarkCurrent, self.dark_e()),
            (EffectId::FrameTransfer, self.mean_trail_e()),
        ];
        let most = areas.chain(others).max_by(|a, b| a.1.total_cmp(&b.1));
        most.map(|(effect, _)| effect)
    }

    /// The part of the pixels (1) that are full in expectation without a star or an object in them.
    pub fn full_part(&self) -> f64 {
        let detector = &self.view.camera.detector;
        let full_e = signal::full_e(detector, &self.simulated);
        if self.brightest_e() < full_e {
            return 0.0;
        }
        let rows = (0..detector.height).into_par_iter();
        let rows = rows.filter(|_| !self.is_cancelled());
        let full = rows.map_init(Vec::new, |light_e: &mut Vec<f32>, row| {
            let first = row * detector.width;
            light_e.clear();
            light_e.resize(detector.width, 0.0);
            self.areas_together().add_to_row(first, light_e);
            let charges = (first..).zip(&*light_e);
            let charges = charges.map(|(pixel, e)| self.without_sources_e(pixel, f64::from(*e)));
            charges.filter(|e| *e >= full_e).count()
        });
        full.sum::<usize>() as f64 / detector.pixels() as f64
    }

    /// The expected charge of a pixel in which area sources leave `light_e`, and stars and objects nothing, e-.
    fn without_sources_e(&self, pixel: usize, light_e: f64) -> f64 {
        let (detector, simulated) = (&self.view.camera.detector, &self.simulated);
        let mut e = light_e;
        if simulated.has(EffectId::PixelResponse) {
            e *= detector.pattern.response_of(pixel);
        }
        if simulated.has(EffectId::DarkCurrent) {
            e += detector.pattern.dark_e_s_of(pixel) * self.view.exposure.duration_s;
        }
        e + self.trail().get(pixel % detector.width).unwrap_or(&0.0)
    }
}
