//! Clamps numbers from callers of the library into their valid range.

use std::ops::RangeInclusive;

/// The number of `range` nearest to `value`; the minimum for NaN, which `clamp` would return.
#[inline]
pub fn nearest(value: f64, range: RangeInclusive<f64>) -> f64 {
    let (min, max) = range.into_inner();
    value.max(min).min(max)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn nan_gives_the_minimum() {
        let given = [f64::NAN, f64::NEG_INFINITY, 0.3, f64::INFINITY];
        assert_eq!(given.map(|x| nearest(x, 0.1..=2.0)), [0.1, 0.1, 0.3, 2.0]);
    }
}
