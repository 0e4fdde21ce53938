//! Quantile of the normal distribution: one draw from one word.
//!
//! ```text
//! z = x P(w),   x = 2 u - 1,   w = -ln(1 - x^2)
//! ```
//!
//! The form is that of Giles 2010 ("Approximating the erfinv function", GPU Computing Gems, Jade
//! ed., ch. 10): `P` is smooth, a polynomial in `w` up to 7 and in its square root beyond. The
//! coefficients are our own minimax fits to the exact quantile (Lawson's weights, against SciPy's
//! `ndtri`). `z` is within 7.3e-6 of the exact quantile: `src/base/tests/words.rs` tests every
//! word.
//!
//! Products and sums are fused, except where a difference would lose digits, and no function of the
//! platform is called, so the bits are the same everywhere.

/// Position of a word in (0, 1). Its upper bit selects the half, and the others count from that
/// half's end.
#[inline(always)]
pub fn uniform_of(word: u32) -> f64 {
    let beyond = (f64::from(distance_from_end(word) as i32) + 0.5) * (1.0 / 4_294_967_296.0);
    if (word as i32) < 0 {
        1.0 - beyond
    } else {
        beyond
    }
}

/// [`uniform_of`] in single precision, within 1e-7.
#[inline(always)]
pub fn uniform_f32(word: u32) -> f32 {
    let beyond = beyond(word) * (1.0 / ALL);
    if (word as i32) < 0 {
        1.0 - beyond
    } else {
        beyond
    }
}

/// Words nearer than this to either end have `w > 7`: 1 in 2193 (`u (1 - u) = exp(-7) / 4`).
pub const FAR: u32 = 979_349;

/// Number of words between this one and the end of its half.
#[inline(always)]
pub fn distance_from_end(word: u32) -> u32 {
    word & 0x7FFF_FFFF
}

/// Number of all words.
const ALL: f32 = 4_294_967_296.0;

/// `2^62 (1 - x^2)` of a word, from the number of words [`beyond`] it.
#[inline(always)]
pub fn one_minus_x2_scaled(beyond: f32) -> f32 {
    beyond * (ALL - beyond)
}

/// Distance of `w` from the middle of its near range, `3.5 - w`, from [`one_minus_x2_scaled`].
#[inline(always)]
pub fn to_middle(left: f32) -> f32 {
    3.5 + ln_over_62(left)
}

/// `-2^31 |x|`.
#[inline(always)]
fn x_of(beyond: f32) -> f32 {
    beyond - ALL / 2.0
}

/// `ln(y / 2^62)` of a positive normal number, within 9e-6: `ln(2^e m) = e ln 2 + ln m`, 1 <= m <
/// 2.
#[inline(always)]
fn ln_over_62(y: f32) -> f32 {
    let exponent = (y.to_bits() >> 23) as i32 - (127 + 62);
    let m = f32::from_bits(y.to_bits() & 0x007F_FFFF | 0x3F80_0000);
    let m2 = m * m;
    let low = m.mul_add(3.529_296_6, -1.941_062_1);
    let mid = m.mul_add(1.130_618_2, -2.461_210_5);
    let high = m.mul_add(0.031_103_654, -0.288_737_24);
    let poly = m2.mul_add(m2.mul_add(high, mid), low);
    (exponent as f32).mul_add(std::f32::consts::LN_2, poly)
}

/// [`distance_from_end`] of a word that is not far, in single precision.
#[inline(always)]
pub fn beyond(word: u32) -> f32 {
    distance_from_end(word) as i32 as f32
}

/// The draw of a word that is not far, from [`to_middle`].
#[inline(always)]
pub fn near(word: u32, v: f32) -> f32 {
    let v2 = v * v;
    let a = v.mul_add(-1.549_963_8e-10, 1.147_732_6e-9);
    let b = v.mul_add(3.192_419_2e-13, -4.428_122e-12);
    let c = v.mul_add(9.843_525e-15, 1.067_075_3e-13);
    let d = v.mul_add(-1.672_028_5e-16, -6.334_260_6e-16);
    let poly = (v2 * v2).mul_add(v2.mul_add(d, c), v2.mul_add(b, a));
    signed(x_of(beyond(word)) * poly, word)
}

/// The draw of a far word.
#[inline(always)]
pub fn far(word: u32) -> f32 {
    let beyond = beyond(word) + 0.5;
    let (x, v) = (x_of(beyond), to_middle(one_minus_x2_scaled(beyond)));
    let s = (3.5 - v).sqrt() - 3.7;
    let poly = 5.002_178_7
        + s * (1.426_152_8
            + s * (0.003_228_449_5
                + s * (-0.001_780_032_4
                    + s * (0.000_728_922_84 + s * (-0.000_811_014_56 + s * 0.000_461_340_13)))));
    signed(x * (1.0 / 2_147_483_648.0) * poly, word)
}

/// Inverts the sign in the upper half.
#[inline(always)]
fn signed(z: f32, word: u32) -> f32 {
    f32::from_bits(z.to_bits() ^ (word & 0x8000_0000))
}

/// The standard normal draw of a word, from -6.34 to 6.34. It increases with the word's position in
/// (0, 1), except for errors of the last digit, and of up to 8.3e-6 where the polynomials meet.
#[inline(always)]
pub fn normal(word: u32) -> f32 {
    if distance_from_end(word) < FAR {
        far(word)
    } else {
        near(word, to_middle(one_minus_x2_scaled(beyond(word))))
    }
}
