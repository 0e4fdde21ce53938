//! Signal above the background, with the pixel neighbourhoods that the detector uses.

use crate::background::Background;
use crate::image::Image;

pub(crate) struct Signal {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// e- above the background.
    pub(crate) electrons: Vec<f32>,
    /// Noise of the background, e-.
    pub(crate) sigma: Vec<f32>,
}

impl Signal {
    pub(crate) fn new(image: &Image<'_>) -> Self {
        let background = Background::measure(image);
        let (gain, offset) = (image.gain_e_per_dn as f32, image.offset_dn as f32);
        let count = image.pixels.len();
        let (mut electrons, mut sigma) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (y, line) in image.pixels.chunks_exact(image.width).enumerate() {
            for (x, dn) in line.iter().enumerate() {
                let (level, noise) = background.at(x, y);
                electrons.push((f32::from(*dn) - offset) * gain - level);
                sigma.push(noise);
            }
        }
        Self {
            width: image.width,
            height: image.height,
            electrons,
            sigma,
        }
    }

    /// Smoothed by [1 2 1]/4 along rows, then columns; edge pixels are repeated.
    pub(crate) fn smoothed(&self) -> Vec<f32> {
        let (width, height) = (self.width, self.height);
        let blend = |a: f32, b: f32, c: f32| 0.25 * a + 0.5 * b + 0.25 * c;
        let mut along = Vec::with_capacity(self.electrons.len());
        for line in self.electrons.chunks_exact(width) {
            along.extend((0..width).map(|x| {
                let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
                blend(line[left], line[x], line[right])
            }));
        }
        let mut both = Vec::with_capacity(along.len());
        for y in 0..height {
            let (up, down) = (y.saturating_sub(1) * width, (y + 1).min(height - 1) * width);
            let smooth = |x| blend(along[up + x], along[y * width + x], along[down + x]);
            both.extend((0..width).map(smooth));
        }
        both
    }

    /// Pixels of the frame within `reach` of a pixel, itself included.
    pub(crate) fn around(&self, index: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y) = (index % self.width, index / self.width);
        self.block(x as isize, y as isize, reach as isize)
    }

    /// Pixels of the frame in a square around (x, y).
    pub(crate) fn block(
        &self,
        x: isize,
        y: isize,
        reach: isize,
    ) -> impl Iterator<Item = usize> + use<> {
        let clip = |centre: isize, end: usize| {
            let end = end as isize;
            ((centre - reach).clamp(0, end) as usize)..((centre + reach + 1).clamp(0, end) as usize)
        };
        let (columns, width) = (clip(x, self.width), self.width);
        clip(y, self.height)
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// Column, row, electrons.
    pub(crate) fn sample(&self, index: usize) -> (f64, f64, f64) {
        let (x, y) = (index % self.width, index / self.width);
        (x as f64, y as f64, self.electrons[index].into())
    }

    /// Pixels on the straight line between two pixels, both included.
    pub(crate) fn between(&self, from: usize, to: usize) -> impl Iterator<Item = usize> + use<> {
        let width = self.width;
        let ((x0, y0), (x1, y1)) = ((from % width, from / width), (to % width, to / width));
        let steps = x0.abs_diff(x1).max(y0.abs_diff(y1)).max(1);
        // Rounded to the nearest pixel, which is always in the frame.
        let along = move |a: usize, b: usize, step: usize| {
            (a * (steps - step) + b * step + steps / 2) / steps
        };
        (0..=steps).map(move |step| along(y0, y1, step) * width + along(x0, x1, step))
    }
}
