//! The square of pixels around a point that its light is drawn on.

use crate::camera::psf::square;
use crate::camera::{Camera, LocalPsf};
use crate::fidelity::Fidelity;
use std::ops::Range;

/// Properties of a source that determine its spread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Upper bound of its electrons: determines how far wide wings are drawn.
    pub electrons: f64,
    /// Mean wavelength in the band over the band's reference.
    pub wavelength_ratio: f64,
}

impl Default for Light {
    /// All wings drawn, the Sun's colour.
    fn default() -> Self {
        Light {
            electrons: f64::INFINITY,
            wavelength_ratio: 1.0,
        }
    }
}

/// The drawn square of a point.
pub(super) struct Drawn<'a> {
    pub psf: LocalPsf<'a>,
    /// Columns and rows of pixels around it, on the unbounded plane.
    pub square: [Range<i64>; 2],
    /// Half its side, px.
    pub reach: f64,
}

impl Drawn<'_> {
    pub fn around<'a>(
        at: [f64; 2],
        camera: &'a Camera,
        fidelity: &Fidelity,
        light: &Light,
    ) -> Drawn<'a> {
        let psf = camera.optics.psf_at(at, light.wavelength_ratio);
        let reach = psf.drawn_px(fidelity, light.electrons);
        let square = square(at, reach);
        Drawn { psf, square, reach }
    }

    /// The centre of `rest` for which `rest` and the `light` of the square's pixels are together
    /// centred on `at`.
    pub fn rest_around(&self, at: [f64; 2], rest: f64, light: &[f64]) -> [f64; 2] {
        let [columns, rows] = &self.square;
        let mut moments = [0.0; 2];
        for (row, light) in rows
            .clone()
            .zip(light.chunks_exact(columns.end.abs_diff(columns.start) as usize))
        {
            let (mut sum, mut along) = (0.0, 0.0);
            for (column, light) in columns.clone().zip(light) {
                sum += light;
                along += light * (column as f64 - at[0]);
            }
            moments = [moments[0] + along, moments[1] + sum * (row as f64 - at[1])];
        }
        [0, 1].map(|axis| at[axis] - moments[axis] / rest)
    }

    /// The shares of the square's columns or rows `i`, linear in `i`. Their sum is 1 and their
    /// centroid `centre`, unless a share would be negative: `w_i = (1 + 12 (i - m) (centre - m) /
    /// (n^2 - 1)) / n` for `n` pixels around `m`.
    pub fn even(&self, axis: usize, centre: [f64; 2]) -> impl Fn(i64) -> f64 {
        let Range { start, end } = self.square[axis];
        let (n, middle) = ((end - start) as f64, (start + end - 1) as f64 / 2.0);
        let steepest = 2.0 / (n - 1.0).max(1.0);
        let tilt = 12.0 * (centre[axis] - middle) / (n * n - 1.0).max(1.0);
        let tilt = tilt.clamp(-steepest, steepest) / n;
        move |i| 1.0 / n + tilt * (i as f64 - middle)
    }
}
