//! What pixels show of a change: no more than they hold; and where charge spills along a column, also elsewhere.
//!
//! Columns that may fill up are few: what they hold with an effect and without it is worked out, pixel by pixel. Elsewhere a pixel
//! shows its own change.

use super::full_well::fill;
use crate::scene::{
    CELL, Change, Compared, EffectId, EffectSet, Image, Peak, Scene, Source, flooding_e,
};
use std::collections::BTreeMap;

/// The charge (e-) that is expected in `columns`, column by column, when their wells are full, in a frame that has those effects of the
/// scene's that `parts` has too.
pub(super) fn held_e(scene: &Scene, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
    let mut charge = scene.light_e(columns, parts);
    hold(scene, &mut charge, columns, parts);
    charge
}

/// Turns the light (e-) on `columns` into the charge that their pixels hold.
fn hold(scene: &Scene, light: &mut [f64], columns: &[usize], parts: &EffectSet) {
    scene.turn(light, columns, parts);
    if parts.has(EffectId::FullWell) {
        let detector = &scene.view.camera.detector;
        let columns = light.chunks_exact_mut(detector.height);
        columns.for_each(|column| fill(column, detector));
    }
}

/// The greatest of what `of` says of groups of `columns`.
pub(super) fn greatest(
    scene: &Scene,
    columns: &[usize],
    of: impl Fn(&[usize]) -> f64 + Send + Sync,
) -> f64 {
    let groups = scene.in_groups(columns, of);
    groups.into_iter().fold(0.0, f64::max)
}

/// Why an effect is not needed where all pixels are full of other light.
pub(super) const DROWNED: &str = "all pixels are full of other light";

/// Whether all pixels are full, with or without an effect, of one area's light: that itself is not left out for others'.
pub(super) fn is_drowned(scene: &Scene, effect: EffectId) -> bool {
    let without = scene.simulated.without(effect);
    let flood = scene
        .spill
        .flood
        .filter(|_| without.has(EffectId::FullWell));
    flood.is_some_and(|kind| without.has(kind.effect))
}

/// A bound (e-) of the change of what a pixel shows without an effect. `cells_e` tells one for pixels that do not fill up, for each column
/// of the scene's cells.
pub(super) fn shown_e(scene: &Scene, cells_e: impl FnOnce() -> Vec<f64>, effect: EffectId) -> f64 {
    let spill = &scene.spill;
    let everywhere = spill.columns.len() == scene.view.camera.detector.width;
    let cells_e = if everywhere { Vec::new() } else { cells_e() };
    let elsewhere = cells_e
        .iter()
        .enumerate()
        .filter(|(cell, _)| !spill.has(cell * CELL));
    let most = elsewhere.map(|(_, e)| *e).fold(0.0, f64::max);
    if spill.columns.is_empty() {
        return most;
    }
    let without = scene.simulated.without(effect);
    // Where all pixels are full either way, nothing of it shows.
    let full_e = flooding_e(&scene.view.camera.detector);
    let floor_e = scene.areas_floor_e(&without);
    let drowns = without.has(EffectId::FullWell) && scene.simulated.has(EffectId::FullWell);
    let columns = spill.columns.iter().copied();
    let columns: Vec<usize> = columns
        .filter(|column| !(drowns && floor_e.get(*column).is_some_and(|e| *e >= full_e)))
        .collect();
    most.max(greatest(scene, &columns, |columns| {
        let [with, without] = [&scene.simulated, &without].map(|of| held_e(scene, columns, of));
        apart(&with, &without)
    }))
}

/// A bound for each column of the scene's cells with the trail (e-, a value a column) that frame transfer adds.
pub(super) fn with_trail(
    scene: &Scene,
    mut cells_e: Vec<f64>,
    trail: impl FnOnce() -> Vec<f64>,
) -> Vec<f64> {
    if scene.trail_part() > 0.0 {
        let trails = of_cells(&trail());
        let cells = cells_e.iter_mut().zip(trails);
        cells.for_each(|(e, trail)| *e += trail);
    }
    cells_e
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
    let spills = scene.simulated.has(EffectId::FullWell) && !scene.spill.columns.is_empty();
    if !spills || scene.is_cancelled() {
        return held;
    }
    let detector = &scene.view.camera.detector;
    // The places among `pixels` of those in each column.
    let mut places = vec![Vec::new(); detector.width];
    let pixels_and_places = pixels.iter().zip(0u32..);
    for (pixel, place) in pixels_and_places.take_while(|_| !scene.is_cancelled()) {
        places[*pixel as usize % detector.width].push(place);
    }
    let spilling = scene.spill.columns.iter().copied();
    let columns: Vec<usize> = spilling
        .filter(|column| !places[*column].is_empty())
        .collect();
    let filled = scene.in_groups(&columns, |columns| {
        let charge = held_e(scene, columns, &scene.simulated);
        let charge = charge.chunks_exact(detector.height).zip(columns);
        let held = charge.flat_map(|(charge, column)| {
            let here = places[*column].iter().map(|at| *at as usize);
            here.map(|at| (at, charge[pixels[at] as usize / detector.width]))
        });
        held.collect::<Vec<(usize, f64)>>()
    });
    let filled = filled.into_iter().flatten();
    for (at, e) in filled.take_while(|_| !scene.is_cancelled()) {
        held[at] = e;
    }
    held
}

/// Bounds are replaced by the truth until they are no more than this times what is known.
const ENOUGH: f64 = 1.0;
/// What is no more than this (e-) is of no interest.
const LEAST_E: f64 = 1e-3;
/// How often, at most.
const ROUNDS: usize = 500;

/// A bound (e-) of the change of what pixels show where images are as with the effects `other`, `change` being a bound of each one's: as pixels
/// respond, with the trails of frame transfer, when wells are full. Near the truth, where that is affordable (`scene::compared`). Where
/// it `enters`, sources may be on the detector that are not now.
pub(super) fn changed_e(
    scene: &Scene,
    other: &EffectSet,
    enters: bool,
    faint: impl Fn(&Source) -> Option<f64> + Sync,
    change: impl Fn(&Image<'_>) -> Change + Sync,
) -> f64 {
    let mut compared = scene.compared(other, enters, faint, change);
    // Of columns that fill up, what is known to be shown of the change, and how many pixels pass the rest on.
    let mut filled = BTreeMap::<usize, Filled>::new();
    let mut most = 0.0;
    let all = scene.sources.iter().map(|source| source.arriving_e);
    let full = all.sum::<f64>() / scene.view.camera.detector.full_well_e;
    // The bound of a cancelled frame is not used.
    let is_on = |_: &usize| !scene.is_cancelled();
    for _ in (0..ROUNDS).take_while(is_on) {
        let peaks = compared.peaks();
        let parts = peaks.iter().enumerate().map(|(column, peak)| {
            let part = Part::of(scene, full, column, peak, filled.get(&column));
            (column, peak, part)
        });
        let Some((column, peak, part)) = parts.max_by(|a, b| a.2.all().total_cmp(&b.2.all()))
        else {
            return 0.0;
        };
        most = part.all().min(scene.spill.most_e);
        let row = if part.passes { peak.most.1 } else { peak.row };
        let enough = part.bound <= ENOUGH * part.known + LEAST_E;
        let replaced = if enough {
            Vec::new()
        } else {
            compared.look_closer(column, row)
        };
        if !replaced.is_empty() {
            for column in replaced {
                filled.remove(&column);
            }
        } else if part.fills && !filled.contains_key(&column) {
            filled.insert(column, Filled::of(scene, &compared, column));
        } else {
            break;
        }
    }
    most
}

/// A bound (e-) of the change of what area light makes of any pixel in the end with the effects `other`: where they leave out one of the
/// scene's the light is laid anew and compared, else it moves by no more than `px`.
pub(super) fn areas_changed_e(scene: &Scene, other: &EffectSet, px: f64) -> f64 {
    let areas = scene.areas_together();
    if areas.light().is_none() {
        return 0.0;
    }
    if scene.simulated.and_shapes(other) != scene.simulated {
        return scene.areas_moved_e(px).min(scene.spill.most_e);
    }
    let detector = &scene.view.camera.detector;
    let (width, height) = (detector.width, detector.height);
    let others = scene.areas_with(other);
    if scene.is_cancelled() {
        return 0.0;
    }
    let [is_e, others_e] = [areas.e(), others.e()];
    let comes_e = |pixel: usize| {
        let comes = others_e.get(pixel).copied().unwrap_or(0.0);
        f64::from(comes) - f64::from(is_e[pixel])
    };
    let (mut most, mut columns_e) = (0.0f64, vec![0.0; width]);
    let rows = (0..height).take_while(|_| !scene.is_cancelled());
    for pixel in rows.flat_map(|row| row * width..(row + 1) * width) {
        let comes = comes_e(pixel);
        columns_e[pixel % width] += comes;
        if !scene.spill.has(pixel % width) {
            most = most.max(comes.abs());
        }
    }
    let trail = columns_e.iter().map(|e| e.abs()).fold(0.0, f64::max);
    let most = most * scene.responds() + trail * scene.trail_part();
    let columns = &scene.spill.columns;
    if columns.is_empty() || scene.is_cancelled() {
        return most;
    }
    most.max(greatest(scene, columns, |columns| {
        let mut with = scene.light_e(columns, &scene.simulated);
        let mut without = with.clone();
        for (charge, column) in without.chunks_exact_mut(height).zip(columns) {
            for (row, e) in charge.iter_mut().enumerate() {
                *e = (*e + comes_e(row * width + column)).max(0.0);
            }
        }
        for light in [&mut with, &mut without] {
            hold(scene, light, columns, &scene.simulated);
        }
        apart(&with, &without)
    }))
}

/// What a column of cells changes by in the end, e-.
struct Part {
    known: f64,
    bound: f64,
    /// Whether its pixels fill up.
    fills: bool,
    /// Whether its bound is that of full pixels.
    passes: bool,
}

impl Part {
    fn of(scene: &Scene, full: f64, column: usize, peak: &Peak, filled: Option<&Filled>) -> Part {
        let detector = &scene.view.camera.detector;
        let (trails, responds) = (scene.trail_part(), scene.responds());
        let [known, bound] = [
            peak.known + trails * peak.all[0],
            peak.bound * responds + trails * peak.all[1],
        ];
        let fills = scene.simulated.has(EffectId::FullWell)
            && scene.fullest_e(column) + known + bound >= detector.full_well_e;
        let spills = fills && scene.spill.along;
        let own = Part {
            known,
            bound,
            fills,
            passes: false,
        };
        match filled.filter(|_| fills) {
            None if spills => Part {
                known: known * (1.0 + full),
                bound: bound * (1.0 + full),
                ..own
            },
            None => own,
            Some(filled) => {
                let most = peak.most.0;
                let passed = if spills {
                    (most * filled.full).min(peak.all[1])
                } else {
                    0.0
                };
                Part {
                    known: filled.apart,
                    bound: (most + passed) * responds + trails * peak.all[1] * (1.0 + filled.full),
                    passes: true,
                    ..own
                }
            }
        }
    }

    fn all(&self) -> f64 {
        self.known + self.bound
    }
}

/// What is known of columns that fill up.
struct Filled {
    /// The greatest change of what a pixel holds, e-.
    apart: f64,
    /// How many pixels of a column are full at most.
    full: f64,
}

impl Filled {
    fn of(scene: &Scene, compared: &Compared<'_>, column: usize) -> Filled {
        let detector = &scene.view.camera.detector;
        let columns = column * CELL..((column + 1) * CELL).min(detector.width);
        let listed: Vec<usize> = columns.clone().collect();
        let with = scene.light_e(&listed, &scene.simulated);
        let comes = compared.comes_e(&columns);
        let without = with.iter().zip(&comes);
        let without = without.map(|(e, comes)| (e + comes).max(0.0)).collect();
        let mut full = 0.0f64;
        let [with, without] = [with, without].map(|mut charge: Vec<f64>| {
            scene.turn(&mut charge, &listed, &scene.simulated);
            for column in charge.chunks_exact_mut(detector.height) {
                full = full.max(column.iter().sum::<f64>() / detector.full_well_e);
                fill(column, detector);
            }
            charge
        });
        Filled {
            apart: apart(&with, &without),
            full,
        }
    }
}
