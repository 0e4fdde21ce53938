//! The sky behind all else: light that is told in magnitudes a square arc second, as far as the Earth does not hide it.

use super::horizon::Horizon;
use super::kinds::{Found, Kind};
use super::{Edge, Radiance, Surroundings};
use crate::scene::{View, World};
use crate::sky::photometry::photon_radiance;
use crate::sky::zodiacal;
use nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

/// Zodiacal light.
pub const ZODIACAL: Kind = Kind {
    effect: "zodiacal light",
    is_in: |simulated| simulated.zodiacal,
    radiance: zodiacal,
    unlit: EARTH_FILLS,
};

/// Stars too faint for the catalogue.
pub const STARLIGHT: Kind = Kind {
    effect: "starlight",
    is_in: |simulated| simulated.starlight,
    radiance: starlight,
    unlit: EARTH_FILLS,
};

const DETAIL_DEG: f64 = 5.0;
const EARTH_FILLS: &str = "the Earth fills the field";

/// V magnitude a square arc second in a direction (unit vector, ICRF).
type Brightness = dyn Fn(&Vector3<f64>) -> f64 + Send + Sync;

struct Background {
    magnitude: Box<Brightness>,
    /// ph/s/m^2 of magnitude 0.
    zero_point: f64,
    horizon: Option<Horizon>,
}

impl fmt::Debug for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background")
            .field("horizon", &self.horizon)
            .finish_non_exhaustive()
    }
}

fn behind_the_earth(view: &View, around: &Surroundings, magnitude: Box<Brightness>) -> Found {
    let horizon = around.horizon;
    if horizon.is_some_and(|horizon| horizon.fills()) {
        return Err(EARTH_FILLS.into());
    }
    Ok(Arc::new(Background {
        magnitude,
        zero_point: view.camera.optics.band.zero_point(),
        horizon,
    }))
}

fn zodiacal(world: &World, view: &View, around: &Surroundings) -> Found {
    let sun_m = view.observer.sun_m(&world.corrections);
    let (sun, distance_m) = (sun_m.normalize(), sun_m.norm());
    let nearer = 2.5 * libm::log10(zodiacal::distance_factor(distance_m));
    let magnitude = move |at: &Vector3<f64>| zodiacal::surface_magnitude(at, &sun) - nearer;
    behind_the_earth(view, around, Box::new(magnitude))
}

fn starlight(world: &World, view: &View, around: &Surroundings) -> Found {
    let starlight = world.starlight.clone();
    let magnitude = move |at: &Vector3<f64>| starlight.surface_magnitude(at);
    behind_the_earth(view, around, Box::new(magnitude))
}

impl Radiance for Background {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        photon_radiance(self.zero_point, (self.magnitude)(direction))
    }

    /// The smallest step of the tables of both.
    fn detail(&self) -> f64 {
        DETAIL_DEG.to_radians()
    }

    fn is_hidden_inside(&self) -> bool {
        true
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.horizon.as_ref()?.as_edge()
    }

    /// Its edge's: in what it hides little changes.
    fn turning(&self) -> Vector3<f64> {
        match self.horizon {
            Some(horizon) if horizon.has_limb() => horizon.turning,
            _ => Vector3::zeros(),
        }
    }
}
