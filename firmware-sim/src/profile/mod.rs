//! Attitude profiles: attitude and rates at any instant.
//!
//! Profiles that follow the orbit get their rates by a central difference over the orbit (`along`).

mod aim;
mod error;
mod limb;
mod scan;

use std::sync::Arc;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_orbit::two_body::propagate_j2;
use skyloop_orbit::{Object, StateVector};

pub use self::aim::{Aim, Direction};
pub use self::error::{OrbitSource, OrbitSourceError, ProfileError};
pub use self::limb::LimbStare;
pub use self::scan::Scan;
use crate::attitude_list::AttitudeList;
use crate::earth::Earth;
use crate::pointing::{Pointing, of_axes, rate_between};

/// The orbit of a catalogue object as an [`OrbitSource`].
#[must_use]
pub fn orbit_of(object: Object) -> OrbitSource {
    Arc::new(move |epoch| Ok(object.state(epoch)?))
}

/// Attitude as a function of time.
#[derive(Clone, Debug)]
pub enum Profile {
    /// Slerp between neighbours of a list.
    List(AttitudeList),
    /// A constant attitude.
    Hold(UnitQuaternion<f64>),
    /// A constant angular velocity from a start attitude.
    Slew {
        /// Epoch of `attitude`.
        start: Epoch,
        /// The attitude at `start`, ICRF to body.
        attitude: UnitQuaternion<f64>,
        /// Body axes, rad/s.
        rates_rad_s: Vector3<f64>,
    },
    /// Scan about a body axis.
    Scan(Scan),
    /// +Z to the Earth's centre, +X towards the velocity. Needs an orbit.
    Nadir,
    /// +Z to a tangent point over the Earth's limb. Needs an orbit.
    LimbStare(LimbStare),
    /// The camera's boresight at a target.
    Aim(Aim),
}

impl Profile {
    /// Attitude and rates at `epoch`. Only [`Profile::Nadir`], [`Profile::LimbStare`] and
    /// [`Profile::Aim`] use `orbit`.
    ///
    /// # Errors
    /// [`ProfileError`]: outside the list, or a missing orbit.
    pub fn at(&self, epoch: Epoch, orbit: Option<&OrbitSource>) -> Result<Pointing, ProfileError> {
        match self {
            Self::List(list) => Ok(list.at(epoch)?),
            Self::Hold(attitude) => Ok(Pointing::at_rest(*attitude)),
            Self::Slew {
                start,
                attitude,
                rates_rad_s,
            } => {
                let at_start = Pointing {
                    attitude: *attitude,
                    rates_rad_s: *rates_rad_s,
                };
                Ok(at_start.after((epoch - *start).to_seconds()))
            }
            Self::Scan(scan) => Ok(scan.at(epoch)),
            Self::Aim(aim) => aim.at(epoch, orbit),
            Self::Nadir => {
                let what = "nadir pointing";
                let orbit = orbit.ok_or(ProfileError::NeedsOrbit { what })?;
                along(orbit, epoch, |state| {
                    nadir(state).ok_or(ProfileError::NoPlane { epoch })
                })
            }
            Self::LimbStare(limb) => {
                let what = "a limb stare";
                let orbit = orbit.ok_or(ProfileError::NeedsOrbit { what })?;
                let earth = Earth::at(epoch);
                along(orbit, epoch, |state| limb.attitude(&earth, epoch, state))
            }
        }
    }
}

/// +Z to the Earth's centre, +X across it towards the velocity; `None` if these are parallel.
fn nadir(state: &StateVector) -> Option<UnitQuaternion<f64>> {
    let z = -state.position_m;
    let x = state.velocity_m_s - z * (z.dot(&state.velocity_m_s) / z.norm_squared());
    let (z, x) = (z.try_normalize(1.0)?, x.try_normalize(1e-3)?);
    Some(of_axes([x, z.cross(&x), z]))
}

/// Attitude from position and velocity, with its rates.
fn along(
    orbit: &OrbitSource,
    epoch: Epoch,
    attitude: impl Fn(&StateVector) -> Result<UnitQuaternion<f64>, ProfileError>,
) -> Result<Pointing, ProfileError> {
    /// Half the interval of the central difference, s: the error is quadratic, below 1e-7 of the
    /// orbital rate.
    const STEP_S: f64 = 0.5;
    let state = orbit(epoch).map_err(|source| ProfileError::Orbit { epoch, source })?;
    // Propagated from this state alone: other states of the orbit may use other elements, or be
    // missing.
    let at = |dt_s| attitude(&propagate_j2(&state, dt_s));
    Ok(Pointing {
        attitude: at(0.0)?,
        rates_rad_s: rate_between(&at(-STEP_S)?, &at(STEP_S)?, 2.0 * STEP_S),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::parse_quaternion;
    use hifitime::Duration;
    use nalgebra::Rotation3;
    use skyloop_orbit::time::parse_utc;

    fn epoch() -> Epoch {
        parse_utc("2019-06-15T23:35:50").unwrap()
    }

    fn after(seconds: f64) -> Epoch {
        epoch() + Duration::from_seconds(seconds)
    }

    /// An orbit of 7000 km inclined by 0.7 rad, circular at the epoch.
    fn circular() -> OrbitSource {
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.7);
        let speed = (3.986_004_418e14_f64 / 7.0e6).sqrt();
        let state = StateVector {
            position_m: Vector3::new(7.0e6, 0.0, 0.0),
            velocity_m_s: tilt * Vector3::new(0.0, speed, 0.0),
        };
        Arc::new(move |t| Ok(propagate_j2(&state, (t - epoch()).to_seconds())))
    }

    /// dR/dt = -[w x] R, by a central difference of R.
    fn assert_rates_belong_to_the_attitude(profile: &Profile, at: Epoch) {
        let orbit = circular();
        let h = 1e-3;
        let r = |dt: f64| {
            let at = profile.at(at + Duration::from_seconds(dt), Some(&orbit));
            at.unwrap().attitude.to_rotation_matrix().into_inner()
        };
        let derivative = (r(h) - r(-h)) / (2.0 * h);
        let rates = profile.at(at, Some(&orbit)).unwrap().rates_rad_s;
        let off = derivative + rates.cross_matrix() * r(0.0);
        assert!(off.norm() < 1e-8, "{profile:?}: {off}");
    }

    fn list() -> AttitudeList {
        // X-Val: the first three attitudes of the CASSIOPE scene (fitted to Table A1 of Clark et
        // al. 2021).
        let text = "# UTC x y z w\n2019-06-15T23:35:50 -0.070834 -0.644137 0.733522 -0.204975\n\n\
                    2019-06-15T23:35:55Z,-0.071699,-0.643288,0.734777,-0.202834\n\
                    2019-06-15T23:36:00 0.071539 0.642526 -0.735767 0.201716 # the sign does not matter\n";
        AttitudeList::parse(text, "attitudes.txt").unwrap()
    }

    fn scan(attitude: UnitQuaternion<f64>) -> Profile {
        let (half_width, rate) = (0.02, 0.015);
        Profile::Scan(Scan::new(epoch(), attitude, Vector3::y_axis(), half_width, rate).unwrap())
    }

    /// Target that crosses the sky at 0.05 rad/s, with the velocity as "up" and a tilted camera
    /// mounting.
    fn aim() -> Profile {
        Profile::Aim(Aim {
            target: Arc::new(|t, _| {
                let angle = 0.05 * (t - epoch()).to_seconds();
                Ok(Vector3::new(angle.cos(), angle.sin(), 0.4))
            }),
            up: Arc::new(|_, state| Ok(state.velocity_m_s)),
            roll_rad: 0.3,
            body_to_camera: UnitQuaternion::from_euler_angles(0.2, -0.4, 0.6),
        })
    }

    fn limb(azimuth_deg: f64) -> Profile {
        Profile::LimbStare(LimbStare {
            height_m: 80e3,
            azimuth_rad: azimuth_deg.to_radians(),
        })
    }

    #[test]
    fn rates_are_the_derivative_of_the_attitude() {
        let attitude = parse_quaternion("-0.070834,-0.644137,0.733522,-0.204975").unwrap();
        let slew = Profile::Slew {
            start: epoch(),
            attitude,
            rates_rad_s: Vector3::new(0.01, -0.02, 0.03),
        };
        for profile in [
            Profile::Hold(attitude),
            slew,
            scan(attitude),
            Profile::Nadir,
            limb(0.0),
            limb(-137.0),
            aim(),
            Profile::List(list()),
        ] {
            // In the scan, 2.0 s is in its linear part, 1.3 s in its turn-round.
            for seconds in [0.5, 1.3, 2.0, 7.3] {
                assert_rates_belong_to_the_attitude(&profile, after(seconds));
            }
        }
    }

    #[test]
    fn lists_pass_their_entries_along_the_shorter_arc() {
        let list = Profile::List(list());
        let expected = [
            "-0.070834 -0.644137 0.733522 -0.204975",
            "-0.071699 -0.643288 0.734777 -0.202834",
        ];
        for (seconds, text) in [(0.0, expected[0]), (5.0, expected[1])] {
            let pointing = list.at(after(seconds), None).unwrap();
            let entry = parse_quaternion(text).unwrap();
            let angle = pointing.attitude.angle_to(&entry);
            assert!(angle < 1e-12, "{seconds}: {angle}");
        }
        assert!(list.at(after(9.0), None).unwrap().rates_rad_s.norm() < 1e-2);
        assert!(list.at(after(10.0), None).is_ok());
        // Outside the list the error states its range.
        for seconds in [-0.1, 10.1] {
            let error = list.at(after(seconds), None).unwrap_err().to_string();
            let covers = error.contains("23:35:50") && error.contains("23:36:00");
            assert!(covers, "{error}");
        }
    }

    #[test]
    fn the_reference_quaternion_points_z_as_documented() {
        let q = parse_quaternion("-0.070834 -0.644137 0.733522 -0.204975").unwrap();
        let z = q.inverse() * Vector3::z();
        // X-Val: reference quaternion of the conventions, RA 248.112 and Dec +9.215 degrees.
        assert!((z.y.atan2(z.x).to_degrees().rem_euclid(360.0) - 248.112).abs() < 1e-3);
        assert!((z.z.asin().to_degrees() - 9.215).abs() < 1e-3);
    }

    #[test]
    fn nadir_points_down_and_turns_once_per_orbit() {
        let pointing = Profile::Nadir.at(epoch(), Some(&circular())).unwrap();
        let state = circular()(epoch()).unwrap();
        assert!((pointing.attitude * -state.position_m.normalize() - Vector3::z()).norm() < 1e-12);
        assert!((pointing.attitude * state.velocity_m_s.normalize() - Vector3::x()).norm() < 1e-12);
        // X-Val: mean motion sqrt(mu / a^3) at 7000 km is 1.078007e-3 rad/s, about -Y (Z down, X
        // ahead).
        assert!((pointing.rates_rad_s - Vector3::new(0.0, -1.078_007e-3, 0.0)).norm() < 1e-8);
        let without = Profile::Nadir.at(epoch(), None);
        assert!(matches!(without, Err(ProfileError::NeedsOrbit { .. })));
    }

    #[test]
    fn nadir_rates_need_only_the_state_at_the_epoch() {
        let circular = circular();
        let inner = circular.clone();
        let at_epoch: OrbitSource = Arc::new(move |t| {
            if t == epoch() {
                inner(t)
            } else {
                Err("another time".into())
            }
        });
        let rates = |orbit| Profile::Nadir.at(epoch(), Some(orbit)).unwrap().rates_rad_s;
        assert_eq!(rates(&at_epoch), rates(&circular));
        let refused = Profile::Nadir.at(after(-1.0), Some(&at_epoch)).unwrap_err();
        assert!(refused.to_string().contains("another time"), "{refused}");
    }
}
