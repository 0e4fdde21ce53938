//! What a source's light is worth: its signal-to-noise ratio on the detector as it is simulated.
//!
//! ```text
//! snr^2 = sum S^2 / V    over the pixels: the best that any weighting of them can reach
//! S = c(s + b) - c(b),   V = c'(s + b)^2 (s + b) + read^2 + gain^2 / 12
//! ```
//!
//! with the light s and the background b (area light, dark charge and what transfer adds to the column, e-) of the pixel as it responds, and the curve c of its amplifier. Pixels that show nothing
//! of the light count for nothing: dead, stuck, or full in expectation.

use super::area::Together;
use super::{Simulated, View};
use crate::camera::Detector;
use crate::footprint::Footprint;
use crate::kernels::{self, Reading};
use skyloop_orbit::sgp4_batch::Level;

/// Pixels that are worked out side by side.
const LANES: usize = 4;

/// The noise of one frame's pixels.
pub(super) struct Noise<'a> {
    detector: &'a Detector,
    simulated: &'a Simulated,
    /// What transfer adds to each column, if anything, e-.
    trail_e: &'a [f64],
    areas: &'a Together,
    exposure_s: f64,
    reading: Reading,
    level: Option<Level>,
}

/// What the pixels of a footprint hold, e-; used again and again, so that nothing is allocated twice.
#[derive(Debug, Default)]
pub(super) struct Held {
    light: Vec<f64>,
    background: Vec<f64>,
}

impl Held {
    fn clear(&mut self) {
        self.light.clear();
        self.background.clear();
    }

    /// So many pixels more, that hold nothing yet: as many as are worked out side by side, or a multiple.
    fn more(&mut self, pixels: usize) -> (&mut [f64], &mut [f64]) {
        let from = self.light.len();
        let past = from + pixels.next_multiple_of(LANES);
        self.light.resize(past, 0.0);
        self.background.resize(past, 0.0);
        let pixels = from..from + pixels;
        (
            &mut self.light[pixels.clone()],
            &mut self.background[pixels],
        )
    }
}

/// Charge (e-) from which a pixel shows no more: its full well, or what the converter reaches.
pub(super) fn full_e(detector: &Detector, simulated: &Simulated) -> f64 {
    let well = if simulated.full_well {
        detector.full_well_e
    } else {
        f64::INFINITY
    };
    well.min(detector.converter_reach_e())
}

impl<'a> Noise<'a> {
    pub fn new(
        view: &'a View,
        simulated: &'a Simulated,
        trail_e: &'a [f64],
        areas: &'a Together,
    ) -> Noise<'a> {
        let detector = &view.camera.detector;
        let read = if simulated.read {
            detector.read_noise_e
        } else {
            0.0
        };
        Noise {
            detector,
            simulated,
            trail_e,
            areas,
            exposure_s: view.exposure.duration_s,
            reading: Reading {
                bend: match simulated.nonlinearity {
                    true => detector.nonlinearity,
                    false => 0.0,
                },
                part_of_full: 1.0 / detector.full_well_e,
                shot: f64::from(u8::from(simulated.shot)),
                floor: read * read + detector.quantisation_variance(),
                full_e: full_e(detector, simulated),
            },
            level: view.level,
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
    pub fn snr(&self, footprint: &Footprint, electrons: f64, held: &mut Held) -> f64 {
        if electrons <= 0.0 {
            return 0.0;
        }
        let (detector, mut sums) = (self.detector, [0.0; LANES]);
        held.clear();
        let mut blind = self.blind(footprint.first_row() * detector.width);
        for (row, column, shares) in footprint.rows(0..detector.height) {
            let first = row * detector.width + column;
            let (light, background) = held.more(shares.len());
            for (light, share) in light.iter_mut().zip(shares) {
                *light = f64::from(*share) * electrons;
            }
            // Pixels come in order: a list is gone through once.
            for list in &mut blind {
                while let Some((pixel, rest)) = list.split_first()
                    && (*pixel as usize) < first + shares.len()
                {
                    if let Some(i) = (*pixel as usize).checked_sub(first) {
                        light[i] = 0.0;
                    }
                    *list = rest;
                }
            }
            self.add(first, column, light, background);
        }
        kernels::add_signal(
            self.level,
            &self.reading,
            &held.light,
            &held.background,
            &mut sums,
        );
        libm::sqrt(sums.iter().sum())
    }

    /// Adds to what the pixels from `pixel` on, in the columns from `column` on, hold beside that light, and lets both respond, e-.
    fn add(&self, pixel: usize, column: usize, light: &mut [f64], background: &mut [f64]) {
        let (detector, simulated) = (self.detector, self.simulated);
        let pattern = &detector.pattern;
        self.areas.of_pixels(pixel, background);
        if let Some(response) = pattern.response().filter(|_| simulated.response) {
            let held = light.iter_mut().zip(background.iter_mut());
            for ((s, b), response) in held.zip(from(response, pixel)) {
                (*s, *b) = (*s * f64::from(*response), *b * f64::from(*response));
            }
        }
        match pattern.dark_e_s() {
            _ if !simulated.dark => {}
            Some(dark_e_s) => {
                for (b, dark_e_s) in background.iter_mut().zip(from(dark_e_s, pixel)) {
                    *b += f64::from(*dark_e_s) * self.exposure_s;
                }
            }
            None => {
                let dark_e = pattern.dark_mean_e_s() * self.exposure_s;
                background.iter_mut().for_each(|b| *b += dark_e);
            }
        }
        for (b, trail_e) in background.iter_mut().zip(from(self.trail_e, column)) {
            *b += trail_e;
        }
    }
}

/// The values from `first` on, if there are any.
fn from<T>(values: &[T], first: usize) -> &[T] {
    values.get(first..).unwrap_or(&[])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::load::Folder;

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
            let blind = simulated.dead && pattern.dead().contains(&at)
                || simulated.stuck && pattern.stuck().contains(&at);
            let mut light = [f64::from(*share) * electrons, noise.areas.of_pixel(pixel)];
            if simulated.response {
                light = light.map(|e| e * pattern.response_of(pixel));
            }
            let dark_e_s = if simulated.dark {
                pattern.dark_e_s_of(pixel)
            } else {
                0.0
            };
            let b = light[1] + dark_e_s * noise.exposure_s + noise.trail_e[pixel % detector.width];
            let held = light[0] + b;
            if *share == 0.0 || held >= noise.reading.full_e || blind {
                return 0.0;
            }
            let read = |e: f64| {
                if simulated.nonlinearity {
                    detector.response_e(e)
                } else {
                    e
                }
            };
            let slope = (read(held + 0.01) - read(held - 0.01)) / 0.02;
            let signal = read(held) - read(b);
            let shot = if simulated.shot { held } else { 0.0 };
            signal * signal / (slope * slope * shot + noise.reading.floor)
        };
        shares.iter().enumerate().map(of_pixel).sum::<f64>().sqrt()
    }

    #[test]
    fn lanes_give_what_the_formula_gives() {
        let camera = Camera::load("cmos-rolling", &Folder::current()).unwrap();
        let detector = &camera.detector;
        let (width, height) = (detector.width, detector.height);
        // Nothing is alike from pixel to pixel, from column to column, or a power of two.
        let wave = |i: usize, steps: usize| 1.0 + (i % steps) as f64 / steps as f64;
        let trail_e: Vec<f64> = (0..width).map(|i| 300.0 * wave(i, 7)).collect();
        let areas_e = (0..width * height).map(|i| 900.0 * wave(i, 113) as f32);
        let areas = Together::each([width, height], areas_e.collect());
        let mut shares: Vec<f32> = (0..width * height)
            .map(|i| wave(i, 59) as f32 * 2e-6)
            .collect();
        shares.iter_mut().step_by(5).for_each(|share| *share = 0.0);
        // One pixel of ten thousand gets a great deal.
        shares
            .iter_mut()
            .step_by(9_973)
            .for_each(|share| *share = 2e-3);
        let footprint = Footprint::whole(width, shares.clone());
        for off in 0..8 {
            let on = |effect: u32| effect != off;
            let simulated = Simulated {
                response: on(1),
                dark: on(2),
                dead: on(3),
                stuck: on(4),
                nonlinearity: on(5),
                shot: on(6),
                ..Simulated::default()
            };
            let noise = Noise {
                detector,
                simulated: &simulated,
                trail_e: &trail_e,
                areas: &areas,
                exposure_s: 0.1,
                reading: Reading {
                    bend: match simulated.nonlinearity {
                        true => detector.nonlinearity,
                        false => 0.0,
                    },
                    part_of_full: 1.0 / detector.full_well_e,
                    shot: f64::from(u8::from(simulated.shot)),
                    floor: 144.0,
                    full_e: detector.full_well_e,
                },
                level: None,
            };
            for electrons in [1e-9, 1.0, 3e7] {
                let [snr, hand] = [
                    noise.snr(&footprint, electrons, &mut Held::default()),
                    by_hand(&noise, &shares, electrons),
                ];
                // By hand the difference of large charges is rounded.
                let rounding = if electrons < 1e-6 { 0.5 } else { 1e-6 };
                assert!(
                    (snr / hand - 1.0).abs() < rounding,
                    "{off} {electrons}: {snr} {hand}"
                );
            }
            assert_eq!(noise.snr(&footprint, 0.0, &mut Held::default()), 0.0);
        }
    }
}
