//! The threads that share the work on a frame.

use rayon::Yield;
use std::hint;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Barrier, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Does `work` on a thread of the pool, while another stays awake to share it, and of more some;
/// when it is done they have finished what else they began.
///
/// A frame has a dozen parts that are shared out, with others between them. A thread that goes to
/// sleep in between takes up to a millisecond to wake: of a frame of 200,000 objects every 0.1 s
/// all threads but one would sleep through most.
pub fn together<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let done = AtomicBool::new(false);
    rayon::scope(|scope| {
        // These tasks lie before any that the work hands out, and other threads take the first
        // before the later: whoever waits for a part of the work, which another thread has taken,
        // does not come upon one of them, and so does not wait for himself.
        for _ in 1..rayon::current_num_threads() {
            scope.spawn(|_| stay(&done));
        }
        // Of work that panics, too.
        let _done = WhenDropped(&done);
        work()
    })
}

/// Does `work` on this thread of the pool, of those from 0 on, while others share it or, where it
/// is done `alone`, do nothing; nothing if there is none of that number. One at a time: alone it
/// waits for all threads.
pub fn led_by<R: Send>(leader: usize, alone: bool, work: impl FnOnce() -> R + Send) -> Option<R> {
    let threads = rayon::current_num_threads();
    if leader >= threads {
        return None;
    }
    let (work, done) = (Mutex::new(Some(work)), AtomicBool::new(false));
    // Whoever comes later could take up a part of the work first, and then wait in the midst of it
    // for its end.
    let all_here = Barrier::new(threads);
    let led = rayon::broadcast(|thread| {
        if alone {
            all_here.wait();
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
    led.into_iter().flatten().next()
}

/// Without work for so long a thread goes to sleep after all: longer than between two parts of most
/// frames.
const PATIENCE: Duration = Duration::from_micros(500);

/// Takes its share until it is done.
fn stay(done: &AtomicBool) {
    let mut idle_since = Instant::now();
    while !done.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(Yield::Executed) {
            idle_since = Instant::now();
        } else if idle_since.elapsed() > PATIENCE {
            return;
        } else {
            // Not `yield_now`: it would lend the processor to another program for milliseconds.
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

    /// Parts within parts, in pools of several sizes, side by side with other work in the same
    /// pool.
    #[test]
    fn the_work_is_done_however_many_share_it() {
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
    fn each_thread_can_take_the_lead() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3);
        let pool = pool.build().unwrap();
        // Numbers with the thread that saw each.
        let led = |leader, alone| {
            led_by(leader, alone, || {
                let seen = |i: u64| (i, rayon::current_thread_index());
                together(|| (0..100).into_par_iter().map(seen).collect::<Vec<_>>())
            })
        };
        pool.install(|| {
            for leader in [0, 1, 2].repeat(50) {
                let seen = led(leader, true).unwrap();
                assert!(seen.into_iter().eq((0..100).map(|i| (i, Some(leader)))));
                let seen = led(leader, false).unwrap();
                assert!(seen.into_iter().map(|(i, _)| i).eq(0..100));
            }
            assert_eq!(led(3, true), None);
        });
    }

    #[test]
    fn work_that_panics_lets_the_others_go() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3);
        let pool = pool.build().unwrap();
        let panics = || pool.install(|| together(|| panic!("as it should")));
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(panics)).is_err());
        assert_eq!(pool.install(|| together(|| 7)), 7);
    }
}
