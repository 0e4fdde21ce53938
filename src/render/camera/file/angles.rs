//! Tables of angles from the boresight.

use skyloop_base::load::{Check, ConfigError, Limit};
use std::ops::RangeInclusive;

/// Angles from the boresight, deg.
pub(crate) const FIELD_DEG: RangeInclusive<f64> = 0.0..=180.0;

/// Keys that determine the field of view.
pub(crate) const FIELD: &[&str] = &[
    "optics.focal_length_mm",
    "optics.principal_px",
    "optics.projection",
    "optics.psf",
    "optics.vignetting",
    "detector.pixel_um",
    "detector.width_px",
    "detector.height_px",
];

/// Refuses a table of angles (deg) that do not rise, or with values outside of their limits.
pub(crate) fn rising_angles(
    key: &str,
    table: &[[f64; 2]],
    limits: &[Limit],
    check: &Check,
) -> Result<(), ConfigError> {
    for (i, [deg, value]) in table.iter().enumerate() {
        check.limit(limits, &format!("{key}[{i}][0]"), *deg)?;
        check.limit(limits, &format!("{key}[{i}][1]"), *value)?;
    }
    match table.windows(2).position(|pair| pair[1][0] <= pair[0][0]) {
        Some(i) => {
            let (entry, given) = (format!("{key}[{}]", i + 1), format!("{:?}", table[i + 1]));
            let allowed = format!(
                "at a greater angle than the point before it, {:?}",
                table[i]
            );
            Err(check.refuse(&entry, given, allowed).needs(&[key]))
        }
        None => Ok(()),
    }
}
