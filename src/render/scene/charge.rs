//! Expected charge of single pixels and whole columns.

use super::area::area_light::AreaLight;
use super::area::light::Light;
use super::content::Scene;
use super::effect_set::{EffectId, EffectSet};
use super::lit::Lit;
use super::source::Source;
use super::transfer_smear;
use crate::camera::Detector;
use rayon::prelude::*;

/// Pixels computed between two checks for cancellation.
const CHUNK_PIXELS: usize = 1 << 15;
/// Pixels of a group of columns: they fit a core's cache.
const GROUP_PIXELS: usize = 1 << 18;
/// Number of groups, if columns are few.
const GROUPS: usize = 8;

/// The expected charge of `pixels` (sorted row-major indices): light and dark charge, e-. Empty
/// once the frame is cancelled.
pub fn expected_e(scene: &Scene, pixels: &[u32]) -> Vec<f64> {
    let groups = pixels
        .par_chunks(CHUNK_PIXELS)
        .filter(|_| !scene.is_cancelled());
    let charge: Vec<Vec<f64>> = groups.map(|pixels| expected_of(scene, pixels)).collect();
    if scene.is_cancelled() {
        return Vec::new();
    }
    charge.concat()
}

fn expected_of(scene: &Scene, pixels: &[u32]) -> Vec<f64> {
    let detector = &scene.view.camera.detector;
    let mut charge = vec![0.0; pixels.len()];
    let within = |from: usize, length: usize| {
        let first = pixels.partition_point(|pixel| (*pixel as usize) < from);
        let past = pixels.partition_point(|pixel| (*pixel as usize) < from + length);
        first..past
    };
    for (charge, pixel) in charge.iter_mut().zip(pixels) {
        *charge = scene.areas_light.of_pixel(*pixel as usize);
    }
    let row = |pixel: Option<&u32>| pixel.map_or(0, |pixel| *pixel as usize / detector.width);
    let rows = row(pixels.first())..row(pixels.last()) + 1;
    let lights = scene.sources.iter().map(Lit::from);
    let lights = lights.take_while(|_| !scene.is_cancelled());
    for light in lights.filter(|light| light.electrons > 0.0) {
        for (row, column, shares) in light.footprint.rows(rows.clone()) {
            let from = row * detector.width + column;
            for i in within(from, shares.len()) {
                charge[i] += light.electrons * f64::from(shares[pixels[i] as usize - from]);
            }
        }
    }
    for (charge, pixel) in charge.iter_mut().zip(pixels) {
        let pixel = *pixel as usize;
        if scene.simulated.has(EffectId::PixelResponse) {
            *charge *= detector.pattern.response_of(pixel);
        }
        *charge += scene.unlit_of(pixel);
    }
    charge
}

/// The charge of particles in `pixels` (sorted row-major indices), e-. Ends once the frame is
/// cancelled.
pub fn struck_e(scene: &Scene, pixels: &[u32]) -> impl Iterator<Item = f64> {
    let mut hits = scene.struck.hits().peekable();
    let pixels = pixels.iter().take_while(|_| !scene.is_cancelled());
    pixels.map(move |pixel| {
        while hits.next_if(|hit| hit.0 < *pixel).is_some() {}
        let hit = hits.next_if(|hit| hit.0 == *pixel);
        hit.map_or(0.0, |hit| f64::from(hit.1))
    })
}

/// The expected charge of `columns` (sorted), one column after the other, in a frame with the
/// effects `parts`, e-: light and dark charge, without full wells.
pub fn columns_e(scene: &Scene, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
    let mut charge = light_e(scene, columns, parts);
    light_to_charge(scene, &mut charge, columns, parts);
    charge
}

/// The light on `columns` (sorted), one column after the other, in a frame with the effects
/// `parts`, e-.
pub(crate) fn light_e(scene: &Scene, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
    let spilling = &scene.blooming.columns;
    let positions = columns
        .iter()
        .map(|column| spilling.binary_search(column).ok());
    let Some(positions) = positions.collect::<Option<Vec<usize>>>() else {
        let sources = sources_if(scene, |source| parts.has(source.body.effect()));
        return light_of(scene, columns, &sources, &scene.area_lights(parts));
    };
    // The total was computed once; the light of effects that are left out is subtracted.
    let all = &scene.spilling_e;
    let height = scene.view.camera.detector.height;
    let column = |position: usize| all.get(position).into_iter().flatten().copied();
    let mut light: Vec<f64> = positions.into_iter().flat_map(column).collect();
    light.resize(columns.len() * height, 0.0);
    let sources = sources_if(scene, |source| !parts.has(source.body.effect()));
    let areas = area_lights_without(scene, parts);
    if !sources.is_empty() || !areas.is_empty() {
        let less = light_of(scene, columns, &sources, &areas);
        // Rounding must not give negative light.
        let both = light.iter_mut().zip(less);
        both.for_each(|(e, less)| *e = (*e - less).max(0.0));
    }
    light
}

/// The light on each of the columns that may fill up, e-.
pub(crate) fn spilling_e(scene: &Scene) -> Vec<Vec<f64>> {
    let sources = sources_if(scene, |source| scene.simulated.has(source.body.effect()));
    let areas = scene.area_lights(&scene.simulated);
    let groups = in_groups(scene, &scene.blooming.columns, |columns| {
        let light = light_of(scene, columns, &sources, &areas);
        let columns = light.chunks_exact(scene.view.camera.detector.height);
        columns.map(<[f64]>::to_vec).collect::<Vec<Vec<f64>>>()
    });
    groups.into_iter().flatten().collect()
}

fn sources_if(scene: &Scene, is_included: impl Fn(&Source) -> bool) -> Vec<Lit<'_>> {
    let sources = scene.sources.iter().filter(|source| is_included(source));
    sources.map(Lit::from).collect()
}

/// The light of `sources` and `areas` on `columns` (sorted), one column after the other, e-.
fn light_of(scene: &Scene, columns: &[usize], sources: &[Lit<'_>], areas: &[&Light]) -> Vec<f64> {
    let Detector { width, height, .. } = scene.view.camera.detector;
    let mut light = vec![0.0; columns.len() * height];
    for lit in sources {
        for (row, first, shares) in lit.footprint.rows(0..height) {
            let from = columns.partition_point(|column| *column < first);
            let touched = columns[from..].iter().zip(from..);
            for (column, i) in touched.take_while(|(column, _)| **column < first + shares.len()) {
                let share = f64::from(shares[*column - first]);
                light[i * height + row] += lit.electrons * share;
            }
        }
    }
    let mut done = 0;
    for run in columns.chunk_by(|a, b| a + 1 == *b) {
        let mut e = vec![0.0; run.len()];
        for (row, area) in (0..height).flat_map(|row| areas.iter().map(move |a| (row, a))) {
            e.fill(0.0);
            area.add_to_row(row * width + run[0], &mut e);
            for (e, i) in e.iter().zip(done..) {
                light[i * height + row] += f64::from(*e);
            }
        }
        done += run.len();
    }
    light
}

/// Converts the light on `columns` to charge, e-: with the pixel response, dark charge and
/// frame-transfer smear that `parts` contains.
pub(crate) fn light_to_charge(
    scene: &Scene,
    light: &mut [f64],
    columns: &[usize],
    parts: &EffectSet,
) {
    let detector = &scene.view.camera.detector;
    let transfer_smear = transfer_smear::part(&scene.view);
    let charges = light.par_chunks_exact_mut(detector.height).zip(columns);
    let charges = charges.filter(|_| !scene.is_cancelled());
    charges.for_each(|(charge, column)| {
        let transfer_smear_e = if parts.has(EffectId::FrameTransfer) {
            transfer_smear * charge.iter().sum::<f64>()
        } else {
            0.0
        };
        for (row, e) in charge.iter_mut().enumerate() {
            let pixel = row * detector.width + column;
            if parts.has(EffectId::PixelResponse) {
                *e *= detector.pattern.response_of(pixel);
            }
            if parts.has(EffectId::DarkCurrent) {
                *e += detector.pattern.dark_e_s_of(pixel) * scene.view.exposure.duration_s;
            }
            *e += transfer_smear_e;
        }
    });
}

/// The results of `work` on groups of `columns`, in parallel; incomplete once the frame is
/// cancelled.
pub fn in_groups<T: Send>(
    scene: &Scene,
    columns: &[usize],
    work: impl Fn(&[usize]) -> T + Send + Sync,
) -> Vec<T> {
    let max_columns = (GROUP_PIXELS / scene.view.camera.detector.height.max(1)).max(1);
    let groups = columns.par_chunks(columns.len().div_ceil(GROUPS).clamp(1, max_columns));
    let groups = groups.filter(|_| !scene.is_cancelled());
    groups.map(work).collect()
}

/// The light of the area sources that are not in `parts`.
fn area_lights_without<'a>(scene: &'a Scene, parts: &EffectSet) -> Vec<&'a Light> {
    let areas = scene.areas.iter();
    let areas = areas.filter(|area| !parts.has(area.effect));
    areas.filter_map(AreaLight::light).collect()
}
