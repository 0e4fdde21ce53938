//! The trail of frame transfer: light that the charge of a column collects while it is shifted below its cover.
//!
//! ```text
//! N_xy <- N_xy + (t_row / t_int) sum_y' N_xy'
//! ```
//!
//! Before the exposure, at the last frame's transfer, the charge of a pixel came past all rows on one side of it; after
//! the exposure it goes past all on the other side. Together it passes every row of its column once, each for t_row, which
//! ever way it goes. The scene is taken to stand still for it: a row's light comes at the rate that it has on average over the exposure.

use super::{Source, View};
use crate::camera::Shutter;

/// What each pixel of a column gets, e-, one value a column; empty where no charge is shifted through light.
pub(super) fn trail_e(view: &View, sources: &[Source]) -> Vec<f64> {
    let detector = &view.camera.detector;
    let Shutter::FrameTransfer { row_s } = view.camera.shutter else {
        return Vec::new();
    };
    let mut columns = vec![0.0; detector.width];
    for source in sources.iter().filter(|source| source.electrons > 0.0) {
        for (_, first, shares) in source.footprint.rows(0..detector.height) {
            for (column, share) in columns[first..].iter_mut().zip(shares) {
                *column += source.electrons * f64::from(*share);
            }
        }
    }
    let part = row_s / view.exposure.duration_s;
    columns.iter_mut().for_each(|column| *column *= part);
    columns
}
