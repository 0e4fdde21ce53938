//! The light of all area sources of a scene together: it is drawn where it is asked for, or at once where nearly all of it will be.

use super::area_light::AreaLight;
use super::light::Light;
use crate::camera::Detector;
use crate::kernels;
use crate::scene::view::View;
use skyloop_orbit::sgp4_batch::Level;

/// Images lie close if they have more than the detector's pixels over this: then all pixels' light is asked for anyway.
const CLOSE: usize = 4;

/// The light of several area sources.
#[derive(Debug, Default)]
pub struct Together {
    /// None where no source has any.
    light: Option<Light>,
    /// Whether it is drawn before it is asked for.
    is_drawn: bool,
}

impl Together {
    /// That of `areas`, before which images have so many `pixels`.
    pub fn of(areas: &[AreaLight], view: &View, pixels: usize) -> Together {
        let Detector { width, height, .. } = view.camera.detector;
        let lights: Vec<&Light> = areas.iter().filter_map(AreaLight::light).collect();
        Together {
            light: Light::of_all(&lights, &view.limit),
            is_drawn: pixels >= width * height / CLOSE,
        }
    }

    /// Light that is given pixel by pixel, row by row, e-.
    #[cfg(test)]
    pub fn each(size: [usize; 2], e: Vec<f32>) -> Together {
        Together {
            light: Some(Light::each(size, e)),
            is_drawn: false,
        }
    }

    /// None where no source has any.
    pub fn light(&self) -> Option<&Light> {
        self.light.as_ref()
    }

    /// Adds the light on the pixels from `first` on, by row-major index, to `electrons`.
    pub fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        match &self.light {
            Some(light) if self.is_drawn => {
                let drawn = &light.footprint().shares()[first..];
                kernels::add(level, drawn, electrons);
            }
            Some(light) => light.add_to(level, first, electrons),
            None => {}
        }
    }

    /// [`Together::add_to`] for a part of a row.
    pub fn add_to_row(&self, first: usize, electrons: &mut [f32]) {
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

    /// The light on one, e-.
    pub fn of_pixel(&self, pixel: usize) -> f64 {
        let mut e = [0.0];
        self.add_to_row(pixel, &mut e);
        e[0].into()
    }

    /// The light on each pixel, row by row, e-; empty where there is none.
    pub fn e(&self) -> &[f32] {
        self.light().map(Light::e).unwrap_or_default()
    }
}
