//! Pause of the exposures.

use std::time::Duration;

/// A time without exposures after the first attitude; attitudes are sent meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pause {
    /// Start of the pause.
    pub after: Duration,
    /// Duration.
    pub lasts: Duration,
}
