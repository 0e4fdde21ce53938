//! Where pixels fill up, and where charge spills.
//!
//! Of charge q >= 0 that is added to a column, a pixel shows its own, and what full pixels beside it pass on. A full run of pixels
//! passes on no more than was added to it, for it held no more than it holds now. So with n full pixels, each holding the full well W,
//!
//! ```text
//! change <= min(W + 1, q own + sum of q over n pixels),   n <= charge of the column / W
//! ```
//!
//! It is monotonic, so the same bounds what is taken away, and what is added here and taken there by the greater of both.

use super::effect_set::EffectId;
use crate::camera::Detector;

/// What fills up and spills.
#[derive(Debug, Default)]
pub struct Spill {
    /// Most that a pixel holds, e-.
    pub most_e: f64,
    /// The columns in which a pixel may fill up, whatever noise and particles add, and those that share a cell with them
    /// (`brightest`); sorted.
    pub columns: Vec<usize>,
    /// Whether their charge spills, rather than being lost.
    pub along: bool,
    /// The brightest area source that alone fills every pixel, if any does.
    pub flood: Option<EffectId>,
}

impl Spill {
    /// Whether a column is among them.
    pub fn has(&self, column: usize) -> bool {
        self.columns.binary_search(&column).is_ok()
    }

    /// Whether charge may spill along a column.
    pub fn spills(&self) -> bool {
        self.along && !self.columns.is_empty()
    }
}

/// Light (e-) so far over the full well that shot noise brings no pixel back below it.
pub fn flooding_e(detector: &Detector) -> f64 {
    2.0 * detector.full_well_e + 100.0
}

/// The most (e-) that is drawn where so much is expected: ten sigma and ten electrons above nothing is.
pub fn drawn_e(expected_e: f64) -> f64 {
    expected_e + 10.0 * expected_e.sqrt() + 10.0
}
