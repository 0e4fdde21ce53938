//! Attitudes of objects in orbit; conventions as in `attitude`.

use crate::attitude::Attitude;
use hifitime::Epoch;
use nalgebra::{Matrix3, Vector3};
use skyloop_orbit::StateVector;

/// The attitude of an object's body over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyAttitude {
    /// Fixed in the ICRF: ICRF to body.
    Inertial(Attitude),
    /// Fixed in the orbital frame: from its axes (+Z to the Earth's centre, +X along the component
    /// of the velocity perpendicular to +Z, +Y opposite to the orbit's normal) to the body.
    Nadir(Attitude),
    /// Constant rates in body axes: a rotation about a direction that is fixed in the ICRF.
    Spin {
        /// The epoch of `attitude`.
        epoch: Epoch,
        /// ICRF to body at `epoch`.
        attitude: Attitude,
        /// Angular velocity of the body against ICRF, body axes, rad/s.
        rates: Vector3<f64>,
    },
}

impl BodyAttitude {
    /// ICRF to body: the rotation matrix `R` of `v_body = R v_icrf`, at `epoch`, for an object with
    /// the geocentric state (GCRF) `state`.
    pub fn matrix(&self, epoch: Epoch, state: &StateVector) -> Matrix3<f64> {
        match self {
            BodyAttitude::Inertial(attitude) => attitude.matrix(),
            BodyAttitude::Nadir(attitude) => attitude.matrix() * orbit_axes(state),
            BodyAttitude::Spin {
                epoch: at,
                attitude,
                rates,
            } => attitude.turned(rates, (epoch - *at).to_seconds()).matrix(),
        }
    }

    /// Angular speed of the body against ICRF, rad/s.
    pub fn rate(&self, state: &StateVector) -> f64 {
        match self {
            BodyAttitude::Inertial(_) => 0.0,
            // |r x v| / r^2
            BodyAttitude::Nadir(_) => {
                let r2 = state.position_m.norm_squared().max(1.0);
                state.position_m.cross(&state.velocity_m_s).norm() / r2
            }
            BodyAttitude::Spin { rates, .. } => rates.norm(),
        }
    }
}

/// GCRF to the axes of the orbit. A degenerate state without an orbital plane gets an arbitrary +X;
/// at the Earth's centre, an arbitrary +Z.
fn orbit_axes(state: &StateVector) -> Matrix3<f64> {
    let up = state.position_m.try_normalize(1e-6);
    let z = -up.unwrap_or_else(Vector3::z);
    let across = |v: &Vector3<f64>| (v - z * z.dot(v)).try_normalize(1e-6);
    let x = across(&state.velocity_m_s)
        .or_else(|| across(&Vector3::x()))
        .or_else(|| across(&Vector3::y()))
        .unwrap_or_else(Vector3::x);
    let y = z.cross(&x);
    // The rows of R are the new axes in the old ones.
    Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

    /// Over the equator at 0 deg, going east.
    fn state() -> StateVector {
        StateVector {
            position_m: Vector3::new(7e6, 0.0, 0.0),
            velocity_m_s: Vector3::new(100.0, 7500.0, 0.0),
        }
    }

    fn epoch(s: f64) -> Epoch {
        Epoch::from_gregorian_utc_at_midnight(2026, 1, 1) + hifitime::Unit::Second * s
    }

    #[test]
    fn nadir_has_z_to_the_earth_and_x_along_the_velocity() {
        let body = BodyAttitude::Nadir(Attitude::identity());
        let r = body.matrix(epoch(0.0), &state());
        assert!((r * -Vector3::x() - Vector3::z()).norm() < 1e-15);
        assert!((r * Vector3::y() - Vector3::x()).norm() < 1e-15);
        // The orbit's normal is north.
        assert!((r * -Vector3::z() - Vector3::y()).norm() < 1e-15);
        assert!((r.determinant() - 1.0).abs() < 1e-15);
        assert!((body.rate(&state()) - 7500.0 / 7e6).abs() < 1e-12);
        // A body rotated by a quarter turn about +Z: its +X is the former +Y (conventions: v_body =
        // R v).
        let quarter = Attitude::from_xyzw([0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2]).unwrap();
        let r = BodyAttitude::Nadir(quarter).matrix(epoch(0.0), &state());
        assert!((r * -Vector3::z() - Vector3::x()).norm() < 1e-12);
    }

    /// Ephemeris files may contain degenerate states.
    #[test]
    fn states_without_an_orbital_plane_have_axes_too() {
        let places = [
            Vector3::zeros(),
            Vector3::x() * 7e6,
            Vector3::y() * 7e6,
            Vector3::z() * 7e6,
        ];
        for position_m in places {
            for velocity_m_s in [Vector3::zeros(), position_m * 1e-3] {
                let state = StateVector {
                    position_m,
                    velocity_m_s,
                };
                let r = BodyAttitude::Nadir(Attitude::identity()).matrix(epoch(0.0), &state);
                assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-15);
                assert!((r.determinant() - 1.0).abs() < 1e-15, "{state:?}");
                if position_m.norm() > 0.0 {
                    assert!((r * position_m.normalize() + Vector3::z()).norm() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn spin_rotates_about_its_epoch_and_inertial_is_fixed() {
        let spin = BodyAttitude::Spin {
            epoch: epoch(0.0),
            attitude: Attitude::identity(),
            rates: Vector3::new(0.0, 0.0, FRAC_PI_2),
        };
        // After a second the body has rotated from +X to +Y: +Y of the ICRF is +X of the body.
        let r = spin.matrix(epoch(1.0), &state());
        assert!((r * Vector3::y() - Vector3::x()).norm() < 1e-12);
        let whole = spin.matrix(epoch(-4.0), &state());
        assert!((whole - Matrix3::identity()).norm() < 1e-12);
        let rest = BodyAttitude::Inertial(Attitude::identity());
        assert_eq!(rest.matrix(epoch(5.0), &state()), Matrix3::identity());
        assert_eq!((rest.rate(&state()), spin.rate(&state())), (0.0, FRAC_PI_2));
    }
}
