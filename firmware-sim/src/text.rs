//! Numbers and quaternions from text.

use nalgebra::{Quaternion, UnitQuaternion};
use skyloop_protocols::command::UNIT_TOLERANCE;

/// Numbers from text, with commas or blanks between.
///
/// # Errors
/// Says which item is not a finite number, or how many there are instead of N.
pub fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let items = text.split([' ', ',', '\t']).filter(|item| !item.is_empty());
    let numbers = items
        .map(|item| match item.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("\"{item}\" is no finite number")),
        })
        .collect::<Result<Vec<f64>, String>>()?;
    let count = numbers.len();
    numbers
        .try_into()
        .map_err(|_| format!("{count} numbers where {N} belong"))
}

/// A unit quaternion from `x y z w`, normalised when its norm is within [`UNIT_TOLERANCE`] of 1.
///
/// # Errors
/// Says what is wrong with the numbers or the norm.
pub fn parse_quaternion(text: &str) -> Result<UnitQuaternion<f64>, String> {
    quaternion(parse_numbers::<4>(text)?)
}

/// A unit quaternion from `[x, y, z, w]`, normalised when its norm is within [`UNIT_TOLERANCE`] of 1.
///
/// # Errors
/// Says the norm.
pub fn quaternion([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if (norm - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(UnitQuaternion::from_quaternion(q))
    } else {
        Err(format!(
            "the quaternion's norm is {norm:.6}, not 1 within {UNIT_TOLERANCE}"
        ))
    }
}
