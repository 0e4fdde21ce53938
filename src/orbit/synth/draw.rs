//! Counter-based random numbers: the draws of an object depend on seed and index alone. By `libm`
//! they are the same on every platform.

use std::f64::consts::TAU;

/// The increment of SplitMix64: 2^64 over the golden ratio, odd.
pub(super) const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// The draws of one object.
pub(super) struct Draw(u64);

impl Draw {
    /// The draws of object `index`.
    pub(super) fn new(seed: u64, index: u64) -> Self {
        Self(mix(seed ^ mix(index)))
    }

    /// Uniform in the open interval (0, 1), 52 bits.
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        ((mix(self.0) >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// Uniform between two values.
    pub(super) fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// An angle, rad.
    pub(super) fn angle(&mut self) -> f64 {
        TAU * self.uniform()
    }

    /// Standard normal, clamped at 2.5 to keep objects in their class. Box and Muller 1958,
    /// `sqrt(-2 ln u) cos(2 pi v)`.
    pub(super) fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(self.uniform()));
        (radius * libm::cos(self.angle())).clamp(-2.5, 2.5)
    }

    /// Log-normal: `median exp(sigma z)`.
    pub(super) fn log_normal(&mut self, (median, sigma): (f64, f64)) -> f64 {
        median * libm::exp(sigma * self.normal())
    }
}

/// The output function of SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
/// generators", OOPSLA).
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
