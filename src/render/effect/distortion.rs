//! Distortion: the lens does not project as its ideal would.
//!
//! Brown-Conrady's model against the pinhole, or the coefficients of a fisheye against the
//! equidistant projection; `camera::projection` has the equations.
//! Reference: Brown 1971 (Photogrammetric Engineering 37, 855), Kannala and Brandt 2006 (IEEE
//! Trans. PAMI 28, 1335), as OpenCV writes them.
//! Validity: to the model's end, beyond which nothing has an image. Without it images are off by
//! the greatest displacement on the detector, and each one's light changes by what its own
//! displacement d makes of its slope, `0.86 N d / s` at most, and by what the PSF differs where it
//! then falls; what touches the detector only without it comes with all its light; and pixels take
//! another solid angle of area light.
//! Price: a polynomial, for a fisheye an arc tangent too, each time a track is looked at.

use super::cause::three_digits;
use super::{Assessment, Effect, ErrorBound};
use crate::camera::Model;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    BoundChange, STEEPEST_STREAK, areas_changed_e, areas_taken_e, changed_e, lines_of_sight,
};
use crate::scene::{EffectId, EffectSet, Scene, Source, View, still_looks};

/// The lens's departure from its ideal.
pub const DISTORTION: Effect = Effect::images(EffectId::Distortion, "distortion", assess, change);

/// Places along a side of the detector, and of what images pass beside it, at which the
/// displacement is looked at.
const PLACES: usize = 13;

fn assess(view: &View, _: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    let (optics, detector) = (&view.camera.optics, &view.camera.detector);
    if optics.projection.is_ideal() {
        return Assessment::none("the lens has no distortion (optics.projection: k, p, strength)");
    }
    let ideal = optics.projection.ideal();
    // An image whose centre is on the detector has been half of its way beside it.
    let beside_px = view.longest_track_px(view.exposure.duration_s) / 2.0;
    let [columns, rows] = detector.sides();
    let place = |i: usize, pixels: f64| {
        i as f64 / (PLACES - 1) as f64 * (pixels + 2.0 * beside_px) - 0.5 - beside_px
    };
    let off = (0..PLACES * PLACES).filter_map(|i| {
        let at = [place(i % PLACES, columns), place(i / PLACES, rows)];
        // Far out there may be no image.
        let [x, y] = optics.project_by(&ideal, &optics.seen_at(at)?)?;
        Some(libm::hypot(x - at[0], y - at[1]))
    });
    // Between two places it is no hundredth more.
    let px = 1.01 * off.fold(0.0, f64::max);
    // Of what moves images by more, nothing else is asked.
    let e = if px <= fidelity.skip_px {
        let ideal = EffectSet::default();
        areas_taken_e(view, &ideal.with(EffectId::Distortion), &ideal)
    } else {
        0.0
    };
    // The arc tangent is the ideal fisheye's too.
    let ns = match optics.projection.model() {
        Model::Fisheye { .. } => 0.6,
        _ => 15.0,
    };
    let because = format!("it moves images by up to {} px", three_digits(px));
    Assessment::new(because, ErrorBound { e, px }, still_looks(view) * ns * 1e-6)
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
        // On the way it is not much more.
        (source.length_px() < 1.0).then_some(1.1 * off_px + 1.0)
    };
    let e = changed_e(scene, &other, enters, faint, |image| {
        let (mut px, mut sharper) = (0.0f64, 0.0f64);
        for seen in seen(&image.source.body) {
            let [a, b] = [&ideal, &optics.projection].map(|by| optics.project_by(by, &seen));
            // Where one of them has no image, off it goes by as much as any.
            let (Some(a), Some(b)) = (a, b) else {
                px = f64::INFINITY;
                continue;
            };
            px = px.max(1.1 * libm::hypot(a[0] - b[0], a[1] - b[1]));
            // Of one colour: others vary alike.
            let [a, b] = [a, b].map(|at| optics.psf_at(at, 1.0));
            sharper = sharper.max(1.1 * a.differs(&b));
        }
        let height_e = image.height_e();
        let off_e = image.moved_e(height_e, STEEPEST_STREAK, px);
        let all_e = image.inside_e(height_e, px) * (1.0 + sharper);
        BoundChange {
            e: (off_e + image.inside_e(height_e, px) * sharper).min(all_e),
            beside_px: px.min(2.0 * bound.px) + 1.0,
        }
    });
    let e = e + areas_changed_e(scene, &other, bound.px);
    // Where it runs, area light without it was laid; else that was moved alone.
    let e = if scene.simulated.has(EffectId::Distortion) {
        e
    } else {
        e + bound.e
    };
    ErrorBound { e, ..*bound }
}
