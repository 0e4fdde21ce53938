//! Availability of an object's states.

use hifitime::{Epoch, Unit};
use nalgebra::Matrix3;
use skyloop_orbit::time::utc_text;
use skyloop_orbit::{Object, OrbitError, StateVector};
use skyloop_render::attitude::{MAX_POSITION, MAX_SPEED};
use thiserror::Error;

/// Interval of two positions that test the speed, s: SGP4's velocities may differ from it. Only for
/// objects beyond their apogees.
const MOTION_S: f64 = 0.1;

/// Why there is no state.
#[derive(Debug, Error)]
pub(super) enum NoState {
    /// The orbit has no state.
    #[error(transparent)]
    Orbit(#[from] OrbitError),
    /// Long after their epochs SGP4 gives extreme positions for some objects, without an error.
    #[error(
        "{object}: no state at {}: SGP4 puts it {:.3e} km from the Earth's centre, at {:.1} km/s: more than 4e6 km or 100 km/s; \
         use elements nearer to the epoch",
        utc_text(*epoch), position_m * 1e-3, speed_m_s * 1e-3
    )]
    Runaway {
        object: String,
        epoch: Epoch,
        position_m: f64,
        speed_m_s: f64,
    },
}

/// The state of `object`, GCRF; `rotation` is from TEME to GCRF.
pub(super) fn state(
    object: &Object,
    epoch: Epoch,
    rotation: &Matrix3<f64>,
) -> Result<StateVector, NoState> {
    let state = object.state_with(epoch, rotation)?;
    let position_m = state.position_m.norm();
    let mut speed_m_s = state.velocity_m_s.norm();
    if position_m > 1.1 * apogee_m(object, epoch)
        && let Ok(later) = object.state_with(epoch + Unit::Second * MOTION_S, rotation)
    {
        let path_m = (later.position_m - state.position_m).norm();
        speed_m_s = speed_m_s.max(path_m / MOTION_S);
    }
    if position_m > MAX_POSITION || speed_m_s > MAX_SPEED {
        return Err(NoState::Runaway {
            object: object.label(),
            epoch,
            position_m,
            speed_m_s,
        });
    }
    Ok(state)
}

/// The apogee from the elements at their epoch, m; infinite for an ephemeris.
fn apogee_m(object: &Object, epoch: Epoch) -> f64 {
    /// m^3/s^2, WGS72.
    const MU: f64 = 3.986_008e14;
    let set = object.sets().nth(object.set_index_at(epoch));
    // Kepler's third law: n^2 a^3 = mu
    set.map_or(f64::INFINITY, |set| {
        let rate = set.mean_motion / 60.0;
        libm::cbrt(MU / (rate * rate)) * (1.0 + set.eccentricity)
    })
}

/// Whether `object`, which has no state at an epoch because of `error`, may have one within
/// `half_s` s. The error for an ephemeris has the times. Elements are tested at both ends: they
/// fail for longer than that, or not at all.
pub(super) fn may_have_near(
    object: &Object,
    error: &NoState,
    epoch: Epoch,
    half_s: f64,
    rotation: &Matrix3<f64>,
) -> bool {
    if let NoState::Orbit(OrbitError::OutsideInterval { start, stop, .. }) = error {
        let away = (*start - epoch).max(epoch - *stop);
        return away <= Unit::Second * half_s;
    }
    let ends = [-half_s, half_s].map(|after_s| epoch + Unit::Second * after_s);
    ends.into_iter()
        .any(|end| state(object, end, rotation).is_ok())
}
