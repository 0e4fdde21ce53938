//! What the emulator says of its frames' times: the age of their attitudes, the time left until their deadlines.

use std::fmt;

use skyloop_protocols::Timing;

use crate::signed_times::SignedTimes;

/// Times of the frames that have any; those of stepped runs have none.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Age of the attitude at the middle of the exposure.
    ages: SignedTimes,
    /// Time left until the deadline when the frame had left.
    spares: SignedTimes,
}

impl Timings {
    /// Adds those of a frame, if it has any.
    pub fn add(&mut self, timing: &Timing) {
        if *timing != Timing::default() {
            self.ages.add(timing.attitude_age_s.into());
            self.spares.add(timing.spare_s.into());
        }
    }

    /// Half of the attitudes are of this age or less at the middle of the exposure, and all of that: s; `None` without any.
    #[must_use]
    pub fn ages_s(&self) -> Option<(f64, f64)> {
        Some((self.ages.quantile(0.5)?, self.ages.quantile(1.0)?))
    }

    /// Half of the frames had this time left or less, and the last of all that: s; `None` without any.
    #[must_use]
    pub fn spares_s(&self) -> Option<(f64, f64)> {
        Some((self.spares.quantile(0.5)?, self.spares.quantile(0.0)?))
    }
}

impl fmt::Display for Timings {
    /// Nothing, or a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Some((age, oldest)), Some((spare, least))) = (self.ages_s(), self.spares_s()) else {
            return Ok(());
        };
        writeln!(
            f,
            "attitude age     p50 {:.2} ms, max {:.2} ms; spare time p50 {:.2} ms, min {:.2} ms",
            age * 1e3,
            oldest * 1e3,
            spare * 1e3,
            least * 1e3
        )
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
}
