//! What pixels show of a change: no more than they hold; and where charge spills along a column, also elsewhere.
//!
//! Columns that may fill up are few: what they hold with an effect and without it is worked out, pixel by pixel. Elsewhere a pixel
//! shows its own change.

use super::full_well::fill;
use crate::scene::{CELL, Scene, Simulated};

/// The charge (e-) that is expected in the columns that may fill up, column by column, when their wells are full, in a
/// frame that has those effects of the scene's that `parts` has too.
pub(super) fn held_e(scene: &Scene, parts: &Simulated) -> Vec<f64> {
    let detector = &scene.view.camera.detector;
    let mut charge = scene.columns_e(&scene.spill.columns, parts);
    if parts.full_well {
        for column in charge.chunks_exact_mut(detector.height) {
            fill(column, detector);
        }
    }
    charge
}

/// A bound (e-) of the change of what a pixel shows without what `leave` leaves out. `cells_e` is one for pixels that do not fill up, for
/// each column of the scene's cells.
pub(super) fn shown_e(scene: &Scene, cells_e: &[f64], leave: impl Fn(&mut Simulated)) -> f64 {
    let spill = &scene.spill;
    let elsewhere = cells_e
        .iter()
        .enumerate()
        .filter(|(cell, _)| !spill.has(cell * CELL));
    let most = elsewhere.map(|(_, e)| *e).fold(0.0, f64::max);
    if spill.columns.is_empty() {
        return most;
    }
    let mut without = scene.simulated;
    leave(&mut without);
    let [with, without] = [&scene.simulated, &without].map(|parts| held_e(scene, parts));
    most.max(apart(&with, &without))
}

/// The greatest of the columns of each of the scene's cells.
pub(super) fn of_cells(columns: &[f64]) -> Vec<f64> {
    let cells = columns.chunks(CELL);
    cells
        .map(|of| of.iter().copied().fold(0.0, f64::max))
        .collect()
}

/// The greatest difference.
pub(super) fn apart(a: &[f64], b: &[f64]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max)
}

/// What `pixels` (sorted by row-major index) expect to hold when wells are full, e-.
pub(super) fn held_of(scene: &Scene, pixels: &[u32]) -> Vec<f64> {
    let mut held = scene.expected_e(pixels);
    if !scene.simulated.full_well || scene.spill.columns.is_empty() {
        return held;
    }
    let detector = &scene.view.camera.detector;
    let filled = held_e(scene, &scene.simulated);
    for (held, pixel) in held.iter_mut().zip(pixels) {
        let (row, column) = (
            *pixel as usize / detector.width,
            *pixel as usize % detector.width,
        );
        if let Ok(i) = scene.spill.columns.binary_search(&column) {
            *held = filled[i * detector.height + row];
        }
    }
    held
}

/// A bound (e-) of the change of what pixels show where the light of images changes by at most `e` on any pixel: as pixels respond,
/// with the trails of frame transfer, and with what full pixels pass on. Without the effect other columns may spill than with it.
pub fn passed_e(scene: &Scene, e: f64) -> f64 {
    let (detector, simulated) = (&scene.view.camera.detector, &scene.simulated);
    let response = if simulated.response {
        1.0 + detector.pattern.worst_response()
    } else {
        1.0
    };
    let trails = if simulated.frame_transfer {
        scene.trail_part() * detector.height as f64
    } else {
        0.0
    };
    let e = e * (response + trails);
    let most = e.min(scene.spill.most_e);
    if !scene.spill.along || scene.brightest_e() + e <= detector.full_well_e {
        return most;
    }
    let all = scene.sources.iter().map(|source| source.arriving_e);
    let full = all.sum::<f64>() / detector.full_well_e;
    (e * (1.0 + full)).min(scene.spill.most_e)
}
