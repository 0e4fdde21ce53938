//! An area source on the pixels.

use super::light::Light;
use super::raster_work::RasterWork;
use crate::scene::effect_set::EffectId;
use skyloop_orbit::sgp4_batch::Level;
use std::borrow::Cow;

/// The light of an area source on the pixels.
#[derive(Debug)]
pub struct AreaLight {
    /// Its effect.
    pub effect: EffectId,
    /// Why it has no light, if so.
    pub dark: Option<Cow<'static, str>>,
    /// Its light on the pixels; none if too faint.
    pub(super) light: Option<Light>,
    /// The least and the most light of a pixel of each column of cells (`bounds::cells`), e-.
    pub(super) ends: Vec<[f32; 2]>,
    /// Electrons on all pixels.
    pub electrons: f64,
    /// The most light in a pixel, e-.
    pub max_e: f64,
    /// Whether its total is lost in noise.
    pub is_thin: bool,
    /// The work of rasterizing it.
    pub work: RasterWork,
}

impl AreaLight {
    /// Its light on the pixels; none if too faint.
    pub(crate) fn light(&self) -> Option<&Light> {
        self.light.as_ref()
    }

    /// Its light on each pixel, row by row, e-; empty if too faint.
    pub fn e(&self) -> &[f32] {
        self.light().map(Light::e).unwrap_or_default()
    }

    /// Number of pixels that are not interpolated.
    pub(crate) fn uneven(&self) -> usize {
        self.light().map_or(0, Light::uneven)
    }

    /// Adds its light on the pixels from `first` (row-major index) on to `electrons`.
    pub(crate) fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        if let Some(light) = &self.light {
            light.add_to(level, first, electrons);
        }
    }

    /// The most light of a pixel in each column of cells, e-.
    pub(crate) fn max_of_columns(&self) -> Vec<f64> {
        self.ends.iter().map(|[_, max]| f64::from(*max)).collect()
    }

    /// The least light of a pixel in each column of cells, e-; empty if too faint.
    pub(crate) fn floor_e(&self) -> impl Iterator<Item = f32> {
        self.ends.iter().map(|[min, _]| *min)
    }
}
