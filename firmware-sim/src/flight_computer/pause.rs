//! A pause of the exposures.

use std::time::Duration;

/// A time without exposures, counted from the first attitude; attitudes leave all the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pause {
    /// When it begins.
    pub after: Duration,
    /// How long it lasts.
    pub lasts: Duration,
}
