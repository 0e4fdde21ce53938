//! Which effects a frame has, as far as images, backgrounds and signal-to-noise ratios depend on them.

/// The effects of one frame. None of them gives still images of an ideal camera, and nothing in them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Simulated {
    /// Images move during the exposure.
    pub smear: bool,
    /// The stars shine.
    pub stars: bool,
    /// The objects in orbit shine.
    pub rsos: bool,
    /// Dark charge is added.
    pub dark: bool,
    /// Charge has shot noise.
    pub shot: bool,
    /// Charge is read with noise.
    pub read: bool,
}
