//! Which effects a frame has, as far as images, backgrounds and signal-to-noise ratios depend on them.

/// An effect, by its row in `effect::EFFECTS`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffectId {
    /// The lens departs from its ideal.
    Distortion,
    /// The observer's velocity changes, and with it the aberration of the stars.
    AberrationDrift,
    /// Images move during the exposure.
    Smear,
    /// Rows open and close one after the other.
    RollingShutter,
    /// Less light passes off the boresight.
    Vignetting,
    /// The stars shine.
    Stars,
    /// The objects in orbit shine.
    Rsos,
    /// Dust between the planets scatters sunlight.
    ZodiacalLight,
    /// Stars shine that are too faint for the catalogue.
    Starlight,
    /// The planets shine.
    Planets,
    /// The Moon shines.
    Moon,
    /// The Earth reflects sunlight.
    Earth,
    /// The Earth's air scatters sunlight and shines.
    Limb,
    /// The optics scatter sunlight over the field.
    Sunlight,
    /// The optics scatter the Moon's light.
    Moonglow,
    /// The optics scatter the Earth's light.
    Earthshine,
    /// Pixels respond as their pattern says.
    PixelResponse,
    /// Charge is shifted through light when it is read out.
    FrameTransfer,
    /// Dark charge is added.
    DarkCurrent,
    /// Charge has shot noise.
    ShotNoise,
    /// Particles cross the detector.
    Radiation,
    /// Pixels fill up.
    FullWell,
    /// Dead pixels give no charge.
    DeadPixels,
    /// The response bends.
    NonLinearity,
    /// Charge is read with noise.
    ReadNoise,
    /// Electrons become digits.
    Readout,
    /// Stuck pixels give their digit.
    StuckPixels,
}

/// The effects of one frame. None of them gives still images of an ideal camera, and nothing in them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectSet {
    /// A bit an effect.
    bits: u32,
    /// What is random is drawn.
    pub noise: bool,
}

impl EffectSet {
    /// Those that shape images.
    const SHAPES: EffectSet = EffectSet::between(EffectId::Distortion, EffectId::Vignetting);
    /// Those that are light.
    pub const LIGHTS: EffectSet = EffectSet::between(EffectId::Stars, EffectId::Earthshine);

    /// The effects from one row to another, both included.
    const fn between(first: EffectId, last: EffectId) -> EffectSet {
        let up_to_last = u32::MAX >> (u32::BITS - 1 - last as u32);
        EffectSet {
            bits: up_to_last & u32::MAX << first as u32,
            noise: false,
        }
    }

    /// Whether an effect is among them.
    pub const fn has(&self, effect: EffectId) -> bool {
        self.bits >> effect as u32 & 1 == 1
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

    /// Without an effect that it has, with one that it has not.
    pub const fn toggled(mut self, effect: EffectId) -> EffectSet {
        self.bits ^= 1 << effect as u32;
        self
    }

    /// Those alone that are light; noise is not drawn.
    pub const fn lights(&self) -> EffectSet {
        EffectSet {
            bits: self.bits & EffectSet::LIGHTS.bits,
            noise: false,
        }
    }

    /// With those of the other's effects that shape images.
    pub const fn and_shapes(mut self, other: &EffectSet) -> EffectSet {
        self.bits |= other.bits & EffectSet::SHAPES.bits;
        self
    }

    /// Whether images move while the shutter is open.
    pub const fn moves_images(&self) -> bool {
        self.has(EffectId::Smear) || self.has(EffectId::AberrationDrift)
    }
}
