//! Poisson distribution: one draw from one mean and one word. It increases with both, except for
//! rounding.
//!
//! Below a mean of 16 the draw is exact, except for the word's 32 bits: a sequential search of the
//! cumulative distribution (Devroye 1986, Non-Uniform Random Variate Generation, X.3.3). From a
//! [`Switch`] on it is the expansion of Giles 2016 (ACM TOMS 42, 7: "Algorithm 955: approximation
//! of the inverse Poisson cumulative distribution function"), a Cornish-Fisher expansion on the
//! integers:
//!
//! ```text
//! k = floor(m + sqrt(m) z + 1/3 + z^2/6
//!           - (z/36 + z^3/72) / sqrt(m) + (-8/405 + 7 z^2/810 + z^4/270) / m)
//! ```
//!
//! Tests compute its total-variation distance from Poisson by counting the draws of all words. For
//! means from 30 to 2^20 it is 1e-5 to 5e-5, the error of the normal draw and of single precision.
//! Beyond, single precision dominates: 1e-4 at 5 million, 2e-4 at 2^24. From there draws are
//! multiples of 2 e-, 4 e- and so on, as are a frame's electrons. Between 16 and the switch the
//! search begins 9 sigma below the mean.

use super::normal::{normal, uniform_of};

/// For means below this (e-) the search begins at 0.
pub const SEARCHED: f32 = 16.0;
/// Means from this on (e-) always use the expansion: their draws have no more digits than single
/// precision.
const WHOLE: f32 = 1_048_576.0;

/// The mean (e-) from which on draws use the expansion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch(pub f32);

impl Switch {
    /// Switches, and upper bounds of the total-variation distance from Poisson (1).
    const KNOWN: [(f32, f64); 4] = [(WHOLE, 1e-6), (SEARCHED, 6e-5), (12.0, 1e-4), (6.0, 5e-4)];

    /// The smallest switch whose draws are within `variation` (1) of Poisson up to 2^20 e- (for
    /// 1e-4, 5 million e-). Beyond, single precision is the limit. The best switch has exact draws,
    /// except for the word's 32 bits (1e-6 over thousands of draws).
    pub fn within(variation: f64) -> Switch {
        let known = Self::KNOWN.iter().rev();
        let mut within = known.filter(|(_, of)| *of <= variation);
        Switch(within.next().map_or(WHOLE, |(mean, _)| *mean))
    }
}

/// Largest mean (e-), within the single precision of a frame's electrons.
const LARGEST: f32 = 1e30;

/// Smallest mean for the expansion.
const MIN: f32 = 6.0;

/// A valid mean: 0 for negative numbers and NaN.
#[inline(always)]
pub fn mean_of(e: f32) -> f32 {
    let e = if e > 0.0 { e } else { 0.0 };
    if e < LARGEST { e } else { LARGEST }
}

/// The draw for a mean from 6 e- on, from its [`inverse_root`] and the normal draw `z`.
#[inline(always)]
pub fn expansion(mean: f32, inverse: f32, z: f32) -> f32 {
    let mean = if mean > MIN { mean } else { MIN };
    let z2 = z * z;
    let third = z2.mul_add(z2.mul_add(1.0 / 270.0, 7.0 / 810.0), -8.0 / 405.0);
    let second = inverse.mul_add(third, z * z2.mul_add(-1.0 / 72.0, -1.0 / 36.0));
    let first = inverse.mul_add(second, z2.mul_add(1.0 / 6.0, 1.0 / 3.0));
    let k = (mean + (mean * inverse).mul_add(z, first)).floor();
    if k > 0.0 { k } else { 0.0 }
}

/// The draw for a mean from the switch on, from the normal draw `z`.
#[inline(always)]
pub fn expanded(mean: f32, z: f32) -> f32 {
    expansion(mean, inverse_root(mean), z)
}

/// `1 / sqrt(x)` of a normal number, within 5e-6: a first guess with half the exponent, and
/// Newton's method. (Divisions and roots would take as long as the rest of the draw.)
#[inline(always)]
pub fn inverse_root(x: f32) -> f32 {
    let x = if x > MIN { x } else { MIN };
    let mut y = f32::from_bits(0x5F37_5A86 - (x.to_bits() >> 1));
    for _ in 0..2 {
        y *= (-0.5 * x * y).mul_add(y, 1.5);
    }
    y
}

/// `exp(-mean)` for means below 16, within 1e-14: `2^n exp(r)`, `|r| <= ln(2) / 2`, and the
/// exponential series.
#[inline(always)]
pub fn exp_minus(mean: f64) -> f64 {
    // A number added to 1.5 * 2^52 is rounded, and its last bits are the integer.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // Two parts, the first with 32 bits.
    const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
    let rounded = ROUND - mean * std::f64::consts::LOG2_E;
    let n = rounded - ROUND;
    let r = (-mean - n * LN_2[0]) - n * LN_2[1];
    let mut series = INVERSE_FACTORIAL[11];
    let mut k = 11;
    while k > 0 {
        k -= 1;
        series = INVERSE_FACTORIAL[k] + r * series;
    }
    f64::from_bits(series.to_bits().wrapping_add(rounded.to_bits() << 52))
}

/// [`exp_minus`] in single precision, within 5e-7 (relative).
#[inline(always)]
pub fn exp_minus_f32(mean: f32) -> f32 {
    // A number added to 1.5 * 2^23 is rounded, and its last bits are the integer.
    const ROUND: f32 = 12_582_912.0;
    // Two parts, the first with 10 bits.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    let rounded = ROUND - mean * std::f32::consts::LOG2_E;
    let n = rounded - ROUND;
    let r = (-mean - n * LN_2[0]) - n * LN_2[1];
    let mut series = INVERSE_FACTORIAL[6] as f32;
    let mut k = 6;
    while k > 0 {
        k -= 1;
        series = INVERSE_FACTORIAL[k] as f32 + r * series;
    }
    f32::from_bits(series.to_bits().wrapping_add(rounded.to_bits() << 23))
}

/// `1 / k`.
pub const INVERSE: [f64; MAX] = {
    let mut inverse = [0.0; MAX];
    let mut k = 1;
    while k < MAX {
        inverse[k] = 1.0 / k as f64;
        k += 1;
    }
    inverse
};

/// `1 / (k + 1)` in single precision.
pub const INVERSE_OF_NEXT: [f32; MAX] = {
    let mut inverse = [0.0; MAX];
    let mut k = 0;
    while k < MAX {
        inverse[k] = 1.0 / (k + 1) as f32;
        k += 1;
    }
    inverse
};

/// `1 / k!`.
const INVERSE_FACTORIAL: [f64; 12] = {
    let mut inverse = [1.0; 12];
    let mut k = 1;
    while k < 12 {
        inverse[k] = inverse[k - 1] / k as f64;
        k += 1;
    }
    inverse
};

/// Error bound of a search in single precision (1). A word farther than this from every step of the
/// cumulative distribution has the draw of an exact search.
///
/// The relative error of a step's probability is 5e-7, plus three roundings for each of k steps: 3
/// m 2^-24 in total below a mean of m. Each sum of numbers below 1 adds half as much. For 40 steps
/// at a mean of 16 the total is 5e-6, and the position of a word adds 1e-7.
pub const UNSURE: f32 = 1e-5;

/// Above any draw for a mean below 16: the last word's quantile is 50.
const MAX: usize = 64;

/// The draw of a word for a mean (e-); 0 for a mean that is not positive.
#[inline(always)]
pub fn poisson(mean: f32, word: u32, switch: Switch) -> f32 {
    let mean = mean_of(mean);
    if mean >= switch.0 {
        return expanded(mean, normal(word));
    }
    if mean >= SEARCHED {
        return from_below(mean, word);
    }
    let (u, mean) = (uniform_of(word), f64::from(mean));
    let mut probability = exp_minus(mean);
    let mut cumulative = probability;
    let mut k = 0;
    while u >= cumulative && k + 1 < MAX {
        k += 1;
        probability *= mean * INVERSE[k];
        cumulative += probability;
    }
    k as f32
}

/// The draw by a search that starts where the probability below is less than 10^-19.
pub fn from_below(mean: f32, word: u32) -> f32 {
    let (u, mean) = (uniform_of(word), f64::from(mean));
    let reach = 9.0 * libm::sqrt(mean);
    let mut k = libm::floor(mean - reach).max(0.0);
    let last = mean + reach + 20.0;
    // P(k) = exp(k ln m - m - ln k!)
    let mut probability = libm::exp(k * libm::log(mean) - mean - libm::lgamma(k + 1.0));
    let mut cumulative = probability;
    while u >= cumulative && k < last {
        k += 1.0;
        probability *= mean / k;
        cumulative += probability;
    }
    k as f32
}
