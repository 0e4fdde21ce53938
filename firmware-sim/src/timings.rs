//! Times of frames as reported by the emulator: age of their attitude, time left to their deadline.

use std::fmt;
use std::time::Duration;

use skyloop_protocols::Timing;

use crate::times::Times;

/// Times of all frames that report them; frames of stepped runs do not.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Age of the attitude at the middle of the exposure.
    ages: SignedTimes,
    /// Time left to the deadline after the frame was sent.
    spares: SignedTimes,
}

impl Timings {
    /// Adds the times of a frame, if it reports any.
    pub(crate) fn add(&mut self, timing: &Timing) {
        if *timing != Timing::default() {
            self.ages.add(timing.attitude_age_s.into());
            self.spares.add(timing.spare_s.into());
        }
    }
}

impl fmt::Display for Timings {
    /// Empty, or one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |times: &SignedTimes, fraction| Some(times.quantile(fraction)? * 1e3);
        let (Some(age), Some(oldest)) = (ms(&self.ages, 0.5), ms(&self.ages, 1.0)) else {
            return Ok(());
        };
        let (Some(spare), Some(min)) = (ms(&self.spares, 0.5), ms(&self.spares, 0.0)) else {
            return Ok(());
        };
        writeln!(
            f,
            "attitude age     p50 {age:.2} ms, max {oldest:.2} ms; spare time p50 {spare:.2} ms, min {min:.2} ms"
        )
    }
}

/// A histogram of signed times, with bins of 1 % on both sides.
#[derive(Clone, Debug, Default)]
struct SignedTimes {
    /// Times of 0 or more.
    above: Times,
    /// Magnitudes of negative times.
    below: Times,
}

impl SignedTimes {
    /// Adds a time, s. NaN is ignored; values beyond `Duration` are limited to its range.
    fn add(&mut self, time_s: f64) {
        let size = Duration::try_from_secs_f64(time_s.abs()).unwrap_or(Duration::MAX);
        if time_s >= 0.0 {
            self.above.add(size);
        } else if time_s < 0.0 {
            self.below.add(size);
        }
    }

    /// Quantile of a fraction (0 to 1), by nearest rank, s; `None` without any. As exact as
    /// [`Times::quantile`].
    fn quantile(&self, fraction: f64) -> Option<f64> {
        let (below, above) = (self.below.count(), self.above.count());
        let count = below + above;
        let rank = ((fraction.clamp(0.0, 1.0) * count as f64).ceil() as u64).max(1);
        // Fraction of one side, in the middle of its rank, so that rounding does not change the
        // rank.
        let share = |rank: u64, of: u64| (rank as f64 - 0.5) / of as f64;
        // The first rank is the most negative time.
        let (side, sign, share) = if rank <= below {
            (&self.below, -1.0, share(below + 1 - rank, below))
        } else {
            (&self.above, 1.0, share(rank - below, above))
        };
        Some(sign * side.quantile(share)?.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_times_are_left_out() {
        let mut timings = Timings::default();
        timings.add(&Timing::default());
        assert_eq!(timings.to_string(), "");
        for (attitude_age_s, spare_s) in [(0.02, 0.05), (0.01, -0.002), (-0.003, 0.04)] {
            timings.add(&Timing {
                attitude_age_s,
                spare_s,
                ..Timing::default()
            });
        }
        assert_eq!(
            timings.to_string(),
            "attitude age     p50 10.00 ms, max 20.00 ms; spare time p50 40.00 ms, min -2.00 ms\n"
        );
    }

    #[test]
    fn quantiles_agree_with_the_sorted_list_to_half_a_percent() {
        let all = [
            -3.0, -0.5, -2e-3, 0.0, 1e-3, 4e-3, 4e-3, 0.02, 0.3, 7.0, 90.0,
        ];
        // All, one sign alone, one time.
        for list in [&all[..], &all[..3], &all[4..], &all[..1], &all[3..4]] {
            let mut times = SignedTimes::default();
            list.iter().rev().for_each(|time_s| times.add(*time_s));
            times.add(f64::NAN);
            for percent in 0..=100 {
                let rank = (percent * list.len()).div_ceil(100).max(1);
                let (exact, found) = (
                    list[rank - 1],
                    times.quantile(percent as f64 / 100.0).unwrap(),
                );
                let off = (found - exact).abs();
                let ends = rank == 1 || rank == list.len();
                let max = if ends { 0.0 } else { 5e-3 * exact.abs() + 1e-9 };
                assert!(off <= max, "{list:?} {percent} %: {found}, not {exact}");
            }
        }
    }

    #[test]
    fn empty_histograms_and_infinite_times_are_handled() {
        let mut times = SignedTimes::default();
        assert_eq!(times.quantile(0.5), None);
        times.add(f64::NEG_INFINITY);
        assert_eq!(times.quantile(0.5), Some(-Duration::MAX.as_secs_f64()));
        times.add(f64::INFINITY);
        assert_eq!(times.quantile(1.0), Some(Duration::MAX.as_secs_f64()));
    }
}
