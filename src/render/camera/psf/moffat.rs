//! Moffat's profile (1969, A&A 3, 455): `I(r) ~ (1 + r^2 / alpha^2)^-beta`; a core with wings of
//! scattered light.
//!
//! Encircled energy `E(r) = 1 - (1 + r^2 / alpha^2)^(1 - beta)`. Unit of width: the full width at
//! half maximum, `2 alpha sqrt(2^(1/beta) - 1)`.

use super::circular::Quadrant;
use skyloop_base::range::nearest;
use std::f64::consts::PI;

/// Parameters and table of a Moffat profile.
#[derive(Debug, PartialEq)]
pub struct Moffat {
    /// Exponent (1).
    beta: f64,
    /// `alpha` in units of the full width at half maximum.
    alpha: f64,
    table: Quadrant,
}

/// Steps of the table.
const STEPS: usize = 320;
/// Radius at which they begin to grow, in units of the full width.
const KNEE: f64 = 4.0;

impl Moffat {
    /// The profile of exponent `beta`, limited to 1.1 to 100: at 1 its light is infinite.
    pub fn new(beta: f64) -> Moffat {
        let beta = nearest(beta, 1.1..=100.0);
        let alpha = 0.5 / (libm::pow(2.0, 1.0 / beta) - 1.0).sqrt();
        Moffat {
            beta,
            alpha,
            table: Quadrant::new(KNEE, STEPS, |r| 1.0 - outside(r / alpha, beta)),
        }
    }

    /// The table of its light.
    pub fn table(&self) -> &Quadrant {
        &self.table
    }

    /// The radius outside of which `loss` of the light falls.
    pub(crate) fn reach(&self, loss: f64) -> f64 {
        self.alpha
            * (libm::pow(loss, 1.0 / (1.0 - self.beta)) - 1.0)
                .max(0.0)
                .sqrt()
    }

    /// The radius outside of which the light per unit area is below `share`.
    pub(crate) fn faint(&self, share: f64) -> f64 {
        let peak = (self.beta - 1.0) / (PI * self.alpha * self.alpha);
        self.alpha
            * (libm::pow(share / peak, -1.0 / self.beta) - 1.0)
                .max(0.0)
                .sqrt()
    }
}

fn outside(r: f64, beta: f64) -> f64 {
    libm::pow(1.0 + r * r, 1.0 - beta)
}
