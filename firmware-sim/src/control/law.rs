//! The controller: proportional and integral, with gains that follow from the delay that is measured.
//!
//! The body is an integrator (its error grows by the rates) behind a delay L: what a rate does is known L later. For such a body
//! Skogestad's rule (J. Process Control 13, 2003) with a closed-loop time of L gives `Kp = 1 / (2 L)` and an integral time of `8 L`: it
//! stays stable for a delay three times as long. Nobody gives gains, so none can be unstable.
//!
//! L is counted from the middle of the exposure until the steering that it led to has done half of its work: age of the frame when its
//! detections are fixed, the time until an attitude may leave, half of the time until the next frame. It rises at once and falls slowly.

use nalgebra::Vector3;

/// Fastest that is steered about any axis, rad/s.
pub const FASTEST_RAD_S: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Shortest delay that the gains are made for, s.
const SHORTEST_S: f64 = 0.02;

/// The controller's state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Law {
    /// Time between two chances to steer, s.
    acts_s: f64,
    /// L, s.
    delay_s: f64,
    /// The drift as it is thought to be, rad/s.
    integral_rad_s: Vector3<f64>,
    /// Middle of the latest exposure, s, and by what the body was turned, rad.
    latest: Option<(f64, Vector3<f64>)>,
}

impl Law {
    /// The exposure with this middle (s) is the one to hold.
    pub fn begin(&mut self, mid_s: f64) {
        self.latest = Some((mid_s, Vector3::zeros()));
    }

    /// How long it was from one chance to steer to the next, s.
    pub fn acts_every(&mut self, seconds: f64) {
        if seconds.is_finite() {
            self.acts_s = rise_or_fall(self.acts_s, seconds);
        }
    }

    /// In the middle of an exposure (s) the body was turned by `error` (rad, body axes), as was known at `taken_s`. False, and nothing
    /// else, if a later exposure has been taken.
    pub fn measured(&mut self, mid_s: f64, taken_s: f64, error: Vector3<f64>) -> bool {
        let interval_s = self.latest.map_or(0.0, |(before_s, _)| mid_s - before_s);
        // No number is neither above 0 nor not.
        if !(interval_s > 0.0 && error.norm_squared().is_finite()) {
            return false;
        }
        let delay_s = (taken_s - mid_s).max(0.0) + self.acts_s + interval_s / 2.0;
        self.delay_s = rise_or_fall(self.delay_s, delay_s).max(SHORTEST_S);
        self.latest = Some((mid_s, error));
        let integral = 1.0 / (16.0 * self.delay_s * self.delay_s);
        let gained = error * (integral * interval_s.min(2.0 * self.delay_s));
        // What cannot be steered need not be remembered.
        let most = FASTEST_RAD_S;
        self.integral_rad_s = (self.integral_rad_s + gained).map(|rate| rate.clamp(-most, most));
        true
    }

    /// The rates to steer by now (s), body axes, rad/s. An error counts for two delays: by itself it never turns the body farther
    /// than back, however long the next frame takes.
    #[must_use]
    pub fn rates(&self, now_s: f64) -> Vector3<f64> {
        let window_s = 2.0 * self.delay_s;
        let is_fresh = |mid_s: f64| window_s > 0.0 && now_s - mid_s <= window_s;
        let proportional = match self.latest {
            Some((mid_s, error)) if is_fresh(mid_s) => error / window_s,
            _ => Vector3::zeros(),
        };
        let rates = -(proportional + self.integral_rad_s);
        rates.map(|rate| rate.clamp(-FASTEST_RAD_S, FASTEST_RAD_S))
    }

    /// By what the body may be turned: as it was when it was seen last, rad, body axes.
    #[must_use]
    pub fn expected(&self) -> Vector3<f64> {
        self.latest.map_or(Vector3::zeros(), |(_, error)| error)
    }
}

/// A value that follows another up at once, down by a tenth of the way.
fn rise_or_fall(value: f64, to: f64) -> f64 {
    to.max(value + (to - value) * 0.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flies an ideal body about one axis: frames every `period_s`, taken `late_s` after their middle, steering every `acts_s`.
    /// Drift 1; gives the error at each steering.
    fn fly(
        period_s: f64,
        late_s: f64,
        acts_s: f64,
        seconds: f64,
        lost: fn(u32) -> bool,
    ) -> Vec<f64> {
        const DRIFT: f64 = 1e-4;
        let (mut law, mut errors, mut error, mut rate) = (Law::default(), Vec::new(), 0.0, 0.0);
        law.begin(0.0);
        let step_s = 1e-3;
        let mut past: Vec<f64> = Vec::new();
        let (mut frame, mut acted) = (1_u32, 0_u32);
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
            if now_s >= f64::from(acted) * acts_s {
                law.acts_every(acts_s);
                rate = law.rates(now_s).x + DRIFT;
                errors.push(error / DRIFT);
                acted += 1;
            }
            error += rate * step_s;
        }
        errors
    }

    fn most(errors: &[f64]) -> f64 {
        errors.iter().fold(0.0, |most, error| most.max(error.abs()))
    }

    #[test]
    fn a_constant_drift_is_held_at_any_latency_of_up_to_two_frames_and_more() {
        let latencies = [0.01, 0.1, 0.2, 0.5].map(|late_s| (0.1, late_s));
        for (period_s, late_s) in latencies.into_iter().chain([(0.02, 0.04), (1.0, 2.0)]) {
            let delay_s = late_s + 0.1 + period_s / 2.0;
            let errors = fly(period_s, late_s, 0.1, 120.0 * delay_s, |_| false);
            // In seconds of drift.
            let (worst, rest) = (most(&errors), most(&errors[errors.len() * 3 / 4..]));
            let case = format!("{period_s} s, {late_s} s late: {worst}, {rest}");
            assert!(worst < 3.0 * delay_s && rest < 1e-2 * delay_s, "{case}");
        }
    }

    #[test]
    fn frames_that_do_not_come_do_not_shake_it() {
        // Two of three are lost, and then ten in a row.
        let lost: [fn(u32) -> bool; 2] = [|n| !n.is_multiple_of(3), |n| (30..40).contains(&n)];
        for lost in lost {
            let errors = fly(0.1, 0.2, 0.1, 60.0, lost);
            let (worst, last) = (most(&errors), errors.last().unwrap().abs());
            assert!(worst < 2.0 && last < 0.02, "{worst} {last}");
        }
    }

    #[test]
    fn an_error_counts_for_two_delays_and_steering_has_a_limit() {
        let mut law = Law::default();
        law.begin(0.0);
        law.acts_every(0.1);
        assert!(law.measured(0.1, 0.15, Vector3::z() * 1e-4));
        // X-Val: L = 0.05 + 0.1 + 0.05 = 0.2 s, Kp = 2.5, Ki = 1 / 0.64, of 0.1 s.
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
