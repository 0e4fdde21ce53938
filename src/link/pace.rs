//! Computes when bytes have passed a line of limited rate, without a clock of its own.

use std::time::{Duration, Instant};

/// One direction of a line of limited rate.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    bytes_per_s: f64,
    /// Maximum lag that is caught up: data waits in the system's queues meanwhile.
    slack: Duration,
    /// When the last byte on it has passed.
    free: Option<Instant>,
}

impl Pace {
    /// A line that has been idle until now.
    pub fn new(bytes_per_s: f64, slack: Duration) -> Pace {
        Pace {
            bytes_per_s,
            slack,
            free: None,
        }
    }

    /// A serial line: 10 bit times a byte (start bit, 8 data bits, stop bit).
    pub fn of_baud(baud: u32) -> Pace {
        const SLACK: Duration = Duration::from_millis(100);
        Pace::new(f64::from(baud) / 10.0, SLACK)
    }

    /// Number of bytes that pass within `time`, at least 1.
    pub fn bytes_in(&self, time: Duration) -> usize {
        ((time.as_secs_f64() * self.bytes_per_s) as usize).max(1)
    }

    /// Notes that the line was idle until `now`: idle time is not caught up.
    pub fn idle(&mut self, now: Instant) {
        self.free = Some(self.free.map_or(now, |free| free.max(now)));
    }

    /// Adds bytes to the line; returns when the last of them has passed.
    pub fn pass(&mut self, bytes: usize, now: Instant) -> Instant {
        let earliest = now.checked_sub(self.slack).unwrap_or(now);
        let start = self.free.map_or(now, |free| free.max(earliest));
        let free = start + Duration::from_secs_f64(bytes as f64 / self.bytes_per_s);
        self.free = Some(free);
        free
    }
}

pub(super) fn sleep_until(end: Instant) {
    std::thread::sleep(end.saturating_duration_since(Instant::now()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn bytes_take_ten_bit_times_each() {
        let (mut line, zero) = (Pace::of_baud(115_200), Instant::now());
        // X-Val: 11,520 bytes a second.
        assert_eq!(line.pass(1152, zero), zero + ms(100));
        assert_eq!(line.pass(11_520, zero), zero + ms(1100));
        assert_eq!(line.bytes_in(ms(1000)), 11_520);
        assert_eq!(Pace::of_baud(9600).bytes_in(ms(1)), 1);
    }

    #[test]
    fn late_reader_catches_up_and_idle_time_does_not_count() {
        let (mut line, zero) = (Pace::of_baud(10_000), Instant::now());
        assert_eq!(line.pass(10, zero), zero + ms(10));
        // 15 ms late; the next bytes waited meanwhile.
        assert_eq!(line.pass(10, zero + ms(25)), zero + ms(20));
        line.idle(zero + ms(60));
        assert_eq!(line.pass(10, zero + ms(60)), zero + ms(70));
        line.idle(zero + ms(65));
        assert_eq!(line.pass(10, zero + ms(65)), zero + ms(80), "it was busy");
        // A lag beyond the slack of 100 ms is not caught up.
        assert_eq!(line.pass(10, zero + ms(1000)), zero + ms(910));
    }
}
