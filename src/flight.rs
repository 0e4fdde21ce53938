//! The vehicle's motion in runs that make their own attitudes: what a mock flight computer would send.

use crate::attitude::{AttitudeError, VehicleState};
use crate::config::{Config, Observer, Sequence, TimedAttitude};
use crate::scene::{Exposure, Unobservable, shutter, turn_at};
use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::attitude_list::{AttitudeList, ListError};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::{OrbitSource, Profile, ProfileError, orbit_of};
use skyloop_orbit::time::utc_text;
use std::time::Duration;
use thiserror::Error;

/// Why a run cannot make its attitudes.
#[derive(Debug, Error)]
pub enum FlightError {
    /// The scene has none.
    #[error(
        "the scene has no [sequence]: add one (see configs/default.toml), or use `skyloop run`"
    )]
    NoSequence,
    /// Objects are seen from somewhere.
    #[error(
        "objects without an observer: from the Earth's centre they have no meaningful direction; \
         give the observer's --state or --orbit ([observer] orbit in a scene)"
    )]
    NoObserver,
    /// Attitude or orbit at a frame.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// A value of a frame.
    #[error("at {}: {source}", utc_text(*epoch))]
    Attitude {
        /// Middle of the exposure.
        epoch: Epoch,
        /// What is wrong.
        source: AttitudeError,
    },
    /// The attitudes do not make a list.
    #[error(transparent)]
    List(#[from] ListError),
    /// A frame that cannot be shown.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
}

/// How long a flight computer waits for a frame.
const TIMEOUT: Duration = Duration::from_secs(30);

/// The mission that `config`'s sequence describes, in lock-step with the emulator. It has an attitude
/// and a state for every frame, and those of the first and last can be shown.
pub fn mission(config: &Config) -> Result<Mission, FlightError> {
    let sequence = config.sequence.as_ref().ok_or(FlightError::NoSequence)?;
    let orbit = config.observer.clone().map(|observer| match observer {
        Observer::Object(object) => orbit_of(*object),
        Observer::State(state) => drift(state, sequence.epoch),
    });
    if orbit.is_none() && !config.objects.is_empty() {
        return Err(FlightError::NoObserver);
    }
    let mission = Mission {
        start: sequence.epoch,
        period_s: sequence.period_s,
        frames: sequence.frames,
        profile: profile(sequence)?,
        orbit,
        timeout: TIMEOUT,
        pace: Pace::Stepped { most_hz: None },
        output: None,
        positions: None,
    };
    // Said before anything is opened or written.
    let open_s = config.camera.exposure_s + config.camera.readout_s();
    for number in [0, mission.frames.saturating_sub(1)] {
        let vehicle = vehicle(&mission, number)?;
        shutter(&vehicle, &Exposure::around(vehicle.epoch, open_s))?;
    }
    // An orbit may have gaps; a state that drifts has none, and takes longer with every frame.
    let may_lack = matches!(config.observer, Some(Observer::Object(_)));
    for number in 0..mission.frames {
        let epoch = mission.epoch(number);
        turn_at(mission.profile.at(epoch, None)?.rates_rad_s, open_s)?;
        if may_lack {
            mission.attitude(number, epoch)?;
        }
    }
    Ok(mission)
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

/// One attitude turns with the sequence's rates; several are slerped.
fn profile(sequence: &Sequence) -> Result<Profile, FlightError> {
    let unit = |timed: &TimedAttitude| {
        let [x, y, z, w] = timed.attitude.xyzw();
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
    };
    if let [one] = &sequence.attitudes[..] {
        return Ok(Profile::Slew {
            start: one.epoch,
            attitude: unit(one),
            rates_rad_s: Vector3::from(sequence.rates),
        });
    }
    let timed = sequence.attitudes.iter();
    let list = timed.map(|timed| (timed.epoch, unit(timed))).collect();
    Ok(Profile::List(AttitudeList::new(
        list,
        "sequence.attitudes",
    )?))
}

/// A state carried on by two-body motion and J2.
fn drift(state: skyloop_orbit::StateVector, at: Epoch) -> OrbitSource {
    std::sync::Arc::new(move |epoch| {
        Ok(skyloop_orbit::two_body::propagate_j2(
            &state,
            (epoch - at).to_seconds(),
        ))
    })
}
