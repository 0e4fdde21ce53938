//! The identities of effects, and sets of them.

/// An effect, by its row in `effect::EFFECTS`.
#[allow(missing_docs, reason = "documented in the files of `effect`")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffectId {
    Distortion,
    AberrationDrift,
    Smear,
    RollingShutter,
    Vignetting,
    Stars,
    Rsos,
    ZodiacalLight,
    Starlight,
    Planets,
    Moon,
    Earth,
    Limb,
    Sunlight,
    Moonglow,
    Earthshine,
    PixelResponse,
    FrameTransfer,
    DarkCurrent,
    ShotNoise,
    Radiation,
    FullWell,
    DeadPixels,
    NonLinearity,
    ReadNoise,
    Readout,
    StuckPixels,
}

/// The effects of one frame. The empty set: still images of an ideal camera, without light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectSet {
    /// One bit per effect.
    bits: u32,
    /// Whether random numbers are drawn.
    pub noise: bool,
}

impl EffectSet {
    /// The effects that shape images.
    const SHAPES: EffectSet = EffectSet::between(EffectId::Distortion, EffectId::Vignetting);
    /// The effects that add light.
    pub const LIGHTS: EffectSet = EffectSet::between(EffectId::Stars, EffectId::Earthshine);

    /// The effects from one row to another, both included.
    const fn between(first: EffectId, last: EffectId) -> EffectSet {
        let up_to_last = u32::MAX >> (u32::BITS - 1 - last as u32);
        EffectSet {
            bits: up_to_last & u32::MAX << first as u32,
            noise: false,
        }
    }

    /// Whether it has an effect.
    pub const fn has(&self, effect: EffectId) -> bool {
        self.bits >> effect as u32 & 1 == 1
    }

    /// `value` if it has an effect, else the default.
    pub(crate) fn only_with<T: Default>(&self, effect: EffectId, value: T) -> T {
        if self.has(effect) {
            value
        } else {
            T::default()
        }
    }

    /// With an effect.
    pub const fn with(mut self, effect: EffectId) -> EffectSet {
        self.bits |= 1 << effect as u32;
        self
    }

    /// Without an effect.
    pub const fn without(mut self, effect: EffectId) -> EffectSet {
        self.bits &= !(1 << effect as u32);
        self
    }

    /// With an effect toggled.
    pub(crate) const fn toggled(mut self, effect: EffectId) -> EffectSet {
        self.bits ^= 1 << effect as u32;
        self
    }

    /// Its effects that add light; without noise.
    pub const fn lights(&self) -> EffectSet {
        EffectSet {
            bits: self.bits & EffectSet::LIGHTS.bits,
            noise: false,
        }
    }

    /// With those effects of `other` added that shape images.
    pub(crate) const fn and_shapes(mut self, other: &EffectSet) -> EffectSet {
        self.bits |= other.bits & EffectSet::SHAPES.bits;
        self
    }

    /// Whether images move while the shutter is open.
    pub(crate) const fn moves_images(&self) -> bool {
        self.has(EffectId::Smear) || self.has(EffectId::AberrationDrift)
    }
}
