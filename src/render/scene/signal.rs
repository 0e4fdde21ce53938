//! The signal-to-noise ratio of a source on the simulated detector.
//!
//! ```text
//! snr^2 = sum S^2 / V    over the pixels: the optimum of all weightings
//! S = c(s + b) - c(b),   V = c'(s + b)^2 (s + b) + read^2 + gain^2 / 12
//! ```
//!
//! with the light s and the background b (area light, dark charge, frame-transfer smear, e-) of the
//! pixel with its response, and the curve c of its amplifier. Pixels that are dead, stuck or full
//! in expectation do not count.

use super::area::together::TotalAreaLight;
use super::effect_set::{EffectId, EffectSet};
use super::view::View;
use crate::camera::Detector;
use crate::footprint::Footprint;
use crate::kernels::{self, Reading};
use skyloop_orbit::sgp4_batch::Level;

/// The noise of one frame's pixels.
pub(super) struct Noise<'a> {
    detector: &'a Detector,
    simulated: &'a EffectSet,
    /// Frame-transfer smear of each column, if any, e-.
    transfer_smear_e: &'a [f64],
    areas: &'a TotalAreaLight,
    exposure_s: f64,
    reading: Reading,
    level: Option<Level>,
}

/// Buffers for the pixels of a footprint, reused.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// Shares of its light with pixel response (1), if it differs.
    shares: Vec<f32>,
    /// Background, e-.
    background: Vec<f32>,
}

/// Saturation charge of a pixel: its full well, or the converter's range, e-.
pub(super) fn full_e(detector: &Detector, simulated: &EffectSet) -> f64 {
    let well = if simulated.has(EffectId::FullWell) {
        detector.full_well_e
    } else {
        f64::INFINITY
    };
    well.min(detector.converter_reach_e())
}

/// How the detector reads charge.
fn reading(detector: &Detector, simulated: &EffectSet) -> Reading {
    let read = simulated.only_with(EffectId::ReadNoise, detector.read_noise_e);
    Reading {
        bend: simulated.only_with(EffectId::NonLinearity, detector.nonlinearity),
        inverse_full_well: 1.0 / detector.full_well_e,
        shot_noise: simulated.only_with(EffectId::ShotNoise, 1.0),
        floor: read * read + detector.quantisation_variance(),
        full_e: full_e(detector, simulated),
    }
}

impl<'a> Noise<'a> {
    pub fn new(
        view: &'a View,
        simulated: &'a EffectSet,
        transfer_smear_e: &'a [f64],
        areas: &'a TotalAreaLight,
    ) -> Noise<'a> {
        let detector = &view.camera.detector;
        Noise {
            detector,
            simulated,
            transfer_smear_e,
            areas,
            exposure_s: view.exposure.duration_s,
            reading: reading(detector, simulated),
            level: view.level,
        }
    }

    /// The dead and the stuck pixels from `first` on.
    fn blind(&self, first: usize) -> [&'a [u32]; 2] {
        let pattern = &self.detector.pattern;
        let lists = [
            (self.simulated.has(EffectId::DeadPixels), pattern.dead()),
            (self.simulated.has(EffectId::StuckPixels), pattern.stuck()),
        ];
        lists.map(|(is_simulated, list)| {
            let before = list.partition_point(|pixel| (*pixel as usize) < first);
            if is_simulated { &list[before..] } else { &[] }
        })
    }

    /// Signal-to-noise ratio of `electrons` spread over `footprint`.
    pub fn snr(&self, footprint: &Footprint, electrons: f64, buffers: &mut Buffers) -> f64 {
        if electrons <= 0.0 {
            return 0.0;
        }
        let Buffers { shares, background } = buffers;
        self.find_background(footprint, background);
        let shares = if self.respond(footprint, shares) {
            &shares[..]
        } else {
            footprint.shares()
        };
        let mut sum = 0.0;
        kernels::add_signal(
            self.level,
            &self.reading,
            electrons,
            shares,
            background,
            &mut sum,
        );
        libm::sqrt(sum)
    }

    /// The response of each pixel, 1 on average; none if it is uniform.
    fn response(&self) -> Option<&'a [f32]> {
        let response = self.detector.pattern.response();
        response.filter(|_| self.simulated.has(EffectId::PixelResponse))
    }

    /// Computes the background of the pixels of a footprint, with their response, e-.
    fn find_background(&self, footprint: &Footprint, background: &mut Vec<f32>) {
        let (detector, pattern) = (self.detector, &self.detector.pattern);
        background.clear();
        background.resize(footprint.shares().len(), 0.0);
        if self.areas.light().is_some() {
            self.row_by_row(footprint, background, |pixel, row| {
                self.areas.add_to_row(pixel, row);
            });
        }
        if let Some(response) = self.response() {
            self.row_by_row(footprint, background, |pixel, row| {
                let response = from(response, pixel);
                row.iter_mut().zip(response).for_each(|(b, of)| *b *= of);
            });
        }
        match pattern
            .dark_e_s()
            .filter(|_| self.simulated.has(EffectId::DarkCurrent))
        {
            Some(dark_e_s) => self.row_by_row(footprint, background, |pixel, row| {
                for (b, dark_e_s) in row.iter_mut().zip(from(dark_e_s, pixel)) {
                    *b += (f64::from(*dark_e_s) * self.exposure_s) as f32;
                }
            }),
            None if self.simulated.has(EffectId::DarkCurrent) => {
                let even_e = (pattern.dark_mean_e_s() * self.exposure_s) as f32;
                background.iter_mut().for_each(|b| *b += even_e);
            }
            None => {}
        }
        if !self.transfer_smear_e.is_empty() {
            self.row_by_row(footprint, background, |pixel, row| {
                let smear_e = from(self.transfer_smear_e, pixel % detector.width);
                let pairs = row.iter_mut().zip(smear_e);
                pairs.for_each(|(b, smear_e)| *b += *smear_e as f32);
            });
        }
    }

    /// Calls `each` with the first pixel (row-major index) of each row of a footprint, and its part
    /// of `values`.
    fn row_by_row(
        &self,
        footprint: &Footprint,
        values: &mut [f32],
        mut each: impl FnMut(usize, &mut [f32]),
    ) {
        let mut rest = values;
        for (row, column, shares) in footprint.rows(0..self.detector.height) {
            let (part, after) = rest.split_at_mut(shares.len());
            rest = after;
            each(row * self.detector.width + column, part);
        }
    }

    /// A footprint's shares with pixel response; false if they are unchanged.
    fn respond(&self, footprint: &Footprint, shares: &mut Vec<f32>) -> bool {
        let detector = self.detector;
        let (response, mut blind) = (
            self.response(),
            self.blind(footprint.first_row() * detector.width),
        );
        if response.is_none() && blind.iter().all(|list| list.is_empty()) {
            return false;
        }
        shares.clear();
        shares.extend_from_slice(footprint.shares());
        let mut rest = &mut shares[..];
        for (row, column, shares) in footprint.rows(0..detector.height) {
            let first = row * detector.width + column;
            let (shares, after) = rest.split_at_mut(shares.len());
            rest = after;
            if let Some(response) = response {
                for (share, response) in shares.iter_mut().zip(from(response, first)) {
                    *share *= response;
                }
            }
            // Pixels are in order: each list is traversed once.
            for list in &mut blind {
                while let Some((pixel, rest)) = list.split_first()
                    && (*pixel as usize) < first + shares.len()
                {
                    if let Some(i) = (*pixel as usize).checked_sub(first) {
                        shares[i] = 0.0;
                    }
                    *list = rest;
                }
            }
        }
        true
    }
}

/// The values from `first` on, if any.
fn from<T>(values: &[T], first: usize) -> &[T] {
    values.get(first..).unwrap_or(&[])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use skyloop_base::load::Folder;

    /// Pixel by pixel, as the formula has it.
    fn by_hand(noise: &Noise<'_>, shares: &[f32], electrons: f64) -> f64 {
        let Noise {
            detector,
            simulated,
            ..
        } = noise;
        let pattern = &detector.pattern;
        let of_pixel = |(pixel, share): (usize, &f32)| {
            let at = pixel as u32;
            let blind = simulated.has(EffectId::DeadPixels) && pattern.dead().contains(&at)
                || simulated.has(EffectId::StuckPixels) && pattern.stuck().contains(&at);
            let mut light = [f64::from(*share) * electrons, noise.areas.of_pixel(pixel)];
            if simulated.has(EffectId::PixelResponse) {
                light = light.map(|e| e * pattern.response_of(pixel));
            }
            let dark_e_s = simulated.only_with(EffectId::DarkCurrent, pattern.dark_e_s_of(pixel));
            let b = light[1]
                + dark_e_s * noise.exposure_s
                + noise.transfer_smear_e[pixel % detector.width];
            let held = light[0] + b;
            if *share == 0.0 || held >= noise.reading.full_e || blind {
                return 0.0;
            }
            let read = |e: f64| {
                if simulated.has(EffectId::NonLinearity) {
                    detector.response_e(e)
                } else {
                    e
                }
            };
            let slope = (read(held + 0.01) - read(held - 0.01)) / 0.02;
            let signal = read(held) - read(b);
            let shot = simulated.only_with(EffectId::ShotNoise, held);
            signal * signal / (slope * slope * shot + noise.reading.floor)
        };
        shares.iter().enumerate().map(of_pixel).sum::<f64>().sqrt()
    }

    #[test]
    fn snr_agrees_with_the_formula_pixel_by_pixel() {
        let camera = Camera::load("cmos-rolling", &Folder::current()).unwrap();
        let detector = &camera.detector;
        let (width, height) = (detector.width, detector.height);
        // No two neighbours are equal, and no period is a power of two.
        let wave = |i: usize, steps: usize| 1.0 + (i % steps) as f64 / steps as f64;
        let transfer_smear_e: Vec<f64> = (0..width).map(|i| 300.0 * wave(i, 7)).collect();
        let areas_e = (0..width * height).map(|i| 900.0 * wave(i, 113) as f32);
        let areas = TotalAreaLight::each([width, height], areas_e.collect());
        let mut shares: Vec<f32> = (0..width * height)
            .map(|i| wave(i, 59) as f32 * 2e-6)
            .collect();
        shares.iter_mut().step_by(5).for_each(|share| *share = 0.0);
        // One pixel of ten thousand is bright.
        shares
            .iter_mut()
            .step_by(9_973)
            .for_each(|share| *share = 2e-3);
        let footprint = Footprint::whole(width, shares.clone());
        let effects = [
            EffectId::PixelResponse,
            EffectId::DarkCurrent,
            EffectId::DeadPixels,
            EffectId::StuckPixels,
            EffectId::NonLinearity,
            EffectId::ShotNoise,
        ];
        let all = effects
            .into_iter()
            .fold(EffectSet::default(), EffectSet::with);
        // The last is not in the list: all run.
        for off in effects.into_iter().chain([EffectId::Readout]) {
            let simulated = all.without(off);
            let noise = Noise {
                detector,
                simulated: &simulated,
                transfer_smear_e: &transfer_smear_e,
                areas: &areas,
                exposure_s: 0.1,
                reading: Reading {
                    floor: 144.0,
                    full_e: detector.full_well_e,
                    ..reading(detector, &simulated)
                },
                level: None,
            };
            for electrons in [1e-9, 1.0, 3e7] {
                let [snr, hand] = [
                    noise.snr(&footprint, electrons, &mut Buffers::default()),
                    by_hand(&noise, &shares, electrons),
                ];
                // By hand the difference of large charges is rounded.
                let rounding = if electrons < 1e-6 { 0.5 } else { 1e-6 };
                assert!(
                    (snr / hand - 1.0).abs() < rounding,
                    "{off:?} {electrons}: {snr} {hand}"
                );
            }
            assert_eq!(noise.snr(&footprint, 0.0, &mut Buffers::default()), 0.0);
        }
    }
}
