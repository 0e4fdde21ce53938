//! Integrated starlight: the stars too faint for the catalogue, as area light.
//!
//! ```text
//! L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2
//! ```
//!
//! (Clark et al. 2021, Eq. (3), its exponent corrected), with m the magnitude per square arc second
//! of all stars below the catalogue's limit, by galactic coordinates (`sky::starlight`).
//! Reference: Hipparcos and Tycho to V = 11, Bahcall & Soneira 1980 (ApJS 44, 73) beyond; Leinert
//! et al. 1998 (A&AS 127, 1).
//! Validity: 20 %, nothing finer than 5 to 15 deg; the Sun's colour; no light scattered by dust.
//! Price: an evaluation of the table for each sample, and the passes over the pixels.

use super::Effect;
use super::area::{assess, up_to};
use super::background::{EARTH_FILLS, behind_the_earth};
use crate::scene::{EffectId, Found, Surroundings, View, World};
use nalgebra::Vector3;

/// Starlight below the catalogue's limit.
pub(crate) const STARLIGHT: Effect = Effect::light(EffectId::Starlight, "starlight", |scene, _| {
    assess(scene, EffectId::Starlight, up_to, 330.0)
})
.area_source(find, EARTH_FILLS);

fn find(world: &World, view: &View, around: &Surroundings) -> Found {
    let light = world.starlight.clone();
    let s10 = Box::new(move |at: &Vector3<f64>| light.s10(at));
    behind_the_earth(view, around, s10, 1.0)
}
