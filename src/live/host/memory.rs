//! Resident memory of this process: once a run is warm, and at its end.

use serde::Serialize;
use std::time::Duration;

/// Resident memory of a run; `None`: could not be read, or the run ended before it was warm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Memory {
    /// When the run is warm, s after its start.
    pub warm_s: f64,
    /// Memory at that time, bytes.
    pub warm: Option<u64>,
    /// Memory at the end, bytes.
    pub end: Option<u64>,
    /// Time of the last reading, after the start.
    #[serde(skip)]
    pub sampled: Option<Duration>,
}

/// Minimum interval of readings, which are slow compared with packets.
const MIN_INTERVAL: Duration = Duration::from_millis(500);

impl Memory {
    /// For a run of this length. It is warm after a fifth of it, or after a minute.
    #[must_use]
    pub fn over(run: Duration) -> Self {
        Self {
            warm_s: (run.as_secs_f64() / 5.0).min(60.0),
            ..Self::default()
        }
    }

    /// Reads the memory, if a reading is due.
    pub fn sample(&mut self, since: Duration) {
        let warms = self.warm.is_none() && since.as_secs_f64() >= self.warm_s;
        let is_soon = |last| since.saturating_sub(last) < MIN_INTERVAL;
        if !warms && self.sampled.is_some_and(is_soon) {
            return;
        }
        (self.end, self.sampled) = (resident(), Some(since));
        if warms {
            self.warm = self.end;
        }
    }

    /// Growth since the run was warm, as a share.
    #[must_use]
    pub(crate) fn growth(&self) -> Option<f64> {
        let [warm, end] = [self.warm?, self.end?].map(|bytes| bytes as f64);
        (warm > 0.0).then(|| (end - warm) / warm)
    }

    /// `98.40 MB after 60 s, 98.65 MB at the end (+0.26 %)`; `98.65 MB at the end, before it was
    /// warm (60 s)`.
    #[must_use]
    pub(crate) fn describe(&self) -> String {
        let megabytes = |bytes: Option<u64>| {
            bytes.map_or("unknown".to_string(), |bytes| {
                format!("{:.2} MB", bytes as f64 * 1e-6)
            })
        };
        let end = megabytes(self.end);
        if self.warm.is_none() && self.end.is_some() {
            return format!("{end} at the end, before it was warm ({} s)", self.after());
        }
        let growth = self.growth();
        let growth = growth.map(|growth| format!(" ({:+.2} %)", growth * 1e2));
        format!(
            "{} after {} s, {end} at the end{}",
            megabytes(self.warm),
            self.after(),
            growth.unwrap_or_default()
        )
    }

    /// Text of the warm-up time: `60`, `0.6`.
    fn after(&self) -> String {
        let decimals = usize::from(self.warm_s < 10.0);
        format!("{:.decimals$}", self.warm_s)
    }
}

/// Resident memory of this process, bytes.
fn resident() -> Option<u64> {
    of_status(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// Resident memory in a `status` file of Linux.
fn of_status(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_resident_memory_is_read() {
        let text = "VmHWM:\t  900 kB\nVmRSS:\t    1200 kB\nRssAnon: 7 kB\n";
        assert_eq!(of_status(text), Some(1200 * 1024));
        for damaged in [
            "",
            "VmRSS:",
            "VmRSS: 12",
            "VmRSS: x kB",
            "VmRSS: 18446744073709551615 kB",
        ] {
            assert_eq!(of_status(damaged), None, "{damaged}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn allocated_memory_is_detected() {
        let mut memory = Memory::over(Duration::from_secs(50));
        memory.sample(Duration::from_secs(9));
        assert_eq!((memory.warm, memory.growth()), (None, None));
        memory.sample(Duration::from_secs(10));
        assert!(memory.warm > Some(0));
        // Written page by page. X-Val: 2^27 bytes; other tests allocate and free meanwhile, but not
        // as much each time.
        let grows = |_| {
            let before = resident().unwrap();
            let taken = vec![1_u8; 1 << 27];
            let grown = resident().unwrap() as f64 - before as f64;
            grown > 0.5 * taken.len() as f64
        };
        assert!((0..20).any(grows));
        memory.sample(Duration::from_secs(11));
        assert!(
            memory.end > Some(0) && memory.growth().is_some(),
            "{memory:?}"
        );
    }

    #[test]
    fn description_has_the_known_values() {
        let memory = Memory {
            warm_s: 60.0,
            warm: Some(98_400_000),
            end: Some(98_650_000),
            sampled: None,
        };
        assert_eq!(
            memory.describe(),
            "98.40 MB after 60 s, 98.65 MB at the end (+0.25 %)"
        );
        let stopped = Memory {
            warm: None,
            ..memory
        };
        assert_eq!(
            stopped.describe(),
            "98.65 MB at the end, before it was warm (60 s)"
        );
        assert_eq!(
            Memory::over(Duration::MAX).describe(),
            "unknown after 60 s, unknown at the end"
        );
    }
}
