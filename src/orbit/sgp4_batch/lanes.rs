//! Arithmetic on several objects side by side, written like that on one.
//!
//! Operations that depend on the order of operands or on the processor are not used: no minimum,
//! maximum or estimate. A product and a sum are fused in `mul_add` only.

use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Objects of a block.
pub const BLOCK: usize = 8;

/// One number of each object of a block.
pub type Row = [f64; BLOCK];

/// One number of each of the objects that a level works on at a time.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

/// A truth of each of them.
#[derive(Clone, Copy, Debug)]
pub struct Truth<S: Simd> {
    simd: S,
    truth: S::m64s,
}

/// The objects of a block that are worked on at a time: which, and with which instructions.
#[derive(Clone, Copy, Debug)]
pub struct Part<S: Simd> {
    simd: S,
    /// Its number within the block.
    index: usize,
    /// The object that stands in all places instead, if any.
    alone: Option<usize>,
}

impl<S: Simd> Part<S> {
    /// The parts that a block is worked on in.
    #[inline(always)]
    pub fn all(simd: S) -> impl Iterator<Item = Part<S>> {
        Part::first(simd, BLOCK)
    }

    /// As many of them as hold the first `places`.
    #[inline(always)]
    pub fn first(simd: S, places: usize) -> impl Iterator<Item = Part<S>> {
        (0..places.div_ceil(S::F64_LANES)).map(move |index| Part {
            simd,
            index,
            alone: None,
        })
    }

    /// The same places with one object in all of them.
    #[inline(always)]
    pub fn alone(self, object: usize) -> Part<S> {
        Part {
            alone: Some(object),
            ..self
        }
    }

    /// This part of a row; of an object that stands alone, its number.
    #[inline(always)]
    pub fn load(self, row: &Row) -> Lanes<S> {
        match self.alone {
            None => self.each(row),
            Some(object) => self.splat(row[object % BLOCK]),
        }
    }

    /// This part of a row, whoever stands there.
    #[inline(always)]
    pub fn each(self, row: &Row) -> Lanes<S> {
        Lanes {
            simd: self.simd,
            values: S::as_simd_f64s(row).0[self.index],
        }
    }

    /// This part of three rows.
    #[inline(always)]
    pub fn load_three(self, [a, b, c]: &[Row; 3]) -> [Lanes<S>; 3] {
        // No closures here: they are compiled without the level's instructions.
        [self.load(a), self.load(b), self.load(c)]
    }

    /// Sets this part of a row.
    #[inline(always)]
    pub fn store(self, row: &mut Row, lanes: Lanes<S>) {
        S::as_mut_simd_f64s(row).0[self.index] = lanes.values;
    }

    /// The same number for all.
    #[inline(always)]
    pub fn splat(self, value: f64) -> Lanes<S> {
        Lanes {
            simd: self.simd,
            values: self.simd.splat_f64s(value),
        }
    }
}

impl<S: Simd> Lanes<S> {
    /// The same number for all.
    #[inline(always)]
    pub fn splat(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }

    /// `self * factor + term`, rounded once.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, term: Self) -> Self {
        self.with(
            self.simd
                .mul_add_f64s(self.values, factor.values, term.values),
        )
    }

    /// `term - self * factor`, rounded once.
    #[inline(always)]
    pub fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        self.with(
            self.simd
                .negate_mul_add_f64s(self.values, factor.values, term.values),
        )
    }

    /// The square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.values))
    }

    /// The square.
    #[inline(always)]
    pub fn squared(self) -> Self {
        self * self
    }

    /// The size without its sign.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let sign = self.simd.splat_f64s(-0.0);
        let is = self.simd.and_f64s(self.values, sign);
        self.with(self.simd.xor_f64s(self.values, is))
    }

    /// The size of `self` with the sign of `other`.
    #[inline(always)]
    pub fn with_sign_of(self, other: Self) -> Self {
        let sign = self.simd.splat_f64s(-0.0);
        let its = self.simd.and_f64s(other.values, sign);
        self.with(self.simd.xor_f64s(self.abs().values, its))
    }

    /// The nearest whole number, even ones from halves; up to 2^51.
    #[inline(always)]
    pub fn round(self) -> Self {
        // Adding 1.5 * 2^52 leaves no bits behind the point.
        let magic = self.splat(6_755_399_441_055_744.0);
        (self + magic) - magic
    }

    /// Whether it is below `other`; not where one is no number.
    #[inline(always)]
    pub fn less_than(self, other: Self) -> Truth<S> {
        Truth {
            simd: self.simd,
            truth: self.simd.less_than_f64s(self.values, other.values),
        }
    }

    /// Whether it is not below `other`; not where one is no number.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Truth<S> {
        other.at_most(self)
    }

    /// Whether it is not above `other`; not where one is no number.
    #[inline(always)]
    pub fn at_most(self, other: Self) -> Truth<S> {
        Truth {
            simd: self.simd,
            truth: self.simd.less_than_or_equal_f64s(self.values, other.values),
        }
    }

    #[inline(always)]
    fn with(self, values: S::f64s) -> Self {
        Self {
            simd: self.simd,
            values,
        }
    }
}

impl<S: Simd> Truth<S> {
    /// `yes` where it is true, `no` elsewhere.
    #[inline(always)]
    pub fn select(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        yes.with(self.simd.select_f64s(self.truth, yes.values, no.values))
    }

    /// Both.
    #[inline(always)]
    pub fn and(self, other: Self) -> Self {
        Self {
            simd: self.simd,
            truth: self.simd.and_m64s(self.truth, other.truth),
        }
    }

    /// Whether it is true of any.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.simd.first_true_m64s(self.truth) < S::F64_LANES
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f64s(self.values, other.values))
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f64s(self.values, other.values))
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f64s(self.values, other.values))
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(self.simd.div_f64s(self.values, other.values))
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.xor_f64s(self.values, self.simd.splat_f64s(-0.0)))
    }
}

impl<S: Simd> Mul<f64> for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self * self.splat(factor)
    }
}
