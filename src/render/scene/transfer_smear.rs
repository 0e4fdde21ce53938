//! Frame-transfer smear: light that a column collects while charge is shifted to the covered
//! storage area.
//!
//! ```text
//! N_xy <- N_xy + (t_row / t_int) sum_y' N_xy'
//! ```
//!
//! During the previous transfer a pixel's charge passed all rows on one side of it; after the
//! exposure it passes all rows on the other side. In total it passes every row of its column once,
//! each for t_row. The scene is assumed to stand still: a row's light has its mean rate over the
//! exposure.

use super::lit::Lit;
use super::view::View;
use crate::camera::Shutter;

/// The smear of each pixel of a column, e-, one value a column; empty without frame transfer.
pub(crate) fn transfer_smear_e<'a>(view: &View, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
    if !matches!(view.camera.shutter, Shutter::FrameTransfer { .. }) {
        return Vec::new();
    }
    let mut columns = columns_e(view, lights);
    let part = part(view);
    columns.iter_mut().for_each(|column| *column *= part);
    columns
}

/// The share of a column's light that smears onto each of its pixels (1).
pub(crate) fn part(view: &View) -> f64 {
    match view.camera.shutter {
        Shutter::FrameTransfer { row_s } => row_s / view.exposure.duration_s,
        Shutter::Global | Shutter::Rolling { .. } => 0.0,
    }
}

/// The light on each column, e-.
pub fn columns_e<'a>(view: &View, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
    let detector = &view.camera.detector;
    let mut columns = vec![0.0; detector.width];
    for light in lights.filter(|light| light.electrons > 0.0) {
        let rows = light.footprint.rows(0..detector.height);
        for (_, first, shares) in rows.take_while(|_| !view.limit.is_cancelled()) {
            for (column, share) in columns[first..].iter_mut().zip(shares) {
                *column += light.electrons * f64::from(*share);
            }
        }
    }
    columns
}
