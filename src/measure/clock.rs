//! Times of repeated work, on one thread.

use super::sample::{Cost, Sample};

/// Maximum and minimum number of timed rounds.
const ROUNDS: [usize; 2] = [25, 5];
/// No further rounds after this time, ms.
const LONG_MS: f64 = 400.0;

/// Time of `work` on the result of `prepare`, and the result of the work.
pub(super) fn cost<T, U>(prepare: impl Fn() -> T, mut work: impl FnMut(T) -> U) -> (Cost, U) {
    let mut round = || {
        let given = prepare();
        let started = thread_ms();
        let made = work(given);
        (thread_ms() - started, made)
    };
    // The first round has cold caches.
    let (_, mut made) = round();
    let times = rounds(|| {
        let took;
        (took, made) = round();
        took
    });
    (Sample::new(times).median(), made)
}

/// The times of rounds within the limits, ms.
pub(super) fn rounds(mut round: impl FnMut() -> f64) -> Vec<f64> {
    let ([max, min], started) = (ROUNDS, thread_ms());
    let mut times = Vec::new();
    while times.len() < min || times.len() < max && thread_ms() - started < LONG_MS {
        times.push(round());
    }
    times
}

/// Processor time of this thread, ms; time of other programs does not count.
#[cfg(target_os = "linux")]
pub fn thread_ms() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// Elapsed real time, ms; it includes time of other programs.
#[cfg(not(target_os = "linux"))]
pub fn thread_ms() -> f64 {
    use std::{sync::LazyLock, time::Instant};
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64() * 1e3
}
