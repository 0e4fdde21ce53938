//! A camera's boresight at a target, with a rule for the roll about it.

use std::fmt;
use std::sync::Arc;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_orbit::StateVector;
use skyloop_orbit::time::seconds;
use skyloop_orbit::two_body::propagate_j2;

use super::error::{OrbitSource, OrbitSourceError, ProfileError};
use crate::pointing::{Pointing, of_axes, rate_between};

/// A direction (ICRF, any length) at an epoch, as it is seen from a state (GCRF).
pub type Direction =
    Arc<dyn Fn(Epoch, &StateVector) -> Result<Vector3<f64>, OrbitSourceError> + Send + Sync>;

/// The camera's boresight (+Z) at a target that may move, and what is up in its image (-Y).
#[derive(Clone)]
pub struct Aim {
    /// The target.
    pub target: Direction,
    /// What is up in the image, as far as it lies across the boresight.
    pub up: Direction,
    /// Turns the image: the position angle of -Y from `up`, in the sense from north through east, rad.
    pub roll_rad: f64,
    /// The camera's mounting.
    pub body_to_camera: UnitQuaternion<f64>,
}

/// Below this sine of the angle between them, target and `up` count as parallel: 0.006 deg.
const PARALLEL: f64 = 1e-4;
/// Half the base of the numeric derivative, s. Its relative error is (rate * step)^2 / 6: 2e-5 at 1 rad/s.
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
    /// Whether `up` is parallel to the boresight at `epoch`. North is up there instead (ICRF +Z), or ICRF +X where that is parallel too.
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

    /// Attitude and rates at `epoch`; without an orbit seen from the Earth's centre.
    pub(super) fn at(
        &self,
        epoch: Epoch,
        orbit: Option<&OrbitSource>,
    ) -> Result<Pointing, ProfileError> {
        let state = state(epoch, orbit)?;
        let [target, up] = self.directions(epoch, &state)?;
        // One rule for all three instants, so that the rates have no jump in them.
        let substitute = [Vector3::z(), Vector3::x()]
            .into_iter()
            .find(|axis| across(axis, &target).is_some())
            .filter(|_| across(&up, &target).is_none());
        let at = |dt_s: f64| {
            // From this state alone: an orbit's neighbouring states may come of other elements, or not be there.
            let there = match orbit {
                Some(_) => propagate_j2(&state, dt_s),
                None => state,
            };
            let [target, up] = self.directions(epoch + seconds(dt_s), &there)?;
            let up = substitute.unwrap_or(up);
            self.attitude(&target, &up)
                .ok_or(ProfileError::NoTarget { epoch })
        };
        let now = at(0.0)?;
        // A target's ephemeris may end here.
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

    /// ICRF to body. With the boresight z, what is up across it n, and the roll r:
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

/// The part of `up` across the unit vector `z`, as a unit vector; `None` where they are parallel.
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
    fn the_roll_rule_holds_and_parallel_directions_have_a_substitute() {
        let epoch = parse_utc("2026-06-01T00:00:00").unwrap();
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let none = Vector3::zeros();
        // Target, up, roll, where -Y lies (by hand), whether the rule is degenerate. From +X with north up, east is +Y.
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
