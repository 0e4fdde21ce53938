//! Numbers of labels, rounded to their accuracy.

use serde::{Serialize, Serializer};

/// Rounds to a number of decimals well below any error of the value, for shorter lines.
#[inline]
pub(super) fn rounded(value: f64, decimals: i32) -> f64 {
    match scaled(value, decimals) {
        // Through an integer: this avoids a call and a negative zero.
        Some(units) => units as f64 / 10f64.powi(decimals),
        None => value,
    }
}

/// The value in units of the last decimal; none if the value has no decimals to drop.
#[inline]
pub(super) fn scaled(value: f64, decimals: i32) -> Option<i64> {
    let scaled = value * 10f64.powi(decimals);
    // From 2^53 on doubles have no decimals.
    (scaled.abs() < 9e15).then(|| (scaled + 0.5f64.copysign(scaled)) as i64)
}

pub(super) fn e4<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(rounded(*value, 4))
}

pub(super) fn e6<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(rounded(*value, 6))
}

/// Rounds to four digits: bounds and estimated times are no more accurate.
fn four_digits(value: f64) -> f64 {
    let decimals = 3 - libm::log10(value.abs().max(1e-12)).floor() as i32;
    rounded(value, decimals)
}

/// Rounds upwards, so that a bound remains one.
pub(super) fn some_bound<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    let up = |value: f64| {
        let near = four_digits(value);
        if near < value {
            four_digits(value * (1.0 + 1e-3 / 2.0))
        } else {
            near
        }
    };
    value.map(up).serialize(to)
}

pub(super) fn some_short<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    value.map(four_digits).serialize(to)
}

pub(super) fn some_e4<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) => e4(value, to),
        None => to.serialize_none(),
    }
}
