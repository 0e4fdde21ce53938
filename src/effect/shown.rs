//! What pixels show of a change: no more than they hold; and where charge spills along a column, also elsewhere.
//!
//! Columns that may spill are few: what they hold with an effect and without it is worked out, pixel by pixel. Elsewhere a pixel shows
//! of its own change what it can hold.

use super::full_well::fill;
use crate::scene::{Scene, Simulated};

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

/// A bound (e-) of the change of what a pixel shows without what `leave` leaves out, which changes the charge of any pixel by at most
/// `e` before wells fill.
pub(super) fn shown_e(scene: &Scene, e: f64, leave: impl Fn(&mut Simulated)) -> f64 {
    let most = e.min(scene.spill.most_e);
    if !scene.spill.spills() {
        return most;
    }
    let mut without = scene.simulated;
    leave(&mut without);
    most.max(apart(
        &held_e(scene, &scene.simulated),
        &held_e(scene, &without),
    ))
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

/// A bound (e-) of the change of what pixels show where images change by at most `e` on any pixel: full pixels pass on what they
/// get. Without the effect other columns may spill than with it.
pub fn passed_e(scene: &Scene, e: f64) -> f64 {
    let detector = &scene.view.camera.detector;
    let most = e.min(scene.spill.most_e);
    if !scene.spill.along || scene.brightest_e() + e <= detector.full_well_e {
        return most;
    }
    let all = scene.sources.iter().map(|source| source.arriving_e);
    let full = all.sum::<f64>() / detector.full_well_e;
    (e * (1.0 + full)).min(scene.spill.most_e)
}
