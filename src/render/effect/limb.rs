//! The Earth's limb: air that scatters sunlight by day and in twilight, and shines by itself at night.
//!
//! ```text
//! L = (1 / 4 pi) integral of (E_sun s n P + e) dl
//! ```
//!
//! along the line of sight, above the limb and before the ground: molecules n of cross-section s, phase function P, as far as the Sun reaches them and they are seen,
//! and the emission e of airglow in layers, in the camera's band (`sky::atmosphere`, where the whole equation stands). Reference: Chandrasekhar 1960 for the scattering;
//! US Standard Atmosphere 1976; published brightness and heights of airglow (`sky::atmosphere::airglow`). Validity: 350 to 1100 nm, clear air, no ozone, no
//! aurora; by day 3 to 25 % too faint from 10 to 80 km; turned as the Earth's centre moves. Price: a look at the frame's tables for each place that is asked for, four for each
//! pixel where it is finer than the grid, and the passes over the pixels.

use super::Effect;
use super::area::{judge, up_to};
use crate::scene::EffectId;

/// The Earth's air.
pub const LIMB: Effect = Effect::light(EffectId::Limb, "limb", |scene, _| {
    let says = |area: &_| format!("the Earth's air is in the field, {}", up_to(area));
    judge(scene, EffectId::Limb, says, 175.0)
});
