//! The time to search, and why it cannot be searched.

use hifitime::Epoch;
use skyloop_config::flight::FlightError;
use skyloop_orbit::time::utc_text;
use skyloop_render::light_curve::NoLightCurve;
use skyloop_render::scene::Unobservable;
use thiserror::Error;

/// When to look, and how closely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The first instant.
    pub from: Epoch,
    /// The last one, after it.
    pub to: Epoch,
    /// Every stay longer than this is found, s; values up to a millisecond count as one.
    pub shortest_s: f64,
}

impl Search {
    pub(super) fn length_s(&self) -> f64 {
        (self.to - self.from).to_seconds()
    }
}

/// Why nothing can be found.
#[derive(Debug, Error)]
pub enum NoPasses {
    /// No attitude or no state of the vehicle.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// Nothing can be seen from there, or then.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
    /// The brightness of an object is not known.
    #[error(transparent)]
    Light(#[from] NoLightCurve),
    /// The observer is inside the Earth.
    #[error(
        "the observer is below the ground (WGS84) at {}: must be above it; check orbit, units and epochs",
        utc_text(*epoch)
    )]
    BelowGround {
        /// When.
        epoch: Epoch,
    },
}
