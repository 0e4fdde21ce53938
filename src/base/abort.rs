//! Limits the work on a frame: another thread may cancel it, and it may cost too much.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A flag that one thread sets and the threads that make a frame read: between the stages of a
/// scene, images, squares of area light, labels and bands of rows. What is made after it was set is
/// incomplete and is not used.
#[derive(Debug, Clone, Default)]
pub struct Abort(Arc<AtomicBool>);

impl Abort {
    /// Cancels the work.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work is cancelled.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// How much work a frame may cost, and how much it has cost so far, by the times that the
/// operations take on one core. Only what can grow without bound is counted: images, tracks, area
/// light that moves, particles. The sum is the same whatever the machine and the number of threads:
/// so is whether it exceeds the limit.
#[derive(Debug, Clone, Default)]
pub struct WorkLimit {
    abort: Abort,
    spent_ns: Arc<AtomicU64>,
    limit_ns: Option<u64>,
}

impl WorkLimit {
    /// At most so many s of a core, if that is limited; `abort` cancels the work.
    pub fn new(limit_s: Option<f64>, abort: Abort) -> WorkLimit {
        WorkLimit {
            abort,
            spent_ns: Arc::default(),
            limit_ns: limit_s.map(|limit_s| (limit_s * 1e9) as u64),
        }
    }

    /// Counts work of so many ns on one core.
    pub fn spend(&self, ns: f64) {
        self.spent_ns.fetch_add(ns as u64, Ordering::Relaxed);
    }

    /// Work so far, s on one core.
    pub fn spent_s(&self) -> f64 {
        self.spent_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// Whether the work has cost more than it may.
    pub fn is_exceeded(&self) -> bool {
        let spent_ns = self.spent_ns.load(Ordering::Relaxed);
        self.limit_ns.is_some_and(|limit_ns| spent_ns > limit_ns)
    }

    /// Whether the work is cancelled or has cost more than it may: nothing more is to be done.
    pub fn is_over(&self) -> bool {
        self.abort.is_set() || self.is_exceeded()
    }

    /// Whether the work is cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.abort.is_set()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_ends_when_it_is_cancelled_or_has_cost_more_than_it_may() {
        let abort = Abort::default();
        let limits = [Some(2e-6), None].map(|s| WorkLimit::new(s, abort.clone()));
        let state = |limit: &WorkLimit| (limit.is_exceeded(), limit.is_over());
        // X-Val: 1500 ns and 500 ns are 2 us, one more is too much.
        for (ns, exceeded) in [(1500.0, false), (500.0, false), (1.0, true)] {
            limits.iter().for_each(|limit| limit.spend(ns));
            let expected = [(exceeded, exceeded), (false, false)];
            assert_eq!(limits.each_ref().map(state), expected);
        }
        abort.set();
        assert_eq!(limits.each_ref().map(state), [(true, true), (false, true)]);
        assert_eq!(limits[1].spent_s(), 2.001e-6);
    }
}
