//! Limits of epochs, turns, exposures and observers.

use super::exposure::Exposure;
use crate::attitude::{AttitudeError, VehicleState, check_orbit};
use crate::sky::apparent::Observer;
use crate::sky::bodies::{Bodies, EpochOutOfRange};
use crate::sky::moon::RADIUS_M;
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::StateVector;
use skyloop_orbit::time::utc_text;
use thiserror::Error;

/// Greatest turn of the body in one exposure, rad: a streak then crosses most fields. Time grows
/// with the streaks' length: at the limit a frame of 256 x 256 pixels takes over a second.
pub const MAX_TURN: f64 = 1.0;

/// Reasons why there is no scene.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unobservable {
    /// The ephemerides do not reach the epoch.
    #[error(transparent)]
    Epoch(#[from] EpochOutOfRange),
    /// The body turns too far.
    #[error(
        "the body turns {turn_deg:.1} deg during the exposure of {exposure_s} s: at most {:.1} deg are shown; \
         lower the rates or the exposure",
        MAX_TURN.to_degrees()
    )]
    Turn {
        /// How far, deg.
        turn_deg: f64,
        /// The exposure time, s.
        exposure_s: f64,
    },
    /// The exposure time is invalid.
    #[error("an exposure of {exposure_s} s: must be 0 or more, and a number")]
    Exposure {
        /// The exposure time, s.
        exposure_s: f64,
    },
    /// The state, propagated along its orbit, is out of range.
    #[error("state propagated to {}: {source}", utc_text(*epoch))]
    State {
        /// An instant of the exposure.
        epoch: Epoch,
        /// The error at that instant.
        source: AttitudeError,
    },
    /// The frame was cancelled.
    #[error("the frame was abandoned before it was complete")]
    Abandoned,
    /// The frame costs too much.
    #[error(
        "the frame costs more than {} s of a core ({sources} sources, images move by up to {} px in {exposure_s} s): lower rates \
         or exposure, choose a coarser fidelity or raise run.work_limit_s",
        two_figures(*limit_s),
        two_figures(*length_px)
    )]
    TooMuchWork {
        /// Sources near the field.
        sources: usize,
        /// How far their images move, px.
        length_px: f64,
        /// The exposure time, s.
        exposure_s: f64,
        /// The limit, s on one core.
        limit_s: f64,
    },
    /// The observer is inside the Moon.
    #[error(
        "the observer is {:.1} km from the Moon's centre at {}: must be above its ground, {:.1} km from there; check state or orbit, units and epochs",
        distance_m * 1e-3,
        utc_text(*epoch),
        RADIUS_M * 1e-3
    )]
    InMoon {
        /// An instant of the exposure.
        epoch: Epoch,
        /// From the Moon's centre, m.
        distance_m: f64,
    },
}

/// A number with two significant figures and no trailing zeros: 0.04, 1.5, 1200.
pub(crate) fn two_figures(value: f64) -> String {
    let rounded = format!("{value:.1e}").parse().unwrap_or(value);
    format!("{rounded}")
}

/// Refuses a geocentric position (ICRF axes, m) inside the Moon or on it; `moon_m` is the Moon's.
pub fn above_the_moon(
    position_m: &Vector3<f64>,
    moon_m: &Vector3<f64>,
    epoch: Epoch,
) -> Result<(), Unobservable> {
    let distance_m = (position_m - moon_m).norm();
    if distance_m <= RADIUS_M {
        return Err(Unobservable::InMoon { epoch, distance_m });
    }
    Ok(())
}

/// The turn of a body with these rates (rad/s) in `exposure_s`, rad; an error beyond [`MAX_TURN`].
pub fn turn_at(rates: Vector3<f64>, exposure_s: f64) -> Result<f64, Unobservable> {
    if !(exposure_s.is_finite() && exposure_s >= 0.0) {
        return Err(Unobservable::Exposure { exposure_s });
    }
    let turn = rates.norm() * exposure_s;
    if turn > MAX_TURN {
        let turn_deg = turn.to_degrees();
        return Err(Unobservable::Turn {
            turn_deg,
            exposure_s,
        });
    }
    Ok(turn)
}

/// The observer at start, mid and end of an exposure. Sun and Moon are computed at mid, and move in
/// straight lines.
pub fn shutter(vehicle: &VehicleState, exposure: &Exposure) -> Result<[Observer; 3], Unobservable> {
    let centre = StateVector {
        position_m: Vector3::zeros(),
        velocity_m_s: Vector3::zeros(),
    };
    let bodies = Bodies::at(exposure.mid)?;
    let at = |epoch: Epoch| -> Result<Observer, Unobservable> {
        let orbit = vehicle.at(epoch).orbit;
        if let Some(state) = &orbit {
            check_orbit(state).map_err(|source| Unobservable::State { epoch, source })?;
        }
        let state = orbit.unwrap_or(centre);
        let bodies = bodies.after((epoch - exposure.mid).to_seconds());
        above_the_moon(&state.position_m, &bodies.moon_geocentric_m, epoch)?;
        Ok(Observer {
            epoch,
            position_m: state.position_m,
            velocity_m_s: state.velocity_m_s,
            bodies,
        })
    };
    Ok([at(exposure.start)?, at(exposure.mid)?, at(exposure.end)?])
}
