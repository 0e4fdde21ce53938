//! Numbers of labels: with no more digits than they are exact to.

use serde::{Serialize, Serializer};

/// Rounds to a number of decimals that lies well below any error of the value, for shorter lines.
#[inline]
fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    let scaled = value * scale;
    // Beyond 2^53 there are no decimals to drop.
    if scaled.abs() < 9e15 {
        // By way of an integer: no call, and no negative zero.
        (scaled + 0.5f64.copysign(scaled)) as i64 as f64 / scale
    } else {
        value
    }
}

pub(super) fn e4<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(rounded(*value, 4))
}

pub(super) fn e6<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(rounded(*value, 6))
}

pub(super) fn e9<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(rounded(*value, 9))
}

/// Degrees of a turn: what is rounded to a whole one is none.
pub(super) fn turn_e9<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    let degrees = rounded(*value, 9);
    to.serialize_f64(if degrees < 360.0 { degrees } else { 0.0 })
}

/// Four digits: bounds and prices are no more exact.
fn four_digits(value: f64) -> f64 {
    let decimals = 3 - libm::log10(value.abs().max(1e-12)).floor() as i32;
    rounded(value, decimals)
}

/// A bound stays one.
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
