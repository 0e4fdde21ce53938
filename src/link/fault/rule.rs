//! A rule: one fault with its times and random numbers.

use skyloop_base::rng::{NoiseKey, PixelStream};
use skyloop_protocols::Fault;
use std::time::Duration;

/// A fault and its active time since the engine's zero.
#[derive(Debug, Clone)]
pub(crate) struct Rule {
    pub(super) fault: Fault,
    /// Seed of its random numbers.
    pub(super) seed: u64,
    /// Index of the rule: two rules of one seed draw different numbers.
    pub(super) number: u32,
    pub(super) from: Duration,
    /// None: to the end of the run.
    pub(super) until: Option<Duration>,
    /// Number of items while it was active.
    seen: u32,
    /// 0 before its beginning, 1 while active, 2 after its end.
    turned: u8,
}

/// Default seed.
pub(super) const SEED: u64 = 1;
/// Live faults are numbered from here.
const LIVE: u32 = 1 << 16;

impl Rule {
    /// Rule `number`.
    pub fn new(
        fault: Fault,
        seed: u64,
        number: u32,
        from: Duration,
        until: Option<Duration>,
    ) -> Rule {
        Rule {
            fault,
            seed,
            number,
            from,
            until,
            seen: 0,
            turned: 0,
        }
    }

    /// The rule of a live fault, the `count`th of its direction.
    pub(super) fn live(fault: Fault, now: Duration, count: u32) -> Rule {
        let until = (fault.seconds > 0.0).then(|| now + Duration::from_secs_f64(fault.seconds));
        Rule::new(fault, SEED, LIVE + count, now, until)
    }

    pub(super) fn is_on(&self, now: Duration) -> bool {
        self.from <= now && self.until.is_none_or(|until| now < until)
    }

    /// When it next begins or ends.
    pub(super) fn next_turn(&self) -> Option<Duration> {
        match self.turned {
            0 => Some(self.from),
            1 => self.until,
            _ => None,
        }
    }

    /// The next unreported beginning or end by `now`: its time, and whether it is the end.
    pub(super) fn take_turn(&mut self, now: Duration) -> Option<(Duration, bool)> {
        let at = self.next_turn().filter(|at| *at <= now)?;
        self.turned += 1;
        Some((at, self.turned == 2))
    }

    /// Whether its end has been reported.
    pub(super) fn is_over(&self) -> bool {
        self.turned == 2
    }

    /// Random numbers for the next item. They depend only on the seed, the rule and the number of
    /// earlier items, so they are reproducible.
    pub(super) fn draw(&mut self) -> PixelStream {
        let key = NoiseKey {
            seed: self.seed,
            sequence: self.seen,
            repeat: 0,
        };
        self.seen = self.seen.wrapping_add(1);
        PixelStream::new(key, self.fault.kind.code(), self.number)
    }
}
