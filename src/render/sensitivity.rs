//! Sensitivity of a camera from its data sheet: field of view, scale, limiting and saturation
//! magnitude.
//!
//! The electrons of a star of magnitude m in the camera's band, at rest on the boresight and in the
//! middle of a pixel, in an exposure t:
//!
//! ```text
//! S = E_zero QE tau A t T(0) 10^(-0.4 m)            Clark et al. 2021, Eq. (2)
//! snr^2 = sum S_i^2 / (S_i + b + read^2 + gain^2 / 12),   S_i = S p_i
//! ```
//!
//! with the vignetting T(0) on the boresight, the share p_i of the point spread function and the
//! background b of dark charge and sky. It is the signal-to-noise ratio of labels without
//! non-linearity, defects and motion. For a star of the Sun's colour m is its V magnitude.

use crate::attitude::angle_between;
use crate::camera::{Camera, Stamp};
use crate::sky::catalog::{Catalog, Selection};
use crate::sky::star_field::StarField;
use nalgebra::Vector3;
use serde::Serialize;

/// A typical dark sky in orbit, zodiacal light plus starlight, mag/arcsec^2 (Leinert et al. 1998,
/// A&AS 127, 1: 21.5 near the ecliptic to 23 at its poles).
pub const SKY_MAG_ARCSEC2: f64 = 22.0;
/// The signal-to-noise ratio of the faintest star.
pub const LIMIT_SNR: f64 = 5.0;
/// Limit (V) to which the embedded catalogue is nearly complete; most fainter stars are missing.
pub const CATALOGUE_MAG: f64 = 8.5;

/// The sensitivity of a camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Field of view along rows, columns and diagonal through the middle of the detector, deg.
    pub field_deg: [f64; 3],
    /// Solid angle of the field, deg^2.
    pub field_deg2: f64,
    /// A pixel in the middle of the detector, arcsec.
    pub arcsec_per_px: f64,
    /// Exposure time of the following values, s.
    pub exposure_s: f64,
    /// Charge of a dark sky of [`SKY_MAG_ARCSEC2`] in a pixel, e-.
    pub sky_e_px: f64,
    /// Dark charge in a pixel, e-.
    pub dark_e_px: f64,
    /// Magnitude in the band at a signal-to-noise ratio of [`LIMIT_SNR`]; none if the background
    /// fills every pixel, or such a star saturates.
    pub limiting_mag: Option<f64>,
    /// Stars to that magnitude in a field of this size, averaged over the sky; most stars fainter
    /// than [`CATALOGUE_MAG`] are missing.
    pub stars_per_frame: Option<f64>,
    /// Magnitude in the band at which the brightest pixel of a star reaches its full well or the
    /// converter's range.
    pub saturation_mag: Option<f64>,
}

/// A star's image on the boresight.
#[derive(Debug)]
pub(crate) struct StillStar {
    /// Electrons of magnitude 0 in the exposure.
    zero_e: f64,
    /// Shares of the pixels (1).
    shares: Vec<f64>,
    /// Variance of reading a pixel, e-^2.
    read_e2: f64,
}

impl StillStar {
    /// The star on the boresight of a camera, at its exposure time.
    pub fn of(camera: &Camera) -> StillStar {
        /// Light lost outside the square.
        const LOSS: f64 = 1e-4;
        /// Greatest half side of the square, px.
        const MAX_PX: f64 = 40.0;
        let psf = camera.optics.psf.at([0.0; 2], 1.0);
        let reach = psf.reach_px(LOSS).min(MAX_PX).ceil() as i32;
        let mut stamp = Stamp::default();
        let mut shares = Vec::new();
        for row in -reach..=reach {
            let across = -reach..=reach;
            shares.extend(
                across.map(|column| psf.on_pixel([column, row].map(f64::from), &mut stamp)),
            );
        }
        let detector = &camera.detector;
        let passing = camera.optics.vignetting.transmission(&Vector3::z());
        StillStar {
            zero_e: camera.electrons_per_second_at_zero() * camera.exposure_s * passing,
            shares,
            read_e2: detector.read_noise_e * detector.read_noise_e
                + detector.quantisation_variance(),
        }
    }

    /// Electrons of a star of this magnitude.
    pub fn electrons(&self, band_mag: f64) -> f64 {
        self.zero_e * libm::exp10(-0.4 * band_mag)
    }

    /// Its signal-to-noise ratio over a background, e- a pixel.
    pub fn snr(&self, band_mag: f64, background_e: f64) -> f64 {
        let electrons = self.electrons(band_mag);
        let part = |share: &f64| {
            let signal = electrons * share;
            signal * signal / (signal + background_e + self.read_e2)
        };
        let sum: f64 = self.shares.iter().map(part).sum();
        sum.sqrt()
    }

    /// The magnitude at which it has this signal-to-noise ratio, by bisection.
    pub fn magnitude_at(&self, snr: f64, background_e: f64) -> f64 {
        let (mut bright, mut faint) = (-30.0, 40.0);
        for _ in 0..60 {
            let middle = (bright + faint) / 2.0;
            if self.snr(middle, background_e) > snr {
                bright = middle;
            } else {
                faint = middle;
            }
        }
        (bright + faint) / 2.0
    }

    /// The magnitude at which its brightest pixel has this charge, e-.
    fn magnitude_of_peak(&self, peak_e: f64) -> f64 {
        let share = self.shares.iter().copied().fold(0.0, f64::max);
        -2.5 * libm::log10(peak_e / (share * self.zero_e))
    }
}

impl Sensitivity {
    /// The sensitivity of a camera at its exposure time.
    pub fn of(camera: &Camera) -> Sensitivity {
        let (optics, detector) = (&camera.optics, &camera.detector);
        let star = StillStar::of(camera);
        let middle = [detector.width, detector.height].map(|pixels| (pixels as f64 - 1.0) / 2.0);
        let step = |axis: usize| {
            let mut moved = middle;
            moved[axis] += 1.0;
            angle_between(&optics.direction(middle), &optics.direction(moved))
        };
        let arcsec = [0, 1].map(|axis| step(axis).to_degrees() * 3600.0);
        let arcsec_per_px = (arcsec[0] * arcsec[1]).sqrt();
        let sky_e_px =
            star.electrons(SKY_MAG_ARCSEC2 - 2.5 * libm::log10(arcsec_per_px * arcsec_per_px));
        let dark_e_px = detector.dark_e(camera.exposure_s);
        let background_e = sky_e_px + dark_e_px;
        let full_e = detector.full_well_e.min(detector.converter_reach_e());
        let free_e = Some(full_e - background_e).filter(|e| *e > 0.0 && star.zero_e > 0.0);
        let saturation_mag = free_e.map(|e| star.magnitude_of_peak(e));
        let limiting_mag = saturation_mag
            .map(|brightest| (brightest, star.magnitude_at(LIMIT_SNR, background_e)))
            .filter(|(brightest, limit)| brightest <= limit)
            .map(|(_, limit)| limit);
        let solid_angle = solid_angle_sr(camera);
        let stars_per_frame = limiting_mag.map(|limit| {
            let catalog = Catalog::embedded(Selection::Hipparcos);
            let stars = StarField::new(catalog, &optics.band, true).brighter_than(limit);
            stars as f64 * solid_angle / (4.0 * std::f64::consts::PI)
        });
        Sensitivity {
            field_deg: field_deg(camera),
            field_deg2: solid_angle * 1f64.to_degrees() * 1f64.to_degrees(),
            arcsec_per_px,
            exposure_s: camera.exposure_s,
            sky_e_px,
            dark_e_px,
            limiting_mag,
            stars_per_frame,
            saturation_mag,
        }
    }
}

/// Whether any light from a direction (camera axes) passes the vignetting.
fn passes_light(camera: &Camera, direction: &Vector3<f64>) -> bool {
    camera.optics.vignetting.transmission(direction) > 0.0
}

/// Field of view through the middle of the detector, deg: along rows, columns and diagonal.
fn field_deg(camera: &Camera) -> [f64; 3] {
    let [width, height] = camera.detector.sides();
    let (left, top) = (-0.5, -0.5);
    let (right, bottom) = (width - 0.5, height - 0.5);
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    let ends = [
        [[left, middle[1]], [right, middle[1]]],
        [[middle[0], top], [middle[0], bottom]],
        [[left, top], [right, bottom]],
    ];
    let direction = |at| camera.optics.direction(at);
    // Bisection for the end of the vignetting: a fisheye's image may end inside the detector.
    let last = |end: [f64; 2]| {
        let at = |part: f64| [0, 1].map(|axis| middle[axis] + part * (end[axis] - middle[axis]));
        let (mut seen, mut dark) = (0.0, 1.0);
        if passes_light(camera, &direction(end)) {
            return direction(end);
        }
        for _ in 0..40 {
            let half = (seen + dark) / 2.0;
            if passes_light(camera, &direction(at(half))) {
                seen = half
            } else {
                dark = half
            }
        }
        direction(at(seen))
    };
    ends.map(|[from, to]| {
        // The sum of two angles, because the field of a fisheye may exceed 180 deg.
        let middle = direction(middle);
        let parts = [from, to].map(|end| angle_between(&last(end), &middle));
        (parts[0] + parts[1]).to_degrees()
    })
}

/// The solid angle of the detector's field, sr: triangles between directions of a grid. Beyond the
/// end of a projection the directions are those of its end, and triangles are empty.
fn solid_angle_sr(camera: &Camera) -> f64 {
    const CELLS: usize = 128;
    let [width, height] = camera.detector.sides();
    let direction = |i: usize, j: usize| {
        let part = |cell: usize, side: f64| cell as f64 / CELLS as f64 * side - 0.5;
        camera.optics.direction([part(i, width), part(j, height)])
    };
    let mut sum = 0.0;
    for (i, j) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (i, j))) {
        let [width, height] = [width, height].map(|side| side / CELLS as f64);
        let centre = [
            (i as f64 + 0.5) * width - 0.5,
            (j as f64 + 0.5) * height - 0.5,
        ];
        if !passes_light(camera, &camera.optics.direction(centre)) {
            continue;
        }
        let corners = [
            direction(i, j),
            direction(i + 1, j),
            direction(i + 1, j + 1),
            direction(i, j + 1),
        ];
        sum += triangle_sr(&corners[0], &corners[1], &corners[2]);
        sum += triangle_sr(&corners[0], &corners[2], &corners[3]);
    }
    sum
}

/// Van Oosterom and Strackee 1983 (IEEE Trans. Biomed. Eng. 30, 125): `tan(w/2) = |a . b x c| / (1
/// + a.b + b.c + c.a)`.
fn triangle_sr(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> f64 {
    let volume = a.dot(&b.cross(c)).abs();
    2.0 * libm::atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_base::load::Folder;

    #[test]
    fn sensitivity_agrees_with_hand_formulas() {
        for name in skyloop_base::load::CAMERAS {
            let camera = Camera::load(name, &Folder::current()).unwrap();
            let found = Sensitivity::of(&camera);
            let (optics, detector) = (&camera.optics, &camera.detector);
            let near = |value: f64, by_hand: f64, share: f64, what: &str| {
                let case = format!("{name}: {what} {value}, by hand {by_hand}");
                assert!((value / by_hand - 1.0).abs() < share, "{case}");
            };
            // 206,265 arcsec a radian.
            if *name != "all-sky" {
                near(
                    found.arcsec_per_px,
                    206_264.8 / optics.focal_px,
                    0.01,
                    "scale",
                );
            }
            let star = StillStar::of(&camera);
            let electrons = optics.band.zero_point()
                * detector.quantum_efficiency
                * optics.transmission
                * optics.aperture_m.powi(2)
                * std::f64::consts::PI
                / 4.0
                * camera.exposure_s;
            near(
                star.electrons(0.0),
                electrons,
                1e-9,
                "electrons of magnitude 0",
            );
            near(star.shares.iter().sum(), 1.0, 0.02, "light on all pixels");
            if let Some(limit) = found.limiting_mag {
                let background = found.sky_e_px + found.dark_e_px;
                near(
                    star.snr(limit, background),
                    LIMIT_SNR,
                    1e-6,
                    "snr at the limit",
                );
                // 1 mag is a factor of 2.512 in the signal.
                let fainter = star.snr(limit + 1.0, background);
                assert!(fainter < LIMIT_SNR && fainter > LIMIT_SNR / 2.6, "{name}");
            }
        }
        let mut camera = Camera::load("rigel-l", &Folder::current()).unwrap();
        let found = Sensitivity::of(&camera);
        // A full well of 100 e- is far below five times a read noise of 90 e-.
        let detector = &mut camera.detector;
        (detector.full_well_e, detector.read_noise_e) = (100.0, 90.0);
        let noisy = Sensitivity::of(&camera);
        assert!(noisy.saturation_mag.is_some(), "{noisy:?}");
        assert_eq!((noisy.limiting_mag, noisy.stars_per_frame), (None, None));
        // X-Val: 2 atan(1024 * 0.018 mm / 2 / 47.7 mm) = 21.8705 deg; diagonal, with sqrt(2):
        // 30.5646 deg.
        for (value, by_hand) in found.field_deg.into_iter().zip([21.8705, 21.8705, 30.5646]) {
            assert!((value - by_hand).abs() < 2e-3, "{value} {by_hand}");
        }
        // X-Val: a pyramid of half angles a: 4 asin(sin^2 a), a = 10.93524 deg: 0.143974 sr.
        let half = 10.93524f64.to_radians();
        let pyramid = 4.0 * (half.sin() * half.sin()).asin() * 1f64.to_degrees().powi(2);
        assert!(
            (found.field_deg2 / pyramid - 1.0).abs() < 1e-3,
            "{found:?} {pyramid}"
        );
    }
}
