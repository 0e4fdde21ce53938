//! Two-body motion with J2, between the states that a flight computer sends.

use crate::StateVector;
use nalgebra::Vector3;

/// Gravitational parameter of the Earth, m^3/s^2 (IERS Conventions 2010, table 1.1).
pub const EARTH_MU: f64 = 3.986_004_418e14;
/// Equatorial radius of the Earth, m (same source).
pub const EARTH_RADIUS_M: f64 = 6_378_136.6;
/// Second zonal harmonic of the Earth, not normalised (same source).
pub const EARTH_J2: f64 = 1.082_635_9e-3;

/// Radians of local circular motion in one integration step.
const STEP_RAD: f64 = 0.005;
/// Largest number of steps, for any state and interval.
const MAX_STEPS: f64 = 2e5;

/// The state `dt_s` seconds later (or earlier, when negative), GCRF, m and m/s.
///
/// Gravity is the central term and J2, with the GCRF z axis as the Earth's pole. Errors (the first
/// two measured in `tests/two_body.rs`):
///
/// - integration: 0.7 mm a revolution at 500 km, 6 cm in an orbit of eccentricity 0.74;
/// - the pole, moved by precession by 0.14 degrees in 2025: at 500 km 0.12 m after a minute, 310 m
///   after a revolution;
/// - J3 and higher, drag, Sun and Moon are left out: at 500 km some 1e-4 m/s^2, so about 0.2 m
///   after a minute, kilometres after some revolutions.
///
/// Intervals beyond 2e5 steps (five days at 500 km) use coarser steps. A state or interval that is
/// not finite gives a state that is not finite.
pub fn propagate_j2(state: &StateVector, dt_s: f64) -> StateVector {
    propagate(state, dt_s, EARTH_J2)
}

/// [`propagate_j2`] with another second zonal harmonic; 0 gives Kepler's ellipse.
///
/// Fourth-order Runge-Kutta method, with steps that depend on the distance.
pub fn propagate(state: &StateVector, dt_s: f64, j2: f64) -> StateVector {
    let (mut now, mut left) = (*state, dt_s);
    if dt_s.is_nan() {
        now.position_m.fill(f64::NAN);
        now.velocity_m_s.fill(f64::NAN);
    }
    while left.abs() > 0.0 {
        // h = STEP sqrt(r^3 / mu): the same share of a circular orbit at any r.
        let r = now.position_m.norm();
        let natural = STEP_RAD * (r * r * r / EARTH_MU).sqrt();
        let step = natural.max(dt_s.abs() / MAX_STEPS).min(left.abs());
        let h = step.copysign(left);
        now = runge_kutta_4(&now, h, j2);
        left -= h;
    }
    now
}

fn runge_kutta_4(s: &StateVector, h: f64, j2: f64) -> StateVector {
    let (r, v) = (s.position_m, s.velocity_m_s);
    let (v1, a1) = (v, gravity(&r, j2));
    let (v2, a2) = (v + a1 * (h / 2.0), gravity(&(r + v1 * (h / 2.0)), j2));
    let (v3, a3) = (v + a2 * (h / 2.0), gravity(&(r + v2 * (h / 2.0)), j2));
    let (v4, a4) = (v + a3 * h, gravity(&(r + v3 * h), j2));
    StateVector {
        position_m: r + (v1 + 2.0 * (v2 + v3) + v4) * (h / 6.0),
        velocity_m_s: v + (a1 + 2.0 * (a2 + a3) + a4) * (h / 6.0),
    }
}

/// Acceleration, m/s^2, at `r` (m) from the Earth's centre.
fn gravity(r: &Vector3<f64>, j2: f64) -> Vector3<f64> {
    let r2 = r.norm_squared();
    // a = -mu r / |r|^3
    let central = -EARTH_MU / (r2 * r2.sqrt());
    // a_J2 = -(3/2) J2 mu Re^2 / |r|^5 (1 - 5 z^2/r^2, same, 3 - 5 z^2/r^2) . (x, y, z)
    // (Vallado, Fundamentals of Astrodynamics, 4th edition, eq. 8-30)
    let k = 1.5 * j2 * EARTH_RADIUS_M * EARTH_RADIUS_M / r2;
    let z = 5.0 * r.z * r.z / r2;
    Vector3::new(
        central * r.x * (1.0 + k * (1.0 - z)),
        central * r.y * (1.0 + k * (1.0 - z)),
        central * r.z * (1.0 + k * (3.0 - z)),
    )
}
