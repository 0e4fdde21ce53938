//! The air and the airglow in the camera's band.

use super::air::{self, Air};
use super::airglow::Airglow;
use super::curve::Curve;
use super::shells::Shells;
use crate::camera::Band;

/// The atmosphere in a band.
#[derive(Debug, Clone, PartialEq)]
pub struct Atmosphere {
    pub(super) air: Air,
    pub(super) airglow: Airglow,
    /// The airglow in shells.
    pub(super) shells: Shells,
    /// `sum E s exp(-s N)`, ph/s: light scattered by a molecule behind a column, at 1 au.
    pub(super) scattered: Curve,
    /// `sum E exp(-s N) / sum E`: transmission of a column for sunlight (1).
    pub(super) passed: Curve,
}

impl Atmosphere {
    /// In `band`. Takes some milliseconds: make one per camera.
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

    /// The airglow in the band.
    pub fn airglow(&self) -> &Airglow {
        &self.airglow
    }
}
