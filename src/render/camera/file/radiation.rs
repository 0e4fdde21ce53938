//! `[radiation]` of a camera file.

use super::timing::Timing;
use crate::camera::{Detector, Flux, MAX_WORK_AN_EVENT, Radiation};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::Number;
use skyloop_base::load::{Check, ConfigError, Limit};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRadiation {
    /// Flux of particles through the detector, both directions, or "orbit": by the position of the
    /// observer; without an observer, far from the Earth (1/cm^2/s)
    flux_cm2_s: RawFlux,
    /// Depth from which charge is collected (um)
    thickness_um: f64,
    /// Kinetic energy of the particles (protons) (MeV)
    #[serde(default = "typical_energy")]
    energy_mev: f64,
    /// Sigma of the diffusion of the charge (um)
    #[serde(default)]
    diffusion_um: f64,
    /// Time after the exposure in which particles still reach the charge, at most 1 / rate_hz (s)
    #[serde(default)]
    readout_s: f64,
}

#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be a number or \"orbit\"")]
enum RawFlux {
    Fixed(f64),
    Named(#[schemars(extend("const" = "orbit"))] String),
}

pub(crate) const LIMITS: &[Limit] = &[
    ("radiation.flux_cm2_s", Number(0.0..=1e9)),
    ("radiation.thickness_um", Number(0.1..=2000.0)),
    ("radiation.energy_mev", Number(50.0..=1e6)),
    ("radiation.diffusion_um", Number(0.0..=100.0)),
    ("radiation.readout_s", Number(0.0..=1e4)),
];

/// Keys that determine the number of particles and their tracks.
const TRACKS: &[&str] = &[
    "radiation.thickness_um",
    "radiation.diffusion_um",
    "radiation.readout_s",
    "detector.pixel_um",
    "detector.width_px",
    "detector.height_px",
    "timing.exposure_s",
];

/// Typical at the Hubble's imagers (Miles et al. 2021), MeV.
fn typical_energy() -> f64 {
    534.0
}

impl RawRadiation {
    pub fn validate(
        self,
        detector: &Detector,
        timing: &Timing,
        check: &Check,
    ) -> Result<Radiation, ConfigError> {
        let limit = |key: &str, value| check.limit(LIMITS, &format!("radiation.{key}"), value);
        let flux = match self.flux_cm2_s {
            RawFlux::Fixed(flux) => Flux::Fixed(limit("flux_cm2_s", flux)?),
            RawFlux::Named(name) if name == "orbit" => Flux::ByOrbit,
            RawFlux::Named(name) => {
                let given = format!("{name:?}");
                return Err(check.refuse("radiation.flux_cm2_s", given, "a number or \"orbit\""));
            }
        };
        let radiation = Radiation {
            flux,
            thickness_um: limit("thickness_um", self.thickness_um)?,
            energy_mev: limit("energy_mev", self.energy_mev)?,
            diffusion_um: limit("diffusion_um", self.diffusion_um)?,
            readout_s: limit("readout_s", self.readout_s)?,
        };
        if radiation.readout_s * timing.rate_hz > 1.0 + 1e-9 {
            let allowed = format!(
                "at most 1 / timing.rate_hz = {} s: a frame's charge is read before the next one's",
                1.0 / timing.rate_hz
            );
            let error = check.refuse("radiation.readout_s", radiation.readout_s, allowed);
            return Err(error.needs(&["timing.rate_hz"]));
        }
        let work = radiation.work_an_event(detector);
        if work > MAX_WORK_AN_EVENT {
            let allowed = format!(
                "such that a particle's charge lies on at most {MAX_WORK_AN_EVENT:.0e} pixels, counted at each step of its track: \
                 {work:.1e} with this radiation.thickness_um"
            );
            let error = check.refuse("radiation.diffusion_um", radiation.diffusion_um, allowed);
            return Err(error.needs(TRACKS));
        }
        if let Flux::Fixed(flux) = flux {
            let events = radiation.expected_events(detector, flux, timing.exposure_s);
            let max = radiation.max_events(detector);
            if events > max {
                let allowed = format!(
                    "at most {:.3e}: {events:.0} particles would cross the detector in one exposure",
                    flux * max / events
                );
                let error = check.refuse("radiation.flux_cm2_s", flux, allowed);
                return Err(error.needs(TRACKS));
            }
        }
        Ok(radiation)
    }
}
