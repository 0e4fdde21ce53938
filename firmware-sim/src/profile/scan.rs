//! A periodic scan about a body axis.

use hifitime::Epoch;
use nalgebra::{Unit, UnitQuaternion, Vector3};

use crate::pointing::{Pointing, turn};

/// Longest turn-round, s. A scan that covers its half width in less time turns round in that time.
pub(crate) const TURN_ROUND_S: f64 = 0.5;

/// A periodic scan to both sides of a start attitude about a body axis. It also covers the time
/// before its start.
///
/// The angle is a triangle wave with rounded corners. The rate is constant, with a constant
/// acceleration at each end, so that angle and rate are continuous. It starts in the middle,
/// towards positive angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scan {
    start: Epoch,
    attitude: UnitQuaternion<f64>,
    axis: Unit<Vector3<f64>>,
    half_width_rad: f64,
    rate_rad_s: f64,
}

impl Scan {
    /// A scan through `attitude` (ICRF to body) at `start`, about `axis` (body), by
    /// `half_width_rad` to either side at `rate_rad_s`. `None` unless both are finite and above 0.
    #[must_use]
    pub fn new(
        start: Epoch,
        attitude: UnitQuaternion<f64>,
        axis: Unit<Vector3<f64>>,
        half_width_rad: f64,
        rate_rad_s: f64,
    ) -> Option<Self> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        (positive(half_width_rad) && positive(rate_rad_s)).then_some(Self {
            start,
            attitude,
            axis,
            half_width_rad,
            rate_rad_s,
        })
    }

    /// Duration of a turn-round, s: `TURN_ROUND_S`, or the time for the half width if that is
    /// shorter.
    #[must_use]
    pub(crate) fn turn_round_s(&self) -> f64 {
        TURN_ROUND_S.min(self.half_width_rad / self.rate_rad_s)
    }

    /// Duration of one cycle, s: four half widths and one turn-round, because a turn-round takes
    /// twice the time of the corner that it replaces.
    #[must_use]
    pub(crate) fn period_s(&self) -> f64 {
        4.0 * self.half_width_rad / self.rate_rad_s + self.turn_round_s()
    }

    /// The angle from the start attitude, rad, and its rate, rad/s.
    fn angle(&self, seconds: f64) -> (f64, f64) {
        let (rate, turning) = (self.rate_rad_s, self.turn_round_s());
        let half_period = self.period_s() / 2.0;
        // From the middle to the start of the turn-round, whose first half adds rate * turning / 4.
        let straight = self.half_width_rad / rate - turning / 4.0;
        let since = seconds + straight;
        let half_cycle = (since / half_period).floor();
        let into = since - half_cycle * half_period;
        let sign = 1.0 - 2.0 * half_cycle.rem_euclid(2.0);
        if into < 2.0 * straight {
            return (sign * rate * (into - straight), sign * rate);
        }
        let from_turn = into - 2.0 * straight - turning / 2.0;
        let acceleration = 2.0 * rate / turning;
        (
            sign * (self.half_width_rad - acceleration * from_turn * from_turn / 2.0),
            -sign * acceleration * from_turn,
        )
    }

    /// Attitude and rates at `epoch`.
    pub(super) fn at(&self, epoch: Epoch) -> Pointing {
        let (angle, rate) = self.angle((epoch - self.start).to_seconds());
        Pointing {
            attitude: turn(self.axis.into_inner() * angle) * self.attitude,
            rates_rad_s: self.axis.into_inner() * rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan_of(half_width_rad: f64, rate_rad_s: f64) -> Option<Scan> {
        let start = Epoch::from_gregorian_utc_at_midnight(2019, 6, 15);
        let (attitude, axis) = (UnitQuaternion::identity(), Vector3::y_axis());
        Scan::new(start, attitude, axis, half_width_rad, rate_rad_s)
    }

    fn scan(half_width_rad: f64, rate_rad_s: f64) -> Scan {
        scan_of(half_width_rad, rate_rad_s).unwrap()
    }

    #[test]
    fn the_angle_is_a_triangle_with_rounded_corners() {
        let scan = scan(0.1, 0.05);
        // X-Val: 4 * 0.1 / 0.05 + 0.5 = 8.5 s. The turn-round begins at 2 - 0.125 = 1.875 s and
        // 0.09375 rad, has its extreme (0.1 rad) 0.25 s later, and ends at 2.375 s. The middle
        // follows after half a period.
        assert_eq!((scan.turn_round_s(), scan.period_s()), (0.5, 8.5));
        for (seconds, angle, rate) in [
            (0.0, 0.0, 0.05),
            (1.0, 0.05, 0.05),
            (1.875, 0.09375, 0.05),
            (2.125, 0.1, 0.0),
            (2.375, 0.09375, -0.05),
            (4.25, 0.0, -0.05),
            (6.375, -0.1, 0.0),
            (8.5, 0.0, 0.05),
            (-1.0, -0.05, 0.05),
            (-2.125, -0.1, 0.0),
            (8.5e6 + 1.0, 0.05, 0.05),
        ] {
            let (is_angle, is_rate) = scan.angle(seconds);
            assert!((is_angle - angle).abs() < 1e-9, "{seconds}: {is_angle}");
            assert!((is_rate - rate).abs() < 1e-9, "{seconds}: {is_rate}");
        }
    }

    #[test]
    fn angle_and_rate_are_continuous_and_consistent() {
        // The second scan turns round in 10 ms, the time for its half width.
        for scan in [scan(0.1, 0.05), scan(0.001, 0.1), scan(3.0, 6.0)] {
            let turning = scan.turn_round_s();
            let limit = 2.0 * scan.rate_rad_s / turning;
            let step = scan.period_s() / 10_007.0;
            let mut widest = 0.0_f64;
            for index in -12_000..24_000 {
                let at = f64::from(index) * step;
                let ((a, rate_a), (b, rate_b)) = (scan.angle(at), scan.angle(at + step));
                // Limited by the constant acceleration.
                assert!((rate_b - rate_a).abs() <= limit * step * (1.0 + 1e-6) + 1e-12);
                // The trapezoidal rule is exact except at jumps of the acceleration within the
                // step.
                let mean = (rate_a + rate_b) / 2.0;
                let off = (b - a - mean * step).abs();
                assert!(off <= limit * step * step / 8.0 + 1e-12, "{at}");
                widest = widest.max(a.abs());
            }
            let off = widest / scan.half_width_rad - 1.0;
            assert!(off.abs() < 1e-5, "{widest}");
        }
    }

    #[test]
    fn invalid_scans_are_none() {
        let infinite = (1.0, f64::INFINITY);
        for (half_width, rate) in [(0.0, 1.0), (1.0, 0.0), (f64::NAN, 1.0), infinite] {
            assert!(scan_of(half_width, rate).is_none());
        }
    }
}
