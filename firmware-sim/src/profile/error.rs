//! Orbit sources, and errors of attitude profiles.

use std::error::Error;
use std::sync::Arc;

use hifitime::Epoch;
use skyloop_orbit::StateVector;
use skyloop_orbit::time::utc_text;
use thiserror::Error;

use crate::attitude_list::OutsideList;

/// Any error of an orbit source.
pub type OrbitSourceError = Box<dyn Error + Send + Sync>;

/// Orbit of the spacecraft: epoch in, GCRF position and velocity out.
pub type OrbitSource = Arc<dyn Fn(Epoch) -> Result<StateVector, OrbitSourceError> + Send + Sync>;

/// Error when there is no attitude at an epoch.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ProfileError {
    #[error(transparent)]
    OutsideList(#[from] OutsideList),
    #[error("{what} needs an orbit: give one (--orbit FILE[:NAME])")]
    NeedsOrbit { what: &'static str },
    #[error("no orbit state at {}: {source}", utc_text(*epoch))]
    Orbit {
        epoch: Epoch,
        source: OrbitSourceError,
    },
    #[error("no pointing direction at {}: {source}", utc_text(*epoch))]
    Target {
        epoch: Epoch,
        source: OrbitSourceError,
    },
    #[error("no pointing direction at {}: the target is at the observer's position, or the direction is zero", utc_text(*epoch))]
    NoTarget { epoch: Epoch },
    #[error("no attitude at {}: position and velocity span no orbital plane", utc_text(*epoch))]
    NoPlane { epoch: Epoch },
    #[error(
        "no limb at {height_km} km at {}: the observer must be above the tangent height, and \
         the orbit is at {orbit_km:.1} km: choose a lower height",
        utc_text(*epoch)
    )]
    BelowLimb {
        epoch: Epoch,
        height_km: f64,
        orbit_km: f64,
    },
}
