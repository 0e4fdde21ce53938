//! The Earth's limb: air that scatters sunlight by day and in twilight, and shines by itself at
//! night.
//!
//! ```text
//! L = (1 / 4 pi) integral of (E_sun s n P + e) dl
//! ```
//!
//! along the line of sight, above the limb and before the ground: molecules n of cross-section s
//! with phase function P, attenuated toward the Sun and the observer, and airglow layers of
//! emission e, in the camera's band. `sky::atmosphere` has the whole equation.
//! Reference: Chandrasekhar 1960 for the scattering; US Standard Atmosphere 1976; published
//! brightness and heights of airglow (`sky::atmosphere::airglow`).
//! Validity: 350 to 1100 nm, clear air, no ozone, no aurora; by day 3 to 25 % too faint from 10 to
//! 80 km; turned as the Earth's centre moves.
//! Price: an evaluation of the frame's tables for each sample, four for each pixel with detail
//! finer than the grid, and the passes over the pixels.

use super::Effect;
use super::area::{assess, up_to};
use crate::scene::{
    Edge, EffectId, Found, Horizon, NO_ORBIT, Radiance, Surroundings, View, World, not_in_field,
};
use crate::sky::atmosphere::Limb;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::Arc;

/// The Earth's air.
pub(crate) const LIMB: Effect = Effect::light(EffectId::Limb, "limb", |scene, _| {
    let because = |area: &_| format!("the Earth's air is in the field, {}", up_to(area));
    assess(scene, EffectId::Limb, because, 175.0)
})
.area_source(
    find,
    "no air in the field is lit, and none shines in the band",
);

/// Pairs of a height (m) and the smallest size (m) of detail above it. Above the mesopause's
/// airglow there are only the red lines, 40 km high; above their peak all light decays smoothly
/// over three scale heights.
const PLAIN: [[f64; 2]; 2] = [[245e3, 120e3], [130e3, 40e3]];

#[derive(Debug)]
struct Air {
    limb: Arc<Limb>,
    horizon: Horizon,
}

fn find(world: &World, view: &View, around: &Surroundings) -> Found {
    let Some(horizon) = around.horizon else {
        return Err(NO_ORBIT.into());
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

    /// The angular size of the detail in the lowest, most distant air in the field; unknown for an
    /// observer inside the air.
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
