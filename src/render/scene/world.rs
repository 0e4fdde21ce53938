//! Data that all frames share.

use crate::sky::atmosphere::Atmosphere;
use crate::sky::starlight::StarLight;
use crate::sky::{Corrections, Population, StarField};
use std::sync::Arc;

/// Data that does not change from frame to frame.
#[derive(Debug)]
pub struct World {
    /// The stars.
    pub stars: StarField,
    /// The light of stars below the catalogue's limit.
    pub starlight: Arc<StarLight>,
    /// The Earth's air in the camera's band.
    pub atmosphere: Arc<Atmosphere>,
    /// The objects in orbit.
    pub population: Arc<Population>,
    /// Corrections from catalogue to apparent directions.
    pub corrections: Corrections,
}
