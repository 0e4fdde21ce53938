//! Orbits of skyloop.

use nalgebra::Vector3;

/// Position and velocity, GCRF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateVector {
    /// Position, m.
    pub position_m: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity_m_s: Vector3<f64>,
}
