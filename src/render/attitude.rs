//! Attitude, body rates and the state of the vehicle; the conventions of skyloop.
//!
//! 1. Frames of reference are ICRF (GCRF for geocentric positions), body and camera. "Frame" alone
//!    always means an image; bytes on a link are a "packet".
//! 2. An attitude is a unit quaternion in Hamilton's algebra, written `[x, y, z, w]` (scalar last),
//!    that takes ICRF to body: `v_body = R(q) v_icrf` with `R(q) v = q v q^-1`. The camera's
//!    mounting takes body to camera likewise.
//! 3. Check value: `[-0.070834, -0.644137, 0.733522, -0.204975]` with identity mounting points +Z
//!    at RA 248.112, Dec +9.215 degrees.
//! 4. Rates are the angular velocity of the body against ICRF in body axes: `dR/dt = -[w x] R`.
//! 5. Camera axes: +Z boresight, +X along increasing column, +Y along increasing row. Pixel (0, 0)
//!    is the centre of the first pixel; row 0 comes first in memory, on the wire and in files.
//! 6. Time is an [`Epoch`] (integer nanoseconds, TAI); text is UTC. An exposure has a start, a
//!    mid and an end, and every value states which one it refers to.
//! 7. Internal units are SI, radians, electrons and pixels. Suffixes (`_deg`, `_px`, `_e`, `_s`)
//!    stand at the interfaces (configurations, wire, labels).

use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use skyloop_orbit::{StateVector, two_body};
use thiserror::Error;

/// Tolerance of the norm of an input quaternion: within it the quaternion is normalised, beyond it
/// refused.
pub use skyloop_protocols::command::UNIT_TOLERANCE as NORM_TOLERANCE;

/// Why an attitude or state is refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AttitudeError {
    /// The norm is further than [`NORM_TOLERANCE`] from 1.
    #[error(
        "quaternion {q:?} has norm {norm:.6}: send a unit quaternion [x, y, z, w] (1 +- {NORM_TOLERANCE})"
    )]
    NotUnit {
        /// As given.
        q: [f64; 4],
        /// Its Euclidean norm.
        norm: f64,
    },
    /// A component is NaN or infinite.
    #[error("{what} {value:?} is not finite: every component must be a finite number")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// As given.
        value: Vec<f64>,
    },
    /// A component is finite but outside the supported range.
    #[error("{what} {}: must be {allowed}", short(value))]
    OutOfRange {
        /// Which quantity.
        what: &'static str,
        /// As given.
        value: Vec<f64>,
        /// The range.
        allowed: &'static str,
    },
}

/// A rotation from one frame of reference to another; ICRF to body unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude(UnitQuaternion<f64>);

impl Attitude {
    /// No rotation.
    pub fn identity() -> Self {
        Attitude(UnitQuaternion::identity())
    }

    /// From `[x, y, z, w]`; normalised within [`NORM_TOLERANCE`], refused beyond.
    pub fn from_xyzw(q: [f64; 4]) -> Result<Self, AttitudeError> {
        finite("quaternion", &q)?;
        let raw = Quaternion::new(q[3], q[0], q[1], q[2]);
        let norm = raw.norm();
        if (norm - 1.0).abs() > NORM_TOLERANCE {
            return Err(AttitudeError::NotUnit { q, norm });
        }
        Ok(Attitude(UnitQuaternion::new_normalize(raw)))
    }

    /// The attitude of a camera whose boresight (+Z) has this right ascension and declination, rad,
    /// ICRF. `roll` (rad) is the position angle of image up (-Y), from north through east. An angle
    /// that is not finite counts as 0.
    pub fn towards(ra: f64, dec: f64, roll: f64) -> Attitude {
        let [(sin_ra, cos_ra), (sin_dec, cos_dec), (sin_roll, cos_roll)] =
            [ra, dec, roll].map(|angle| libm::sincos(if angle.is_finite() { angle } else { 0.0 }));
        let z = Vector3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec);
        let east = Vector3::new(-sin_ra, cos_ra, 0.0);
        let up = z.cross(&east) * cos_roll + east * sin_roll;
        let x = z.cross(&up);
        let rows = Matrix3::from_rows(&[x.transpose(), -up.transpose(), z.transpose()]);
        let rotation = Rotation3::from_matrix_unchecked(rows);
        Attitude(UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// Right ascension, declination and roll (rad) of a camera of this attitude: the inverse of
    /// [`Attitude::towards`]. They are geometric, without aberration. At a pole the right ascension
    /// is arbitrary, and the roll is the one for the returned right ascension.
    ///
    /// The rows of the rotation matrix are the camera's axes X, Y, Z in the ICRF; with up = -Y,
    /// east = (-sin ra, cos ra, 0), north = Z x east:
    ///
    /// ```text
    /// ra = atan2(Zy, Zx),   dec = atan2(Zz, hypot(Zx, Zy)),   roll = atan2(up.east, up.north)
    /// ```
    pub fn ra_dec_roll(&self) -> [f64; 3] {
        let matrix = self.matrix();
        let (up, z) = (-matrix.row(1).transpose(), matrix.row(2).transpose());
        let ra = libm::atan2(z.y, z.x);
        let dec = libm::atan2(z.z, libm::hypot(z.x, z.y));
        let (sin_ra, cos_ra) = libm::sincos(ra);
        let east = Vector3::new(-sin_ra, cos_ra, 0.0);
        let roll = libm::atan2(up.dot(&east), up.dot(&z.cross(&east)));
        [ra, dec, roll]
    }

    /// The inverse rotation.
    pub fn inverse(&self) -> Attitude {
        Attitude(self.0.inverse())
    }

    /// As `[x, y, z, w]`.
    pub fn xyzw(&self) -> [f64; 4] {
        let q = self.0.quaternion();
        [q.i, q.j, q.k, q.w]
    }

    /// `R(q) v`.
    pub fn rotate(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.0 * v
    }

    /// `R(q)` as a matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        self.0.to_rotation_matrix().into_inner()
    }

    /// This rotation, then `next`.
    pub fn then(&self, next: &Attitude) -> Attitude {
        let mut product = next.0 * self.0;
        // Without this, rounding of the norm accumulates, always with one sign: 1e-10 in 1e7 steps.
        product.renormalize_fast();
        Attitude(product)
    }

    /// The attitude `dt_s` seconds later under constant body rates (rad/s):
    /// `dR/dt = -[w x] R`, so `R(t) = exp(-[w x] dt) R(0)`. Unchanged if the angle is not finite.
    pub fn turned(&self, rates: &Vector3<f64>, dt_s: f64) -> Attitude {
        let turn = -rates * dt_s;
        if !turn.norm_squared().is_finite() {
            return *self;
        }
        self.then(&Attitude(UnitQuaternion::from_scaled_axis(turn)))
    }
}

/// The angle (rad) between two vectors of any length, by its tangent. It is precise near 0 and pi,
/// where an arc cosine loses half of its digits. 0 if a vector is zero, NaN if a component is.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}

/// An angle (rad) in degrees, from 0 to below 360. `rem_euclid` alone rounds a tiny negative angle
/// up to 360.
pub fn degrees_of_turn(angle: f64) -> f64 {
    let degrees = angle.to_degrees().rem_euclid(360.0);
    if degrees < 360.0 { degrees } else { 0.0 }
}

/// The state of the vehicle at one instant, from attitude messages.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleState {
    /// The attitude message's own sequence number; part of the noise key.
    pub sequence: u32,
    /// The instant of all values below.
    pub epoch: Epoch,
    /// ICRF to body.
    pub attitude: Attitude,
    /// Angular velocity of the body against ICRF, body axes, rad/s.
    pub rates: Vector3<f64>,
    /// Geocentric position and velocity, GCRF; without it the observer is at the Earth's centre.
    pub orbit: Option<StateVector>,
}

/// Body rates beyond this (rad/s; 100 turns a second) are refused.
const MAX_RATE: f64 = 628.4;
/// Geocentric positions nearer than this (m) lie below the ground: the Earth's polar radius is
/// 6,356,752 m. Positions in files are checked against the ellipsoid itself (`flight`).
pub const MIN_POSITION: f64 = 6_356_000.0;
/// Geocentric positions beyond this (m) are refused: the observer is assumed to orbit the Earth.
pub const MAX_POSITION: f64 = 4e9;
/// Geocentric speeds beyond this (m/s) are refused.
pub const MAX_SPEED: f64 = 1e5;

/// Checks the position and velocity of an observer.
pub fn check_orbit(state: &StateVector) -> Result<(), AttitudeError> {
    let position: [f64; 3] = state.position_m.into();
    let velocity: [f64; 3] = state.velocity_m_s.into();
    bounded(
        "position (m)",
        &position,
        MAX_POSITION,
        "at most 4e9 m from the Earth's centre",
    )?;
    if length(&position) < MIN_POSITION {
        return Err(AttitudeError::OutOfRange {
            what: "position (m)",
            value: position.to_vec(),
            allowed: "at least 6356000 m from the Earth's centre, or left out",
        });
    }
    bounded("velocity (m/s)", &velocity, MAX_SPEED, "at most 1e5 m/s")
}

impl VehicleState {
    /// A state from external input, checked.
    pub fn new(
        sequence: u32,
        epoch: Epoch,
        q_icrf_to_body: [f64; 4],
        rates: [f64; 3],
        orbit: Option<([f64; 3], [f64; 3])>,
    ) -> Result<Self, AttitudeError> {
        let attitude = Attitude::from_xyzw(q_icrf_to_body)?;
        bounded(
            "body rates (rad/s)",
            &rates,
            MAX_RATE,
            "at most 628.4 rad/s",
        )?;
        let orbit = orbit.map(|(position, velocity)| StateVector {
            position_m: position.into(),
            velocity_m_s: velocity.into(),
        });
        orbit.as_ref().map_or(Ok(()), check_orbit)?;
        Ok(VehicleState {
            sequence,
            epoch,
            attitude,
            rates: rates.into(),
            orbit,
        })
    }

    /// Propagated to another instant: attitude by its rates, orbit by two-body motion and J2.
    pub fn at(&self, epoch: Epoch) -> VehicleState {
        let dt_s = (epoch - self.epoch).to_unit(Unit::Second);
        VehicleState {
            sequence: self.sequence,
            epoch,
            attitude: self.attitude.turned(&self.rates, dt_s),
            rates: self.rates,
            orbit: self.orbit.as_ref().map(|s| two_body::propagate_j2(s, dt_s)),
        }
    }
}

/// The vehicle at `epoch` between two messages. Both are propagated as by [`VehicleState::at`] and
/// blended, so that attitude, rates, position and velocity equal each message at its own epoch and
/// are continuous between them. It is exact for constant rates. `sequence` is the earlier one's.
///
/// The weight is Hermite's `s = u^2 (3 - 2 u)`, `u` the elapsed fraction of the interval: its slope
/// is 0 at both ends.
pub fn between(before: &VehicleState, after: &VehicleState, epoch: Epoch) -> VehicleState {
    let whole_s = (after.epoch - before.epoch).to_unit(Unit::Second);
    let passed_s = (epoch - before.epoch).to_unit(Unit::Second);
    if whole_s <= 0.0 {
        return after.at(epoch);
    }
    let u = (passed_s / whole_s).clamp(0.0, 1.0);
    let s = u * u * (3.0 - 2.0 * u);
    let (a, b) = (before.at(epoch), after.at(epoch));
    let turn = b.attitude.0 * a.attitude.0.inverse();
    let attitude = UnitQuaternion::from_scaled_axis(turn.scaled_axis() * s) * a.attitude.0;
    let orbit = match (a.orbit, b.orbit) {
        (Some(a), Some(b)) => Some(StateVector {
            position_m: a.position_m.lerp(&b.position_m, s),
            velocity_m_s: a.velocity_m_s.lerp(&b.velocity_m_s, s),
        }),
        (a, b) => a.or(b),
    };
    VehicleState {
        attitude: Attitude(attitude),
        rates: a.rates.lerp(&b.rates, s),
        orbit,
        ..a
    }
}

/// The constant body rates (rad/s) that rotate one attitude into another in `dt_s` along the
/// shorter arc. `q(t) = exp(-w t / 2) q(0)`, convention 4.
pub fn rates_between(before: &Attitude, after: &Attitude, dt_s: f64) -> Vector3<f64> {
    let turn = after.0 * before.0.inverse();
    let rates = -turn.scaled_axis() / dt_s;
    if rates.norm_squared().is_finite() {
        rates
    } else {
        Vector3::zeros()
    }
}

fn finite(what: &'static str, value: &[f64]) -> Result<(), AttitudeError> {
    if value.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    Err(AttitudeError::NotFinite {
        what,
        value: value.to_vec(),
    })
}

/// Numbers short enough for a `Nack`.
fn short(value: &[f64]) -> String {
    let numbers = value.iter().map(|v| match v.to_string() {
        short if short.len() <= 12 => short,
        _ => format!("{v:.6e}"),
    });
    format!("[{}]", numbers.collect::<Vec<_>>().join(", "))
}

fn length(value: &[f64]) -> f64 {
    value.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn bounded(
    what: &'static str,
    value: &[f64],
    limit: f64,
    allowed: &'static str,
) -> Result<(), AttitudeError> {
    finite(what, value)?;
    if length(value) <= limit {
        return Ok(());
    }
    Err(AttitudeError::OutOfRange {
        what,
        value: value.to_vec(),
        allowed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // X-Val: convention 3, from the attitude fit of the RCM scene.
    const TOUCHSTONE: [f64; 4] = [-0.070834, -0.644137, 0.733522, -0.204975];

    #[test]
    fn touchstone_boresight_matches_the_conventions() {
        let q = Attitude::from_xyzw(TOUCHSTONE).unwrap();
        let boresight = q.matrix().transpose() * Vector3::z();
        let ra_deg = boresight
            .y
            .atan2(boresight.x)
            .to_degrees()
            .rem_euclid(360.0);
        let dec_deg = boresight.z.asin().to_degrees();
        assert!((ra_deg - 248.112).abs() < 5e-4 && (dec_deg - 9.215).abs() < 5e-4);
    }

    #[test]
    fn pointing_angles_round_trip() {
        for dec in [-90.0, -89.9999, -45.0, 0.0, 9.215, 89.9999, 90.0] {
            for (ra, roll) in [(0.0, 0.0), (248.112, 30.0), (359.9, 359.0), (180.0, 180.0)] {
                let [ra, dec, roll] = [ra, dec, roll].map(f64::to_radians);
                let camera = Attitude::towards(ra, dec, roll);
                let [a, d, r] = camera.ra_dec_roll();
                let apart = Attitude::towards(a, d, r).matrix() - camera.matrix();
                assert!(apart.norm() < 1e-14, "{ra} {dec} {roll}: {apart}");
                assert!((d - dec).abs() < 1e-8, "{ra} {dec} {roll}: {d}");
            }
        }
    }

    #[test]
    fn camera_points_as_commanded_with_north_up() {
        let angles = [248.112_f64, 9.215, 30.0].map(f64::to_radians);
        let [ra, dec, roll] = angles;
        let camera = Attitude::towards(ra, dec, roll);
        let at =
            |ra: f64, dec: f64| Vector3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
        assert!((camera.rotate(&at(ra, dec)) - Vector3::z()).norm() < 1e-15);
        // X-Val: by hand: seen from inside, with north up (-Y), east is left (-X). With up turned
        // by 30 deg to the east, north lies to its right.
        let step = 1e-6;
        let north = camera.rotate(&at(ra, dec + step)) / step;
        let east = camera.rotate(&at(ra + step / dec.cos(), dec)) / step;
        let near = |v: Vector3<f64>, x: f64, y: f64| (v.x - x).hypot(v.y - y) < 1e-5;
        assert!(near(north, 0.5, -0.75_f64.sqrt()), "{north}");
        assert!(near(east, -0.75_f64.sqrt(), -0.5), "{east}");
        let round_trip = camera.then(&camera.inverse());
        assert!((round_trip.matrix() - Matrix3::identity()).norm() < 1e-15);
    }

    #[test]
    fn rates_turn_the_attitude_by_convention_4() {
        let q = Attitude::from_xyzw(TOUCHSTONE).unwrap();
        let w = Vector3::new(0.01, -0.02, 0.03);
        let h = 1e-4;
        let derivative = (q.turned(&w, h).matrix() - q.turned(&w, -h).matrix()) / (2.0 * h);
        let expected = -w.cross_matrix() * q.matrix();
        assert!((derivative - expected).norm() < 1e-9);
    }

    #[test]
    fn quaternion_is_normalised_within_the_tolerance_only() {
        let scaled = |s: f64| TOUCHSTONE.map(|c| c * s);
        let norm = |q: [f64; 4]| q.iter().map(|c| c * c).sum::<f64>().sqrt();
        let q = Attitude::from_xyzw(scaled(1.0009)).unwrap();
        assert!((norm(q.xyzw()) - 1.0).abs() < 1e-15);
        let refused = Attitude::from_xyzw(scaled(1.0011)).unwrap_err();
        assert!(refused.to_string().contains("norm 1.0011"), "{refused}");
        for bad in [f64::NAN, f64::INFINITY] {
            let refused = Attitude::from_xyzw([0.0, bad, 0.0, 1.0]).unwrap_err();
            assert!(matches!(refused, AttitudeError::NotFinite { .. }));
        }
    }

    #[test]
    fn blending_is_exact_for_a_constant_rate() {
        let start = Epoch::from_gregorian_utc_hms(2019, 6, 15, 23, 35, 50);
        let orbit = ([7e6, 0.0, 0.0], [0.0, 7546.0, 0.0]);
        let rates = [0.02, -0.3, 0.1];
        let first = VehicleState::new(1, start, TOUCHSTONE, rates, Some(orbit)).unwrap();
        let at = |s: f64| first.at(start + hifitime::Duration::from_seconds(s));
        let second = VehicleState {
            sequence: 2,
            ..at(0.5)
        };
        for s in [0.0, 0.1, 0.25, 0.4999, 0.5] {
            let (found, exact) = (between(&first, &second, at(s).epoch), at(s));
            let off = rates_between(&found.attitude, &exact.attitude, 1.0).norm();
            assert!(off < 1e-9, "{s}: {off} rad");
            let moved = found.orbit.unwrap().position_m - exact.orbit.unwrap().position_m;
            assert!(moved.norm() < 1e-3, "{s}: {} m", moved.norm());
        }
        let turned = rates_between(&first.attitude, &second.attitude, 0.5);
        assert!((turned - Vector3::from(rates)).norm() < 1e-12, "{turned}");
    }

    #[test]
    fn blending_without_rates_is_continuous() {
        let start = Epoch::from_gregorian_utc_hms(2019, 6, 15, 23, 35, 50);
        let first = VehicleState::new(1, start, TOUCHSTONE, [0.0; 3], None).unwrap();
        let turned = first.attitude.turned(&Vector3::new(0.0, 0.01, 0.0), 1.0);
        let later = start + Unit::Second * 1;
        let second = VehicleState::new(2, later, turned.xyzw(), [0.0; 3], None).unwrap();
        let angle = |u: f64| {
            let epoch = start + hifitime::Duration::from_seconds(u);
            rates_between(
                &first.attitude,
                &between(&first, &second, epoch).attitude,
                1.0,
            )
            .norm()
        };
        // X-Val: u^2 (3 - 2 u) of 0.01 rad.
        for (u, share) in [(0.0, 0.0), (0.25, 0.15625), (0.5, 0.5), (1.0, 1.0)] {
            assert!((angle(u) - 0.01 * share).abs() < 1e-12, "{u}");
        }
        // Of two messages with the same epoch the later one is used.
        let same = VehicleState {
            epoch: start,
            ..second.clone()
        };
        let blended = between(&first, &same, start).attitude;
        assert!(rates_between(&blended, &second.attitude, 1.0).norm() < 1e-12);
    }
}
