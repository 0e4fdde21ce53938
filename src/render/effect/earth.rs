//! The Earth's disc: an ellipsoid that reflects sunlight, by day; by night it is dark.
//!
//! ```text
//! L = A E_sun cos(i) / pi
//! ```
//!
//! (see `sky::earth_light`; rasterized by Eqs. (4), (5) of Clark et al. 2021). The sky behind it is
//! dark whether the effect runs or not.
//! Reference: Lambert's law; Kiehl & Trenberth 1997 (BAMS 78, 197) for the albedo.
//! Validity: one albedo, so no clouds, no continents and no glint; its direction is that of
//! mid-exposure, turned as its centre moves.
//! Price: an evaluation of the ellipsoid for each sample, four for each pixel at the limb, and the
//! passes over the pixels.

use super::Effect;
use super::area::{assess, up_to};
use crate::scene::{
    Edge, EffectId, Found, Horizon, NO_ORBIT, Radiance, Surroundings, View, World, not_in_field,
};
use crate::sky::atmosphere::Limb;
use crate::sky::earth_light::EarthDisc;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;
use std::sync::Arc;

/// The Earth's disc.
pub(crate) const EARTH: Effect = Effect::light(EffectId::Earth, "earth", |scene, _| {
    let because = |area: &_| format!("its day side is in the field, {}", up_to(area));
    assess(scene, EffectId::Earth, because, 240.0)
})
.area_source(find, "no part of its day side is in the field");

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
        return Err(NO_ORBIT.into());
    };
    if !horizon.is_in_field() {
        return Err(not_in_field("the Earth", horizon.nearest()));
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
        let share = (self.air.as_ref()).map_or(1.0, |air| air.ground_transmission(direction));
        self.sun * reflectance * share
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.horizon.as_edge()
    }

    fn turning(&self) -> Vector3<f64> {
        self.horizon.turning
    }
}
