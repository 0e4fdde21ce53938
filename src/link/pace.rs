//! A line with a rate: when each byte put on it has passed. It has no clock of its own.

use std::time::{Duration, Instant};

/// One direction of a line that carries so many octets a second and no more.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    bytes_per_s: f64,
    /// How far the line may lag and still catch up: data waits in the system's queues meanwhile.
    slack: Duration,
    /// When the last octet put on it has passed.
    free: Option<Instant>,
}

impl Pace {
    /// A line that has been idle until now.
    pub fn new(octets_per_s: f64, slack: Duration) -> Pace {
        Pace {
            bytes_per_s: octets_per_s,
            slack,
            free: None,
        }
    }

    /// A serial line: 10 bit times an octet (start bit, 8 data bits, stop bit).
    pub fn of_baud(baud: u32) -> Pace {
        const SLACK: Duration = Duration::from_millis(100);
        Pace::new(f64::from(baud) / 10.0, SLACK)
    }

    /// Octets that pass within `time`; one at least.
    pub fn bytes_in(&self, time: Duration) -> usize {
        ((time.as_secs_f64() * self.bytes_per_s) as usize).max(1)
    }

    /// There was nothing to carry until `now`: time that passed unused is not caught up.
    pub fn rest(&mut self, now: Instant) {
        self.free = Some(self.free.map_or(now, |free| free.max(now)));
    }

    /// Puts octets on the line behind those that are on it; when the last of them has passed.
    pub fn pass(&mut self, bytes: usize, now: Instant) -> Instant {
        let earliest = now.checked_sub(self.slack).unwrap_or(now);
        let start = self.free.map_or(now, |free| free.max(earliest));
        let free = start + Duration::from_secs_f64(bytes as f64 / self.bytes_per_s);
        self.free = Some(free);
        free
    }
}

/// Sleeps until `then`, if that is still to come.
pub(super) fn sleep_until(then: Instant) {
    std::thread::sleep(then.saturating_duration_since(Instant::now()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn octets_take_ten_bit_times_each_behind_one_another() {
        let (mut line, zero) = (Pace::of_baud(115_200), Instant::now());
        // X-Val: 11,520 octets a second.
        assert_eq!(line.pass(1152, zero), zero + ms(100));
        assert_eq!(line.pass(11_520, zero), zero + ms(1100));
        assert_eq!(line.bytes_in(ms(1000)), 11_520);
        assert_eq!(Pace::of_baud(9600).bytes_in(ms(1)), 1);
    }

    #[test]
    fn a_late_reader_catches_up_but_an_idle_line_saves_nothing() {
        let (mut line, zero) = (Pace::of_baud(10_000), Instant::now());
        assert_eq!(line.pass(10, zero), zero + ms(10));
        // 15 ms late, and the next octets waited all the time.
        assert_eq!(line.pass(10, zero + ms(25)), zero + ms(20));
        line.rest(zero + ms(60));
        assert_eq!(line.pass(10, zero + ms(60)), zero + ms(70));
        line.rest(zero + ms(65));
        assert_eq!(line.pass(10, zero + ms(65)), zero + ms(80), "it was busy");
        // Longer than the slack of 100 ms is not caught up.
        assert_eq!(line.pass(10, zero + ms(1000)), zero + ms(910));
    }
}
