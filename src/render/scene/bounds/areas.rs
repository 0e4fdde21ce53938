//! Area light: the change of any pixel without an effect that shapes images.

use super::wells::{greatest, hold, max_difference};
use crate::camera::Detector;
use crate::reduce;
use crate::scene::area::area_light::AreaLight;
use crate::scene::area::full::Full;
use crate::scene::area::image::lit_by;
use crate::scene::area::plane::Plane;
use crate::scene::area::together::TotalAreaLight;
use crate::scene::charge::light_e;
use crate::scene::content::Scene;
use crate::scene::effect_set::EffectSet;
use crate::scene::view::View;
use nalgebra::Vector3;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;

/// Steepest slope of the light over its steepest step from pixel to pixel.
const STEEPER: f64 = 1.5;
/// Samples of solid angles along a side of the detector, and the margin for positions between them.
const SAMPLES: usize = 7;
const BETWEEN: f64 = 1.1;
/// Rows computed together.
const BAND: usize = 16;

/// The light of all area sources with the effects `other`.
pub(crate) fn areas_with(scene: &Scene, other: &EffectSet) -> TotalAreaLight {
    let view = &scene.view;
    let full = Full::of(view, view.areas.iter(), other, &scene.fidelity);
    let areas = view.areas.iter();
    let areas = areas.filter(|area| other.has(area.effect));
    let areas: Vec<AreaLight> = areas
        .map(|area| lit_by(view, area, other, &full, &scene.fidelity))
        .collect();
    TotalAreaLight::of(&areas, view, view.camera.detector.pixels())
}

/// The greatest error of light that is not evaluated in full pixels, compared with the effects
/// `other`, which have no full wells, e-.
pub fn full_pixel_error_e(scene: &Scene, other: &EffectSet) -> f64 {
    let others = areas_with(scene, other);
    if scene.is_cancelled() {
        return 0.0;
    }
    let [current_e, others_e] = [scene.areas_light.e(), others.e()];
    f64::from(reduce::max_difference(current_e, others_e)) * scene.max_response()
}

/// Bound of the change of a pixel if area light moves by `px`, from the steepest step between two
/// pixels, e-.
pub(crate) fn areas_moved_e(scene: &Scene, px: f64) -> f64 {
    let steepest = |rows: &[f32], step: usize| match rows.get(step..) {
        Some(next) => reduce::max_difference(rows, next),
        None => 0.0,
    };
    let Detector { width, height, .. } = scene.view.camera.detector;
    let Some(light) = scene.areas_light.light() else {
        return 0.0;
    };
    let bands = (0..height.div_ceil(BAND)).into_par_iter();
    let bands = bands.filter(|_| !scene.is_cancelled());
    // Each band includes the first row of the next.
    let slopes = bands.map_init(Vec::new, |e, band| {
        let rows = band * BAND..(band * BAND + BAND + 1).min(height);
        e.clear();
        e.resize(rows.len() * width, 0.0);
        light.add_to(Some(Level::best()), rows.start * width, e);
        let across = e.chunks(width).map(|row| steepest(row, 1));
        [across.fold(0.0, f32::max), steepest(e, width)]
    });
    let greater = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
    let [across, down] = slopes.reduce(|| [0.0; 2], greater).map(f64::from);
    STEEPER * px * libm::hypot(across, down) * scene.max_response()
}

/// Estimate of the greatest change of a pixel's area light between the effects `a` and `b`, by its
/// solid angle and transmission, e-. Both are relative to the ideal pixel for which the peaks are
/// computed.
pub fn areas_transmission_change_e(view: &View, a: &EffectSet, b: &EffectSet) -> f64 {
    let of_sky = view.areas.iter().filter(|area| {
        let radiance = area.radiance.as_ref();
        radiance.is_ok_and(|radiance| !radiance.is_of_pixels())
    });
    let peak_e: f64 = of_sky.map(|area| area.peak_e).sum();
    if peak_e == 0.0 {
        return 0.0;
    }
    let planes = [&EffectSet::default(), a, b];
    let planes = planes.map(|of| Plane::new(view, of, Vector3::zeros()));
    let position = |i: usize, side: f64| i as f64 / (SAMPLES - 1) as f64 * side - 0.5;
    let [columns, rows] = view.camera.detector.sides();
    let parts = (0..SAMPLES * SAMPLES).filter_map(|i| {
        let at = [position(i % SAMPLES, columns), position(i / SAMPLES, rows)];
        let solid_angle_sr = |plane: &Plane<'_>| Some(plane.solid_angle_sr(at)?.1);
        let [ideal, a, b] = [&planes[0], &planes[1], &planes[2]].map(solid_angle_sr);
        let difference = (a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs();
        Some(difference / ideal.filter(|ideal| *ideal > 0.0)?)
    });
    BETWEEN * peak_e * parts.fold(0.0, f64::max)
}

/// Bound of the final change of any pixel by area light with the effects `other`, e-. If `other`
/// only leaves out effects of the scene, the light is rasterized again and compared; else the bound
/// is that of a motion by `px`.
pub fn areas_changed_e(scene: &Scene, other: &EffectSet, px: f64) -> f64 {
    let areas = &scene.areas_light;
    if areas.light().is_none() {
        return 0.0;
    }
    if scene.simulated.and_shapes(other) != scene.simulated {
        return areas_moved_e(scene, px).min(scene.blooming.max_e);
    }
    let detector = &scene.view.camera.detector;
    let (width, height) = (detector.width, detector.height);
    let others = areas_with(scene, other);
    if scene.is_cancelled() {
        return 0.0;
    }
    let [current_e, others_e] = [areas.e(), others.e()];
    let change_e = |pixel: usize| {
        let other = others_e.get(pixel).copied().unwrap_or(0.0);
        f64::from(other) - f64::from(current_e[pixel])
    };
    let (mut max_e, mut columns_e) = (0.0f64, vec![0.0; width]);
    let rows = (0..height).take_while(|_| !scene.is_cancelled());
    for pixel in rows.flat_map(|row| row * width..(row + 1) * width) {
        let change = change_e(pixel);
        columns_e[pixel % width] += change;
        if !scene.blooming.has(pixel % width) {
            max_e = max_e.max(change.abs());
        }
    }
    let transfer_smear = columns_e.iter().map(|e| e.abs()).fold(0.0, f64::max);
    let max_e = max_e * scene.max_response() + transfer_smear * scene.transfer_smear_fraction();
    let columns = &scene.blooming.columns;
    if columns.is_empty() || scene.is_cancelled() {
        return max_e;
    }
    max_e.max(greatest(scene, columns, |columns| {
        let mut with = light_e(scene, columns, &scene.simulated);
        let mut without = with.clone();
        for (charge, column) in without.chunks_exact_mut(height).zip(columns) {
            for (row, e) in charge.iter_mut().enumerate() {
                *e = (*e + change_e(row * width + column)).max(0.0);
            }
        }
        for light in [&mut with, &mut without] {
            hold(scene, light, columns, &scene.simulated);
        }
        max_difference(&with, &without)
    }))
}
