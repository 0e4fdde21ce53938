//! Times of repeated work, on one thread.

use super::sample::{Cost, Sample};

/// Rounds that a time is taken of: at most, and at least.
const ROUNDS: [usize; 2] = [25, 5];
/// No more rounds once they have taken this long, ms.
const LONG_MS: f64 = 400.0;

/// What `work` takes on what `prepare` makes, and what it came to.
pub(super) fn cost<T, U>(prepare: impl Fn() -> T, mut work: impl FnMut(T) -> U) -> (Cost, U) {
    let mut round = || {
        let given = prepare();
        let started = thread_ms();
        let made = work(given);
        (thread_ms() - started, made)
    };
    // The first round finds cold caches.
    let (_, mut made) = round();
    let times = rounds(|| {
        let took;
        (took, made) = round();
        took
    });
    (Sample::new(times).median(), made)
}

/// The times of as many rounds as there is time for, ms.
pub(super) fn rounds(mut round: impl FnMut() -> f64) -> Vec<f64> {
    let ([most, least], started) = (ROUNDS, thread_ms());
    let mut times = Vec::new();
    while times.len() < least || times.len() < most && thread_ms() - started < LONG_MS {
        times.push(round());
    }
    times
}

/// A clock of what this thread has had of a processor, ms: what other programs take does not count.
#[cfg(target_os = "linux")]
pub fn thread_ms() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// A clock, ms: here it counts what other programs take too.
#[cfg(not(target_os = "linux"))]
pub fn thread_ms() -> f64 {
    use std::{sync::LazyLock, time::Instant};
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64() * 1e3
}
