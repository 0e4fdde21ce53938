//! The most and the least light that a pixel of each column of cells turns into charge.

use super::cells::{self, CELL};
use crate::scene::area::area_light::AreaLight;
use crate::scene::content::Scene;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::lit::Lit;
use crate::scene::source::{Body, Source};
use crate::scene::trail::columns_e;

/// What of light the pixels turn into charge, by `lights` alone: a bound (e-) for each column of cells (`brightest`), whether
/// their response is skipped or not.
pub fn lit_e<'a>(scene: &Scene, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
    cells::greatest_e(&scene.view.camera.detector, &light_of_cells(scene, lights))
}

fn light_of_cells<'a>(scene: &Scene, lights: impl Iterator<Item = Lit<'a>>) -> Vec<Vec<f64>> {
    let detector = &scene.view.camera.detector;
    let response = |pixel| detector.pattern.response_of(pixel).max(1.0);
    let weight = !turns_all_alike(scene);
    let weight = weight.then_some(&response as cells::Weight<'_>);
    cells::cells_of(detector, lights, weight, &scene.view.limit)
}

/// [`lit_e`] by the stars, and by all light.
pub fn stars_and_all_lit_e(scene: &Scene) -> [Vec<f64>; 2] {
    let detector = &scene.view.camera.detector;
    let (stars, others): (Vec<&Source>, _) =
        (scene.sources.iter()).partition(|source| matches!(source.body, Body::Star(_)));
    let lit = |sources: Vec<&Source>| light_of_cells(scene, sources.into_iter().map(Lit::from));
    let mut parts = lit(stars);
    let stars = cells::greatest_e(detector, &parts);
    parts.extend(lit(others));
    let areas = scene.areas_light.light();
    if turns_all_alike(scene) {
        parts.extend(areas.map(|light| light.most_of_cells(CELL)));
    } else {
        parts.extend(light_of_cells(scene, areas.into_iter().map(Lit::from)));
    }
    [stars, cells::greatest_e(detector, &parts)]
}

/// Whether all pixels turn light into charge alike.
fn turns_all_alike(scene: &Scene) -> bool {
    !scene.simulated.has(EffectId::PixelResponse)
        || scene.view.camera.detector.pattern.response().is_none()
}

/// [`lit_e`] by an area's light alone.
pub fn area_lit_e(scene: &Scene, area: &AreaLight) -> Vec<f64> {
    if turns_all_alike(scene) {
        area.most_of_columns()
    } else {
        lit_e(scene, area.light().into_iter().map(Lit::from))
    }
}

/// No pixel gets more light than this from all sources together after it is multiplied by its `weight`, e-, for each column of cells.
pub fn lit_where(scene: &Scene, weight: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
    let detector = &scene.view.camera.detector;
    cells::pixels_e(
        detector,
        scene.lights(&scene.simulated),
        Some(&weight),
        &scene.view.limit,
    )
}

/// What each pixel of each column gets of the column's light by an area's alone while it is shifted, e-.
pub fn trail_of(scene: &Scene, area: &AreaLight) -> Vec<f64> {
    let lights = area.light().into_iter().map(Lit::from);
    let mut columns = columns_e(&scene.view, lights);
    let part = scene.trail_part();
    columns.iter_mut().for_each(|e| *e *= part);
    columns
}

/// No pixel of a column gets less than this of the area light that a frame with the effects `parts` has too, e-, as much as the least
/// response leaves of it; empty where there is none.
pub fn areas_floor_e(scene: &Scene, parts: &EffectSet) -> Vec<f64> {
    let width = scene.view.camera.detector.width;
    let mut floors = Vec::new();
    let both = scene.areas.iter().filter(|area| parts.has(area.effect));
    for area in both.filter(|area| area.electrons > 0.0) {
        floors.resize(width, 0.0);
        for (floors, e) in floors.chunks_mut(CELL).zip(area.floor_e()) {
            floors.iter_mut().for_each(|floor| *floor += f64::from(e));
        }
    }
    let responds = 2.0 - scene.responds();
    floors.iter_mut().for_each(|floor| *floor *= responds);
    floors
}

/// No pixel turns less of an area's light into charge, e-.
pub fn least_e(scene: &Scene, area: &AreaLight) -> f64 {
    let least = area.floor_e().reduce(f32::min).unwrap_or(0.0);
    f64::from(least) * (2.0 - scene.responds())
}
