//! Parses numbers and quaternions.

use nalgebra::{Quaternion, UnitQuaternion};
use skyloop_protocols::command::UNIT_TOLERANCE;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Parses N numbers separated by commas or blanks.
///
/// # Errors
/// Names the item that is no finite number, or the number of items.
pub fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let items = text.split([' ', ',', '\t']).filter(|item| !item.is_empty());
    let numbers = items.map(|item| match item.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("\"{item}\" is no finite number")),
    });
    let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
    let numbers = <[f64; N]>::try_from(numbers);
    numbers.map_err(|numbers| format!("{} numbers where {N} belong", numbers.len()))
}

/// Parser of command-line options: a whole number within a range.
pub fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone,
{
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        let (min, max) = (range.start(), range.end());
        number.ok_or_else(|| format!("a whole number from {min} to {max} is wanted"))
    }
}

/// Parser of command-line options: a number within a range.
pub fn decimal(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        let (min, max) = (range.start(), range.end());
        number.ok_or_else(|| format!("a number from {min} to {max} is wanted"))
    }
}

/// Parser of command-line options: a number of `unit` within a range.
pub fn within(
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match text.trim().parse() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!(
            "it must be {} to {} {unit}",
            range.start(),
            range.end()
        )),
    }
}

/// Parser of command-line options: a finite number.
pub fn number(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| "a number is wanted".to_string())
}

/// Parses a unit quaternion `x y z w`, normalized if its norm is within [`UNIT_TOLERANCE`] of 1.
///
/// # Errors
/// Describes the wrong number or norm.
pub fn parse_quaternion(text: &str) -> Result<UnitQuaternion<f64>, String> {
    quaternion(parse_numbers::<4>(text)?)
}

/// A unit quaternion from `[x, y, z, w]`, normalized if its norm is within [`UNIT_TOLERANCE`] of 1.
pub fn quaternion([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if (norm - 1.0).abs() <= UNIT_TOLERANCE {
        return Ok(UnitQuaternion::from_quaternion(q));
    }
    Err(format!(
        "the quaternion's norm is {norm:.6}, not 1 within {UNIT_TOLERANCE}"
    ))
}
