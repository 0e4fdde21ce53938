//! Numbers and their ranges in words, with the units in the names of keys.

use super::document::matches;
use std::ops::RangeInclusive;

/// A number in decimals, or with a power of ten if it has many digits.
pub(super) fn short(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-5..1e16 => value.to_string(),
        _ => format!("{value:e}"),
    }
}

/// The allowed range of a key, with its unit.
pub(super) fn range_text(key: &str, range: &RangeInclusive<f64>) -> String {
    let text = match *range.start() {
        f64::MIN_POSITIVE => format!("above 0, at most {}", range.end()),
        min => format!("{min} to {}", range.end()),
    };
    match unit_of(key) {
        "" => text,
        unit => format!("{text} {unit}"),
    }
}

/// Units of keys whose names have none.
const UNITS_OF_KEYS: &[(&str, &str)] = &[
    ("optics.band[]", "nm"),
    ("optics.psf.width_by_field[][0]", "deg"),
    ("optics.stray.pst[][0]", "deg"),
    ("optics.vignetting.table[][0]", "deg"),
    ("sequence.look_at[]", "deg"),
    ("sequence.radec[]", "deg"),
];

/// Suffixes of keys and their units; the first match counts.
const UNITS: &[(&str, &str)] = &[
    ("_e_per_dn", "e-/DN"),
    ("_cm2_s", "1/cm^2/s"),
    ("_deg_s", "deg/s"),
    ("_e_s", "e-/s"),
    ("_arcsec", "arcsec"),
    ("_deg", "deg"),
    ("_m2", "m^2"),
    ("_bits", "bits"),
    ("_mev", "MeV"),
    ("_mm", "mm"),
    ("_um", "um"),
    ("_us", "us"),
    ("_px", "px"),
    ("_hz", "Hz"),
    ("_dn", "DN"),
    ("_e", "e-"),
    ("_c", "deg C"),
    ("_k", "K"),
    ("_m", "m"),
    ("_s", "s"),
];

/// The unit in the name of a key, or empty.
pub(super) fn unit_of(key: &str) -> &'static str {
    let mut own = UNITS_OF_KEYS.iter();
    if let Some((_, unit)) = own.find(|(pattern, _)| matches(pattern, key)) {
        return unit;
    }
    let name = match key.rfind('[') {
        Some(at) if key.ends_with(']') => &key[..at],
        _ => key,
    };
    let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
    unit.map_or("", |(_, unit)| *unit)
}
