//! The light of the Earth's air before the camera: above the limb, and between the observer and the ground.

use super::horizon::Horizon;
use super::kinds::{Found, Kind};
use super::{Edge, Radiance, Surroundings, not_in_field};
use crate::scene::{View, World};
use crate::sky::atmosphere::Limb;
use nalgebra::Vector3;
use std::sync::Arc;

/// The Earth's limb.
pub const LIMB: Kind = Kind {
    effect: "limb",
    is_in: |simulated| simulated.limb,
    radiance: find,
    unlit: "no air in the field is lit, and none shines in the band",
};

#[derive(Debug)]
struct Air {
    limb: Arc<Limb>,
    horizon: Horizon,
}

fn find(world: &World, view: &View, around: &Surroundings) -> Found {
    let Some(horizon) = around.horizon else {
        return Err(super::NO_ORBIT.into());
    };
    match around.limb(world, view) {
        Some(limb) => Ok(Arc::new(Air { limb, horizon })),
        None => Err(not_in_field("the Earth's limb", horizon.nearest())),
    }
}

impl Radiance for Air {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        self.limb.radiance(direction)
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.horizon.as_edge()
    }

    fn turning(&self) -> Vector3<f64> {
        self.horizon.turning
    }
}
