//! Zodiacal light: sunlight that the dust between the planets scatters, by its direction from the
//! Sun in ecliptic coordinates.
//!
//! ```text
//! L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2
//! ```
//!
//! (Clark et al. 2021, Eq. (3), its exponent corrected), with m the magnitude per square arc
//! second, interpolated in the table of Levasseur-Regourd & Dumont 1980 (`sky::zodiacal`).
//!
//! Reference: Leinert et al. 1998 (A&AS 127, 1), Table 16.
//! Validity: 10 %; the Sun's colour; the observer about 1 au from the Sun; the Earth hides it, the
//! Moon does not.
//! Price: an evaluation of the table for each sample, and the passes over the pixels.

use super::Effect;
use super::area::{assess, up_to};
use super::background::{EARTH_FILLS, behind_the_earth};
use crate::scene::{EffectId, Found, Surroundings, View, World};
use crate::sky::zodiacal::{ZodiacalLight, distance_factor};
use nalgebra::Vector3;

/// Zodiacal light.
pub(crate) const ZODIACAL_LIGHT: Effect =
    Effect::light(EffectId::ZodiacalLight, "zodiacal light", |scene, _| {
        assess(scene, EffectId::ZodiacalLight, up_to, 260.0)
    })
    .area_source(find, EARTH_FILLS);

fn find(world: &World, view: &View, around: &Surroundings) -> Found {
    let sun_m = view.observer.sun_m(&world.corrections);
    let light = ZodiacalLight::new(&sun_m);
    let s10 = Box::new(move |at: &Vector3<f64>| light.s10(at));
    behind_the_earth(view, around, s10, distance_factor(sun_m.norm()))
}
