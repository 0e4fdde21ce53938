//! Limits the work on a frame: it can be cancelled by another thread, and its cost is limited.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A flag for cancelling a frame. One thread sets it. The threads that make the frame read it
/// between stages of a scene, images, squares of area light, labels and bands of rows. Results
/// after cancellation are incomplete and are not used.
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

/// The cost limit of a frame, and its cost so far, by operation times on one core. Only work that
/// can grow without bound is counted: images, tracks, moving area light, particles. The sum does
/// not depend on the machine or the number of threads, so whether it exceeds the limit does not
/// either.
#[derive(Debug, Clone, Default)]
pub struct WorkLimit {
    abort: Abort,
    spent_ns: Arc<AtomicU64>,
    limit_ns: Option<u64>,
}

impl WorkLimit {
    /// Limits the work, s of one core, or not at all; `abort` cancels it.
    pub fn new(limit_s: Option<f64>, abort: Abort) -> WorkLimit {
        WorkLimit {
            abort,
            spent_ns: Arc::default(),
            limit_ns: limit_s.map(|limit_s| (limit_s * 1e9) as u64),
        }
    }

    /// Counts work, ns of one core.
    pub fn spend(&self, ns: f64) {
        self.spent_ns.fetch_add(ns as u64, Ordering::Relaxed);
    }

    /// Work so far, s of one core.
    pub fn spent_s(&self) -> f64 {
        self.spent_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// Whether the work exceeds its limit.
    pub fn is_exceeded(&self) -> bool {
        let spent_ns = self.spent_ns.load(Ordering::Relaxed);
        self.limit_ns.is_some_and(|limit_ns| spent_ns > limit_ns)
    }

    /// Whether the work is cancelled or exceeds its limit, so that it must stop.
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
    fn work_is_over_when_cancelled_or_above_its_limit() {
        let abort = Abort::default();
        let limits = [Some(2e-6), None].map(|s| WorkLimit::new(s, abort.clone()));
        let state = |limit: &WorkLimit| (limit.is_exceeded(), limit.is_over());
        // X-Val: 1500 ns and 500 ns are 2 us, one more exceeds the limit.
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
