//! Points at a tangent point above the Earth's limb.

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_orbit::StateVector;

use super::error::ProfileError;
use crate::earth::{EQUATOR_M, Earth, POLE_M};
use crate::pointing::of_axes;

/// A line of sight with a given minimum height above the WGS84 ellipsoid.
///
/// +Z points to the tangent point. -Y ("up" in the image of a camera along +Z) points away from the
/// Earth's centre, +X to the right, so that the limb is horizontal in the image. +Z and -Y lie in
/// the vertical plane of the azimuth, which contains the Earth's centre. The height of the tangent
/// point refers to the ellipsoid, not to a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbStare {
    /// Height of the tangent point above the ellipsoid, m.
    pub height_m: f64,
    /// Azimuth of the line of sight, rad: from the horizontal part of the velocity, positive to the
    /// right of the flight (clockwise as seen from above, against the orbit's normal `r x v`).
    pub azimuth_rad: f64,
}

/// A vertical plane through the spacecraft: its position, the vertical, and the horizontal
/// direction at the azimuth.
struct Plane<'a> {
    earth: &'a Earth,
    position_m: Vector3<f64>,
    up: Vector3<f64>,
    level: Vector3<f64>,
}

impl LimbStare {
    /// Line of sight from a state: unit vector, ICRF.
    ///
    /// # Errors
    ///
    /// [`ProfileError`]: no orbital plane, or the state is below the height.
    pub fn direction(
        &self,
        epoch: Epoch,
        state: &StateVector,
    ) -> Result<Vector3<f64>, ProfileError> {
        let attitude = self.attitude(&Earth::at(epoch), epoch, state)?;
        Ok(attitude.inverse() * Vector3::z())
    }

    /// ICRF to body.
    pub(super) fn attitude(
        &self,
        earth: &Earth,
        epoch: Epoch,
        state: &StateVector,
    ) -> Result<UnitQuaternion<f64>, ProfileError> {
        let plane = Plane::new(earth, state, self.azimuth_rad);
        let plane = plane.ok_or(ProfileError::NoPlane { epoch })?;
        let depression = plane.depression(self.height_m);
        let depression = depression.ok_or_else(|| ProfileError::BelowLimb {
            epoch,
            height_km: self.height_m / 1e3,
            orbit_km: earth.above(&state.position_m).0 / 1e3,
        })?;
        let z = plane.direction(depression);
        let (sin, cos) = libm::sincos(depression);
        let y = -(plane.level * sin + plane.up * cos);
        Ok(of_axes([y.cross(&z), y, z]))
    }
}

impl<'a> Plane<'a> {
    fn new(earth: &'a Earth, state: &StateVector, azimuth: f64) -> Option<Self> {
        let up = state.position_m.try_normalize(1.0)?;
        let ahead = state.velocity_m_s - up * up.dot(&state.velocity_m_s);
        let ahead = ahead.try_normalize(1e-3)?;
        let (sin, cos) = libm::sincos(azimuth);
        Some(Self {
            earth,
            position_m: state.position_m,
            up,
            level: ahead * cos + ahead.cross(&up) * sin,
        })
    }

    /// Line of sight at an angle below the horizontal, rad.
    fn direction(&self, depression: f64) -> Vector3<f64> {
        let (sin, cos) = libm::sincos(depression);
        self.level * cos - self.up * sin
    }

    /// Minimum height above the ellipsoid along a line of sight, m.
    fn tangent_m(&self, depression: f64) -> f64 {
        /// Each step reduces the position error to less than a hundredth; the height error is its
        /// square.
        const STEPS: usize = 6;
        let direction = self.direction(depression);
        // Start at the point nearest to the centre, the tangent point of a sphere.
        let mut along = -self.position_m.dot(&direction).min(0.0);
        for _ in 0..STEPS {
            let point = self.position_m + direction * along;
            let (_, up) = self.earth.above(&point);
            along = (along - up.dot(&direction) * point.norm()).max(0.0);
        }
        self.earth.above(&(self.position_m + direction * along)).0
    }

    /// Angle below the horizontal at which the line of sight has this minimum height, rad; `None`
    /// if there is none.
    ///
    /// False position (Illinois rule) between the lines tangent to two spheres about the Earth's
    /// centre: one line is always above the height, the other never.
    fn depression(&self, height_m: f64) -> Option<f64> {
        const MAX: usize = 60;
        /// Corresponds to 4e-13 rad from 500 km.
        const CLOSE_M: f64 = 1e-6;
        let radius = self.position_m.norm();
        let touching = |sphere_m: f64| libm::acos((sphere_m / radius).clamp(0.0, 1.0));
        let (mut above, mut below) = (touching(EQUATOR_M + height_m), touching(POLE_M + height_m));
        let (mut too_high, mut too_low) = (
            self.tangent_m(above) - height_m,
            self.tangent_m(below) - height_m,
        );
        // Over the equator or a pole, one of them is the result.
        for (depression, error) in [(above, too_high), (below, too_low)] {
            if error.abs() < CLOSE_M {
                return Some(depression);
            }
        }
        if !(too_high > 0.0 && too_low < 0.0) {
            return None;
        }
        let mut last = 0.0;
        for _ in 0..MAX {
            let between = above + (below - above) * too_high / (too_high - too_low);
            let error = self.tangent_m(between) - height_m;
            if error.abs() < CLOSE_M {
                return Some(between);
            }
            // An end that stays twice gets half the weight.
            if error > 0.0 {
                (above, too_high) = (between, error);
                too_low *= if last > 0.0 { 0.5 } else { 1.0 };
            } else {
                (below, too_low) = (between, error);
                too_high *= if last < 0.0 { 0.5 } else { 1.0 };
            }
            last = error;
        }
        Some((above + below) / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::{OrbitSource, Profile};
    use hifitime::Duration;
    use skyloop_orbit::time::parse_utc;
    use skyloop_orbit::two_body::propagate_j2;
    use std::sync::Arc;

    fn epoch() -> Epoch {
        parse_utc("2019-06-15T23:35:50").unwrap()
    }

    fn limb(height_m: f64, azimuth_rad: f64) -> LimbStare {
        LimbStare {
            height_m,
            azimuth_rad,
        }
    }

    /// Polar orbit, 500 to 770 km high.
    fn polar() -> OrbitSource {
        let state = StateVector {
            position_m: Vector3::new(6.88e6, 0.0, 0.0),
            velocity_m_s: Vector3::new(0.0, 0.8e3, 7.62e3),
        };
        Arc::new(move |t| Ok(propagate_j2(&state, (t - epoch()).to_seconds())))
    }

    /// Height above WGS84 by a search along the meridian's ellipse, without a formula of [`Earth`].
    fn height_by_search(pole: &Vector3<f64>, point: &Vector3<f64>) -> f64 {
        let z = point.dot(pole);
        let rho = (point - pole * z).norm();
        let distance = |u: f64| {
            let (sin, cos) = u.sin_cos();
            // X-Val: the semi-axes of WGS84, m.
            (rho - 6_378_137.0 * cos).hypot(z - 6_356_752.314_245 * sin)
        };
        let (mut lo, mut hi) = (-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2);
        for _ in 0..100 {
            let third = (hi - lo) / 3.0;
            if distance(lo + third) < distance(hi - third) {
                hi -= third;
            } else {
                lo += third;
            }
        }
        distance((lo + hi) / 2.0)
    }

    #[test]
    fn the_boresight_has_the_requested_minimum_height_along_an_orbit() {
        let orbit = polar();
        let pole = Earth::at(epoch()).pole;
        for (index, minute) in (0..100).step_by(9).enumerate() {
            let at = epoch() + Duration::from_seconds(60.0 * f64::from(minute));
            let azimuth_rad = 0.7 * index as f64 - 2.0;
            for height_m in [0.0, 83_000.0] {
                let limb = limb(height_m, azimuth_rad);
                let pointing = Profile::LimbStare(limb).at(at, Some(&orbit)).unwrap();
                let state = orbit(at).unwrap();
                let line = pointing.attitude.inverse() * Vector3::z();
                // Minimum over steps of 200 m around the point nearest to the centre.
                let nearest = -state.position_m.dot(&line);
                assert!(nearest > 0.0, "ahead");
                let lowest = (-300..=300)
                    .map(|step| state.position_m + line * (nearest + 200.0 * f64::from(step)))
                    .map(|point| height_by_search(&pole, &point))
                    .fold(f64::INFINITY, f64::min);
                // Half a step off changes the height by up to 1 mm: (100 m)^2 / (2 R). The search
                // is exact to some micrometres.
                assert!((lowest - height_m).abs() < 2e-3, "{minute} min: {lowest}");
            }
        }
    }

    #[test]
    fn azimuth_is_positive_to_the_right_and_image_up_is_away_from_the_earth() {
        let orbit = polar();
        let state = orbit(epoch()).unwrap();
        let up = state.position_m.normalize();
        let normal = state.position_m.cross(&state.velocity_m_s).normalize();
        let ahead = normal.cross(&up);
        let quarters = [(0.0, ahead), (1.0, -normal), (2.0, -ahead), (-1.0, normal)];
        for (quarter, level) in quarters {
            let limb = limb(0.0, quarter * std::f64::consts::FRAC_PI_2);
            let pointing = Profile::LimbStare(limb).at(epoch(), Some(&orbit)).unwrap();
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let [x, y, z] = axes.map(|axis| pointing.attitude.inverse() * axis);
            assert!((z.dot(&level) - (1.0 - z.dot(&up).powi(2)).sqrt()).abs() < 1e-12);
            assert!(z.dot(&up) < -0.3 && -y.dot(&up) > 0.9, "{quarter}");
            assert!(x.dot(&up).abs() < 1e-12, "level: {quarter}");
        }
    }

    #[test]
    fn equator_and_pole_agree_with_tangents_of_a_circle() {
        let earth = Earth { pole: Vector3::z() };
        let view = |azimuth, position_m| {
            let velocity_m_s = Vector3::new(0.0, 7.5e3, 0.0);
            let state = StateVector {
                position_m,
                velocity_m_s,
            };
            let attitude = limb(80e3, azimuth).attitude(&earth, epoch(), &state);
            attitude.unwrap().inverse() * Vector3::z()
        };
        // X-Val: cos(depression) = (R + 80 km) / 7000 km with the equatorial radius R. From above
        // the pole all meridians are equal.
        let z = view(0.0, Vector3::x() * 7.0e6);
        let cos: f64 = (6_378_137.0 + 80e3) / 7.0e6;
        assert!((z - Vector3::new(-(1.0 - cos * cos).sqrt(), cos, 0.0)).norm() < 1e-12);
        let downs = [0.0, 1.0, 4.0].map(|azimuth| view(azimuth, Vector3::z() * 7.0e6).z);
        let alike = downs.iter().all(|down| (down - downs[0]).abs() < 1e-11);
        assert!(alike, "{downs:?}");
    }

    #[test]
    fn orbits_below_the_height_are_refused() {
        let stare = |height_m, orbit| Profile::LimbStare(limb(height_m, 0.3)).at(epoch(), orbit);
        let orbit = polar();
        let error = stare(600e3, Some(&orbit)).unwrap_err().to_string();
        for part in ["600 km", "at 501.9 km", "lower height"] {
            assert!(error.contains(part), "{error}");
        }
        // Just below the orbit the line of sight is almost horizontal.
        let level = stare(500e3, Some(&orbit)).unwrap();
        let z = level.attitude.inverse() * Vector3::z();
        assert!(z.x.abs() < 0.03, "{z}");
        let error = stare(0.0, None).unwrap_err().to_string();
        assert!(error.contains("--orbit"), "{error}");
    }
}
