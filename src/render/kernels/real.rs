//! Numbers of kernels, in single or double precision.

use std::ops::{Add, Mul, Neg, Sub};

/// A number in single or in double precision.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Neg<Output = Self>
    + Mul<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
{
    /// Rounded from double precision.
    fn of(x: f64) -> Self;
    /// In single precision.
    fn single(self) -> f32;
    /// `self a + b`, rounded once.
    fn fused(self, a: Self, b: Self) -> Self;
    /// The nearest integer, for magnitudes below 2^22. It is in the last bits of a sum with 1.5
    /// times a large power of two, without the calls and branches of `round` and `as`.
    fn nearest(self) -> (i32, Self);
}

impl Real for f32 {
    #[inline(always)]
    fn of(x: f64) -> f32 {
        x as f32
    }

    #[inline(always)]
    fn single(self) -> f32 {
        self
    }

    #[inline(always)]
    fn fused(self, a: f32, b: f32) -> f32 {
        self.mul_add(a, b)
    }

    #[inline(always)]
    fn nearest(self) -> (i32, f32) {
        const WHOLE: f32 = 12_582_912.0;
        let sum = self + WHOLE;
        let last = (sum.to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32);
        (last, sum - WHOLE)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn single(self) -> f32 {
        self as f32
    }

    #[inline(always)]
    fn fused(self, a: f64, b: f64) -> f64 {
        self.mul_add(a, b)
    }

    #[inline(always)]
    fn nearest(self) -> (i32, f64) {
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let sum = self + WHOLE;
        (sum.to_bits() as i32, sum - WHOLE)
    }
}
