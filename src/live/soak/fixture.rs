//! Runs for tests.

use super::limits::{Camera, Limits, Measured};
use crate::timing::{FrameTimes, Latencies};
use std::time::Duration;

/// A frame that took 4 ms.
pub(crate) const TIMES: FrameTimes = FrameTimes {
    last_byte: Duration::from_millis(4),
    spare_s: 0.05,
    whole: true,
    ..FrameTimes::incomplete(0)
};

/// Limits without a limit on memory.
pub(crate) fn limits(max_miss_rate: f64, max_p99_ms: Option<f64>) -> Limits {
    Limits {
        max_miss_rate,
        max_p99_ms,
        max_growth: None,
    }
}

/// A run of one camera.
pub(crate) fn of(latencies: Latencies) -> Measured {
    let name = "A".to_string();
    Measured {
        cameras: vec![Camera {
            name,
            latencies,
            ..Camera::default()
        }],
        ..Measured::default()
    }
}

/// A run of `frames` frames. From `slow` on, every second takes 14.2 ms; those in `late` are late
/// by 4.2 ms.
pub(crate) fn run(limits: &Limits, frames: u32, slow: u32, late: std::ops::Range<u32>) -> Measured {
    let mut all = limits.latencies();
    for frame in 0..frames {
        let mut times = FrameTimes { frame, ..TIMES };
        if frame >= slow && (frame - slow).is_multiple_of(2) {
            times.last_byte = Duration::from_micros(14_200);
        }
        if late.contains(&frame) {
            times.spare_s = -4.2e-3;
        }
        all.add(&times);
    }
    of(all)
}
