//! Zodiacal light: sunlight that the dust between the planets scatters, by its direction from the Sun in ecliptic coordinates.
//!
//! ```text
//! L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2
//! ```
//!
//! (Clark et al. 2021, Eq. (3), its exponent mended) of the magnitude m a square arc second of the table of Levasseur-Regourd & Dumont 1980, smoothly
//! interpolated (`sky::zodiacal`). Reference: Leinert et al. 1998 (A&AS 127, 1), Table 16. Validity: 10 %; the Sun's colour, the observer 1 au or so from the
//! Sun; the Earth hides it, the Moon does not. Price: a look at the table for each place that is asked for, and the passes over the pixels.

use super::Effect;
use super::area::{judge, up_to};
use crate::scene::EffectId;

/// Zodiacal light.
pub const ZODIACAL_LIGHT: Effect =
    Effect::light(EffectId::ZodiacalLight, "zodiacal light", |scene, _| {
        judge(scene, EffectId::ZodiacalLight, up_to, 260.0)
    });
