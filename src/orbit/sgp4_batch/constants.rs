//! The SGP4 constants of one object, computed by the `sgp4` crate.
//!
//! Its `Constants` have private fields but can be serialised. They are written as bytes and read
//! into the structures of this file, which have the same fields in the same order. Every test of
//! the batch would fail if the crate changed that order.

use crate::elements::ModelError;
use serde::Deserialize;

/// The model's constants of one object; angles in rad, times in minutes, lengths in Earth radii.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct ModelConstants {
    /// The Earth's field: a_e (km), k_e, J2, J3, J4.
    pub earth: [f64; 5],
    pub node_dot: f64,
    pub perigee_dot: f64,
    pub mean_anomaly_dot: f64,
    pub c1: f64,
    pub c4: f64,
    pub k0: f64,
    pub k1: f64,
    pub method: Method,
    pub orbit: Mean,
}

/// The mean elements, with Brouwer's mean motion.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Mean {
    pub inclination: f64,
    pub node: f64,
    pub eccentricity: f64,
    pub perigee: f64,
    pub mean_anomaly: f64,
    pub mean_motion: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) enum Method {
    NearEarth {
        a0: f64,
        _k2_k3_k4: [f64; 3],
        k5: f64,
        _k6: f64,
        high: High,
    },
    DeepSpace {
        eccentricity_dot: f64,
        inclination_dot: f64,
        sun: Perturber,
        moon: Perturber,
        resonant: Resonant,
    },
}

/// Drag terms of an orbit with its perigee at 220 km or above.
#[derive(Clone, Debug, Deserialize)]
#[allow(clippy::large_enum_variant)] // as in the crate
pub(crate) enum High {
    No {},
    Yes {
        c5: f64,
        d2: f64,
        d3: f64,
        d4: f64,
        eta: f64,
        k7: f64,
        k8: f64,
        k9: f64,
        k10: f64,
        elliptic: Elliptic,
    },
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) enum Elliptic {
    No {},
    Yes { k11: f64, k12: f64, k13: f64 },
}

/// Amplitudes of Sun or Moon, and its mean anomaly at the epoch.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Perturber {
    pub k: [f64; 12],
    pub mean_anomaly: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) enum Resonant {
    No {
        a0: f64,
    },
    Yes {
        lambda: f64,
        lambda_dot: f64,
        sidereal_time: f64,
        resonance: Resonance,
    },
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) enum Resonance {
    /// dr1, dr2, dr3.
    OneDay([f64; 3]),
    /// D2201, D2211, D3210, D3222, D4410, D4422, D5220, D5232, D5421, D5433 and k14, the perigee's
    /// rate.
    HalfDay([f64; 11]),
}

/// Buffer size; the longest form has 69 numbers and the variants.
const LONGEST: usize = 640;

impl ModelConstants {
    /// Reads the constants of the crate.
    ///
    /// # Errors
    ///
    /// The crate writes them in another form.
    pub fn of(constants: &sgp4::Constants) -> Result<ModelConstants, ModelError> {
        let mut bytes = [0; LONGEST];
        let unread = |error: postcard::Error| ModelError::new(error.to_string());
        let written = postcard::to_slice(constants, &mut bytes).map_err(unread)?;
        let constants: ModelConstants = postcard::from_bytes(written).map_err(unread)?;
        let sgp4::Geopotential { ae, ke, j2, j3, j4 } = sgp4::WGS72;
        if constants.earth != [ae, ke, j2, j3, j4] {
            return Err(ModelError::new(
                "the constants are not those of WGS72".to_string(),
            ));
        }
        Ok(constants)
    }
}
