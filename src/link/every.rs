//! Messages of the log that may come often: the first at once, later ones together.

use std::time::{Duration, Instant};

/// Between two messages of one kind.
const INTERVAL: Duration = Duration::from_secs(10);

/// When a kind of message is due.
#[derive(Debug, Clone, Copy, Default)]
pub struct Every {
    last: Option<Instant>,
    /// Events that no message has reported.
    unreported: u32,
}

impl Every {
    /// Counts an event. If a message is due: the number of events since the last, this one
    /// included.
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
    fn the_first_event_is_reported_at_once_and_the_next_together() {
        let (mut every, begin) = (Every::default(), Instant::now());
        let at = |ms| begin + Duration::from_millis(ms);
        let reported = [0, 1, 9_999, 10_000, 10_001, 25_000].map(|ms| every.count(at(ms)));
        assert_eq!(reported, [Some(1), None, None, Some(3), None, Some(2)]);
    }
}
