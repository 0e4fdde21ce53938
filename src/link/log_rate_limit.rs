//! Rate limit for log messages: the first at once, later ones summed up.

use std::time::{Duration, Instant};

/// Minimum interval between two messages of one kind.
const INTERVAL: Duration = Duration::from_secs(10);

/// Rate limit of one kind of message.
#[derive(Debug, Clone, Copy, Default)]
pub struct LogRateLimit {
    last: Option<Instant>,
    /// Events not yet reported.
    unreported: u32,
}

impl LogRateLimit {
    /// Counts an event. If a message is due, returns the number of events since the last message.
    pub fn count(&mut self, now: Instant) -> Option<u32> {
        self.unreported = self.unreported.saturating_add(1);
        let passed = self.last.map(|last| now.saturating_duration_since(last));
        if passed.is_some_and(|passed| passed < INTERVAL) {
            return None;
        }
        self.last = Some(now);
        Some(std::mem::take(&mut self.unreported))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_event_is_reported_at_once_and_later_ones_summed() {
        let (mut every, begin) = (LogRateLimit::default(), Instant::now());
        let at = |ms| begin + Duration::from_millis(ms);
        let reported = [0, 1, 9_999, 10_000, 10_001, 25_000].map(|ms| every.count(at(ms)));
        assert_eq!(reported, [Some(1), None, None, Some(3), None, Some(2)]);
    }
}
