//! The point spread function, integrated over each pixel: how it varies over the field and with colour.

mod gaussian;

use gaussian::Gaussian;
use std::ops::Range;

/// How a camera spreads the light of a point over the detector.
#[derive(Debug, Clone, PartialEq)]
pub struct Psf {
    shape: Shape,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Gaussian(Gaussian),
}

/// The spread at one place of the field and of one colour.
#[derive(Debug, Clone, Copy)]
pub struct LocalPsf<'a> {
    shape: &'a Shape,
    /// Its width, in units of the shape's own.
    scale: f64,
}

/// The light of a point on a rectangle of pixels; used again and again, so that nothing is allocated twice.
#[derive(Debug, Default)]
pub struct Stamp {
    /// Light on each pixel, row by row.
    pub light: Vec<f64>,
    across: Vec<f64>,
    down: Vec<f64>,
}

impl Psf {
    /// A circular Gaussian of this standard deviation (px), the same everywhere.
    pub fn gaussian(sigma_px: f64) -> Psf {
        Psf {
            shape: Shape::Gaussian(Gaussian { sigma_px }),
        }
    }

    /// The spread at `field_px` from the principal point for a source whose mean wavelength is `wavelength_ratio`
    /// times the band's reference.
    pub fn at(&self, _field_px: [f64; 2], _wavelength_ratio: f64) -> LocalPsf<'_> {
        LocalPsf {
            shape: &self.shape,
            scale: 1.0,
        }
    }

    /// The greatest [`LocalPsf::reach_px`] of the field.
    pub fn reach_px(&self, loss: f64) -> f64 {
        self.at([0.0; 2], 1.0).reach_px(loss)
    }

    /// The least [`LocalPsf::core_px`] of the field.
    pub fn core_px(&self) -> f64 {
        self.at([0.0; 2], 1.0).core_px()
    }
}

impl LocalPsf<'_> {
    /// Half the side (px) of the square outside of which less than `loss` of the light falls.
    pub fn reach_px(&self, loss: f64) -> f64 {
        match self.shape {
            Shape::Gaussian(gaussian) => gaussian.scaled(self.scale).reach_px(loss),
        }
    }

    /// The width (px) of its core, as the standard deviation of a Gaussian: how fine a track must be sampled.
    pub fn core_px(&self) -> f64 {
        match self.shape {
            Shape::Gaussian(gaussian) => gaussian.scaled(self.scale).sigma_px,
        }
    }

    /// Spreads `light` around `at` (px) over a rectangle of pixels.
    pub fn spread(
        &self,
        light: f64,
        at: [f64; 2],
        columns: Range<i64>,
        rows: Range<i64>,
        stamp: &mut Stamp,
    ) {
        match self.shape {
            Shape::Gaussian(gaussian) => {
                let gaussian = gaussian.scaled(self.scale);
                gaussian.shares(at[0], columns, &mut stamp.across);
                gaussian.shares(at[1], rows, &mut stamp.down);
                stamp.light.clear();
                for down in &stamp.down {
                    let down = light * down;
                    stamp
                        .light
                        .extend(stamp.across.iter().map(|across| down * across));
                }
            }
        }
    }
}
