//! Bounds of the light of a pixel, for each column of cells.

use super::cells::{self, CELL};
use crate::scene::area::area_light::AreaLight;
use crate::scene::content::Scene;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::lit::Lit;
use crate::scene::source::{Body, Source};
use crate::scene::transfer_smear::columns_e;

/// Bound of the charge of a pixel from `lights` alone, for each column of cells, e-. It holds with
/// and without pixel response.
pub fn lit_e<'a>(scene: &Scene, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
    cells::greatest_e(&scene.view.camera.detector, &light_of_cells(scene, lights))
}

fn light_of_cells<'a>(scene: &Scene, lights: impl Iterator<Item = Lit<'a>>) -> Vec<Vec<f64>> {
    let detector = &scene.view.camera.detector;
    let response = |pixel| detector.pattern.response_of(pixel).max(1.0);
    let weight = !has_uniform_response(scene);
    let weight = weight.then_some(&response as cells::Weight<'_>);
    cells::cells_of(detector, lights, weight, &scene.view.limit)
}

/// [`lit_e`] of the stars, and of all light.
pub(crate) fn stars_and_all_lit_e(scene: &Scene) -> [Vec<f64>; 2] {
    let detector = &scene.view.camera.detector;
    let (stars, others): (Vec<&Source>, _) =
        (scene.sources.iter()).partition(|source| matches!(source.body, Body::Star(_)));
    let lit = |sources: Vec<&Source>| light_of_cells(scene, sources.into_iter().map(Lit::from));
    let mut parts = lit(stars);
    let stars = cells::greatest_e(detector, &parts);
    parts.extend(lit(others));
    let areas = scene.areas_light.light();
    if has_uniform_response(scene) {
        parts.extend(areas.map(|light| light.max_of_cells(CELL)));
    } else {
        parts.extend(light_of_cells(scene, areas.into_iter().map(Lit::from)));
    }
    [stars, cells::greatest_e(detector, &parts)]
}

/// Whether all pixels have the same response.
fn has_uniform_response(scene: &Scene) -> bool {
    !scene.simulated.has(EffectId::PixelResponse)
        || scene.view.camera.detector.pattern.response().is_none()
}

/// [`lit_e`] of one area source.
pub fn area_lit_e(scene: &Scene, area: &AreaLight) -> Vec<f64> {
    if has_uniform_response(scene) {
        area.max_of_columns()
    } else {
        lit_e(scene, area.light().into_iter().map(Lit::from))
    }
}

/// Bound of the light of a pixel from all sources times its `weight`, for each column of cells, e-.
pub fn lit_where(scene: &Scene, weight: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
    let detector = &scene.view.camera.detector;
    cells::pixels_e(
        detector,
        scene.lights(&scene.simulated),
        Some(&weight),
        &scene.view.limit,
    )
}

/// Frame-transfer smear of one area source in each column, e- a pixel.
pub fn transfer_smear_of(scene: &Scene, area: &AreaLight) -> Vec<f64> {
    let lights = area.light().into_iter().map(Lit::from);
    let mut columns = columns_e(&scene.view, lights);
    let part = scene.transfer_smear_fraction();
    columns.iter_mut().for_each(|e| *e *= part);
    columns
}

/// The least charge of a pixel of each column from the area sources in `parts`, at the least
/// response, e-; empty without area sources.
pub(crate) fn areas_min_e(scene: &Scene, parts: &EffectSet) -> Vec<f64> {
    let width = scene.view.camera.detector.width;
    let mut floors = Vec::new();
    let both = scene.areas.iter().filter(|area| parts.has(area.effect));
    for area in both.filter(|area| area.electrons > 0.0) {
        floors.resize(width, 0.0);
        for (floors, e) in floors.chunks_mut(CELL).zip(area.floor_e()) {
            floors.iter_mut().for_each(|floor| *floor += f64::from(e));
        }
    }
    let min_response = 2.0 - scene.max_response();
    floors.iter_mut().for_each(|floor| *floor *= min_response);
    floors
}

/// The least charge of a pixel from an area source, e-.
pub(crate) fn min_charge_e(scene: &Scene, area: &AreaLight) -> f64 {
    let min_e = area.floor_e().reduce(f32::min).unwrap_or(0.0);
    f64::from(min_e) * (2.0 - scene.max_response())
}
