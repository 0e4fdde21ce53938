//! The WGS84 ellipsoid about the Earth's true pole of date.

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::frames::teme_to_gcrf;

/// Equatorial radius of the WGS84 ellipsoid, m.
pub(crate) const EQUATOR_M: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// Polar radius of the WGS84 ellipsoid, m.
pub(crate) const POLE_M: f64 = EQUATOR_M * (1.0 - FLATTENING);
/// Square of the ellipsoid's first eccentricity.
const E2: f64 = FLATTENING * (2.0 - FLATTENING);

#[derive(Clone, Copy, Debug)]
pub(crate) struct Earth {
    /// Unit vector of the axis, GCRF.
    pub pole: Vector3<f64>,
}

impl Earth {
    pub fn at(epoch: Epoch) -> Self {
        // TEME's z axis is the true pole.
        let pole = teme_to_gcrf(epoch).column(2).into_owned();
        Self { pole }
    }

    /// Height of a point (GCRF, m) above the ellipsoid, m, negative below it, and the ellipsoid's
    /// normal there, unit vector.
    ///
    /// Bowring's iteration, which gains some three digits per step near the Earth.
    pub fn above(&self, position_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
        const STEPS: usize = 5;
        let z = position_m.dot(&self.pole);
        let across = position_m - self.pole * z;
        let rho = across.norm();
        let outward = across.try_normalize(0.0).unwrap_or_default();
        // The parametric latitude u, starting with that of a point on the ellipsoid.
        let mut u = libm::atan2(z * EQUATOR_M, rho * POLE_M);
        let mut latitude = u;
        for _ in 0..STEPS {
            let (sin, cos) = libm::sincos(u);
            latitude = libm::atan2(
                z + E2 / (1.0 - E2) * POLE_M * sin.powi(3),
                rho - E2 * EQUATOR_M * cos.powi(3),
            );
            let (sin, cos) = libm::sincos(latitude);
            u = libm::atan2((1.0 - FLATTENING) * sin, cos);
        }
        let (sin, cos) = libm::sincos(latitude);
        let height_m = rho * cos + z * sin - EQUATOR_M * (1.0 - E2 * sin * sin).sqrt();
        (height_m, outward * cos + self.pole * sin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_orbit::time::parse_utc;

    #[test]
    fn geodetic_heights_are_recovered() {
        let earth = Earth { pole: Vector3::z() };
        for degrees in [-90.0, -37.0, 0.0, 1e-3, 45.0, 89.9_f64] {
            for height_m in [-10e3, 0.0, 80e3, 570e3, 36e6] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                // X-Val: geodetic to Cartesian in closed form, N = a / sqrt(1 - e^2 sin^2).
                let n = 6_378_137.0 / (1.0 - 6.694_379_990_141e-3 * sin * sin).sqrt();
                let point = Vector3::new(
                    (n + height_m) * cos,
                    0.0,
                    (n * (1.0 - 6.694_379_990_141e-3) + height_m) * sin,
                );
                let (height, up) = earth.above(&point);
                assert!(
                    (height - height_m).abs() < 1e-6,
                    "{degrees} {height_m}: {height}"
                );
                assert!((up - Vector3::new(cos, 0.0, sin)).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn the_pole_includes_precession() {
        let earth = Earth::at(parse_utc("2019-06-15T23:35:50").unwrap());
        // X-Val: 20.04 arcsec a year since 2000 towards RA 0, and nutation of up to 9 arcsec.
        let arcsec = earth.pole.x.to_degrees() * 3600.0;
        assert!((arcsec - 19.46 * 20.04).abs() < 10.0, "{arcsec}");
    }
}
