//! The light of a point on a rectangle of pixels.

use crate::kernels::Place;
use skyloop_orbit::sgp4_batch::Level;

/// The light of a point on a rectangle of pixels; used again and again, so that nothing is
/// allocated twice.
#[derive(Debug)]
pub struct Stamp {
    /// Light on each pixel, row by row.
    pub light: Vec<f64>,
    /// The vector instructions that it is computed with; all give the same.
    pub(super) level: Option<Level>,
    pub(super) across: Vec<f64>,
    pub(super) down: Vec<f64>,
    pub(super) places: Vec<Place>,
}

impl Stamp {
    /// One that is computed with the vector instructions of `level`.
    pub fn of(level: Option<Level>) -> Stamp {
        Stamp {
            light: Vec::new(),
            level,
            across: Vec::new(),
            down: Vec::new(),
            places: Vec::new(),
        }
    }
}

impl Default for Stamp {
    /// With the fastest that the processor has.
    fn default() -> Stamp {
        Stamp::of(Some(Level::best()))
    }
}
