//! Digital numbers to grey levels: the contact sheet's panels and the previews.
//!
//! Light is measured in standard deviations of its own noise. With the charge e (e-) above the dark
//! level and the variance v (e-^2) of a pixel without light, their number between 0 and e is
//!
//! ```text
//! u(e) = integral of de / sqrt(v + e) = 2 (sqrt(v + e) - sqrt(v)),   e / sqrt(v) below 0
//! ```
//!
//! Let `low` be the 10 % quantile of the pixels, or the dark level if that is higher. Grey is
//! - linear in DN from black at the dark level to `low`, with the slope that would reach white at a
//!   full pixel;
//! - then `asinh(u / soft)`, where `soft` grows with the spread between the 10 % and 90 %
//!   quantiles: faint stars are distinct on a uniform sky, and a bright Earth next to a dark sky
//!   has contrast.
//!
//! So pixels without light are black and full pixels are white, whatever their share of the frame.

use skyloop_render::camera::Camera;
use skyloop_render::label::Label;

/// Longer side of a panel, px.
const PANEL_PX: usize = 512;
/// Minimum of `soft`, standard deviations.
const SOFT: f64 = 2.5;
/// `soft` relative to the spread between the 10 % and 90 % quantiles (1).
const SOFT_OF_SPREAD: f64 = 0.5;
/// Minimum of white above `low`, standard deviations; white is at most a full pixel.
const WHITE: f64 = 250.0;
/// Quantile of the pixels up to which the picture does not saturate (1).
const WHITE_PART: f64 = 0.999;

/// Scale of a frame's digital numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Levels {
    /// DN of a pixel without light: offset and dark charge.
    pub dark_dn: f64,
    /// DN of a full pixel.
    pub full_dn: f64,
    /// Electrons per digital number.
    pub gain_e_per_dn: f64,
    /// Variance of a pixel without light, e-^2.
    pub variance_e2: f64,
}

impl Levels {
    /// For a frame of `camera`.
    pub fn of(camera: &Camera, label: &Label) -> Levels {
        let detector = &camera.detector;
        let full_dn = f64::from(detector.saturation_dn());
        let dark_e = detector.dark_e(label.exposure_s);
        let dark_dn = detector.offset_dn + detector.response_e(dark_e) / detector.gain_e_per_dn;
        let read_e2 = detector.read_noise_e * detector.read_noise_e;
        Levels {
            dark_dn: dark_dn.min(full_dn),
            full_dn,
            gain_e_per_dn: detector.gain_e_per_dn,
            variance_e2: (dark_e + read_e2 + detector.quantisation_variance()).max(1e-9),
        }
    }
}

/// Grey levels of one frame.
#[derive(Debug)]
pub(crate) struct Stretch {
    levels: Levels,
    /// Pixels of the camera per pixel of the picture.
    averaged: f64,
    low_dn: f64,
    soft: f64,
    /// Standard deviations from `low_dn` to white.
    white: f64,
}

impl Stretch {
    /// For a picture of these values (DN), each the mean of `averaged` pixels.
    pub fn new(levels: Levels, values: impl Iterator<Item = f32>, averaged: f64) -> Stretch {
        let [tenth, nine_tenths, bright] = quantiles(values, [0.1, 0.9, WHITE_PART]);
        let mut stretch = Stretch {
            levels,
            averaged: averaged.max(1.0),
            low_dn: tenth.max(levels.dark_dn).min(levels.full_dn),
            soft: SOFT,
            white: WHITE,
        };
        stretch.soft = SOFT.max(SOFT_OF_SPREAD * stretch.sigmas(nine_tenths));
        let max = stretch.sigmas(levels.full_dn);
        stretch.white = WHITE.max(stretch.sigmas(bright)).min(max).max(1e-9);
        stretch
    }

    /// Standard deviations from `low_dn` to a value.
    fn sigmas(&self, dn: f64) -> f64 {
        let variance = self.levels.variance_e2;
        let u = |dn: f64| {
            let e = (dn - self.levels.dark_dn) * self.levels.gain_e_per_dn;
            if e > 0.0 {
                2.0 * ((variance + e).sqrt() - variance.sqrt())
            } else {
                e / variance.sqrt()
            }
        };
        (u(dn) - u(self.low_dn)) * self.averaged.sqrt()
    }

    /// The grey level of a value (DN).
    pub fn grey(&self, dn: f64) -> u8 {
        let Levels {
            dark_dn, full_dn, ..
        } = self.levels;
        if dn >= full_dn {
            return 255;
        }
        let part = |dn: f64| ((dn - dark_dn) / (full_dn - dark_dn).max(1e-9)).clamp(0.0, 1.0);
        if dn <= self.low_dn {
            return (part(dn) * 255.0).round() as u8;
        }
        let low = part(self.low_dn);
        let rise = libm::asinh(self.sigmas(dn) / self.soft) / libm::asinh(self.white / self.soft);
        ((low + (1.0 - low) * rise.clamp(0.0, 1.0)) * 255.0).round() as u8
    }
}

/// The grey levels of a frame at full resolution.
pub(crate) fn preview(levels: Levels, dn: &[u16]) -> Vec<u8> {
    let stretch = Stretch::new(levels, dn.iter().map(|dn| f32::from(*dn)), 1.0);
    let max = dn.iter().copied().max().unwrap_or(0);
    let greys: Vec<u8> = (0..=max).map(|dn| stretch.grey(f64::from(dn))).collect();
    dn.iter().map(|dn| greys[usize::from(*dn)]).collect()
}

/// Quantiles (DN) of the values, with a resolution of one digital number.
fn quantiles<const N: usize>(values: impl Iterator<Item = f32>, parts: [f64; N]) -> [f64; N] {
    let mut counts = vec![0u64; 1 << 16];
    values.for_each(|value| counts[usize::from(value.round() as u16)] += 1);
    let all = counts.iter().sum::<u64>() as f64;
    parts.map(|part| {
        let mut below = 0;
        let reached = counts.iter().position(|count| {
            below += count;
            below as f64 >= part * all
        });
        reached.unwrap_or(0) as f64
    })
}

/// Size of the panel for a frame of `size` columns and rows: a small frame is enlarged by an
/// integer factor, a large one is reduced to [`PANEL_PX`].
pub(crate) fn panel_size(size: [usize; 2]) -> [usize; 2] {
    let longer = size[0].max(size[1]).max(1);
    if longer <= PANEL_PX {
        size.map(|n| n * (PANEL_PX / longer))
    } else {
        size.map(|n| (n * PANEL_PX).div_ceil(longer))
    }
}

/// Resamples DN to the panel's size: repeats pixels to enlarge, averages areas to reduce.
pub(crate) fn scaled(dn: &[u16], from: [usize; 2], to: [usize; 2]) -> Vec<f32> {
    let rows: Vec<f32> = dn
        .chunks_exact(from[0].max(1))
        .flat_map(|row| resampled(from[0], to[0], |i| f32::from(row[i])))
        .collect();
    let mut out = vec![0.0; to[0] * to[1]];
    for x in 0..to[0] {
        let column = resampled(from[1], to[1], |y| rows[y * to[0] + x]);
        for (y, value) in column.enumerate() {
            out[y * to[0] + x] = value;
        }
    }
    out
}

/// Divides `from` values into `to` equal intervals, and gives the mean of each.
fn resampled(from: usize, to: usize, value: impl Fn(usize) -> f32) -> impl Iterator<Item = f32> {
    let step = from as f64 / to as f64;
    (0..to).map(move |i| {
        let (start, end) = (i as f64 * step, (i + 1) as f64 * step);
        let last = ((end - 1e-9) as usize).min(from - 1);
        let sum: f64 = (start as usize..=last)
            .map(|j| {
                let overlap = end.min((j + 1) as f64) - start.max(j as f64);
                overlap * f64::from(value(j))
            })
            .sum();
        (sum / step) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fit_any_camera() {
        assert_eq!(panel_size([256, 256]), [512, 512]);
        assert_eq!(panel_size([1280, 1024]), [512, 410]);
        assert_eq!(panel_size([300, 200]), [300, 200]);
        assert_eq!(panel_size([8192, 1]), [512, 1]);
        assert_eq!(panel_size([1, 1]), [512, 512]);
    }

    #[test]
    fn scaling_repeats_up_and_averages_down() {
        assert_eq!(
            scaled(&[1, 2], [2, 1], [4, 2]),
            [1., 1., 2., 2., 1., 1., 2., 2.]
        );
        assert_eq!(scaled(&[1, 2, 3, 4, 5, 6], [3, 2], [1, 1]), [3.5]);
        // Half of the middle one each: (1 + 0.5 * 4) / 1.5 and (0.5 * 4 + 7) / 1.5.
        assert_eq!(scaled(&[1, 4, 7], [3, 1], [2, 1]), [2.0, 6.0]);
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        let dn: Vec<u16> = (0..1280 * 1024u64)
            .map(|i| (i * 7919 % 4096) as u16)
            .collect();
        let small = scaled(&dn, [1280, 1024], [512, 410]);
        assert!((mean(&small) - 2047.5).abs() < 0.5);
    }

    /// A detector of 2 e- noise and 1 e-/DN, dark at 100 DN and full at 4095.
    const LEVELS: Levels = Levels {
        dark_dn: 100.0,
        full_dn: 4095.0,
        gain_e_per_dn: 1.0,
        variance_e2: 4.0,
    };

    /// Groups of pixels (count, DN), and the range of grey levels of each.
    #[test]
    fn dark_is_black_and_full_is_white_for_any_share_of_the_frame() {
        let (dark, full) = (100, 4095);
        for (groups, greys) in [
            // Dark frames, with a bright star and without.
            (&[(1000, dark)][..], &[0..=0][..]),
            (&[(1000, dark), (1, full)], &[0..=0, 255..=255]),
            // Full of light, all, nearly all, and a part.
            (&[(1000, full)], &[255..=255]),
            (&[(10, dark), (990, full)], &[0..=0, 255..=255]),
            (&[(200, dark), (800, full)], &[0..=0, 255..=255]),
            (&[(800, dark), (200, full)], &[0..=0, 255..=255]),
            // A faint sky is dark; a star of 5 standard deviations stands out of it (its own noise:
            // sqrt(4 + 20) = 4.9 e-).
            (&[(1000, 120), (1, 145)], &[0..=30, 31..=120]),
            // An evenly bright frame, half of full.
            (&[(1000, 2100)], &[120..=135]),
            // A limb by day: black sky, and an Earth with contrast.
            (
                &[(500, dark), (150, 900), (150, 1800), (200, 3000)],
                &[0..=0, 100..=190, 150..=225, 200..=255],
            ),
        ] {
            let values = groups.iter().flat_map(|(count, dn)| vec![*dn; *count]);
            let values: Vec<u16> = values.collect();
            let picture = preview(LEVELS, &values);
            let mut first = 0;
            let mut last = None;
            for ((count, dn), range) in groups.iter().zip(greys) {
                let grey = picture[first];
                assert!(range.contains(&grey), "{dn} of {groups:?}: {grey}");
                assert!(
                    last.is_none_or(|last| grey > last + 9),
                    "{dn} of {groups:?}"
                );
                (first, last) = (first + count, Some(grey));
            }
        }
    }

    #[test]
    fn averaging_reduces_noise_and_grey_is_monotonic() {
        let sky = || (0..1000).map(|i| 120.0 + (i % 7) as f32);
        let [one, nine] = [1.0, 9.0].map(|averaged| Stretch::new(LEVELS, sky(), averaged));
        assert!(nine.grey(130.0) > one.grey(130.0));
        for stretch in [one, nine] {
            let greys = (0..=4200).map(|dn| stretch.grey(f64::from(dn)));
            assert!(greys.is_sorted());
        }
        // No values, and no range between dark and full.
        let full = Levels {
            dark_dn: 4095.0,
            ..LEVELS
        };
        let stretch = Stretch::new(full, [].into_iter(), 0.0);
        assert_eq!([4094.0, 4095.0].map(|dn| stretch.grey(dn)), [0, 255]);
        assert_eq!(preview(LEVELS, &[]), [0u8; 0]);
    }
}
