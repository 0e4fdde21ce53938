//! Light of stars, objects, the Moon and the planets: the change of any pixel with other images.

use super::cells::CELL;
use super::compared::{Compared, Peak, compare};
use super::image::{BoundChange, Image};
use super::wells::{fill, max_difference};
use crate::scene::charge::{light_e, light_to_charge};
use crate::scene::content::Scene;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::source::Source;
use std::collections::BTreeMap;

/// Bounds are replaced until they are at most this times the known changes.
const ENOUGH: f64 = 1.0;
/// Bounds below this do not matter, e-.
const MIN_E: f64 = 1e-3;
/// Greatest number of rounds.
const ROUNDS: usize = 500;

/// Bound of the final change of any pixel with the effects `other`, e-: with pixel response,
/// frame-transfer smear and full wells. `change` bounds the change of each image; if the budget
/// allows, images are compared (`compared`). With `enters`, further sources may come onto the
/// detector.
pub fn changed_e(
    scene: &Scene,
    other: &EffectSet,
    enters: bool,
    faint: impl Fn(&Source) -> Option<f64> + Sync,
    change: impl Fn(&Image<'_>) -> BoundChange + Sync,
) -> f64 {
    let mut compared = compare(scene, other, enters, faint, change);
    // Columns of cells that fill up.
    let mut filled = BTreeMap::<usize, Filled>::new();
    let mut max_e = 0.0;
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
        max_e = part.all().min(scene.blooming.max_e);
        let row = if part.overflows {
            peak.max_bound.1
        } else {
            peak.row
        };
        let enough = part.bound <= ENOUGH * part.known + MIN_E;
        let replaced = if enough {
            Vec::new()
        } else {
            compared.replace_bounds(column, row)
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
    max_e
}

/// The final change of a column of cells, e-.
struct Part {
    known: f64,
    bound: f64,
    /// Whether its pixels fill up.
    fills: bool,
    /// Whether its bound includes the overflow of full pixels.
    overflows: bool,
}

impl Part {
    fn of(scene: &Scene, full: f64, column: usize, peak: &Peak, filled: Option<&Filled>) -> Part {
        let detector = &scene.view.camera.detector;
        let (smear, max_response) = (scene.transfer_smear_fraction(), scene.max_response());
        let [known, bound] = [
            peak.known + smear * peak.all[0],
            peak.bound * max_response + smear * peak.all[1],
        ];
        let fills = scene.simulated.has(EffectId::FullWell)
            && scene.brightest_of_cells(column) + known + bound >= detector.full_well_e;
        let spills = fills && scene.blooming.along;
        let own = Part {
            known,
            bound,
            fills,
            overflows: false,
        };
        match filled.filter(|_| fills) {
            None if spills => Part {
                known: known * (1.0 + full),
                bound: bound * (1.0 + full),
                ..own
            },
            None => own,
            Some(filled) => {
                let max_bound = peak.max_bound.0;
                let passed = if spills {
                    (max_bound * filled.full).min(peak.all[1])
                } else {
                    0.0
                };
                Part {
                    known: filled.change_e,
                    bound: (max_bound + passed) * max_response
                        + smear * peak.all[1] * (1.0 + filled.full),
                    overflows: true,
                    ..own
                }
            }
        }
    }

    fn all(&self) -> f64 {
        self.known + self.bound
    }
}

/// Columns that fill up, computed with both images.
struct Filled {
    /// The greatest change of a pixel's charge, e-.
    change_e: f64,
    /// Bound of the number of full pixels in a column.
    full: f64,
}

impl Filled {
    fn of(scene: &Scene, compared: &Compared<'_>, column: usize) -> Filled {
        let detector = &scene.view.camera.detector;
        let columns = column * CELL..((column + 1) * CELL).min(detector.width);
        let listed: Vec<usize> = columns.clone().collect();
        let with = light_e(scene, &listed, &scene.simulated);
        let change = compared.change_e(&columns);
        let without = with.iter().zip(&change);
        let without = without.map(|(e, change)| (e + change).max(0.0)).collect();
        let mut full = 0.0f64;
        let [with, without] = [with, without].map(|mut charge: Vec<f64>| {
            light_to_charge(scene, &mut charge, &listed, &scene.simulated);
            for column in charge.chunks_exact_mut(detector.height) {
                full = full.max(column.iter().sum::<f64>() / detector.full_well_e);
                fill(column, detector);
            }
            charge
        });
        Filled {
            change_e: max_difference(&with, &without),
            full,
        }
    }
}
