//! The sky behind the Earth: light in S10 (stars of V = 10 a square degree).

use crate::scene::{Edge, Found, Horizon, Radiance, Surroundings, View};
use crate::sky::photometry::photon_radiance;
use crate::sky::zodiacal::S10_MAG;
use nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

/// The smallest step of the tables of zodiacal light and starlight.
const DETAIL_DEG: f64 = 5.0;
pub(super) const EARTH_FILLS: &str = "the Earth fills the field";

/// S10 in a direction (unit vector, ICRF).
pub(super) type Brightness = dyn Fn(&Vector3<f64>) -> f64 + Send + Sync;

struct Background {
    s10: Box<Brightness>,
    /// Radiance of 1 S10, ph/s/m^2/sr.
    unit: f64,
    horizon: Option<Horizon>,
}

impl fmt::Debug for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background")
            .field("horizon", &self.horizon)
            .finish_non_exhaustive()
    }
}

/// Light of `scale` times `s10`, except behind the Earth.
pub(super) fn behind_the_earth(
    view: &View,
    around: &Surroundings,
    s10: Box<Brightness>,
    scale: f64,
) -> Found {
    let horizon = around.horizon;
    if horizon.is_some_and(|horizon| horizon.fills()) {
        return Err(EARTH_FILLS.into());
    }
    let zero_point = view.camera.optics.band.zero_point();
    Ok(Arc::new(Background {
        s10,
        unit: photon_radiance(zero_point, S10_MAG) * scale,
        horizon,
    }))
}

impl Radiance for Background {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        self.unit * (self.s10)(direction)
    }

    fn detail(&self) -> f64 {
        DETAIL_DEG.to_radians()
    }

    fn is_hidden_inside(&self) -> bool {
        true
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.horizon.as_ref()?.as_edge()
    }

    /// The turning of its edge: the background itself hardly changes.
    fn turning(&self) -> Vector3<f64> {
        match self.horizon {
            Some(horizon) if horizon.has_limb() => horizon.turning,
            _ => Vector3::zeros(),
        }
    }
}
