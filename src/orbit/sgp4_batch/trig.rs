//! Sine, cosine and the angle of a vector, on lanes.
//!
//! Absolute errors, tested against 60 digits: sine and cosine at most 1.5e-16 (1.4 units in the
//! last place near 1) for arguments up to 1e7 rad, three centuries of the fastest orbit; the angle
//! of a vector at most 5e-16 rad.

use super::lanes::Lanes;
use pulp::Simd;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, TAU};

/// pi/2 - `FRAC_PI_2`.
const FRAC_PI_2_REST: f64 = 6.123_233_995_736_766e-17;

/// Coefficients of sin x = x + x^3 (S[0] + S[1] x^2 + ...) for |x| <= pi/4, within 2^-58 (fdlibm,
/// k_sin.c, 1993).
const S: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

/// Coefficients of cos x = 1 - x^2/2 + x^4 (C[0] + C[1] x^2 + ...) for |x| <= pi/4, within 2^-58
/// (fdlibm, k_cos.c, 1993).
const C: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

impl<S_: Simd> Lanes<S_> {
    /// Sine and cosine of an angle of up to 1e7 rad.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        // x = k pi/2 + r, |r| <= pi/4. The first product and difference are exact (Cody and Waite
        // 1980, with fused products).
        let k = (self * FRAC_2_PI).round();
        let r = k.neg_mul_add(self.splat(FRAC_PI_2), self);
        let r = k.neg_mul_add(self.splat(FRAC_PI_2_REST), r);
        let (sin, cos) = r.sin_cos_of_small();

        // k modulo 4 is -2, -1, 0, 1 or 2.
        let quarter = (k * 0.25).round().neg_mul_add(self.splat(4.0), k);
        let odd = quarter.squared();
        let (half, one_and_half) = (self.splat(0.5), self.splat(1.5));
        let odd = half.less_than(odd).and(odd.less_than(one_and_half));
        // sin: -cos r, +-(-sin r), sin r, cos r; cos: sin r, -cos r, cos r, -sin r
        let (first, second) = (odd.select(cos, sin), odd.select(sin, cos));
        let sin_up = (-half).less_than(quarter).select(first, -first);
        let sin = quarter.less_than(one_and_half).select(sin_up, -first);
        let cos_up = quarter.less_than(half).select(second, -second);
        let cos = (-one_and_half).less_than(quarter).select(cos_up, -second);
        (sin, cos)
    }

    /// Sine and cosine of an angle of at most pi/4 in size, rad.
    #[inline(always)]
    pub fn sin_cos_of_small(self) -> (Self, Self) {
        let x2 = self.squared();
        let x4 = x2.squared();
        // Estrin's scheme shortens the dependent chain.
        let pair = |a: f64, b: f64| x2.mul_add(self.splat(b), self.splat(a));
        let sine = x4.mul_add(
            x4.mul_add(pair(S[4], S[5]), pair(S[2], S[3])),
            pair(S[0], S[1]),
        );
        let cosine = x4.mul_add(
            x4.mul_add(pair(C[4], C[5]), pair(C[2], C[3])),
            pair(C[0], C[1]),
        );
        let sin = (x2 * self).mul_add(sine, self);
        let cos = self.splat(1.0) - x2.mul_add(self.splat(0.5), -(x4 * cosine));
        (sin, cos)
    }

    /// [`Lanes::sin_cos`], faster where all angles are at most pi/4 in size.
    #[inline(always)]
    pub fn sin_cos_often_small(self) -> (Self, Self) {
        let small = self.sin_cos_of_small();
        let large = self.splat(FRAC_PI_4).less_than(self.abs());
        if !large.any() {
            return small;
        }
        let any = self.sin_cos();
        (large.select(any.0, small.0), large.select(any.1, small.1))
    }

    /// The angle modulo 2 pi, in -pi to pi, rad. The divisor is the double nearest to 2 pi, as in
    /// the scalar model.
    #[inline(always)]
    pub fn within_a_turn(self) -> Self {
        let turns = (self * (1.0 / TAU)).round();
        turns.neg_mul_add(self.splat(TAU), self)
    }

    /// The angle modulo 2 pi with its own sign, as the remainder of a division.
    #[inline(always)]
    pub fn remainder_of_turns(self) -> Self {
        let within = self.within_a_turn();
        let zero = self.splat(0.0);
        let turn = self.splat(TAU).with_sign_of(self);
        // Correct the sign.
        (within * turn)
            .less_than(zero)
            .select(within + turn, within)
    }

    /// The angle of the vector (`x`, `self`) from the x axis, -pi to pi, rad; 0 for a zero vector.
    #[inline(always)]
    pub fn angle_above(self, x: Self) -> Self {
        let (zero, one) = (self.splat(0.0), self.splat(1.0));
        let length = self.mul_add(self, x.squared()).sqrt();
        let steep = x.abs().less_than(self.abs());
        let (long, short) = (
            steep.select(self.abs(), x.abs()),
            steep.select(x.abs(), self.abs()),
        );
        let slope = zero.less_than(long).select(short / long, zero);
        // atan t = t (pi/4 + 0.273 (1 - t)), within 0.004.
        let small = slope * (one - slope).mul_add(self.splat(0.273), self.splat(FRAC_PI_4));
        let up = steep.select(self.splat(FRAC_PI_2) - small, small);
        let guess = x.less_than(zero).select(self.splat(TAU * 0.5) - up, up);
        let guess = guess.with_sign_of(self);
        // sin(angle - guess) = (y cos guess - x sin guess) / length
        let (sin, cos) = guess.sin_cos();
        let s = (self * cos - x * sin) / length;
        let s2 = s.squared();
        // asin s = s + s^3/6 + 3 s^5/40 + 5 s^7/112
        let series = s2.mul_add(
            s2.mul_add(self.splat(5.0 / 112.0), self.splat(3.0 / 40.0)),
            self.splat(1.0 / 6.0),
        );
        let rest = (s2 * s).mul_add(series, s);
        zero.less_than(length).select(guess + rest, zero)
    }
}

#[cfg(test)]
mod tests {
    use crate::sgp4_batch::lanes::{BLOCK, Lanes, Part, Row};
    use crate::sgp4_batch::level::Level;
    use pulp::{Simd, WithSimd};
    use std::f64::consts::TAU;

    /// For (x, y): sine and cosine of x, the angle of (y, x), and both remainders of x.
    type Angles = [f64; 5];

    struct Work(Row, Row);

    impl WithSimd for Work {
        type Output = [Row; 5];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> [Row; 5] {
            let mut rows = [[0.0; BLOCK]; 5];
            for part in Part::all(simd) {
                let (x, y): (Lanes<S>, Lanes<S>) = (part.load(&self.0), part.load(&self.1));
                let (sin, cos) = x.sin_cos();
                let (within, remainder) = (x.within_a_turn(), x.remainder_of_turns());
                let all = [sin, cos, x.angle_above(y), within, remainder];
                for (row, lanes) in rows.iter_mut().zip(all) {
                    part.store(row, lanes);
                }
            }
            rows
        }
    }

    /// Checks that all levels of this processor give the same bits, except the sign of NaN.
    fn angles(x: f64, y: f64) -> Angles {
        // Other values in the other lanes.
        let row = |value: f64| std::array::from_fn(|i| value * (1.0 + i as f64));
        let work = |level: Level| level.run(Work(row(x), row(y))).map(|row| row[0]);
        let first = work(Level::Portable);
        for level in Level::available() {
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            let found = work(level);
            let all = found.into_iter().zip(first).all(|(a, b)| same(a, b));
            assert!(all, "{level}: {x:e}, {y:e}: {found:?}, {first:?}");
        }
        first
    }

    fn numbers(row: &str) -> Vec<f64> {
        row.split(' ').map(|word| word.parse().unwrap()).collect()
    }

    /// Rows of a kind. X-Val: 60 digits of mpmath, by `data/make_batch_references.py`: each value
    /// as a double and its remainder.
    fn reference(kind: &'static str) -> impl Iterator<Item = Vec<f64>> {
        let text = include_str!("../tests/data/angles.txt");
        text.lines()
            .filter_map(move |line| Some(numbers(line.strip_prefix(kind)?)))
    }

    #[test]
    fn sines_and_cosines_are_within_the_bound() {
        let (mut worst, mut worst_share, mut rows) = (0.0_f64, 0.0_f64, 0);
        for row in reference("sin ") {
            for sign in [1.0, -1.0] {
                let [sin, cos, ..] = angles(sign * row[0], 1.0);
                for (found, exact, rest) in [(sign * sin, row[1], row[2]), (cos, row[3], row[4])] {
                    let error = ((found - exact) - rest).abs();
                    assert!(error <= 1.5e-16, "{:e}: {error:e}", row[0]);
                    worst = worst.max(error);
                    worst_share = worst_share.max(error / exact.abs().max(f64::MIN_POSITIVE));
                }
                rows += 1;
            }
        }
        println!("{rows} hard arguments: at most {worst:.2e}, {worst_share:.1e} of the value");
        assert!(rows > 1500);
    }

    #[test]
    fn sines_and_cosines_have_no_gaps() {
        let mut worst = 0.0_f64;
        for i in 0..400_000 {
            // Multiples of the golden ratio cover the range evenly.
            let x = (f64::from(i) * 0.618_033_988_749_894_9).fract() * 2e7 - 1e7;
            let [sin, cos, ..] = Level::best()
                .run(Work([x; BLOCK], [1.0; BLOCK]))
                .map(|row| row[3]);
            worst = worst.max((sin - x.sin()).abs()).max((cos - x.cos()).abs());
        }
        println!("against the system's: {worst:.2e}");
        // The bound, and 0.55 units in the last place for the system's library.
        assert!(worst <= 1.5e-16 + 0.62e-16);
    }

    #[test]
    fn zeros_of_both_signs_have_a_sine_and_nan_has_none() {
        for zero in [0.0, -0.0] {
            assert_eq!(angles(zero, 1.0)[..2], [0.0, 1.0]);
        }
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(
                angles(x, 1.0)[0].is_nan() && angles(x, 1.0)[1].is_nan(),
                "{x}"
            );
        }
    }

    #[test]
    fn angles_of_vectors_are_within_the_bound() {
        let (mut worst, mut rows) = (0.0_f64, 0);
        for row in reference("angle ") {
            let found = angles(row[0], row[1])[2];
            // Both ends of the half turn are the same direction.
            let error = ((found - row[2]) - row[3]).abs();
            let error = error.min((error - TAU).abs());
            assert!(
                error <= 5e-16,
                "{:e}, {:e}: {found:e}, {error:e}",
                row[0],
                row[1]
            );
            worst = worst.max(error);
            rows += 1;
        }
        println!("{rows} vectors: at most {worst:.2e} rad");
        assert!(rows > 400);
    }

    #[test]
    fn remainders_are_those_of_a_division() {
        for row in reference("sin ") {
            for x in [row[0], -row[0]] {
                let [.., within, remainder] = angles(x, 1.0);
                let exact = x % TAU;
                // A last digit of 2 pi; near a whole turn either end of it.
                let apart = |a: f64| ((a - exact).abs() % TAU).min(TAU - (a - exact).abs() % TAU);
                assert!(apart(within) <= 1e-15 && apart(remainder) <= 1e-15, "{x:e}");
                assert!(
                    within.abs() <= TAU * 0.500_000_1 && remainder.abs() <= TAU,
                    "{x:e}"
                );
                assert!(
                    remainder * x >= 0.0 || remainder.abs() < 1e-15,
                    "{x:e}: {remainder:e}"
                );
            }
        }
    }
}
