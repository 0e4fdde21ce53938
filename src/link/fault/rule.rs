//! A rule: one fault, when it is in force, and its random numbers.

use skyloop_base::rng::{NoiseKey, PixelStream};
use skyloop_protocols::Fault;
use std::time::Duration;

/// A fault and when it is in force, from the engine's zero.
#[derive(Debug, Clone)]
pub struct Rule {
    /// What happens to whom, and how much.
    pub(super) fault: Fault,
    /// Of its random numbers.
    pub(super) seed: u64,
    /// Its number among the rules: two of one seed draw different numbers.
    pub(super) number: u32,
    pub(super) from: Duration,
    /// None: to the end of the run.
    pub(super) until: Option<Duration>,
    /// Items that have come while it was in force.
    seen: u32,
    /// How often it has turned: begun, ended.
    turned: u8,
}

/// Seed of faults that name none.
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

    /// Whether it is in force.
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

    /// If it has begun or ended by `now` and nobody knows yet: when, and whether it is the end.
    pub(super) fn take_turn(&mut self, now: Duration) -> Option<(Duration, bool)> {
        let at = self.next_turn().filter(|at| *at <= now)?;
        self.turned += 1;
        Some((at, self.turned == 2))
    }

    /// Whether it has ended and everybody knows.
    pub(super) fn is_over(&self) -> bool {
        self.turned == 2
    }

    /// Random numbers for the next item. They depend on the seed, the rule and the number of items
    /// before, so that they repeat.
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
