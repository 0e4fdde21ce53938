//! The sum of all area light of a scene, computed on demand, or at once if most pixels are needed.

use super::area_light::AreaLight;
use super::light::Light;
use crate::camera::Detector;
use crate::kernels;
use crate::scene::view::View;
use skyloop_orbit::sgp4_batch::Level;

/// All pixels are computed at once if images cover more than this part (1 / n) of the detector.
const CLOSE: usize = 4;

/// The light of several area sources.
#[derive(Debug, Default)]
pub struct TotalAreaLight {
    /// None if no source has light.
    light: Option<Light>,
    /// Whether all pixels are computed at once.
    is_drawn: bool,
}

impl TotalAreaLight {
    /// The sum of `areas`; images cover so many `pixels`.
    pub(crate) fn of(areas: &[AreaLight], view: &View, pixels: usize) -> TotalAreaLight {
        let Detector { width, height, .. } = view.camera.detector;
        let lights: Vec<&Light> = areas.iter().filter_map(AreaLight::light).collect();
        TotalAreaLight {
            light: Light::of_all(&lights, &view.limit),
            is_drawn: pixels >= width * height / CLOSE,
        }
    }

    /// Light given pixel by pixel, row by row, e-.
    #[cfg(test)]
    pub(crate) fn each(size: [usize; 2], e: Vec<f32>) -> TotalAreaLight {
        TotalAreaLight {
            light: Some(Light::each(size, e)),
            is_drawn: false,
        }
    }

    /// None if no source has light.
    pub(crate) fn light(&self) -> Option<&Light> {
        self.light.as_ref()
    }

    /// Adds the light on the pixels from `first` (row-major index) on to `electrons`.
    pub(crate) fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        match &self.light {
            Some(light) if self.is_drawn => {
                let drawn = &light.footprint().shares()[first..];
                kernels::add(level, drawn, electrons);
            }
            Some(light) => light.add_to(level, first, electrons),
            None => {}
        }
    }

    /// [`TotalAreaLight::add_to`] for a part of a row.
    pub(crate) fn add_to_row(&self, first: usize, electrons: &mut [f32]) {
        match &self.light {
            Some(light) if self.is_drawn => {
                let drawn = &light.footprint().shares()[first..];
                let both = electrons.iter_mut().zip(drawn);
                both.for_each(|(e, light)| *e += light);
            }
            Some(light) => light.add_to_row(first, electrons),
            None => {}
        }
    }

    /// The light on one pixel, e-.
    pub(crate) fn of_pixel(&self, pixel: usize) -> f64 {
        let mut e = [0.0];
        self.add_to_row(pixel, &mut e);
        e[0].into()
    }

    /// The light on each pixel, row by row, e-; empty without light.
    pub(crate) fn e(&self) -> &[f32] {
        self.light().map(Light::e).unwrap_or_default()
    }
}
