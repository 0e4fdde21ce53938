//! Inputs of an emulator.

use crate::camera::Camera;
use crate::fidelity::{Choice, Fidelity};
use crate::sky::Corrections;
use crate::sky::catalog::Selection;
use crate::sky::population::Population;
use std::sync::Arc;

/// The stars and the corrections of their directions.
#[derive(Debug, Clone, Copy)]
pub struct Sky {
    /// The selected part of the catalogue.
    pub selection: Selection,
    /// Corrections from catalogue to apparent place.
    pub corrections: Corrections,
    /// Whether the band magnitude of stars includes their colour (else it is V).
    pub colour: bool,
}

/// The inputs of an emulator.
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
