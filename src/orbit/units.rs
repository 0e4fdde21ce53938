//! Units of element sets in files, and text that restores numbers exactly.

use std::f64::consts::PI;

/// Radians in a degree.
pub(crate) const DEGREE: f64 = PI / 180.0;
/// Radians a minute in a revolution a day.
pub(crate) const REV_PER_DAY: f64 = PI / 720.0;

/// `value` in units of `unit`, with the fewest of 15 to 17 digits that restore it. A few values
/// have no such text and are restored with an error of one unit in the last place.
pub(crate) fn decimal(value: f64, unit: f64) -> String {
    let quotient = value / unit;
    let rounded = [14, 15, 16].map(|digits| format!("{quotient:.digits$e}").parse());
    let near = [quotient.next_down(), quotient.next_up()];
    let tried = rounded.into_iter().flatten().chain(near);
    let exact = tried.into_iter().find(|x: &f64| x * unit == value);
    plain(exact.unwrap_or(quotient))
}

/// The shortest text of a number; small numbers have a power of ten.
pub(crate) fn plain(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-4 {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_decimal_is_restored_as_written() {
        for text in [
            "51.6416",
            "0.0001",
            "359.9999",
            "15.49815328",
            "247.4627",
            "0",
        ] {
            let value: f64 = text.parse().unwrap();
            for unit in [DEGREE, REV_PER_DAY] {
                assert_eq!(decimal(value * unit, unit), text);
            }
        }
        assert_eq!(plain(2.8098e-5), "2.8098e-5");
        assert_eq!(plain(-0.0), "-0");
    }

    proptest! {
        #[test]
        fn any_value_is_restored_to_its_last_place(value in -7.0..7.0) {
            let read: f64 = decimal(value, DEGREE).parse().unwrap();
            prop_assert!((read * DEGREE - value).abs() <= value.abs() * f64::EPSILON);
        }
    }
}
