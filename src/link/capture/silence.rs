//! How long a replay has stood still, and for how much of that the emulator was idle.

use std::time::{Duration, Instant};

/// An idle emulator polls for packets at least this often (`serve`: every 50 ms). A later poll
/// means that it was rendering, which may take minutes.
const LOOKS: Duration = Duration::from_millis(200);

/// Since something was taken or sent.
pub(super) struct Silence {
    moved: Instant,
    /// The last look for a packet in vain, or what came since.
    looked: Instant,
    /// Time without work.
    idle: Duration,
}

impl Silence {
    pub fn from(now: Instant) -> Silence {
        Silence {
            moved: now,
            looked: now,
            idle: Duration::ZERO,
        }
    }

    /// Something was taken or sent.
    pub fn broken(&mut self, now: Instant) {
        *self = Silence::from(now);
    }

    /// The emulator is about to do something that the recording does not show.
    pub fn excused(&mut self) {
        self.idle = Duration::ZERO;
    }

    /// The emulator has looked for a packet in vain.
    pub fn looked(&mut self, now: Instant) {
        let since = now.saturating_duration_since(self.looked);
        if since <= LOOKS {
            self.idle += since;
        }
        self.looked = now;
    }

    /// How long the emulator has had nothing to do.
    pub fn idle(&self) -> Duration {
        self.idle
    }

    /// How long nothing has been taken or sent.
    pub fn lasts(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_no_silence() {
        let start = Instant::now();
        let at = |s: f64| start + Duration::from_secs_f64(s);
        let mut silence = Silence::from(start);
        // A look before a frame, one after its rendering of 1000 s, then every 50 ms.
        silence.looked(at(0.001));
        silence.looked(at(1000.0));
        for look in 1..=40 {
            silence.looked(at(1000.0 + 0.05 * f64::from(look)));
        }
        let idle = silence.idle().as_secs_f64();
        assert!((idle - 2.001).abs() < 1e-6, "{idle}");
        assert_eq!(silence.lasts(at(1002.0)), Duration::from_secs(1002));
        silence.excused();
        assert_eq!(silence.idle(), Duration::ZERO);
        assert_eq!(silence.lasts(at(1002.0)), Duration::from_secs(1002));
        silence.broken(at(1003.0));
        silence.looked(at(1003.1));
        assert!((silence.idle().as_secs_f64() - 0.1).abs() < 1e-6);
        assert!((silence.lasts(at(1004.0)).as_secs_f64() - 1.0).abs() < 1e-6);
    }
}
