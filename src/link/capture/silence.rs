//! How long a replay has stalled, and how much of that time the emulator was idle.

use std::time::{Duration, Instant};

/// An idle emulator polls for packets at least this often (`serve`: every 50 ms). A longer gap
/// means rendering, which may take minutes.
const MAX_POLL_INTERVAL: Duration = Duration::from_millis(200);

/// Time since a packet was taken or sent.
pub(super) struct Silence {
    moved: Instant,
    /// Last poll of the empty queue, or last packet.
    polled: Instant,
    /// Idle time.
    idle: Duration,
}

impl Silence {
    pub fn from(now: Instant) -> Silence {
        Silence {
            moved: now,
            polled: now,
            idle: Duration::ZERO,
        }
    }

    /// A packet was taken or sent.
    pub fn restart(&mut self, now: Instant) {
        *self = Silence::from(now);
    }

    /// The emulator works on something that the recording does not show.
    pub fn clear_idle(&mut self) {
        self.idle = Duration::ZERO;
    }

    /// The emulator polled the empty queue.
    pub fn polled(&mut self, now: Instant) {
        let since = now.saturating_duration_since(self.polled);
        if since <= MAX_POLL_INTERVAL {
            self.idle += since;
        }
        self.polled = now;
    }

    /// How long the emulator has been idle.
    pub fn idle(&self) -> Duration {
        self.idle
    }

    /// Time since the last packet.
    pub fn duration(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rendering_is_not_idle_time() {
        let start = Instant::now();
        let at = |s: f64| start + Duration::from_secs_f64(s);
        let mut silence = Silence::from(start);
        // A poll before a frame, one after 1000 s of rendering, then one every 50 ms.
        silence.polled(at(0.001));
        silence.polled(at(1000.0));
        for poll in 1..=40 {
            silence.polled(at(1000.0 + 0.05 * f64::from(poll)));
        }
        let idle = silence.idle().as_secs_f64();
        assert!((idle - 2.001).abs() < 1e-6, "{idle}");
        assert_eq!(silence.duration(at(1002.0)), Duration::from_secs(1002));
        silence.clear_idle();
        assert_eq!(silence.idle(), Duration::ZERO);
        assert_eq!(silence.duration(at(1002.0)), Duration::from_secs(1002));
        silence.restart(at(1003.0));
        silence.polled(at(1003.1));
        assert!((silence.idle().as_secs_f64() - 0.1).abs() < 1e-6);
        assert!((silence.duration(at(1004.0)).as_secs_f64() - 1.0).abs() < 1e-6);
    }
}
