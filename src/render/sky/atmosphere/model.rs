//! The air and the airglow in the camera's band.

use super::air::{self, Air};
use super::airglow::Airglow;
use super::curve::Curve;
use super::shells::Shells;
use crate::camera::Band;

/// The atmosphere as a band sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Atmosphere {
    pub(super) air: Air,
    pub(super) airglow: Airglow,
    /// The same in shells.
    pub(super) shells: Shells,
    /// `sum E s exp(-s N)`, ph/s: what a molecule takes from the Sun's light behind a column, at 1 au.
    pub(super) scattered: Curve,
    /// `sum E exp(-s N) / sum E`: the part of the Sun's light that passes a column (1).
    pub(super) passed: Curve,
}

impl Atmosphere {
    /// Of a band. Costs some milliseconds: make it once a camera.
    pub fn of(band: &Band) -> Atmosphere {
        let sun: Vec<[f64; 2]> = band
            .sun_spectrum()
            .map(|(wavelength_m, photons)| [photons, air::cross_section_m2(wavelength_m)])
            .collect();
        let all: f64 = sun.iter().map(|[e, _]| e).sum();
        let curve = |weight: &dyn Fn(f64, f64) -> f64| {
            let parts = sun.iter().map(|&[e, s]| [weight(e, s), s]);
            Curve::new(&parts.collect::<Vec<_>>())
        };
        let airglow = Airglow::of(band);
        Atmosphere {
            air: Air::standard(),
            shells: Shells::of(&airglow),
            airglow,
            scattered: curve(&|e, s| e * s),
            passed: curve(&|e, _| e / all),
        }
    }

    /// The airglow that the band sees.
    pub fn airglow(&self) -> &Airglow {
        &self.airglow
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_their_sums() {
        // Cross-sections of air at 350 and 1100 nm, m^2 (see air), of the one twice the light.
        let parts = [[2.0, 2.93e-30], [1.0, 2.74e-32]];
        let curve = Curve::new(&parts);
        for k in 0..2000 {
            let column = libm::exp(54.0 + 20.0 * f64::from(k) / 2000.0);
            let of = |moment: i32| -> f64 {
                let of = |[w, s]: &[f64; 2]| w * (s * column).powi(moment) * libm::exp(-s * column);
                parts.iter().map(of).sum()
            };
            // A straight line is off by h^2 / 8 of the second moment, h = 1/64; and of no depth by as much as that of the least column is.
            let bound = of(2) / 32768.0 * 1.1 + 2e-6 * of(0);
            let error = (curve.at(column) - of(0)).abs();
            assert!(error <= bound + 1e-30, "{column:e}: {error:e} {bound:e}");
        }
        assert_eq!(curve.at(0.0), curve.at(1.0));
        assert_eq!(curve.at(f64::INFINITY), curve.at(2e32));
        assert_eq!(curve.at(f64::NAN), curve.at(0.0));
    }
}
