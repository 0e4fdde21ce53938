//! Objects with states as a function of time.
#![allow(dead_code, reason = "each test program uses its own part of this")]

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::orbit::Object;

/// Gravitational parameter of the Earth, km^3/s^2 (WGS84).
const GM: f64 = 398_600.441_8;

/// An OEM of 21 s around `mid`; `state` gives km and km/s at a time (s) after `mid`.
pub fn oem(
    id: &str,
    mid: Epoch,
    state: impl Fn(f64) -> (Vector3<f64>, Vector3<f64>),
) -> Vec<Object> {
    let text = oem_text(id, mid, state);
    skyloop::orbit::parse(&text, "test.oem").unwrap().objects
}

/// The text of [`oem`].
pub fn oem_text(
    id: &str,
    mid: Epoch,
    state: impl Fn(f64) -> (Vector3<f64>, Vector3<f64>),
) -> String {
    let utc = |s: f64| {
        let text = skyloop::orbit::time::utc_text(mid + hifitime::Duration::from_seconds(s));
        text.trim_end_matches('Z').to_string()
    };
    let mut text = format!(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\nOBJECT_NAME = {id}\n\
         OBJECT_ID = {id}\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = {}\nSTOP_TIME = {}\n\
         INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 5\nMETA_STOP\n\n",
        utc(-10.0),
        utc(10.0)
    );
    for s in -10..=10 {
        let (r, v) = state(f64::from(s));
        text += &format!(
            "{} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12}\n",
            utc(f64::from(s)),
            r.x,
            r.y,
            r.z,
            v.x,
            v.y,
            v.z
        );
    }
    text
}

/// A state that falls freely from `r` (km), `v` (km/s), to second order in time.
pub fn falling(
    r: Vector3<f64>,
    v: Vector3<f64>,
) -> impl Fn(f64) -> (Vector3<f64>, Vector3<f64>) + Clone {
    move |t| {
        let pull = r * (-GM / r.norm().powi(3));
        (r + v * t + pull * (t * t / 2.0), v + pull * t)
    }
}
