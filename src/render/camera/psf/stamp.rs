//! The light of a point on a rectangle of pixels.

use crate::kernels::Place;
use skyloop_orbit::sgp4_batch::Level;

/// The light of a point on a rectangle of pixels. It is reused, so that memory is allocated once.
#[derive(Debug)]
pub struct Stamp {
    /// Light on each pixel, row by row.
    pub light: Vec<f64>,
    /// Vector instructions of the computation; all give the same result.
    pub(super) level: Option<Level>,
    pub(super) across: Vec<f64>,
    pub(super) down: Vec<f64>,
    pub(super) places: Vec<Place>,
}

impl Stamp {
    /// A stamp computed with the vector instructions of `level`.
    pub(crate) fn of(level: Option<Level>) -> Stamp {
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
    /// With the fastest instructions of the processor.
    fn default() -> Stamp {
        Stamp::of(Some(Level::best()))
    }
}
