//! The Earth at one time, and axes to place objects around it.

use std::str::FromStr;

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::sky::shadow::Earth;

pub fn earth() -> Earth {
    Earth::at(Epoch::from_str("2019-06-15T23:35:50 UTC").unwrap())
}

/// Two vectors in the equator plane and the pole: GCRF, unit vectors.
pub fn axes() -> [Vector3<f64>; 3] {
    let pole = earth().pole();
    let x = pole.cross(&Vector3::y()).normalize();
    [x, pole.cross(&x), pole]
}
