//! Where pixels fill up, and where charge spills.
//!
//! Of charge q >= 0 added to a column, a pixel shows its own, and what full neighbours pass on. A
//! full run of pixels passes on no more than was added to it. With n full pixels of full well W:
//!
//! ```text
//! change <= min(W + 1, q own + sum of q over n pixels),   n <= charge of the column / W
//! ```
//!
//! It is monotonic: the same bounds what is removed, and the greater of both bounds a mixture.

use super::effect_set::EffectId;
use crate::camera::Detector;

/// What fills up and spills.
#[derive(Debug, Default)]
pub struct BloomingColumns {
    /// The most that a pixel holds, e-.
    pub most_e: f64,
    /// The columns in which a pixel may fill up, with noise and particles, and those that share a
    /// cell with them (`bounds::cells`); sorted.
    pub columns: Vec<usize>,
    /// Whether their charge spills, or is lost.
    pub along: bool,
    /// The brightest area source that alone fills every pixel, if any does.
    pub flood: Option<EffectId>,
}

impl BloomingColumns {
    /// Whether a column is among them.
    pub fn has(&self, column: usize) -> bool {
        self.columns.binary_search(&column).is_ok()
    }

    /// Whether charge may spill along a column.
    pub fn spills(&self) -> bool {
        self.along && !self.columns.is_empty()
    }
}

/// Light so far over the full well that shot noise brings no pixel below it, e-.
pub fn flooding_e(detector: &Detector) -> f64 {
    2.0 * detector.full_well_e + 100.0
}

/// Bound of the charge drawn from an expectation, e-: ten sigma and ten electrons more.
pub fn drawn_e(expected_e: f64) -> f64 {
    expected_e + 10.0 * expected_e.sqrt() + 10.0
}
