//! The light of the Earth's air before the camera: above the limb, and between the observer and the ground.

use super::horizon::Horizon;
use super::kinds::{Found, Kind};
use super::{Edge, Radiance, Surroundings, not_in_field};
use crate::scene::{EffectId, View, World};
use crate::sky::atmosphere::Limb;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::Arc;

/// The Earth's limb.
pub const LIMB: Kind = Kind {
    effect: EffectId::Limb,
    radiance: find,
    unlit: "no air in the field is lit, and none shines in the band",
};

/// Of air above so many m, how many m hide nothing from places at both ends: above the mesopause's layers of airglow there are the red lines
/// alone, 40 km high; above their peak all light falls off evenly, and three scale heights tell how.
const PLAIN: [[f64; 2]; 2] = [[245e3, 120e3], [130e3, 40e3]];

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

    /// As large as it is seen of the lowest air in the field, which is the furthest away; of an observer within, nothing is known.
    fn detail(&self) -> f64 {
        let lowest_m = self.horizon.lowest_m();
        let plain = PLAIN.iter().find(|[from_m, _]| lowest_m > *from_m);
        plain.map_or(0.0, |[_, size_m]| {
            let [foot, top] = [lowest_m, lowest_m + size_m].map(|m| self.horizon.height_of(m));
            if top < PI { top - foot } else { 0.0 }
        })
    }

    fn turning(&self) -> Vector3<f64> {
        self.horizon.turning
    }
}
