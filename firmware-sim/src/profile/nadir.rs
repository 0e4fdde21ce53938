//! To the Earth's centre.

use nalgebra::UnitQuaternion;
use skyloop_orbit::StateVector;

use crate::pointing::of_axes;

/// +Z to the Earth's centre, +X perpendicular to it towards the velocity; `None` where these span no plane.
pub(super) fn attitude(state: &StateVector) -> Option<UnitQuaternion<f64>> {
    let z = -state.position_m;
    let x = state.velocity_m_s - z * (z.dot(&state.velocity_m_s) / z.norm_squared());
    let (z, x) = (z.try_normalize(1.0)?, x.try_normalize(1e-3)?);
    Some(of_axes([x, z.cross(&x), z]))
}
