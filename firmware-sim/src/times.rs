//! A logarithmic histogram of durations; its size does not depend on the length of a run.

use std::time::Duration;

/// Lower edge of the first bin, s.
const FIRST_S: f64 = 1e-6;
/// Upper edge of a bin over its lower edge.
const STEP: f64 = 1.01;
/// Number of bins up to 1000 s: ln(1e9) / ln(1.01) = 2082.7. The end bins include everything
/// beyond.
const BINS: usize = 2083;

/// A histogram of durations with bins of 1 % from 1 microsecond to 1000 s.
#[derive(Clone, Debug)]
pub struct Times {
    bins: Box<[u64; BINS]>,
    count: u64,
    sum: Duration,
    min: Duration,
    max: Duration,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            bins: Box::new([0; BINS]),
            count: 0,
            sum: Duration::ZERO,
            min: Duration::MAX,
            max: Duration::ZERO,
        }
    }
}

impl Times {
    /// Adds a duration.
    pub fn add(&mut self, time: Duration) {
        // The cast saturates at 0 for durations below the first bin.
        self.bins[(bin_position(time) as usize).min(BINS - 1)] += 1;
        self.count += 1;
        self.sum = self.sum.saturating_add(time);
        self.min = self.min.min(time);
        self.max = self.max.max(time);
    }

    /// Number of durations.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Sum of all durations, limited to the range of `Duration`.
    #[must_use]
    pub fn sum(&self) -> Duration {
        self.sum
    }

    /// Number of durations up to `bound`, rising with the bound.
    ///
    /// Exact at and beyond the shortest and the longest duration. In between, durations in the
    /// bound's own bin count as its middle, as in [`Times::quantile`].
    #[must_use]
    pub fn within(&self, bound: Duration) -> u64 {
        if bound >= self.max {
            return self.count;
        }
        if bound < self.min {
            return 0;
        }
        // Bins with a middle below the bound. The shortest duration is within, the longest is not.
        let bins = (bin_position(bound) + 0.5).floor() as usize;
        let within: u64 = self.bins.iter().take(bins).sum();
        within.clamp(1, self.count - 1)
    }

    /// Quantile of a fraction (0 to 1), by nearest rank; `None` without any.
    ///
    /// The shortest and the longest are exact; others are the middle of their bin, with an error of
    /// up to 0.5 % from 1 microsecond to 1000 s (and half a nanosecond).
    #[must_use]
    pub fn quantile(&self, fraction: f64) -> Option<Duration> {
        if self.count == 0 {
            return None;
        }
        let rank = (fraction.clamp(0.0, 1.0) * self.count as f64).ceil() as u64;
        if rank <= 1 {
            return Some(self.min);
        }
        if rank >= self.count {
            return Some(self.max);
        }
        let mut within = 0;
        let bin = self.bins.iter().position(|count| {
            within += count;
            within >= rank
        })?;
        let middle_s = FIRST_S * libm::pow(STEP, bin as f64 + 0.5);
        Some(Duration::from_secs_f64(middle_s).clamp(self.min, self.max))
    }
}

/// Position of a duration on the bin axis, from the lower edge of the first bin.
fn bin_position(time: Duration) -> f64 {
    libm::log(time.as_secs_f64() / FIRST_S) / libm::log(STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number, shortest in s, decades: the whole range; typical times of a run; three times.
    const RUNS: [(u64, f64, f64); 3] = [(9999, 1e-6, 9.0), (1000, 5e-3, 1.0), (3, 0.1, 0.1)];

    fn of(list: &[Duration]) -> Times {
        let mut times = Times::default();
        list.iter().for_each(|time| times.add(*time));
        times
    }

    /// Durations from `low` on, evenly distributed by logarithm over `decades`, unsorted.
    fn spread(count: u64, low: f64, decades: f64) -> Vec<Duration> {
        let fraction = |n: u64| (n as f64 * 0.618_033_988_749_895).fract();
        let second = |n| low * 10_f64.powf(decades * fraction(n));
        let times = (0..count).map(|n| Duration::from_secs_f64(second(n)));
        times.collect()
    }

    #[test]
    fn quantiles_agree_with_the_sorted_list_to_half_a_percent() {
        for (count, low, decades) in RUNS.into_iter().chain([(1, 7.0, 0.0)]) {
            let mut sorted = spread(count, low, decades);
            let times = of(&sorted);
            sorted.sort_unstable();
            assert_eq!(times.count(), count);
            for fraction in [0.0, 0.001, 0.01, 0.3, 0.5, 0.9, 0.99, 0.999, 1.0] {
                let rank = ((fraction * count as f64).ceil() as usize).max(1);
                let (exact, found) = (sorted[rank - 1], times.quantile(fraction).unwrap());
                let off = found.abs_diff(exact);
                let ends = rank == 1 || rank == sorted.len();
                let max = if ends {
                    Duration::ZERO
                } else {
                    exact / 200 + Duration::from_nanos(1)
                };
                assert!(off <= max, "{count} {fraction}: {found:?}, not {exact:?}");
            }
        }
    }

    #[test]
    fn durations_beyond_the_bins_are_counted_within_min_and_max() {
        assert_eq!(Times::default().quantile(0.5), None);
        let (short, long) = (Duration::ZERO, Duration::MAX);
        let times = of(&[short, short, Duration::from_secs(1), long, long]);
        assert_eq!(times.quantile(0.2), Some(short));
        assert!(times.quantile(0.4).unwrap() < Duration::from_micros(2));
        assert!((times.quantile(0.6).unwrap().as_secs_f64() - 1.0).abs() < 5e-3);
        assert!(times.quantile(0.8).unwrap() >= Duration::from_secs(990));
        assert_eq!(times.quantile(1.0), Some(long));
        let short = of(&[Duration::from_nanos(3); 3]);
        assert_eq!(short.quantile(0.5), Some(Duration::from_nanos(3)));
    }

    #[test]
    fn counts_within_a_bound_agree_with_the_list_to_half_a_percent() {
        for (count, low, decades) in RUNS {
            let list = spread(count, low, decades);
            let times = of(&list);
            let exact = |bound_s: f64| {
                let within = list.iter().filter(|time| time.as_secs_f64() <= bound_s);
                within.count() as u64
            };
            let mut before = 0;
            for step in 0..=200 {
                let bound_s = 1e-7 * 10_f64.powf(f64::from(step) * 0.055);
                let within = times.within(Duration::from_secs_f64(bound_s));
                let range = exact(bound_s * 0.995 - 1e-9)..=exact(bound_s * 1.005 + 1e-9);
                assert!(range.contains(&within), "{bound_s}: {within}, {range:?}");
                assert!(within >= before, "{bound_s}: {within} after {before}");
                before = within;
            }
            assert_eq!(before, count);
        }
    }

    #[test]
    fn counts_at_the_extremes_are_exact() {
        assert_eq!(Times::default().within(Duration::MAX), 0);
        let ms = Duration::from_millis;
        let times = of(&[ms(3), ms(5), ms(5), ms(8)]);
        // X-Val: by hand.
        let bounds = [(2, 0), (3, 1), (4, 1), (6, 3), (7, 3), (8, 4), (9, 4)];
        for (bound, count) in bounds {
            assert_eq!(times.within(ms(bound)), count, "{bound} ms");
        }
        assert_eq!(of(&[Duration::ZERO; 2]).within(Duration::ZERO), 2);
        // Both durations are in one bin.
        for start in (1..200).map(|n| Duration::from_micros(1000 * n)) {
            let next = start + Duration::from_nanos(10);
            assert_eq!(of(&[start, next]).within(start), 1, "{start:?}");
        }
    }

    #[test]
    fn the_sum_includes_all_and_saturates() {
        assert_eq!(Times::default().sum(), Duration::ZERO);
        let ms = Duration::from_millis;
        // X-Val: by hand.
        assert_eq!(of(&[ms(3), ms(5), ms(8)]).sum(), ms(16));
        assert_eq!(of(&[Duration::MAX, ms(1)]).sum(), Duration::MAX);
    }
}
