//! The vehicle's motion in runs that make their own attitudes, as from a mock flight computer.

mod aim;

use crate::{AttitudeFile, Config, Observer, Sequence, TimedAttitude};
use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::attitude_list::{AttitudeList, ListError};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::{OrbitSource, Profile, ProfileError, orbit_of};
use skyloop_orbit::time::utc_text;
use skyloop_orbit::two_body::propagate_j2;
use skyloop_orbit::{Object, StateVector};
use skyloop_render::attitude::{AttitudeError, VehicleState};
use skyloop_render::camera::Camera;
use skyloop_render::scene::{Exposure, Unobservable, above_the_moon, shutter, turn_at};
use skyloop_render::sky::Corrections;
use skyloop_render::sky::bodies::Bodies;
use skyloop_render::sky::shadow::Earth;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use thiserror::Error;

/// Why a run cannot make its attitudes.
#[derive(Debug, Error)]
pub enum FlightError {
    /// The scene has no sequence.
    #[error(
        "the scene has no [sequence]: add one (see configs/default.toml), or use `skyloop run`"
    )]
    NoSequence,
    /// Objects need an observer.
    #[error(
        "objects without an observer: from the Earth's centre they have no meaningful direction; \
         give [observer] state or orbit in the scene, or --state or --orbit where the command has them"
    )]
    NoObserver,
    /// A direction that depends on the observer's position.
    #[error(
        "{what} needs an orbit: give [observer] state or orbit in the scene, or --state or --orbit where the command has them"
    )]
    NeedsOrbit {
        /// The direction.
        what: &'static str,
    },
    /// A position inside the Earth.
    #[error(
        "{key} = {value}: at {} it is {position_km:?} km (GCRF), {:.1} km from the Earth's centre and below the ground (WGS84): must be above it; \
         check orbit, units and epochs",
        utc_text(*epoch),
        Vector3::from(*position_km).norm()
    )]
    BelowGround {
        /// The key or option that gives the observer's orbit.
        key: &'static str,
        /// The value.
        value: String,
        /// Middle of the exposure.
        epoch: Epoch,
        /// The position, GCRF, km.
        position_km: [f64; 3],
    },
    /// A position inside the Moon, or a time without a known position of the Moon.
    #[error("{key} = {value}: {source}")]
    NearMoon {
        /// The key or option that gives the observer's orbit.
        key: &'static str,
        /// The value.
        value: String,
        /// The fault.
        source: Unobservable,
    },
    /// No attitude or orbit for a frame.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// An invalid value of a frame.
    #[error("at {}: {source}", utc_text(*epoch))]
    Attitude {
        /// Middle of the exposure.
        epoch: Epoch,
        /// The fault.
        source: AttitudeError,
    },
    /// The attitudes are no valid list.
    #[error(transparent)]
    List(#[from] ListError),
    /// A frame that cannot be rendered.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
}

impl FlightError {
    /// Whether the error is a target without a known direction.
    pub fn lacks_direction(&self) -> bool {
        matches!(self, FlightError::Profile(ProfileError::Target { .. }))
    }
}

/// Timeout of a flight computer for a frame.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The mission of `config`'s sequence, in lock-step with the emulator. It has an attitude and a
/// state for every frame, and the first and last frames can be rendered.
pub fn mission(config: &Config) -> Result<Mission, FlightError> {
    let sequence = config.sequence.as_ref().ok_or(FlightError::NoSequence)?;
    let orbit = (config.observer.as_ref()).map(|observer| orbit(observer, sequence.epoch));
    if orbit.is_none() && !config.objects.is_empty() {
        return Err(FlightError::NoObserver);
    }
    let profile = profile(sequence, &config.camera, config.sky.corrections)?;
    let needs_orbit = match (&profile, &sequence.look_at) {
        (Profile::Nadir, _) => Some("nadir pointing"),
        (_, Some(look)) => look.needs_orbit(),
        _ => None,
    };
    if let Some(what) = needs_orbit.filter(|_| orbit.is_none()) {
        return Err(FlightError::NeedsOrbit { what });
    }
    let mission = Mission {
        start: sequence.epoch,
        period_s: sequence.period_s,
        frames: sequence.frames,
        profile,
        orbit,
        timeout: TIMEOUT,
        pace: Pace::Stepped { most_hz: None },
        output: None,
        positions: None,
    };
    // Reported before any file is opened or written.
    if let Some(observer) = &config.observer {
        above_ground(observer, &mission)?;
    }
    let open_s = config.camera.exposure_s + config.camera.readout_s();
    for number in [0, mission.frames.saturating_sub(1)] {
        let vehicle = vehicle(&mission, number)?;
        shutter(&vehicle, &Exposure::around(vehicle.epoch, open_s))?;
    }
    // Only the orbit of an object can have gaps. Propagation of a state to every frame is slow.
    let may_lack = matches!(config.observer, Some(Observer::Object(_)));
    for number in 0..mission.frames {
        let epoch = mission.epoch(number);
        let pointing = mission.profile.at(epoch, mission.orbit.as_ref())?;
        turn_at(pointing.rates_rad_s, open_s)?;
        if may_lack {
            mission.attitude(number, epoch)?;
        }
    }
    if let Some(look) = &sequence.look_at {
        for notice in aim::notices(look, &mission)? {
            tracing::warn!("{notice}");
        }
    }
    Ok(mission)
}

/// Distance from the Earth's centre (m) below which the Moon cannot be: its perigees are 356,400
/// km.
const BELOW_MOON: f64 = 3.5e8;

/// Refuses an observer inside the Earth or the Moon in the middle of an exposure. Packets are
/// checked otherwise: against the radius of the Earth's pole (`attitude::check_orbit`) before their
/// time is known, and against the Moon at that time (`scene::shutter`).
fn above_ground(observer: &Observer, mission: &Mission) -> Result<(), FlightError> {
    // Propagated from frame to frame: propagation from the first one would take ever longer.
    let mut drifting = match observer {
        Observer::State(state) => Some(*state),
        Observer::Object(_) => None,
    };
    for number in 0..mission.frames {
        let epoch = mission.epoch(number);
        let (key, value, state) = match (observer, &mut drifting) {
            (Observer::Object(object), _) => {
                // A gap in an orbit is reported with the attitudes.
                let Ok(state) = object.state(epoch) else {
                    continue;
                };
                ("observer.orbit", object.label(), state)
            }
            (Observer::State(given), Some(state)) => {
                let now = *state;
                *state = propagate_j2(&now, mission.period_s);
                let value = format!("{:?} km", given.position_m.map(|m| m * 1e-3).as_slice());
                ("observer.state (--state)", value, now)
            }
            (Observer::State(_), None) => continue,
        };
        if Earth::at(epoch).contains(state.position_m) {
            return Err(FlightError::BelowGround {
                key,
                value,
                epoch,
                position_km: state.position_m.map(|m| (m * 1e-2).round() / 10.0).into(),
            });
        }
        if state.position_m.norm() > BELOW_MOON {
            let moon = Bodies::at(epoch).map_err(Unobservable::from);
            moon.and_then(|at| above_the_moon(&state.position_m, &at.moon_geocentric_m, epoch))
                .map_err(|source| FlightError::NearMoon { key, value, source })?;
        }
    }
    Ok(())
}

/// The vehicle in the middle of exposure `number` of a mission.
pub fn vehicle(mission: &Mission, number: u32) -> Result<VehicleState, FlightError> {
    let epoch = mission.epoch(number);
    let attitude = mission.attitude(number, epoch)?;
    let orbit = attitude
        .state
        .map(|state| (state.position_m, state.velocity_m_s));
    VehicleState::new(
        number,
        epoch,
        attitude.q_icrf_to_body,
        attitude.rates_rad_s,
        orbit,
    )
    .map_err(|source| FlightError::Attitude { epoch, source })
}

/// The vehicle at any instant, without frames.
#[derive(Clone)]
pub struct Flight {
    /// Pointing.
    pub profile: Profile,
    /// Orbit.
    pub orbit: OrbitSource,
    /// The object that it points at, if any.
    pub target: Option<Object>,
}

impl Flight {
    /// Position and velocity.
    pub fn state(&self, epoch: Epoch) -> Result<StateVector, FlightError> {
        (self.orbit)(epoch).map_err(|source| ProfileError::Orbit { epoch, source }.into())
    }

    /// The vehicle with a known state.
    pub fn vehicle(&self, epoch: Epoch, state: StateVector) -> Result<VehicleState, FlightError> {
        let known: OrbitSource = std::sync::Arc::new(move |_| Ok(state));
        let pointing = self.profile.at(epoch, Some(&known))?;
        let q = pointing.attitude.as_vector();
        let orbit = (state.position_m.into(), state.velocity_m_s.into());
        let rates = pointing.rates_rad_s.into();
        VehicleState::new(0, epoch, [q.x, q.y, q.z, q.w], rates, Some(orbit))
            .map_err(|source| FlightError::Attitude { epoch, source })
    }
}

/// The orbit of an observer; `at` is the epoch of a state.
pub fn orbit(observer: &Observer, at: Epoch) -> OrbitSource {
    match observer {
        Observer::Object(object) => orbit_of((**object).clone()),
        Observer::State(state) => drift(*state, at),
    }
}

/// The pointing of a sequence. A target is followed by the boresight of `camera`. One attitude
/// turns with the sequence's rates; several are slerped. Without these +Z points to the Earth's
/// centre and +X along the velocity.
pub fn profile(
    sequence: &Sequence,
    camera: &Camera,
    corrections: Corrections,
) -> Result<Profile, FlightError> {
    if let Some(look) = &sequence.look_at {
        return Ok(Profile::Aim(aim::aim(look, camera, corrections)));
    }
    let unit = |timed: &TimedAttitude| {
        let [x, y, z, w] = timed.attitude.xyzw();
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
    };
    if let Some(AttitudeFile { name, text }) = &sequence.attitude_file {
        return Ok(Profile::List(AttitudeList::parse(text, name)?));
    }
    match &sequence.attitudes[..] {
        [] => return Ok(Profile::Nadir),
        [one] => {
            return Ok(Profile::Slew {
                start: one.epoch,
                attitude: unit(one),
                rates_rad_s: Vector3::from(sequence.rates),
            });
        }
        _ => {}
    }
    let timed = sequence.attitudes.iter();
    let list = timed.map(|timed| (timed.epoch, unit(timed))).collect();
    Ok(Profile::List(AttitudeList::new(
        list,
        "sequence.attitudes",
    )?))
}

/// Interval of the stored states of a propagated orbit, s, and their number in each direction: 694
/// days.
const STORED_S: f64 = 600.0;
const STORED: usize = 100_000;

/// A state propagated by two-body motion and J2. States are stored, since a search needs thousands.
fn drift(state: StateVector, at: Epoch) -> OrbitSource {
    let stored = [(); 2].map(|()| Mutex::new(vec![state]));
    Arc::new(move |epoch| {
        let dt_s = (epoch - at).to_seconds();
        let step_s = STORED_S.copysign(dt_s);
        let count = (dt_s / step_s) as usize;
        let [after, before] = &stored;
        let stored = if dt_s < 0.0 { before } else { after };
        // The list is valid even after a panic of another thread.
        let mut stored = stored.lock().unwrap_or_else(PoisonError::into_inner);
        let mut last = stored.last().copied().unwrap_or(state);
        while stored.len() <= count.min(STORED) {
            last = propagate_j2(&last, step_s);
            stored.push(last);
        }
        let index = count.min(STORED);
        let from = stored.get(index).copied().unwrap_or(state);
        drop(stored);
        Ok(propagate_j2(&from, dt_s - index as f64 * step_s))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times in any order: between stored states, on one, and beyond the last, in both directions.
    #[test]
    fn stored_states_equal_one_propagation() {
        let state = StateVector {
            position_m: Vector3::new(7.0e6, 0.0, 1.0e5),
            velocity_m_s: Vector3::new(0.0, 7.4e3, 1.0e3),
        };
        let at = Epoch::from_gregorian_utc_at_midnight(2026, 1, 1);
        let orbit = drift(state, at);
        for dt_s in [0.0, 1.5, 599.0, -600.0, 86_400.3, 1200.0, -43_210.9] {
            let found = orbit(at + hifitime::Unit::Second * dt_s).unwrap();
            let off_m = (found.position_m - propagate_j2(&state, dt_s).position_m).norm();
            // Both integrations have errors of 0.7 mm a revolution (`propagate_j2`).
            assert!(off_m < 0.02, "{dt_s} s: {off_m} m");
        }
        let far_s = STORED_S * (STORED as f64 + 2.5);
        let far = orbit(at + hifitime::Unit::Second * far_s).unwrap();
        let r = far.position_m.norm();
        assert!((6.6e6..7.2e6).contains(&r), "{r} m");
    }
}
