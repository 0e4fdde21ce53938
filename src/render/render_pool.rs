//! The thread pool that renders a frame.

use rayon::Yield;
use std::hint;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Barrier, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Runs `work` on a thread of the pool while the others stay awake to share it.
///
/// A frame has a dozen parallel parts with serial parts between them. A thread that sleeps in
/// between takes up to a millisecond to wake up: in a frame of 200,000 objects every 0.1 s, all
/// threads but one would miss most parts.
pub fn together<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let done = AtomicBool::new(false);
    rayon::scope(|scope| {
        // These tasks are queued first, and other threads steal the oldest first. So a thread that
        // waits for a part of the work does not pick up one of these, which would be a deadlock.
        for _ in 1..rayon::current_num_threads() {
            scope.spawn(|_| stay(&done));
        }
        // Sets `done` even if the work panics.
        let _done = WhenDropped(&done);
        work()
    })
}

/// Runs `work` on the pool's thread number `leader`, from 0. The other threads share it or, if
/// `alone`, stay idle. None if there is no such thread. Calls must not overlap: with `alone` each
/// waits for all threads.
pub(crate) fn run_on<R: Send>(
    leader: usize,
    alone: bool,
    work: impl FnOnce() -> R + Send,
) -> Option<R> {
    let threads = rayon::current_num_threads();
    if leader >= threads {
        return None;
    }
    let (work, done) = (Mutex::new(Some(work)), AtomicBool::new(false));
    // Otherwise a late thread could steal a part of the work and, within it, start its own closure,
    // which waits for the end of the work.
    let all_ready = Barrier::new(threads);
    let results = rayon::broadcast(|thread| {
        if alone {
            all_ready.wait();
        }
        if thread.index() == leader {
            let _done = WhenDropped(&done);
            let work = work.lock().unwrap_or_else(PoisonError::into_inner).take();
            return work.map(|work| work());
        }
        while alone && !done.load(Ordering::Acquire) {
            std::thread::sleep(Duration::from_micros(50));
        }
        None
    });
    results.into_iter().flatten().next()
}

/// An idle thread sleeps after this time: longer than the serial parts of most frames.
const TIMEOUT: Duration = Duration::from_micros(500);

/// Executes tasks of the pool until `done`.
fn stay(done: &AtomicBool) {
    let mut idle_since = Instant::now();
    while !done.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(Yield::Executed) {
            idle_since = Instant::now();
        } else if idle_since.elapsed() > TIMEOUT {
            return;
        } else {
            // Not `yield_now`: another program could occupy the processor for milliseconds.
            (0..20).for_each(|_| hint::spin_loop());
        }
    }
}

struct WhenDropped<'a>(&'a AtomicBool);

impl Drop for WhenDropped<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// Nested parts, in pools of several sizes, in parallel with other work in the same pool.
    #[test]
    fn nested_work_completes_in_pools_of_any_size() {
        let sum = || -> u64 {
            let row = |i: u64| (0..50u64).into_par_iter().map(|k| i * k).sum::<u64>();
            (0..100u64).into_par_iter().map(row).sum()
        };
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| {
                for _ in 0..200 {
                    // X-Val: (0 + .. + 99) (0 + .. + 49)
                    assert_eq!(together(sum), 4950 * 1225);
                    let (a, b) = rayon::join(|| together(sum), || together(|| together(sum)));
                    assert_eq!((a, b), (4950 * 1225, 4950 * 1225));
                }
            });
        }
    }

    #[test]
    fn each_thread_can_lead() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3);
        let pool = pool.build().unwrap();
        // Numbers, with the thread of each.
        let led_by = |leader, alone| {
            run_on(leader, alone, || {
                let seen = |i: u64| (i, rayon::current_thread_index());
                together(|| (0..100).into_par_iter().map(seen).collect::<Vec<_>>())
            })
        };
        pool.install(|| {
            for leader in [0, 1, 2].repeat(50) {
                let seen = led_by(leader, true).unwrap();
                assert!(seen.into_iter().eq((0..100).map(|i| (i, Some(leader)))));
                let seen = led_by(leader, false).unwrap();
                assert!(seen.into_iter().map(|(i, _)| i).eq(0..100));
            }
            assert_eq!(led_by(3, true), None);
        });
    }

    #[test]
    fn a_panic_releases_the_other_threads() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3);
        let pool = pool.build().unwrap();
        let panics = || pool.install(|| together(|| panic!("as it should")));
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics)).is_err());
        assert_eq!(pool.install(|| together(|| 7)), 7);
    }
}
