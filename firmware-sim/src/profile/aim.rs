//! Points the camera's boresight at a target, with a rule for the roll.

use std::fmt;
use std::sync::Arc;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_orbit::StateVector;
use skyloop_orbit::time::seconds;
use skyloop_orbit::two_body::propagate_j2;

use super::error::{OrbitSource, OrbitSourceError, ProfileError};
use crate::pointing::{Pointing, of_axes, rate_between};

/// A direction (ICRF, any length) at an epoch, from a state (GCRF).
pub type Direction =
    Arc<dyn Fn(Epoch, &StateVector) -> Result<Vector3<f64>, OrbitSourceError> + Send + Sync>;

/// Points the camera's boresight (+Z) at a moving target, with a direction for "up" in the image
/// (-Y).
#[derive(Clone)]
pub struct Aim {
    /// The target.
    pub target: Direction,
    /// Direction of "up"; only its part across the boresight counts.
    pub up: Direction,
    /// Rotation of the image: position angle of -Y from `up`, from north through east, rad.
    pub roll_rad: f64,
    /// Mounting of the camera.
    pub body_to_camera: UnitQuaternion<f64>,
}

/// Below this sine of the angle between them, target and `up` count as parallel: 0.006 deg.
const PARALLEL: f64 = 1e-4;
/// Half the interval of the central difference, s. Its relative error is (rate * step)^2 / 6: 2e-5
/// at 1 rad/s.
const STEP_S: f64 = 0.01;

impl fmt::Debug for Aim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Aim")
            .field("roll_rad", &self.roll_rad)
            .field("body_to_camera", &self.body_to_camera)
            .finish_non_exhaustive()
    }
}

impl Aim {
    /// Whether `up` is parallel to the boresight at `epoch`. Then north (ICRF +Z) replaces it, or
    /// ICRF +X if north is parallel too.
    ///
    /// # Errors
    /// [`ProfileError`]: no state, or no direction to the target.
    pub fn is_degenerate(
        &self,
        epoch: Epoch,
        orbit: Option<&OrbitSource>,
    ) -> Result<bool, ProfileError> {
        let state = state(epoch, orbit)?;
        let [target, up] = self.directions(epoch, &state)?;
        Ok(across(&up, &target).is_none())
    }

    /// Attitude and rates at `epoch`. Without an orbit the observer is the Earth's centre.
    pub(super) fn at(
        &self,
        epoch: Epoch,
        orbit: Option<&OrbitSource>,
    ) -> Result<Pointing, ProfileError> {
        let state = state(epoch, orbit)?;
        let [target, up] = self.directions(epoch, &state)?;
        // The same substitute for "up" at all three instants keeps the rates continuous.
        let substitute = [Vector3::z(), Vector3::x()]
            .into_iter()
            .find(|axis| across(axis, &target).is_some())
            .filter(|_| across(&up, &target).is_none());
        let at = |dt_s: f64| {
            // Propagated from this state alone: other states of the orbit may use other elements,
            // or be missing.
            let nearby = match orbit {
                Some(_) => propagate_j2(&state, dt_s),
                None => state,
            };
            let [target, up] = self.directions(epoch + seconds(dt_s), &nearby)?;
            let up = substitute.unwrap_or(up);
            self.attitude(&target, &up)
                .ok_or(ProfileError::NoTarget { epoch })
        };
        let now = at(0.0)?;
        // The target's ephemeris may end at this epoch.
        let (before, after, span_s) = match (at(-STEP_S), at(STEP_S)) {
            (Ok(before), Ok(after)) => (before, after, 2.0 * STEP_S),
            (Ok(before), Err(_)) => (before, now, STEP_S),
            (Err(_), Ok(after)) => (now, after, STEP_S),
            (Err(error), Err(_)) => return Err(error),
        };
        Ok(Pointing {
            attitude: now,
            rates_rad_s: rate_between(&before, &after, span_s),
        })
    }

    fn directions(
        &self,
        epoch: Epoch,
        state: &StateVector,
    ) -> Result<[Vector3<f64>; 2], ProfileError> {
        let failed = |source| ProfileError::Target { epoch, source };
        let target = (self.target)(epoch, state).map_err(failed)?;
        let target = target.try_normalize(0.0);
        let target = target.ok_or(ProfileError::NoTarget { epoch })?;
        Ok([target, (self.up)(epoch, state).map_err(failed)?])
    }

    /// ICRF to body. With the boresight z, the part n of "up" across it, and the roll r:
    ///
    /// ```text
    /// -y = n cos r + (n x z) sin r,   x = z x (-y)
    /// ```
    ///
    /// For n to the north, n x z is east, and r the position angle of `--radec`.
    fn attitude(&self, z: &Vector3<f64>, up: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        let n = across(up, z)?;
        let (sin, cos) = libm::sincos(self.roll_rad);
        let up = n * cos + n.cross(z) * sin;
        let camera = of_axes([z.cross(&up), -up, *z]);
        Some(self.body_to_camera.inverse() * camera)
    }
}

/// The part of `up` across the unit vector `z`, normalized; `None` if they are parallel.
fn across(up: &Vector3<f64>, z: &Vector3<f64>) -> Option<Vector3<f64>> {
    let up = up.try_normalize(0.0)?;
    (up - z * z.dot(&up)).try_normalize(PARALLEL)
}

fn state(epoch: Epoch, orbit: Option<&OrbitSource>) -> Result<StateVector, ProfileError> {
    match orbit {
        Some(orbit) => orbit(epoch).map_err(|source| ProfileError::Orbit { epoch, source }),
        None => Ok(StateVector {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_orbit::time::parse_utc;

    fn aim(target: Vector3<f64>, up: Vector3<f64>, roll_deg: f64) -> Aim {
        Aim {
            target: Arc::new(move |_, _| Ok(target)),
            up: Arc::new(move |_, _| Ok(up)),
            roll_rad: roll_deg.to_radians(),
            body_to_camera: UnitQuaternion::identity(),
        }
    }

    #[test]
    fn roll_follows_up_or_its_substitute() {
        let epoch = parse_utc("2026-06-01T00:00:00").unwrap();
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let none = Vector3::zeros();
        // Target, up, roll, expected -Y (by hand), whether the rule is degenerate. From +X with
        // north up, east is +Y.
        for (target, up, roll, image_up, degenerate) in [
            (x, 2.0 * z, 0.0, z, false),
            (x, 2.0 * z, 90.0, y, false),
            (3.0 * x, 5.0 * x + y, 0.0, y, false),
            (x, -7.0 * x, 0.0, z, true),
            (x, none, 0.0, z, true),
            (z, z, 0.0, x, true),
            (-z, 9e-5 * y + z, 0.0, x, true),
            (-z, 2e-4 * y + z, 0.0, y, false),
        ] {
            let aim = aim(target, up, roll);
            let case = format!("{target:?} {up:?} {roll}");
            let found = aim.is_degenerate(epoch, None).unwrap();
            assert_eq!(found, degenerate, "{case}");
            let pointing = aim.at(epoch, None).unwrap();
            let to_icrf = pointing.attitude.inverse();
            assert!((to_icrf * z - target.normalize()).norm() < 1e-12, "{case}");
            assert!((to_icrf * -y - image_up).norm() < 1e-12, "{case}");
            assert!(pointing.rates_rad_s.norm() < 1e-12, "{case}");
        }
        let nowhere = aim(none, z, 0.0).at(epoch, None);
        assert!(matches!(nowhere, Err(ProfileError::NoTarget { .. })));
    }
}
