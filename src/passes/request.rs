//! The time span of a search, and why it cannot be searched.

use hifitime::Epoch;
use skyloop_config::flight::FlightError;
use skyloop_orbit::time::utc_text;
use skyloop_render::light_curve::NoLightCurve;
use skyloop_render::scene::Unobservable;
use thiserror::Error;

/// Time span and resolution of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The first instant.
    pub from: Epoch,
    /// The last instant, after the first.
    pub to: Epoch,
    /// Every pass longer than this is found, s; values below a millisecond count as a millisecond.
    pub shortest_s: f64,
}

impl Search {
    pub(super) fn length_s(&self) -> f64 {
        (self.to - self.from).to_seconds()
    }
}

/// Why a search is impossible.
#[derive(Debug, Error)]
pub enum NoPasses {
    /// No attitude or no state of the vehicle.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// Position or time of the observer is not supported.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
    /// The brightness of an object is unknown.
    #[error(transparent)]
    Light(#[from] NoLightCurve),
    /// The observer is inside the Earth.
    #[error(
        "the observer is below the ground (WGS84) at {}: must be above it; check orbit, units and epochs",
        utc_text(*epoch)
    )]
    BelowGround {
        /// Time of the position.
        epoch: Epoch,
    },
}
