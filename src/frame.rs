//! The frame: digits, and on request the expected electrons behind them.

use crate::rng::NoiseKey;

/// A frame as the camera gives it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Digital numbers, row-major, row 0 first.
    pub digits: Vec<u16>,
    /// Expected electrons before any noise, in the same order, where they were asked for.
    pub expected_e: Option<Vec<f32>>,
    /// The charge that the converter read, e-, likewise.
    pub charge_e: Option<Vec<f32>>,
}

/// A band of whole rows while it is being rendered.
pub struct Tile<'a> {
    /// First row.
    pub row: usize,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub width: usize,
    /// Charge, e-, row-major.
    pub electrons: &'a mut [f32],
    /// Digital numbers, row-major.
    pub digits: &'a mut [u16],
    /// What noise is keyed by.
    pub key: NoiseKey,
}

impl Tile<'_> {
    /// Index on the whole detector of the tile's first pixel.
    pub fn first_pixel(&self) -> usize {
        self.row * self.width
    }
}

/// The whole frame's charge while it is being rendered.
pub struct Charge<'a> {
    /// Columns.
    pub width: usize,
    /// Charge, e-, row-major.
    pub electrons: &'a mut [f32],
}
