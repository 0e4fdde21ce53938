//! Constants and time scales of the ephemerides.

use hifitime::{Epoch, Unit};

/// Astronomical unit, m (IAU 2012 Resolution B2, exact).
pub const AU_M: f64 = 149_597_870_700.0;
/// Speed of light, m/s (exact).
pub const LIGHT_M_S: f64 = 299_792_458.0;
/// Radius of the Sun, m (IAU 2015 Resolution B3, nominal).
pub const SUN_RADIUS_M: f64 = 695_700_000.0;

pub(crate) const DAY_S: f64 = 86_400.0;
pub(crate) const J2000_JD: f64 = 2_451_545.0;

/// Days of TT since J2000.0 (2000-01-01 12:00 TT).
pub(crate) fn tt_days_since_j2000(t: Epoch) -> f64 {
    t.to_tt_since_j2k().to_unit(Unit::Day)
}
