//! The Earth's disc: an ellipsoid that reflects sunlight, by day; by night it is dark.
//!
//! ```text
//! L = A E_sun cos(i) / pi
//! ```
//!
//! (see `sky::earth_light`; laid on the pixels by Eqs. (4), (5) of Clark et al. 2021). What it hides is left out of the sky behind it, whether it runs or not.
//! Reference: Lambert's law; Kiehl & Trenberth 1997 (BAMS 78, 197) for the albedo. Validity: one albedo, so no clouds, no continents and no glint; its
//! direction is that of mid-exposure, turned as its centre moves. Price: a look at the ellipsoid for each place that is asked for, four for each pixel at the limb, and
//! the passes over the pixels.

use super::Effect;
use super::area::{judge, up_to};
use crate::scene::EffectId;

/// The Earth's disc.
pub const EARTH: Effect = Effect::light(EffectId::Earth, "earth", |scene, _| {
    let says = |area: &_| format!("its day side is in the field, {}", up_to(area));
    judge(scene, EffectId::Earth, says, 240.0)
});
