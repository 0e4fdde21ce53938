//! Numbers brought into the range that they are meant for, where a caller of the library may give
//! any.

use std::ops::RangeInclusive;

/// The number of `range` that is nearest to `value`; the least where that is no number, which a
/// clamp would let pass.
#[inline]
pub fn nearest(value: f64, range: RangeInclusive<f64>) -> f64 {
    let (least, most) = range.into_inner();
    value.max(least).min(most)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn what_is_no_number_is_the_least() {
        let given = [f64::NAN, f64::NEG_INFINITY, 0.3, f64::INFINITY];
        assert_eq!(given.map(|x| nearest(x, 0.1..=2.0)), [0.1, 0.1, 0.3, 2.0]);
    }
}
