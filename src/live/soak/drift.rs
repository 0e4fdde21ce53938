//! Drift of the scene time against the client's clock over a run.

use hifitime::Epoch;
use serde::{Serialize, Serializer};
use std::time::{Duration, Instant};

/// Drift by the fastest frames: from the end of the exposure, in scene time, to the last packet, in
/// the client's time. The lowest latency of an interval is nearly constant, so its change is drift.
#[derive(Debug, Clone, Default)]
pub struct Drift {
    /// Length of the compared parts.
    part: Duration,
    length: Duration,
    /// Scene time and client's time of the first frame.
    zero: Option<(Epoch, Instant)>,
    /// Lowest latency in the first part and in the last, relative to the first frame, s.
    min_s: [Option<f64>; 2],
}

impl Drift {
    /// For a run of this length. Compares its first and last fifth.
    #[must_use]
    pub fn over(length: Duration) -> Self {
        Self {
            part: length / 5,
            length,
            ..Self::default()
        }
    }

    /// Adds a frame whose exposure ended at `exposed` and that arrived at `at`, `since` the start.
    pub fn add(&mut self, since: Duration, exposed: Epoch, at: Instant) {
        let (scene, client) = *self.zero.get_or_insert((exposed, at));
        let part = if since <= self.part {
            0
        } else if since >= self.length - self.part {
            1
        } else {
            return;
        };
        let passed_s = crate::timing::spare_s(at, client);
        let more_s = passed_s - (exposed - scene).to_seconds();
        if let Some(min_s) = self.min_s.get_mut(part) {
            *min_s = Some(min_s.map_or(more_s, |min_s| min_s.min(more_s)));
        }
    }

    /// Loss of scene time from the first part to the last, s; none if a part had no frame.
    #[must_use]
    pub fn seconds(&self) -> Option<f64> {
        let [first, last] = self.min_s;
        Some(last? - first?)
    }

    /// The text in the table.
    #[must_use]
    pub(crate) fn describe(&self) -> String {
        self.seconds().map_or("not known".to_string(), |drift_s| {
            format!("{:+.2} ms from the first fifth to the last", drift_s * 1e3)
        })
    }
}

impl Serialize for Drift {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.seconds().serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_orbit::time::seconds;

    /// Drift over 100 s at 10 Hz, with a latency of `late_s` and a loss per second of `lost`.
    fn drift_s(lost: f64, late_s: impl Fn(u32) -> f64) -> f64 {
        let (scene, zero) = (
            Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0),
            Instant::now(),
        );
        let mut drift = Drift::over(Duration::from_secs(100));
        for frame in 0..1000 {
            let exposed_s = f64::from(frame) * 0.1;
            let arrival_s = exposed_s * (1.0 + lost) + late_s(frame);
            let since = Duration::from_secs_f64(arrival_s);
            drift.add(since, scene + seconds(exposed_s), zero + since);
        }
        drift.seconds().unwrap()
    }

    #[test]
    fn drift_is_measured_despite_varying_latency() {
        // A varying latency from 10 ms; in the last fifth every second frame waits 50 ms more.
        let late_s = |frame: u32| {
            let spread = 0.004 * (f64::from(frame) * 0.618_033_988_75).fract();
            let waits = frame >= 800 && frame.is_multiple_of(2);
            0.01 + spread + if waits { 0.05 } else { 0.0 }
        };
        assert!(drift_s(0.0, late_s).abs() < 1e-4);
        // X-Val: 1e-4 of the 80 s between the starts of the parts, where the minimum lies.
        assert!((drift_s(1e-4, |_| 0.01) - 8e-3).abs() < 1e-4);
        // For a gaining clock the minimum lies at the ends of the parts.
        assert!((drift_s(-1e-4, |_| 0.01) + 8e-3).abs() < 1e-4);
    }

    #[test]
    fn stopped_run_has_no_drift() {
        let mut drift = Drift::over(Duration::from_secs(100));
        assert_eq!(drift.describe(), "not known");
        let now = Instant::now();
        drift.add(Duration::ZERO, Epoch::from_unix_seconds(0.0), now);
        assert_eq!(drift.seconds(), None);
    }
}
