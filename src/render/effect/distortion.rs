//! Distortion: the departure of the lens from its ideal projection.
//!
//! Brown-Conrady's model against the pinhole, or the coefficients of a fisheye against the
//! equidistant projection; `camera::projection` has the equations.
//! Reference: Brown 1971 (Photogrammetric Engineering 37, 855), Kannala and Brandt 2006 (IEEE
//! Trans. PAMI 28, 1335), as OpenCV writes them.
//! Validity: up to the model's end, beyond which nothing has an image. Errors without it: images
//! are off by up to the greatest displacement on the detector. The light of an image with
//! displacement d changes by at most `0.86 N d / s`, and by the difference of the PSF at the other
//! position. Images may enter or leave the detector. Pixels see area light in another solid angle.
//! Price: a polynomial for each evaluation of a track, for a fisheye also an arc tangent.

use super::cause::three_digits;
use super::{Assessment, Effect, ErrorBound};
use crate::camera::Model;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    BoundChange, STEEPEST_STREAK, areas_changed_e, areas_transmission_change_e, changed_e,
    lines_of_sight,
};
use crate::scene::{EffectId, EffectSet, Scene, Source, View, still_evaluations};

/// The lens's departure from its ideal.
pub(crate) const DISTORTION: Effect =
    Effect::images(EffectId::Distortion, "distortion", assess, change);

/// Samples of the displacement along a side of the detector and its margins.
const SAMPLES: usize = 13;

fn assess(view: &View, _: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    let (optics, detector) = (&view.camera.optics, &view.camera.detector);
    if optics.projection.is_ideal() {
        return Assessment::none("the lens has no distortion (optics.projection: k, p, strength)");
    }
    let ideal = optics.projection.ideal();
    // Half the track of an image whose centre is on the detector may lie outside.
    let margin_px = view.longest_track_px(view.exposure.duration_s) / 2.0;
    let [columns, rows] = detector.sides();
    let position = |i: usize, pixels: f64| {
        i as f64 / (SAMPLES - 1) as f64 * (pixels + 2.0 * margin_px) - 0.5 - margin_px
    };
    let off = (0..SAMPLES * SAMPLES).filter_map(|i| {
        let at = [position(i % SAMPLES, columns), position(i / SAMPLES, rows)];
        // Far out there may be no image.
        let [x, y] = optics.project_by(&ideal, &optics.seen_at(at)?)?;
        Some(libm::hypot(x - at[0], y - at[1]))
    });
    // Between two samples it is at most 1 % greater.
    let px = 1.01 * off.fold(0.0, f64::max);
    // Beyond this tolerance the effect runs: no need for the other bound.
    let e = if px <= fidelity.skip_px {
        let ideal = EffectSet::default();
        areas_transmission_change_e(view, &ideal.with(EffectId::Distortion), &ideal)
    } else {
        0.0
    };
    // The ideal fisheye needs the arc tangent too.
    let ns = match optics.projection.model() {
        Model::Fisheye { .. } => 0.6,
        _ => 15.0,
    };
    let because = format!("it moves images by up to {} px", three_digits(px));
    Assessment::new(
        because,
        ErrorBound { e, px },
        still_evaluations(view) * ns * 1e-6,
    )
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let optics = &scene.view.camera.optics;
    let ideal = optics.projection.ideal();
    let other = scene.simulated.toggled(EffectId::Distortion);
    let enters = scene.simulated.has(EffectId::Distortion);
    let seen = lines_of_sight(scene);
    let faint = |source: &Source| {
        let [_, seen, _] = seen(&source.body);
        let [a, b] = [&ideal, &optics.projection].map(|by| optics.project_by(by, &seen));
        let (a, b) = a.zip(b)?;
        let off_px = libm::hypot(a[0] - b[0], a[1] - b[1]);
        // Elsewhere on the track the displacement is only slightly greater.
        (source.length_px() < 1.0).then_some(1.1 * off_px + 1.0)
    };
    let e = changed_e(scene, &other, enters, faint, |image| {
        let (mut px, mut sharper) = (0.0f64, 0.0f64);
        for seen in seen(&image.source.body) {
            let [a, b] = [&ideal, &optics.projection].map(|by| optics.project_by(by, &seen));
            // If one projection has no image, the displacement is unbounded.
            let (Some(a), Some(b)) = (a, b) else {
                px = f64::INFINITY;
                continue;
            };
            px = px.max(1.1 * libm::hypot(a[0] - b[0], a[1] - b[1]));
            // For one colour: others vary alike.
            let [a, b] = [a, b].map(|at| optics.psf_at(at, 1.0));
            sharper = sharper.max(1.1 * a.differs(&b));
        }
        let height_e = image.height_e();
        let off_e = image.moved_e(height_e, STEEPEST_STREAK, px);
        let all_e = image.inside_e(height_e, px) * (1.0 + sharper);
        BoundChange {
            e: (off_e + image.inside_e(height_e, px) * sharper).min(all_e),
            reach_px: px.min(2.0 * bound.px) + 1.0,
        }
    });
    let e = e + areas_changed_e(scene, &other, bound.px);
    // If the effect runs, `areas_changed_e` has rasterized the light without it; else it has only
    // moved the light.
    let e = if scene.simulated.has(EffectId::Distortion) {
        e
    } else {
        e + bound.e
    };
    ErrorBound { e, ..*bound }
}
