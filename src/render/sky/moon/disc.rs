//! The Moon's disc; the equations are in the module `moon`.

use crate::camera::SUN_MAGNITUDE;
use crate::sky::apparent::{Corrections, Observer};
use crate::sky::constants::AU_M;
use crate::sky::ecliptic;
use crate::sky::photometry::phase_angle;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Mean radius of the Moon, m (IAU WGCCRE 2015; Archinal et al. 2018, Table 5).
pub const RADIUS_M: f64 = 1_737_400.0;

/// Kieffer & Stone 2005, Table 4, row 549.1 nm: `a0` to `a3`, by rad of phase.
const A: [f64; 4] = [-2.107_82, -1.667_36, 0.416_97, -0.220_26];
/// `b1` to `b3`, by rad of the Sun's longitude: the east of the near side is brighter.
const B: [f64; 3] = [0.034_51, 0.014_52, -0.005_17];
/// `d1` and `d2`.
const D: [f64; 2] = [0.368_14, -0.098_15];
/// Their Eq. (11): `p1` and `p2`, deg.
const P_DEG: [f64; 2] = [4.060_54, 12.880_2];

/// Phase angles within this of pi (rad) have no visible light: the crescent is 9 mm wide.
pub(super) const NEW_MOON: f64 = 1e-4;

/// The Moon's disc for one observer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoonDisc {
    /// Apparent direction of its centre: unit vector, ICRF.
    pub direction: Vector3<f64>,
    /// Angular radius, rad.
    pub angular_radius: f64,
    /// From the Moon to the Sun: unit vector, ICRF.
    pub to_sun: Vector3<f64>,
    /// Phase angle Sun - Moon - observer, rad: 0 at full Moon.
    pub phase: f64,
    /// Observer to the Moon's centre, m.
    pub distance_m: f64,
    /// Moon to Sun, m.
    pub sun_distance_m: f64,
    /// Share of all light per steradian where `mu0 / (mu0 + mu)` is 1.
    scale: f64,
}

impl MoonDisc {
    /// The disc for `observer`.
    pub fn seen_by(observer: &Observer, corrections: &Corrections) -> Self {
        Self::new(observer.moon_m(corrections), observer.sun_m(corrections))
    }

    /// The disc with the Moon's centre at `moon_m` and the Sun at `sun_m` from an observer outside
    /// the Moon (m, ICRF). For input that is not finite it is dark, and its magnitude NaN.
    pub fn new(moon_m: Vector3<f64>, sun_m: Vector3<f64>) -> Self {
        let (distance_m, from_moon) = (moon_m.norm(), sun_m - moon_m);
        let sun_distance_m = from_moon.norm();
        let direction = moon_m / distance_m;
        let to_sun = from_moon / sun_distance_m;
        let phase = phase_angle(&to_sun, &-direction);
        let angular_radius = libm::asin((RADIUS_M / distance_m).min(1.0));
        let all = disc_integral(phase) * angular_radius * angular_radius;
        MoonDisc {
            direction,
            angular_radius,
            to_sun,
            phase,
            distance_m,
            sun_distance_m,
            scale: if PI - phase > NEW_MOON {
                1.0 / all
            } else {
                0.0
            },
        }
    }

    /// V magnitude of the whole disc, in full sunlight.
    pub fn magnitude(&self) -> f64 {
        // The Sun's longitude from the observer's meridian, east positive. The ecliptic's pole
        // replaces the Moon's (1.5 deg off).
        let toward_us = -self.direction;
        let east = ecliptic::POLE.cross(&toward_us);
        let pole_side = ecliptic::POLE.dot(&toward_us) * ecliptic::POLE.dot(&self.to_sun);
        let longitude = libm::atan2(
            self.to_sun.dot(&east),
            self.to_sun.dot(&toward_us) - pole_side,
        );
        let size = RADIUS_M / self.distance_m;
        SUN_MAGNITUDE - 2.5 * libm::log10(disc_reflectance(self.phase, longitude) * size * size)
            + 5.0 * libm::log10(self.sun_distance_m / AU_M)
    }

    /// The share of the disc's light from direction `at` (unit vector, ICRF), per steradian: its
    /// integral over the disc is 1. It is 0 off the disc, on the night side, and for NaN.
    pub fn brightness(&self, at: &Vector3<f64>) -> f64 {
        // The position on the unit sphere: across the line of sight by the angle from the centre,
        // then up to the surface.
        let toward_us = -self.direction;
        let across = (at - self.direction * at.dot(&self.direction)) / self.angular_radius;
        let square = across.norm_squared();
        let is_before = square < 1.0 && at.dot(&self.direction) > 0.0;
        if !is_before {
            return 0.0;
        }
        let mu = (1.0 - square).sqrt();
        let mu0 = (across + toward_us * mu).dot(&self.to_sun);
        self.scale * lommel_seeliger(mu0, mu)
    }
}

/// Radiance by the cosines of incidence and emission: `mu0 / (mu0 + mu)`, 0 on the night side.
pub(super) fn lommel_seeliger(mu0: f64, mu: f64) -> f64 {
    if mu0 > 0.0 { mu0 / (mu0 + mu) } else { 0.0 }
}

/// `A` of the module `moon`: the reflectance of the disc relative to a flat white screen of its
/// size, at phase angle `phase` and the Sun's longitude `longitude` (rad).
fn disc_reflectance(phase: f64, longitude: f64) -> f64 {
    let square = longitude * longitude;
    let smooth = A[0] + phase * (A[1] + phase * (A[2] + phase * A[3]));
    let side = longitude * (B[0] + square * (B[1] + square * B[2]));
    let surge = |k: usize| D[k] * libm::exp(-phase.to_degrees() / P_DEG[k]);
    libm::exp(smooth + side + surge(0) + surge(1))
}

/// `S` of the module `moon`.
fn disc_integral(phase: f64) -> f64 {
    let half = phase / 2.0;
    // The product approaches g^2 ln g toward 0.
    let lost = if phase > 1e-9 {
        libm::sin(half) * libm::tan(half) * -libm::log(libm::tan(half / 2.0))
    } else {
        0.0
    };
    FRAC_PI_2 * (1.0 - lost)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Moon at its mean distance with this phase angle (deg), waxing for positive angles.
    fn moon(phase_deg: f64) -> MoonDisc {
        let toward = ecliptic::to_icrf(&Vector3::new(0.6, 0.8, 0.0));
        let east = ecliptic::POLE.cross(&-toward);
        let g = phase_deg.to_radians();
        let moon_m = toward * 384_400e3;
        MoonDisc::new(moon_m, moon_m + (-toward * g.cos() + east * g.sin()) * AU_M)
    }

    #[test]
    fn full_moon_and_quarters_have_their_known_magnitudes() {
        // The surge makes the full Moon 0.3 mag brighter at 2 degrees than at 7.
        for phase_deg in [2.0, 3.0, 4.0, 5.0, 6.0, 7.0] {
            let m = moon(phase_deg).magnitude();
            assert!((m + 12.7).abs() < 0.2, "{phase_deg}: {m}");
        }
        let surge = moon(7.0).magnitude() - moon(2.0).magnitude();
        assert!((0.25..0.40).contains(&surge), "{surge}");
        for phase_deg in [90.0, -90.0] {
            let m = moon(phase_deg).magnitude();
            assert!((m + 10.0).abs() < 0.3, "{phase_deg}: {m}");
        }
        // The first quarter is brighter: fewer maria. X-Val: exp(2 * 0.0612) = 13 % by the
        // terms of b.
        let sides = moon(-90.0).magnitude() - moon(90.0).magnitude();
        assert!((sides - 0.133).abs() < 0.005, "{sides}");
    }

    #[test]
    fn magnitudes_agree_with_allens_law() {
        for phase_deg in (10..=150).step_by(5).map(f64::from) {
            let both = (moon(phase_deg).magnitude() + moon(-phase_deg).magnitude()) / 2.0;
            // X-Val: Allen 1976 as in Krisciunas & Schaefer 1991 (PASP 103, 1033), V = -12.73 +
            // 0.026 |g| + 4e-9 g^4.
            let allen = -12.73 + 0.026 * phase_deg + 4e-9 * phase_deg.powi(4);
            assert!((both - allen).abs() < 0.2, "{phase_deg}: {both} {allen}");
        }
    }

    #[test]
    fn magnitudes_follow_the_distances() {
        let near = moon(40.0);
        let far = MoonDisc::new(
            near.direction * (2.0 * near.distance_m),
            near.direction * (2.0 * near.distance_m) + near.to_sun * near.sun_distance_m,
        );
        assert!((far.magnitude() - near.magnitude() - 5.0 * 2f64.log10()).abs() < 1e-9);
        assert!((far.angular_radius / near.angular_radius - 0.5).abs() < 1e-4);
    }

    /// Integral over the disc: x = cos(v) sin(u) toward the Sun, y = sin(v), by the midpoints of
    /// `n` times `n` steps. The terminator is a line of constant u.
    fn integral(disc: &MoonDisc, n: u32) -> f64 {
        let y = disc.direction.cross(&disc.to_sun).normalize();
        let x = y.cross(&disc.direction);
        let step = PI / f64::from(n);
        let angle = |k: u32| (f64::from(k) + 0.5) * step - FRAC_PI_2;
        let mut sum = 0.0;
        for (u, v) in (0..n * n).map(|k| (angle(k % n), angle(k / n))) {
            let offset = (x * (v.cos() * u.sin()) + y * v.sin()) * disc.angular_radius;
            let at = disc.direction + offset.normalize() * offset.norm().tan();
            sum += disc.brightness(&at.normalize()) * v.cos().powi(2) * u.cos();
        }
        sum * (step * disc.angular_radius).powi(2)
    }

    #[test]
    fn integral_over_the_disc_is_1_at_every_phase() {
        for phase_deg in (0..=170).step_by(10).map(f64::from) {
            let sum = integral(&moon(phase_deg + 0.01), 400);
            assert!((sum - 1.0).abs() < 1e-3, "{phase_deg}: {sum}");
        }
    }

    #[test]
    fn bright_limb_points_to_the_sun() {
        for phase_deg in [20.0, 60.0, 90.0, 120.0, -150.0] {
            let disc = moon(phase_deg);
            let sunward =
                (disc.to_sun - disc.direction * disc.to_sun.dot(&disc.direction)).normalize();
            let at = |x: f64| (disc.direction + sunward * (x * disc.angular_radius)).normalize();
            assert!(disc.brightness(&at(0.99)) > 0.0, "{phase_deg}");
            assert_eq!(disc.brightness(&at(-0.99)) == 0.0, phase_deg.abs() > 10.0);
            assert_eq!(disc.brightness(&at(1.001)), 0.0);
            // The terminator crosses the middle line at -cos(phase).
            let terminator = -phase_deg.to_radians().cos();
            assert!(disc.brightness(&at(terminator + 0.003)) > 0.0);
            assert_eq!(disc.brightness(&at(terminator - 0.003)), 0.0);
        }
        // Full: uniform (mu0 = mu), half of the scale.
        let full = moon(0.0);
        let (middle, edge) = (
            full.direction,
            full.direction + Vector3::z() * 0.9 * full.angular_radius,
        );
        assert!((full.brightness(&edge.normalize()) / full.brightness(&middle) - 1.0).abs() < 1e-6);
        // New, and behind the observer.
        assert_eq!(moon(180.0).brightness(&full.direction), 0.0);
        assert_eq!(full.brightness(&-full.direction), 0.0);
    }
}
