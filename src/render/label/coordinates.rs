//! Directions and vectors in the units of labels.

use crate::attitude::degrees_of_turn;
use nalgebra::Vector3;

/// Right ascension (from 0 to below 360) and declination of a direction, deg.
pub(crate) fn ra_dec_deg(direction: &Vector3<f64>) -> [f64; 2] {
    let dec = libm::atan2(direction.z, libm::hypot(direction.x, direction.y));
    let ra = libm::atan2(direction.y, direction.x);
    [degrees_of_turn(ra), dec.to_degrees()]
}

pub(crate) fn km(v: &Vector3<f64>) -> [f64; 3] {
    (v * 1e-3).into()
}
