//! Arithmetic on several objects at a time, written like that on one.
//!
//! Operations whose result depends on operand order or processor are not used: no minimum, maximum
//! or estimate. Only `mul_add` fuses a product and a sum.

use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number of objects in a block.
pub const BLOCK: usize = 8;

/// One number for each object of a block.
pub type Row = [f64; BLOCK];

/// One number for each object in a vector register.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

/// One truth value for each object in a vector register.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Truth<S: Simd> {
    simd: S,
    truth: S::m64s,
}

/// The objects of a block that fit a vector register, and the instructions for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part<S: Simd> {
    simd: S,
    /// Index within the block.
    index: usize,
    /// The object that is loaded into all lanes instead, if any.
    broadcast: Option<usize>,
}

impl<S: Simd> Part<S> {
    /// All parts of a block.
    #[inline(always)]
    pub fn all(simd: S) -> impl Iterator<Item = Part<S>> {
        Part::first(simd, BLOCK)
    }

    /// The parts that hold the first `slots`.
    #[inline(always)]
    pub fn first(simd: S, slots: usize) -> impl Iterator<Item = Part<S>> {
        // The constant end of the range keeps index checks out of the loops.
        let used = move |index: &usize| index * S::F64_LANES < slots;
        let parts = (0..BLOCK / S::F64_LANES).take_while(used);
        parts.map(move |index| Part {
            simd,
            index,
            broadcast: None,
        })
    }

    /// The same part with one object in all lanes.
    #[inline(always)]
    pub fn broadcast(self, object: usize) -> Part<S> {
        Part {
            broadcast: Some(object),
            ..self
        }
    }

    /// This part of a row; the broadcast object's number, if there is one.
    #[inline(always)]
    pub fn load(self, row: &Row) -> Lanes<S> {
        match self.broadcast {
            None => self.each(row),
            Some(object) => self.splat(row[object % BLOCK]),
        }
    }

    /// This part of a row, without broadcast.
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
        // A closure would be compiled without the level's instructions.
        [self.load(a), self.load(b), self.load(c)]
    }

    /// Sets this part of a row.
    #[inline(always)]
    pub fn store(self, row: &mut Row, lanes: Lanes<S>) {
        S::as_mut_simd_f64s(row).0[self.index] = lanes.values;
    }

    /// The same number in all lanes.
    #[inline(always)]
    pub fn splat(self, value: f64) -> Lanes<S> {
        Lanes {
            simd: self.simd,
            values: self.simd.splat_f64s(value),
        }
    }
}

impl<S: Simd> Lanes<S> {
    /// The same number in all lanes.
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

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.values))
    }

    #[inline(always)]
    pub fn squared(self) -> Self {
        self * self
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        let sign = self.simd.splat_f64s(-0.0);
        let is = self.simd.and_f64s(self.values, sign);
        self.with(self.simd.xor_f64s(self.values, is))
    }

    /// The absolute value with the sign of `other`.
    #[inline(always)]
    pub fn with_sign_of(self, other: Self) -> Self {
        let sign = self.simd.splat_f64s(-0.0);
        let sign = self.simd.and_f64s(other.values, sign);
        self.with(self.simd.xor_f64s(self.abs().values, sign))
    }

    /// The nearest integer, ties to even; for values up to 2^51.
    #[inline(always)]
    pub fn round(self) -> Self {
        // Adding 1.5 * 2^52 leaves no fraction bits.
        let magic = self.splat(6_755_399_441_055_744.0);
        (self + magic) - magic
    }

    /// Whether it is below `other`; false for NaN.
    #[inline(always)]
    pub fn less_than(self, other: Self) -> Truth<S> {
        Truth {
            simd: self.simd,
            truth: self.simd.less_than_f64s(self.values, other.values),
        }
    }

    /// Whether it is at least `other`; false for NaN.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Truth<S> {
        other.at_most(self)
    }

    /// Whether it is at most `other`; false for NaN.
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

    #[inline(always)]
    pub fn and(self, other: Self) -> Self {
        Self {
            simd: self.simd,
            truth: self.simd.and_m64s(self.truth, other.truth),
        }
    }

    /// Whether it is true in any lane.
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
