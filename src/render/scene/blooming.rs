//! Columns in which pixels fill up and charge blooms.
//!
//! If charge q >= 0 is added to a column, a pixel gains its own part and the overflow of full
//! neighbours. A run of full pixels passes on no more than was added to it. With n full pixels of
//! full well W:
//!
//! ```text
//! change <= min(W + 1, q own + sum of q over n pixels),   n <= charge of the column / W
//! ```
//!
//! The bound is monotonic. It also holds for removed charge; for a mixture of both take the
//! greater.

use super::effect_set::EffectId;
use crate::camera::Detector;

/// The columns that may saturate.
#[derive(Debug, Default)]
pub struct BloomingColumns {
    /// The most charge that a pixel holds, e-.
    pub max_e: f64,
    /// The columns in which a pixel may fill up, with noise and particles, and all columns of the
    /// same cells (`bounds::cells`); sorted.
    pub columns: Vec<usize>,
    /// Whether their excess charge blooms; else it is lost.
    pub along: bool,
    /// The brightest area source that alone fills every pixel, if any.
    pub flood: Option<EffectId>,
}

impl BloomingColumns {
    /// Whether a column is among them.
    pub(crate) fn has(&self, column: usize) -> bool {
        self.columns.binary_search(&column).is_ok()
    }

    /// Whether charge may bloom along a column.
    pub(crate) fn spills(&self) -> bool {
        self.along && !self.columns.is_empty()
    }
}

/// Light that fills every pixel in spite of shot noise, e-.
pub(crate) fn flooding_e(detector: &Detector) -> f64 {
    2.0 * detector.full_well_e + 100.0
}

/// Bound of the charge drawn from an expectation, e-: plus ten sigma and ten electrons.
pub fn drawn_e(expected_e: f64) -> f64 {
    expected_e + 10.0 * expected_e.sqrt() + 10.0
}
