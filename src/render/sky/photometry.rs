//! Photometry: magnitudes, photon irradiance and the reflecting sphere.
//!
//! Clark et al. 2021 (Sensors 21, 7868), Eqs. (1), (6)-(10), with two corrections: the exponent of
//! Eqs. (1) and (10) is -0.4 m (printed -0.04 m), and the specular phase function of Eq. (8) is
//! 1 / (4 pi) (printed 1 / (4 pi^2)): only so does a lossless mirror sphere conserve light.

use super::bodies::AU_M;
use crate::attitude::angle_between;
use crate::camera::SUN_MAGNITUDE;
use nalgebra::Vector3;
use skyloop_base::range::nearest;
use std::f64::consts::PI;

/// Photon irradiance (ph/s/m^2) of magnitude `m` in a band with zero point `e_zero`: Eqs. (1),
/// (10), `E = E_zero 10^(-0.4 m)`; NaN if an argument is.
pub fn photon_irradiance(e_zero: f64, m: f64) -> f64 {
    e_zero * libm::exp10(-0.4 * m)
}

/// Photon radiance (ph/s/m^2/sr) of `m` magnitudes per square arc second: Eq. (3), its exponent
/// corrected, `L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2`; NaN if an argument is.
pub fn photon_radiance(e_zero: f64, m: f64) -> f64 {
    const ARCSEC: f64 = PI / 648_000.0;
    e_zero * libm::exp10(-0.4 * m) / (ARCSEC * ARCSEC)
}

/// A sphere that reflects sunlight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Diameter, m.
    pub diameter_m: f64,
    /// Reflectance `rho` (1).
    pub reflectance: f64,
    /// Hejduk's diffuse mixing coefficient `B_diff` (1).
    pub diffuse: f64,
    /// Hejduk's specular mixing coefficient `B_spec` (1).
    pub specular: f64,
}

impl Default for Sphere {
    /// The paper's: 10 m, reflectance 0.2, fully diffuse.
    fn default() -> Self {
        Sphere {
            diameter_m: 10.0,
            reflectance: 0.2,
            diffuse: 1.0,
            specular: 0.0,
        }
    }
}

impl Sphere {
    /// Eq. (6): `rho A F = rho A (B_diff F_diff + B_spec F_spec)` at phase angle `phase` (rad),
    /// m^2/sr.
    pub fn reflective_area(&self, phase: f64) -> f64 {
        let [diffuse, specular] = self.parts();
        diffuse * diffuse_phase(phase) + specular
    }

    /// The factor of [`diffuse_phase`], m^2, and the constant part, m^2/sr; 0 instead of a negative
    /// value or NaN.
    pub(crate) fn parts(&self) -> [f64; 2] {
        let area = PI * self.diameter_m * self.diameter_m / 4.0;
        let reflective = self.reflectance * area;
        [
            reflective * self.diffuse,
            reflective * self.specular * SPECULAR_PHASE,
        ]
        .map(|part| part.max(0.0))
    }

    /// [`magnitude`] at phase angle `phase` (rad).
    pub fn magnitude(&self, phase: f64, to_sun_m: f64, to_sensor_m: f64) -> f64 {
        magnitude(self.reflective_area(phase), to_sun_m, to_sensor_m)
    }
}

/// Apparent magnitude: Eq. (9),
/// `m = m_sun - 2.5 log10(rho A F / a^2) + 5 log10(d_rso,sun d_rso,sensor / a^2)`, of the
/// reflective area `rho A F` (m^2/sr), distances in m. Infinite if the area is not positive or NaN;
/// NaN if a distance is.
pub fn magnitude(reflective_area: f64, to_sun_m: f64, to_sensor_m: f64) -> f64 {
    let a2 = AU_M * AU_M;
    SUN_MAGNITUDE - 2.5 * libm::log10(reflective_area.max(0.0) / a2)
        + 5.0 * libm::log10(to_sun_m * to_sensor_m / a2)
}

/// Eq. (7): `F_diff = 2 / (3 pi^2) [(pi - phi) cos phi + sin phi]`, 1/sr, for phase angles from 0
/// to pi; constant beyond, and 0 for NaN.
///
/// Near `phi = pi` the bracket is the difference of two equal numbers; with `d = pi - phi` it is
/// `sin d - d cos d`, whose series starts with `d^3 / 3`.
pub fn diffuse_phase(phase: f64) -> f64 {
    let d = nearest(PI - phase, 0.0..=PI);
    let bracket = if d.abs() < 1e-2 {
        d * d * d * (1.0 / 3.0 - d * d / 30.0)
    } else {
        libm::sin(d) - d * libm::cos(d)
    };
    2.0 / (3.0 * PI * PI) * bracket
}

/// Eq. (8), corrected: `F_spec = 1 / (4 pi)`, 1/sr.
pub const SPECULAR_PHASE: f64 = 1.0 / (4.0 * PI);

/// The phase angle Sun - object - sensor (rad), from the object's directions to both.
pub(crate) fn phase_angle(to_sun: &Vector3<f64>, to_sensor: &Vector3<f64>) -> f64 {
    angle_between(to_sun, to_sensor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Energy: a lossless sphere sends the light of its cross-section into 4 pi.
    #[test]
    fn spheres_conserve_light() {
        const STEPS: usize = 100_000;
        let over_sphere = |f: &dyn Fn(f64) -> f64| -> f64 {
            let h = PI / STEPS as f64;
            (0..STEPS)
                .map(|i| (i as f64 + 0.5) * h)
                .map(|p| f(p) * 2.0 * PI * p.sin() * h)
                .sum()
        };
        assert!((over_sphere(&diffuse_phase) - 1.0).abs() < 1e-8);
        assert!((over_sphere(&|_| SPECULAR_PHASE) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn phase_function_is_smooth_where_its_terms_cancel() {
        let (below, above) = (
            diffuse_phase(PI - 1.000_001e-2),
            diffuse_phase(PI - 0.999_999e-2),
        );
        assert!((below / above - 1.0).abs() < 1e-5);
        assert_eq!(diffuse_phase(PI), 0.0);
        assert!((diffuse_phase(0.0) - 2.0 / (3.0 * PI)).abs() < 1e-15);
    }

    #[test]
    fn magnitudes_follow_range_phase_and_size() {
        let sphere = Sphere::default();
        let near = sphere.magnitude(1.0, AU_M, 500e3);
        assert!((sphere.magnitude(1.0, AU_M, 5000e3) - near - 5.0).abs() < 1e-12);
        let large = Sphere {
            diameter_m: 100.0,
            ..sphere
        };
        assert!((near - large.magnitude(1.0, AU_M, 500e3) - 5.0).abs() < 1e-12);
        // X-Val: by hand for phase 0, 1000 km: -26.73 - 2.5 log10(0.2 * 78.5398 * 0.212207) + 5
        // log10(1e6).
        assert!((sphere.magnitude(0.0, AU_M, 1e6) - 1.9631).abs() < 1e-3);
        // X-Val: by hand, the same with F = 1 / (4 pi) = 0.0795775 at any phase, and with half of
        // each: 0.1458922.
        let mix = |diffuse, specular| Sphere {
            diffuse,
            specular,
            ..sphere
        };
        let mirror = mix(0.0, 1.0);
        assert!((mirror.magnitude(0.0, AU_M, 1e6) - 3.0277).abs() < 1e-3);
        assert_eq!(
            mirror.magnitude(2.0, AU_M, 1e6),
            mirror.magnitude(0.0, AU_M, 1e6)
        );
        assert!((mix(0.5, 0.5).magnitude(0.0, AU_M, 1e6) - 2.3696).abs() < 1e-3);
    }

    #[test]
    fn irradiance_falls_a_hundredfold_in_five_magnitudes() {
        assert!((photon_irradiance(1e10, 5.0) - 1e8).abs() < 1e-4);
    }
}
