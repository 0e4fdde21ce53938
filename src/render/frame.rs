//! The frame: pixel values, and on request their expected electrons.

use skyloop_base::rng::NoiseKey;
use skyloop_orbit::sgp4_batch::Level;
use std::ops::Range;

/// A frame of the camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Digital numbers, row-major, row 0 first.
    pub dn: Vec<u16>,
    /// Expected electrons without noise, in the same order, if requested.
    pub expected_e: Option<Vec<f32>>,
    /// The charge at the converter, e-, if requested.
    pub charge_e: Option<Vec<f32>>,
}

/// Reusable buffers: frames of equal shape need no new allocation.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    /// Pixel values of an earlier frame.
    pub dn: Vec<u16>,
    /// Charge of a whole frame, e-.
    pub electrons: Vec<f32>,
}

impl Memory {
    /// Takes back the buffers of a frame.
    pub fn recycle(&mut self, frame: Frame) {
        self.dn = frame.dn;
        if let Some(electrons) = frame.charge_e {
            self.electrons = electrons;
        }
    }
}

/// A part of a frame while it is being rendered: a band of whole rows, or a run of pixels.
pub struct Tile<'a> {
    /// First pixel, row-major, on the whole detector.
    pub first: usize,
    /// Columns of the detector.
    pub width: usize,
    /// Charge, e-, row-major.
    pub electrons: &'a mut [f32],
    /// Digital numbers, row-major.
    pub dn: &'a mut [u16],
    /// The key of its noise.
    pub key: NoiseKey,
    /// The vector instructions of kernels; none for the scalar code, pixel by pixel.
    pub level: Option<Level>,
}

impl Tile<'_> {
    /// The rows of a band.
    pub(crate) fn rows(&self) -> Range<usize> {
        let first = self.first / self.width;
        first..first + self.dn.len() / self.width
    }

    /// Its pixels in consecutive runs of at most `pixels`.
    pub(crate) fn runs(&mut self, pixels: usize) -> impl Iterator<Item = Tile<'_>> {
        let (first, width, key, level) = (self.first, self.width, self.key, self.level);
        let electrons = self.electrons.chunks_mut(pixels);
        let runs = electrons.zip(self.dn.chunks_mut(pixels)).enumerate();
        runs.map(move |(run, (electrons, dn))| Tile {
            first: first + run * pixels,
            width,
            electrons,
            dn,
            key,
            level,
        })
    }
}

/// The whole frame's charge while it is being rendered.
pub struct Charge<'a> {
    /// Columns.
    pub width: usize,
    /// Charge, e-, row-major.
    pub electrons: &'a mut [f32],
}
