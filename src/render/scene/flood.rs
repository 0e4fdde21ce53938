//! Pixels that are full without stars and objects.

use super::content::Scene;
use super::effect_set::EffectId;
use super::signal;
use rayon::prelude::*;

/// The effect that adds the most charge, if every pixel is full without stars and objects.
pub fn flooded_by(scene: &Scene) -> Option<EffectId> {
    if let Some(area) = scene.blooming.flood {
        return Some(area);
    }
    let full_e = signal::full_e(&scene.view.camera.detector, &scene.simulated);
    // The faintest pixel is at most the mean.
    if scene.background_e() * scene.max_response() < full_e || full_part(scene) < 1.0 {
        return None;
    }
    let pixels = scene.view.camera.detector.pixels() as f64;
    let areas = scene.areas.iter();
    let areas = areas.map(|area| (area.effect, area.electrons / pixels));
    let others = [
        (EffectId::DarkCurrent, scene.dark_e()),
        (EffectId::FrameTransfer, scene.mean_transfer_smear_e()),
    ];
    let brightest = areas.chain(others).max_by(|a, b| a.1.total_cmp(&b.1));
    brightest.map(|(effect, _)| effect)
}

/// The part of the pixels that are full in expectation without stars and objects (1).
pub fn full_part(scene: &Scene) -> f64 {
    let detector = &scene.view.camera.detector;
    let full_e = signal::full_e(detector, &scene.simulated);
    if scene.brightest_e() < full_e {
        return 0.0;
    }
    let rows = (0..detector.height).into_par_iter();
    let rows = rows.filter(|_| !scene.is_cancelled());
    let full = rows.map_init(Vec::new, |light_e: &mut Vec<f32>, row| {
        let first = row * detector.width;
        light_e.clear();
        light_e.resize(detector.width, 0.0);
        scene.areas_light.add_to_row(first, light_e);
        let charges = (first..).zip(&*light_e);
        let charges = charges.map(|(pixel, e)| without_sources_e(scene, pixel, f64::from(*e)));
        charges.filter(|e| *e >= full_e).count()
    });
    full.sum::<usize>() as f64 / detector.pixels() as f64
}

/// The expected charge of a pixel with area light `light_e`, and without stars and objects, e-.
fn without_sources_e(scene: &Scene, pixel: usize, light_e: f64) -> f64 {
    let (detector, simulated) = (&scene.view.camera.detector, &scene.simulated);
    let mut e = light_e;
    if simulated.has(EffectId::PixelResponse) {
        e *= detector.pattern.response_of(pixel);
    }
    if simulated.has(EffectId::DarkCurrent) {
        e += detector.pattern.dark_e_s_of(pixel) * scene.view.exposure.duration_s;
    }
    e + scene
        .transfer_smear()
        .get(pixel % detector.width)
        .unwrap_or(&0.0)
}
