//! Which effects a frame has, as far as images, backgrounds and signal-to-noise ratios depend on them.

/// The effects of one frame. None of them gives still images of an ideal camera, and nothing in them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Simulated {
    /// What is random is drawn.
    pub noise: bool,
    /// The lens departs from its ideal.
    pub distortion: bool,
    /// The observer's velocity changes, and with it the aberration of the stars.
    pub aberration_drift: bool,
    /// Images move during the exposure.
    pub smear: bool,
    /// Rows open and close one after the other.
    pub rolling: bool,
    /// Less light passes off the boresight.
    pub vignetting: bool,
    /// The stars shine.
    pub stars: bool,
    /// The objects in orbit shine.
    pub rsos: bool,
    /// The planets shine.
    pub planets: bool,
    /// The Moon shines.
    pub moon: bool,
    /// The Earth reflects sunlight.
    pub earth: bool,
    /// The Earth's air scatters sunlight and shines.
    pub limb: bool,
    /// The optics scatter sunlight over the field.
    pub sunlight: bool,
    /// The optics scatter the Moon's light.
    pub moonglow: bool,
    /// The optics scatter the Earth's light.
    pub earthshine: bool,
    /// Dust between the planets scatters sunlight.
    pub zodiacal: bool,
    /// Stars shine that are too faint for the catalogue.
    pub starlight: bool,
    /// Pixels respond as their pattern says.
    pub response: bool,
    /// Charge is shifted through light when it is read out.
    pub frame_transfer: bool,
    /// Dark charge is added.
    pub dark: bool,
    /// Charge has shot noise.
    pub shot: bool,
    /// Particles cross the detector.
    pub radiation: bool,
    /// Pixels fill up.
    pub full_well: bool,
    /// Dead pixels give no charge.
    pub dead: bool,
    /// The response bends.
    pub nonlinearity: bool,
    /// Stuck pixels give their digit.
    pub stuck: bool,
    /// Charge is read with noise.
    pub read: bool,
}

impl Simulated {
    /// Those alone that are light.
    pub fn lights(&self) -> Simulated {
        Simulated {
            stars: self.stars,
            rsos: self.rsos,
            planets: self.planets,
            moon: self.moon,
            earth: self.earth,
            limb: self.limb,
            sunlight: self.sunlight,
            moonglow: self.moonglow,
            earthshine: self.earthshine,
            zodiacal: self.zodiacal,
            starlight: self.starlight,
            ..Simulated::default()
        }
    }

    /// With those of the other's effects that shape images.
    pub fn and_shapes(&self, other: &Simulated) -> Simulated {
        Simulated {
            distortion: self.distortion || other.distortion,
            aberration_drift: self.aberration_drift || other.aberration_drift,
            smear: self.smear || other.smear,
            rolling: self.rolling || other.rolling,
            vignetting: self.vignetting || other.vignetting,
            ..*self
        }
    }
}
