//! The controller: proportional and integral, with gains from the measured delay.
//!
//! The body integrates the rates behind a delay L: the effect of a rate is measured L later. For
//! such a body Skogestad's rule (J. Process Control 13, 2003) with a closed-loop time of L gives
//! `Kp = 1 / (2 L)` and an integral time of `8 L`. It stays stable for a delay three times as long.
//! No gain is a setting, so no setting makes the loop unstable.
//!
//! L runs from the middle of an exposure to the mean effect of its correction. It is the age of the
//! frame when its detections are fixed, plus the attitude period, plus half the frame interval. It
//! rises at once and falls slowly.

use nalgebra::Vector3;

/// Fastest steering rate about any axis, rad/s.
pub(crate) const FASTEST_RAD_S: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Shortest delay for the gains, s.
const SHORTEST_S: f64 = 0.02;

/// The controller's state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Law {
    steer_period_s: f64,
    /// L, s.
    delay_s: f64,
    /// Estimated drift, rad/s.
    integral_rad_s: Vector3<f64>,
    /// Middle of the latest exposure, s, and the measured error, rad.
    latest: Option<(f64, Vector3<f64>)>,
}

impl Law {
    /// Starts the loop at the reference exposure with this middle (s).
    pub(crate) fn begin(&mut self, mid_s: f64) {
        self.latest = Some((mid_s, Vector3::zeros()));
    }

    /// Updates the attitude period, s.
    pub(crate) fn set_steer_period(&mut self, seconds: f64) {
        if seconds.is_finite() {
            self.steer_period_s = rise_or_fall(self.steer_period_s, seconds);
        }
    }

    /// Adds a measurement: the body's error (rad, body axes) in the middle of an exposure (s),
    /// available at `taken_s`. False, without effect, if a later exposure has been taken.
    pub(crate) fn measured(&mut self, mid_s: f64, taken_s: f64, error: Vector3<f64>) -> bool {
        let interval_s = self.latest.map_or(0.0, |(before_s, _)| mid_s - before_s);
        // Written so that NaN fails.
        if !(interval_s > 0.0 && error.norm_squared().is_finite()) {
            return false;
        }
        let delay_s = (taken_s - mid_s).max(0.0) + self.steer_period_s + interval_s / 2.0;
        self.delay_s = rise_or_fall(self.delay_s, delay_s).max(SHORTEST_S);
        self.latest = Some((mid_s, error));
        let integral = 1.0 / (16.0 * self.delay_s * self.delay_s);
        let increment = error * (integral * interval_s.min(2.0 * self.delay_s));
        // Anti-windup: limited to the fastest steering rate.
        let limit = |rate: f64| rate.clamp(-FASTEST_RAD_S, FASTEST_RAD_S);
        self.integral_rad_s = (self.integral_rad_s + increment).map(limit);
        true
    }

    /// Steering rates at a time (s), body axes, rad/s. An error is used for two delays only, so
    /// that it never turns the body past zero, however late the next frame is.
    #[must_use]
    pub(crate) fn rates(&self, now_s: f64) -> Vector3<f64> {
        let window_s = 2.0 * self.delay_s;
        let is_fresh = |mid_s: f64| window_s > 0.0 && now_s - mid_s <= window_s;
        let proportional = match self.latest {
            Some((mid_s, error)) if is_fresh(mid_s) => error / window_s,
            _ => Vector3::zeros(),
        };
        let rates = -(proportional + self.integral_rad_s);
        rates.map(|rate| rate.clamp(-FASTEST_RAD_S, FASTEST_RAD_S))
    }

    /// The latest measured error, rad, body axes.
    #[must_use]
    pub(crate) fn latest_error_rad(&self) -> Vector3<f64> {
        self.latest.map_or(Vector3::zeros(), |(_, error)| error)
    }
}

/// Follows a value: upwards at once, downwards by a tenth of the difference.
fn rise_or_fall(value: f64, to: f64) -> f64 {
    to.max(value + (to - value) * 0.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of an ideal body about one axis at each steering, over the drift. Frames come every
    /// `period_s` and `late_s` after their middle; steering is every `steer_period_s`.
    fn simulate(
        period_s: f64,
        late_s: f64,
        steer_period_s: f64,
        seconds: f64,
        lost: fn(u32) -> bool,
    ) -> Vec<f64> {
        const DRIFT: f64 = 1e-4;
        let (mut law, mut errors, mut error, mut rate) = (Law::default(), Vec::new(), 0.0, 0.0);
        law.begin(0.0);
        let step_s = 1e-3;
        let mut past: Vec<f64> = Vec::new();
        let (mut frame, mut steered) = (1_u32, 0_u32);
        for tick in 0..(seconds / step_s) as usize {
            let now_s = tick as f64 * step_s;
            past.push(error);
            let mid_s = f64::from(frame) * period_s;
            if now_s >= mid_s + late_s {
                let seen = past[(mid_s / step_s) as usize];
                if !lost(frame) {
                    assert!(law.measured(mid_s, now_s, Vector3::x() * seen));
                }
                frame += 1;
            }
            if now_s >= f64::from(steered) * steer_period_s {
                law.set_steer_period(steer_period_s);
                rate = law.rates(now_s).x + DRIFT;
                errors.push(error / DRIFT);
                steered += 1;
            }
            error += rate * step_s;
        }
        errors
    }

    fn max_abs(errors: &[f64]) -> f64 {
        errors.iter().fold(0.0, |max, error| max.max(error.abs()))
    }

    #[test]
    fn constant_drift_is_corrected_for_delays_beyond_two_frames() {
        let latencies = [0.01, 0.1, 0.2, 0.5].map(|late_s| (0.1, late_s));
        for (period_s, late_s) in latencies.into_iter().chain([(0.02, 0.04), (1.0, 2.0)]) {
            let delay_s = late_s + 0.1 + period_s / 2.0;
            let errors = simulate(period_s, late_s, 0.1, 120.0 * delay_s, |_| false);
            // Errors in seconds of drift.
            let (worst, rest) = (max_abs(&errors), max_abs(&errors[errors.len() * 3 / 4..]));
            let case = format!("{period_s} s, {late_s} s late: {worst}, {rest}");
            assert!(worst < 3.0 * delay_s && rest < 1e-2 * delay_s, "{case}");
        }
    }

    #[test]
    fn lost_frames_do_not_destabilize_the_loop() {
        // Two of three frames are lost, or ten in a row.
        let lost: [fn(u32) -> bool; 2] = [|n| !n.is_multiple_of(3), |n| (30..40).contains(&n)];
        for lost in lost {
            let errors = simulate(0.1, 0.2, 0.1, 60.0, lost);
            let (worst, last) = (max_abs(&errors), errors.last().unwrap().abs());
            assert!(worst < 2.0 && last < 0.02, "{worst} {last}");
        }
    }

    #[test]
    fn errors_expire_after_two_delays_and_rates_are_limited() {
        let mut law = Law::default();
        law.begin(0.0);
        law.set_steer_period(0.1);
        assert!(law.measured(0.1, 0.15, Vector3::z() * 1e-4));
        // X-Val: L = 0.05 + 0.1 + 0.05 = 0.2 s, Kp = 2.5, Ki = 1 / 0.64, over 0.1 s.
        let integral = 1e-4 * 0.1 / 0.64;
        assert!((law.delay_s - 0.2).abs() < 1e-12);
        assert!((law.rates(0.2).z + 2.5e-4 + integral).abs() < 1e-12);
        assert!((law.rates(0.6).z + integral).abs() < 1e-12);
        assert!(!law.measured(0.1, 0.2, Vector3::zeros()), "the same again");
        assert!(!law.measured(f64::NAN, 0.2, Vector3::zeros()));
        assert!(!law.measured(0.2, 0.2, Vector3::repeat(f64::NAN)));
        assert!(law.measured(0.2, 0.25, Vector3::repeat(-10.0)));
        assert_eq!(law.rates(0.25), Vector3::repeat(FASTEST_RAD_S));
    }
}
