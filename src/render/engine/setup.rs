//! What an emulator is made of.

use crate::camera::Camera;
use crate::fidelity::{Choice, Fidelity};
use crate::sky::Corrections;
use crate::sky::catalog::Selection;
use crate::sky::population::Population;
use std::sync::Arc;

/// The stars and the corrections of their directions.
#[derive(Debug, Clone, Copy)]
pub struct Sky {
    /// Which part of the catalogue.
    pub selection: Selection,
    /// Corrections from catalogue to apparent place.
    pub corrections: Corrections,
    /// Whether stars carry their colour into the band (else the band magnitude is V).
    pub colour: bool,
}

/// What an emulator is made of.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The camera.
    pub camera: Camera,
    /// Error tolerances.
    pub fidelity: Fidelity,
    /// Which effects may run.
    pub choice: Choice,
    /// Seed of all noise.
    pub seed: u64,
    /// The faintest object that labels list, as signal-to-noise ratio.
    pub label_snr: f64,
    /// The stars.
    pub sky: Sky,
    /// Resident space objects.
    pub population: Arc<Population>,
    /// Records of the object files that were refused.
    pub rejected_records: u32,
}
