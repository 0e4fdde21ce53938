//! Which area sources there are. Adding one is a file here, a line in [`KINDS`], and its effect.

use super::{Radiance, Surroundings};
use crate::scene::{EffectId, View, World};
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// The area sources, in the order of their effects.
pub static KINDS: &[Kind] = &[
    super::background::ZODIACAL,
    super::background::STARLIGHT,
    super::earth::EARTH,
    super::limb::LIMB,
    super::veil::SUNLIGHT,
    super::veil::MOONGLOW,
    super::veil::EARTHSHINE,
];

/// The light of an area source before the camera, or why there is none.
pub type Found = Result<Arc<dyn Radiance>, Cow<'static, str>>;

/// A kind of area source.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Its effect.
    pub effect: EffectId,
    /// Finds its light.
    pub radiance: fn(&World, &View, &Surroundings) -> Found,
    /// Why none of it is on the detector though it was found.
    pub unlit: &'static str,
}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.effect.fmt(f)
    }
}
