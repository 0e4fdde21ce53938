//! Values that a camera file or a command may set.

use std::ops::RangeInclusive;

/// Exposure times (s) that a file or a command may set.
pub const EXPOSURE_S: RangeInclusive<f64> = 1e-9..=1e4;
/// Gains (e-/DN) that a file or a command may set.
pub const GAIN_E_PER_DN: RangeInclusive<f64> = 1e-4..=1e6;
/// Frame rates (Hz) that a file or a command may set.
pub const RATE_HZ: RangeInclusive<f64> = 1e-4..=1e4;
