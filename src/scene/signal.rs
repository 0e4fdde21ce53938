//! What a source's light is worth: its signal-to-noise ratio on the detector as it is simulated.
//!
//! ```text
//! snr^2 = sum S^2 / V    over the pixels: the best that any weighting of them can reach
//! S = c(s + b) - c(b),   V = c'(s + b)^2 (s + b) + read^2 + gain^2 / 12
//! ```
//!
//! with the light s and the background b (area light, dark charge and what transfer adds to the column, e-) of the pixel as it responds, and the curve c of its amplifier. Pixels that show nothing
//! of the light count for nothing: dead, stuck, or full in expectation.

use super::{Simulated, View};
use crate::camera::Detector;
use crate::footprint::Footprint;

/// The noise of one frame's pixels.
pub(super) struct Noise<'a> {
    detector: &'a Detector,
    simulated: &'a Simulated,
    /// What transfer adds to each column, if anything, e-.
    trail_e: &'a [f64],
    /// Area light on each pixel, if any, e-.
    areas_e: &'a [f32],
    exposure_s: f64,
    /// Variance beside the charge's own, e-^2.
    floor: f64,
    /// Charge from which a pixel shows no more, e-.
    full_e: f64,
}

impl<'a> Noise<'a> {
    pub fn new(
        view: &'a View,
        simulated: &'a Simulated,
        trail_e: &'a [f64],
        areas_e: &'a [f32],
    ) -> Noise<'a> {
        let detector = &view.camera.detector;
        let read = if simulated.read {
            detector.read_noise_e
        } else {
            0.0
        };
        let well = if simulated.full_well {
            detector.full_well_e
        } else {
            f64::INFINITY
        };
        Noise {
            detector,
            simulated,
            trail_e,
            areas_e,
            exposure_s: view.exposure.duration_s,
            floor: read * read + detector.quantisation_variance(),
            full_e: well.min(detector.converter_reach_e()),
        }
    }

    /// Background of a pixel of that column, e-.
    fn background_e(&self, pixel: usize, column: usize) -> f64 {
        let trail = self.trail_e.get(column);
        let light = self.areas_e.get(pixel).map_or(0.0, |e| f64::from(*e));
        let light = if self.simulated.response {
            light * self.detector.pattern.response_of(pixel)
        } else {
            light
        };
        let dark = if self.simulated.dark {
            self.detector.pattern.dark_e_s_of(pixel) * self.exposure_s
        } else {
            0.0
        };
        light + dark + trail.copied().unwrap_or(0.0)
    }

    /// Whether nothing of its light shows in a pixel.
    fn is_blind(&self, pixel: usize) -> bool {
        let found = |list: &[u32]| list.binary_search(&(pixel as u32)).is_ok();
        let pattern = &self.detector.pattern;
        (self.simulated.dead && found(pattern.dead()))
            || (self.simulated.stuck && found(pattern.stuck()))
    }

    /// Signal-to-noise ratio of `electrons` spread over `footprint`.
    pub fn snr(&self, footprint: &Footprint, electrons: f64) -> f64 {
        let (detector, mut sum) = (self.detector, 0.0);
        for (row, column, shares) in footprint.rows(0..detector.height) {
            for (column, share) in (column..).zip(shares) {
                let light = f64::from(*share) * electrons;
                if light > 0.0 {
                    sum += self.of_pixel(row * detector.width + column, column, light);
                }
            }
        }
        libm::sqrt(sum)
    }

    /// What one pixel adds to the square of the ratio.
    fn of_pixel(&self, pixel: usize, column: usize, light: f64) -> f64 {
        let detector = self.detector;
        let s = if self.simulated.response {
            light * detector.pattern.response_of(pixel)
        } else {
            light
        };
        let b = self.background_e(pixel, column);
        let held = s + b;
        if held >= self.full_e || self.is_blind(pixel) {
            return 0.0;
        }
        let (signal, slope) = if self.simulated.nonlinearity {
            let signal = detector.response_e(held) - detector.response_e(b);
            (signal, detector.response_slope(held))
        } else {
            (s, 1.0)
        };
        let shot = if self.simulated.shot { held } else { 0.0 };
        signal * signal / (slope * slope * shot + self.floor)
    }
}
