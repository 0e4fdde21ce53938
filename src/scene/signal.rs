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

/// Pixels that are worked out side by side.
const LANES: usize = 4;

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

    /// The pixels from `first` on that show nothing of their light: dead ones, stuck ones.
    fn blind(&self, first: usize) -> [&'a [u32]; 2] {
        let pattern = &self.detector.pattern;
        let lists = [
            (self.simulated.dead, pattern.dead()),
            (self.simulated.stuck, pattern.stuck()),
        ];
        lists.map(|(is_simulated, list)| {
            let before = list.partition_point(|pixel| (*pixel as usize) < first);
            if is_simulated { &list[before..] } else { &[] }
        })
    }

    /// Signal-to-noise ratio of `electrons` spread over `footprint`.
    pub fn snr(&self, footprint: &Footprint, electrons: f64) -> f64 {
        if electrons <= 0.0 {
            return 0.0;
        }
        let (detector, mut sums) = (self.detector, [0.0; LANES]);
        let mut blind = self.blind(footprint.first_row() * detector.width);
        for (row, column, shares) in footprint.rows(0..detector.height) {
            let first = row * detector.width + column;
            // Rows come in order: what lies before this one is done with.
            for list in &mut blind {
                while let Some((pixel, rest)) = list.split_first()
                    && (*pixel as usize) < first
                {
                    *list = rest;
                }
            }
            for k in 0..shares.len().div_ceil(LANES) {
                let from = first + k * LANES;
                let mut light = lanes_of(shares, k * LANES, 0.0).map(|share| share * electrons);
                for list in blind {
                    let here = list.iter().map(|pixel| *pixel as usize);
                    for pixel in here.take_while(|pixel| *pixel < from + LANES) {
                        if let Some(i) = pixel.checked_sub(from) {
                            light[i] = 0.0;
                        }
                    }
                }
                self.add(from, column + k * LANES, &light, &mut sums);
            }
        }
        libm::sqrt(sums.iter().sum())
    }

    /// Adds what the pixels from `pixel` on, in the columns from `column` on, add to the square of the ratio by that light, e-.
    fn add(&self, pixel: usize, column: usize, light: &[f64; LANES], sums: &mut [f64; LANES]) {
        let (detector, simulated) = (self.detector, self.simulated);
        let pattern = &detector.pattern;
        let response = match pattern.response() {
            Some(response) if simulated.response => lanes_of(response, pixel, 1.0),
            _ => [1.0; LANES],
        };
        let dark_e_s = match pattern.dark_e_s() {
            _ if !simulated.dark => [0.0; LANES],
            Some(dark_e_s) => lanes_of(dark_e_s, pixel, 0.0),
            None => [pattern.dark_mean_e_s(); LANES],
        };
        let area = lanes_of(self.areas_e, pixel, 0.0);
        let trail = lanes_of(self.trail_e, column, 0.0);
        let bend = if simulated.nonlinearity {
            detector.nonlinearity
        } else {
            0.0
        };
        let shot = f64::from(u8::from(simulated.shot));
        let part_of_full = 1.0 / detector.full_well_e;
        for i in 0..LANES {
            let s = light[i] * response[i];
            let b = area[i] * response[i] + dark_e_s[i] * self.exposure_s + trail[i];
            let held = s + b;
            // c(e) = e (1 - a e / full well), as Detector::response_e has it
            let bent = |e: f64| bend * (e * part_of_full).clamp(0.0, 1.0);
            let signal = held * (1.0 - bent(held)) - b * (1.0 - bent(b));
            let slope = 1.0 - 2.0 * bent(held);
            let variance = slope * slope * shot * held + self.floor;
            // Not by a jump around the division, which keeps lanes from running side by side. Steps of the converter are above 0, and so is their
            // variance.
            let shows = (light[i] > 0.0) & (held < self.full_e);
            let signal = if shows { signal } else { 0.0 };
            sums[i] += signal * signal / variance;
        }
    }
}

/// The values from `from` on, and that where there are none.
#[inline(always)]
fn lanes_of<T: Copy + Into<f64>>(values: &[T], from: usize, none: f64) -> [f64; LANES] {
    let values = values.get(from..).unwrap_or(&[]);
    if let Some(all) = values.first_chunk::<LANES>() {
        return all.map(T::into);
    }
    let mut lanes = [none; LANES];
    for (lane, value) in lanes.iter_mut().zip(values) {
        *lane = (*value).into();
    }
    lanes
}
