//! The Earth's atmosphere as a camera in space sees it: sunlight that air scatters, and airglow.
//!
//! [`air`] has density, columns and scattering, [`airglow`] the layers that shine by themselves; [`Atmosphere`] is both as one band sees
//! them, made once a camera; [`Limb`] is its light for one frame, in every direction: above the limb, and before the ground.
//!
//! Sunlight is scattered once, on the way from the Sun to the line of sight, and dimmed on both ways; of what the air scatters more than
//! once, the part that comes back from below is counted as light of the day side, of which each point of the line sees a share:
//!
//! ```text
//! L = 1/(4 pi) sum over wavelengths of E s  integral n [P(t) V exp(-s (N_v + N_s)) + 2 A c (1 - sqrt(1 - (R/r)^2)) V exp(-s N_v)] dl
//! ```
//!
//! with the Sun's photon irradiance `E`, the cross-section `s`, the density `n`, the phase function `P` of the scattering angle `t`, the
//! columns `N_v` to the observer and `N_s` to the Sun, the visible part `V` of the Sun's disc, the albedo `A`, the cosine `c` of the Sun's
//! zenith distance and the radius `r` (Chandrasekhar 1960, Radiative Transfer, for single scattering). Twilight is what is left when
//! the Earth's shadow climbs through the air.
//!
//! Valid for clear air from 350 to 1100 nm: by day 3 to 25 % below a full calculation from 10 to 80 km of tangent altitude (tests/limb.rs).
//! Left out: clouds and dust (some tens of per cent of the limb below 20 km, more in the red), ozone (the yellow, below 30 km), light
//! scattered more than once in twilight, refraction, the day's airglow and aurora.

pub mod air;
pub mod airglow;
mod limb;
mod shells;
mod sight;
mod tables;

pub use air::{Air, TOP_M};
pub use airglow::Airglow;
pub use limb::Limb;

use crate::camera::Band;
use shells::Shells;

/// The atmosphere as a band sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Atmosphere {
    air: Air,
    airglow: Airglow,
    /// The same in shells.
    shells: Shells,
    /// `sum E s exp(-s N)`, ph/s: what a molecule takes from the Sun's light behind a column, at 1 au.
    scattered: Curve,
    /// `sum E exp(-s N) / sum E`: the part of the Sun's light that passes a column (1).
    passed: Curve,
}

impl Atmosphere {
    /// Of a band. Costs some milliseconds: make it once a camera.
    pub fn of(band: &Band) -> Atmosphere {
        let sun: Vec<[f64; 2]> = band
            .sun_spectrum()
            .map(|(wavelength_m, photons)| [photons, air::cross_section_m2(wavelength_m)])
            .collect();
        let all: f64 = sun.iter().map(|[e, _]| e).sum();
        let sum = |n: f64, weight: &dyn Fn(f64, f64) -> f64| -> f64 {
            sun.iter()
                .map(|&[e, s]| weight(e, s) * libm::exp(-s * n))
                .sum()
        };
        let airglow = Airglow::of(band);
        Atmosphere {
            air: Air::standard(),
            shells: Shells::of(&airglow),
            airglow,
            scattered: Curve::new(|n| sum(n, &|e, s| e * s)),
            passed: Curve::new(|n| sum(n, &|e, _| e / all)),
        }
    }

    /// The airglow that the band sees.
    pub fn airglow(&self) -> &Airglow {
        &self.airglow
    }

    /// The optical depth of the air from the ground to space, straight up, for sunlight in the band (1).
    pub fn optical_depth(&self) -> f64 {
        -libm::log(self.passed.at(self.air.column(0.0, 1.0)))
    }
}

/// A positive function of a column (1/m^2) as a table: straight lines in the logarithms of both.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    logs: Vec<f64>,
}

/// The columns of the table, as natural logarithms, and its steps.
const LOG_COLUMNS: [f64; 2] = [55.0, 73.0]; // 8e23 to 5e31 1/m^2: from no optical depth to the opaque
const STEPS: usize = 288;

impl Curve {
    fn new(value: impl Fn(f64) -> f64) -> Curve {
        let step = (LOG_COLUMNS[1] - LOG_COLUMNS[0]) / STEPS as f64;
        let log = |i| libm::log(value(libm::exp(LOG_COLUMNS[0] + i as f64 * step)).max(1e-300));
        Curve {
            logs: (0..=STEPS).map(log).collect(),
        }
    }

    fn at(&self, column: f64) -> f64 {
        let [from, to] = LOG_COLUMNS;
        let log = libm::log(column.max(1.0)).clamp(from, to);
        let along = (log - from) / (to - from) * STEPS as f64;
        let i = (along as usize).min(STEPS - 1);
        let (a, b) = match (self.logs.get(i), self.logs.get(i + 1)) {
            (Some(a), Some(b)) => (*a, *b),
            _ => return 0.0,
        };
        libm::exp(a + (b - a) * (along - i as f64))
    }
}
