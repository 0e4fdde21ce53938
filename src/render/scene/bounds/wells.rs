//! Full wells: a full pixel hides a change; blooming moves it along the column.
//!
//! The charge of columns that may fill up is computed pixel by pixel, with an effect and without
//! it. In other columns a pixel has its own change.

use super::brightest::{areas_min_e, min_charge_e};
use super::cells::CELL;
use crate::camera::{Blooming, Detector};
use crate::kernels::Bloom;
use crate::scene::area::area_light::AreaLight;
use crate::scene::blooming::{BloomingColumns, drawn_e, flooding_e};
use crate::scene::charge::{expected_e, in_groups, light_e, light_to_charge};
use crate::scene::content::Scene;
use crate::scene::effect_set::{EffectId, EffectSet};

/// The columns that may saturate, in a scene whose images are formed.
pub fn find_blooming(scene: &Scene) -> BloomingColumns {
    let (detector, simulated) = (&scene.view.camera.detector, &scene.simulated);
    let full_e = detector.full_well_e;
    let mut events = vec![0.0; detector.width];
    let struck = scene.struck.hits();
    for (pixel, e) in struck.take_while(|_| !scene.is_cancelled()) {
        events[pixel as usize % detector.width] += f64::from(e);
    }
    let fills = |column: &usize| drawn_e(scene.brightest_of(*column)) + events[*column] >= full_e;
    let may = drawn_e(scene.brightest_e()) + scene.struck.max_e() >= full_e;
    // By whole cells, so that the bounds of other cells hold for all other columns.
    let cells = |column: &usize| {
        let past = (column + CELL).min(detector.width);
        !scene.is_cancelled() && (*column..past).any(|column| fills(&column))
    };
    let filling = (0..if may { detector.width } else { 0 }).step_by(CELL);
    let filling = filling
        .filter(cells)
        .flat_map(|column| column..(column + CELL).min(detector.width));
    BloomingColumns {
        // Blooming moves whole electrons: one more is possible.
        max_e: if simulated.has(EffectId::FullWell) {
            full_e + 1.0
        } else {
            f64::INFINITY
        },
        columns: filling.collect(),
        along: simulated.has(EffectId::FullWell) && detector.blooming == Blooming::Column,
        flood: flood(scene),
    }
}

fn flood(scene: &Scene) -> Option<EffectId> {
    let full_e = flooding_e(&scene.view.camera.detector);
    let floods = |area: &&AreaLight| area.max_e >= full_e && min_charge_e(scene, area) >= full_e;
    let areas = scene
        .areas
        .iter()
        .filter(|_| scene.simulated.has(EffectId::FullWell));
    let floods = areas.filter(floods);
    let brightest = floods.max_by(|a, b| a.electrons.total_cmp(&b.electrons))?;
    Some(brightest.effect)
}

/// Limits the charge of a column to what its pixels hold, e-.
pub(crate) fn fill(column: &mut [f64], detector: &Detector) {
    let full = detector.full_well_e;
    match detector.blooming {
        Blooming::None => column.iter_mut().for_each(|e| *e = e.min(full)),
        Blooming::Column => {
            let mut held: Vec<f32> = column.iter().map(|e| *e as f32).collect();
            Bloom::default().blooming(&mut held, full);
            for (e, held) in column.iter_mut().zip(held) {
                *e = held.into();
            }
        }
    }
}

/// The charge that the pixels of `columns` hold, column by column, in a frame with the effects
/// `parts`, e-.
pub fn held_e(scene: &Scene, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
    let mut charge = light_e(scene, columns, parts);
    hold(scene, &mut charge, columns, parts);
    charge
}

/// Converts the light on `columns` to the charge that their pixels hold, e-.
pub(crate) fn hold(scene: &Scene, light: &mut [f64], columns: &[usize], parts: &EffectSet) {
    light_to_charge(scene, light, columns, parts);
    if parts.has(EffectId::FullWell) {
        let detector = &scene.view.camera.detector;
        let columns = light.chunks_exact_mut(detector.height);
        columns.for_each(|column| fill(column, detector));
    }
}

/// The greatest value of `of` over groups of `columns`.
pub fn greatest(
    scene: &Scene,
    columns: &[usize],
    of: impl Fn(&[usize]) -> f64 + Send + Sync,
) -> f64 {
    let groups = in_groups(scene, columns, of);
    groups.into_iter().fold(0.0, f64::max)
}

/// Why an effect is not needed if all pixels are full of other light.
pub const ALL_FULL: &str = "all pixels are full of other light";

/// Whether one area source fills all pixels with or without an effect. False for that source's own
/// effect.
pub fn is_flooded_without(scene: &Scene, effect: EffectId) -> bool {
    let without = scene.simulated.without(effect);
    let flood = scene
        .blooming
        .flood
        .filter(|_| without.has(EffectId::FullWell));
    flood.is_some_and(|area| without.has(area))
}

/// Bound of the final change of a pixel without an effect, e-. `cells_e` is the bound for pixels
/// that do not fill up, for each column of cells.
pub fn final_change_e(scene: &Scene, cells_e: impl FnOnce() -> Vec<f64>, effect: EffectId) -> f64 {
    let blooming = &scene.blooming;
    let everywhere = blooming.columns.len() == scene.view.camera.detector.width;
    let cells_e = if everywhere { Vec::new() } else { cells_e() };
    let elsewhere = cells_e
        .iter()
        .enumerate()
        .filter(|(cell, _)| !blooming.has(cell * CELL));
    let max_e = elsewhere.map(|(_, e)| *e).fold(0.0, f64::max);
    if blooming.columns.is_empty() {
        return max_e;
    }
    let without = scene.simulated.without(effect);
    // A change is invisible where all pixels are full with and without the effect.
    let full_e = flooding_e(&scene.view.camera.detector);
    let floor_e = areas_min_e(scene, &without);
    let stay_full = without.has(EffectId::FullWell) && scene.simulated.has(EffectId::FullWell);
    let columns = blooming.columns.iter().copied();
    let columns: Vec<usize> = columns
        .filter(|column| !(stay_full && floor_e.get(*column).is_some_and(|e| *e >= full_e)))
        .collect();
    max_e.max(greatest(scene, &columns, |columns| {
        let [with, without] = [&scene.simulated, &without].map(|of| held_e(scene, columns, of));
        max_difference(&with, &without)
    }))
}

/// A bound for each column of cells, plus frame-transfer smear (a value a column), e-.
pub fn with_transfer_smear(
    scene: &Scene,
    mut cells_e: Vec<f64>,
    transfer_smear: impl FnOnce() -> Vec<f64>,
) -> Vec<f64> {
    if scene.transfer_smear_fraction() > 0.0 {
        let smear = of_cells(&transfer_smear());
        let cells = cells_e.iter_mut().zip(smear);
        cells.for_each(|(e, smear)| *e += smear);
    }
    cells_e
}

/// The greatest value in each column of cells.
pub fn of_cells(columns: &[f64]) -> Vec<f64> {
    let cells = columns.chunks(CELL);
    cells
        .map(|of| of.iter().copied().fold(0.0, f64::max))
        .collect()
}

/// The greatest absolute difference of corresponding values.
pub fn max_difference(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// The expected charge that `pixels` (sorted row-major indices) hold, e-.
pub fn held_of(scene: &Scene, pixels: &[u32]) -> Vec<f64> {
    let mut held = expected_e(scene, pixels);
    let spills = scene.simulated.has(EffectId::FullWell) && !scene.blooming.columns.is_empty();
    if !spills || scene.is_cancelled() {
        return held;
    }
    let detector = &scene.view.camera.detector;
    // The positions in `pixels` of those in each column.
    let mut positions = vec![Vec::new(); detector.width];
    let pixels_and_positions = pixels.iter().zip(0u32..);
    for (pixel, position) in pixels_and_positions.take_while(|_| !scene.is_cancelled()) {
        positions[*pixel as usize % detector.width].push(position);
    }
    let spilling = scene.blooming.columns.iter().copied();
    let columns: Vec<usize> = spilling
        .filter(|column| !positions[*column].is_empty())
        .collect();
    let filled = in_groups(scene, &columns, |columns| {
        let charge = held_e(scene, columns, &scene.simulated);
        let charge = charge.chunks_exact(detector.height).zip(columns);
        let held = charge.flat_map(|(charge, column)| {
            let positions = positions[*column].iter().map(|at| *at as usize);
            positions.map(|at| (at, charge[pixels[at] as usize / detector.width]))
        });
        held.collect::<Vec<(usize, f64)>>()
    });
    let filled = filled.into_iter().flatten();
    for (at, e) in filled.take_while(|_| !scene.is_cancelled()) {
        held[at] = e;
    }
    held
}
