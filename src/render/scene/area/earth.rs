//! The Earth's disc before the camera: the ground, as far as the air before it lets it be seen.

use super::horizon::Horizon;
use super::kinds::Found;
use super::{Edge, Kind, Radiance, Surroundings};
use crate::scene::{EffectId, View, World};
use crate::sky::atmosphere::Limb;
use crate::sky::earth_light::EarthDisc;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;
use std::sync::Arc;

/// The Earth's disc.
pub const EARTH: Kind = Kind {
    effect: EffectId::Earth,
    radiance: find,
    unlit: "no part of its day side is in the field",
};

#[derive(Debug)]
struct Disc {
    disc: EarthDisc,
    horizon: Horizon,
    air: Option<Arc<Limb>>,
    /// The Sun's irradiance at 1 au, ph/s/m^2.
    sun: f64,
}

fn find(world: &World, view: &View, around: &Surroundings) -> Found {
    let horizon = around.horizon;
    let (position_m, bodies) = (view.observer.position_m, &view.observer.bodies);
    let earth = Earth::at(view.exposure.mid);
    let disc = EarthDisc::new(position_m, bodies.sun_apparent_m(), earth);
    let (Some(horizon), Some(disc)) = (horizon, disc) else {
        return Err(super::NO_ORBIT.into());
    };
    if !horizon.is_in_field() {
        return Err(super::not_in_field("the Earth", horizon.nearest()));
    }
    Ok(Arc::new(Disc {
        disc,
        horizon,
        air: around.limb(world, view),
        sun: view.camera.optics.band.sun_irradiance(),
    }))
}

impl Radiance for Disc {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        let reflectance = self.disc.reflectance(direction);
        if reflectance == 0.0 {
            return 0.0;
        }
        let share = (self.air.as_ref()).map_or(1.0, |air| air.ground_share(direction));
        self.sun * reflectance * share
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.horizon.as_edge()
    }

    fn turning(&self) -> Vector3<f64> {
        self.horizon.turning
    }
}
