//! Attitude and rates of the body at one instant.
//!
//! Quaternions are Hamilton's, ICRF to body: `v_body = q v_icrf q^-1`. Rates are the angular
//! velocity of the body relative to ICRF in body axes, so that `dR/dt = -[w x] R`: over a time dt
//! with constant w, `q(t + dt) = exp(-w dt) q(t)`, where `exp(v)` is the rotation by |v| about v.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Attitude and rates at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointing {
    /// ICRF to body.
    pub attitude: UnitQuaternion<f64>,
    /// Angular velocity of the body relative to ICRF, body axes, rad/s.
    pub rates_rad_s: Vector3<f64>,
}

impl Pointing {
    /// A body without rotation.
    #[must_use]
    pub(crate) fn at_rest(attitude: UnitQuaternion<f64>) -> Self {
        Self {
            attitude,
            rates_rad_s: Vector3::zeros(),
        }
    }

    /// The pointing `seconds` later, exact for constant rates.
    #[must_use]
    pub(crate) fn after(&self, seconds: f64) -> Self {
        Self {
            attitude: turn(self.rates_rad_s * seconds) * self.attitude,
            ..*self
        }
    }
}

/// `exp(-v)`: the change of the ICRF-to-body quaternion when the body rotates by `v` (rotation
/// vector, body axes, rad).
pub(crate) fn turn(v: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(-v)
}

/// The constant rate (body axes, rad/s) from `before` to `after` in `seconds`, along the shorter
/// arc.
pub(crate) fn rate_between(
    before: &UnitQuaternion<f64>,
    after: &UnitQuaternion<f64>,
    seconds: f64,
) -> Vector3<f64> {
    // q1 = exp(-w dt) q0, so w = -log(q1 q0^-1) / dt.
    -(after * before.inverse()).scaled_axis() / seconds
}

/// The attitude of a body whose axes are these unit vectors (ICRF, right-handed).
pub(crate) fn of_axes([x, y, z]: [Vector3<f64>; 3]) -> UnitQuaternion<f64> {
    // The rows of R are the body axes in ICRF.
    let rotation = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation))
}
