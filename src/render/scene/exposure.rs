//! The instants of an exposure.

use hifitime::Epoch;
use skyloop_orbit::time::seconds;

/// An exposure's three instants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Shutter opens.
    pub start: Epoch,
    /// The middle: epoch of attitude and state.
    pub mid: Epoch,
    /// Shutter closes.
    pub end: Epoch,
    /// Exposure time, s.
    pub duration_s: f64,
}

impl Exposure {
    /// The exposure of `duration_s` around `mid`, its ends to the nearest nanosecond. If
    /// `duration_s` is not a number, they equal the middle.
    pub fn around(mid: Epoch, duration_s: f64) -> Exposure {
        let half = seconds(duration_s / 2.0);
        Exposure {
            start: mid - half,
            mid,
            end: mid + half,
            duration_s,
        }
    }
}
