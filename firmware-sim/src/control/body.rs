//! A rigid body that turns as it is told.

use nalgebra::{UnitQuaternion, Vector3};

use crate::pointing::turn;

/// A body whose rates change in steps and are constant between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// ICRF to body.
    pub attitude: UnitQuaternion<f64>,
    /// Angular velocity against ICRF, body axes, rad/s.
    pub rates_rad_s: Vector3<f64>,
}

impl Body {
    /// A body that does not turn.
    #[must_use]
    pub fn at_rest(attitude: UnitQuaternion<f64>) -> Self {
        Self {
            attitude,
            rates_rad_s: Vector3::zeros(),
        }
    }

    /// Turns on for some time: exact, since the rates are constant.
    pub fn go_on(&mut self, seconds: f64) {
        self.attitude = turn(self.rates_rad_s * seconds) * self.attitude;
        // Or rounding adds up in the norm.
        self.attitude.renormalize_fast();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_steps_are_one() {
        let rates_rad_s = Vector3::new(0.3, -0.2, 0.5);
        let mut body = Body {
            rates_rad_s,
            ..Body::at_rest(UnitQuaternion::identity())
        };
        (0..100_000).for_each(|_| body.go_on(1e-4));
        // X-Val: dR/dt = -[w x] R: q(t) = exp(-w t / 2).
        let once = UnitQuaternion::from_scaled_axis(-rates_rad_s * 10.0);
        assert!(body.attitude.angle_to(&once) < 1e-10);
        assert!((body.attitude.norm() - 1.0).abs() < 1e-15);
    }
}
