//! Distortion: the lens does not project as its ideal would.
//!
//! Brown-Conrady's model against the pinhole, or the coefficients of a fisheye against the equidistant projection;
//! `camera::projection` has the equations. Reference: Brown 1971 (Photogrammetric Engineering 37, 855), Kannala and Brandt 2006 (IEEE
//! Trans. PAMI 28, 1335), as OpenCV writes them. Validity: to the model's end, beyond which nothing has an image. Without it images are
//! off by the greatest displacement on the detector, and each one's light changes by what its own displacement d makes of its slope,
//! `0.86 N d / s` at most. Price: a polynomial, for a fisheye an arc tangent too, each time a
//! track is looked at.

use super::{Effect, Judge, Loss, Need, Stage};
use crate::camera::Model;
use crate::fidelity::Fidelity;
use crate::scene::{Change, STEEPEST_STREAK, Scene, View};

/// The lens's departure from its ideal.
pub const DISTORTION: Effect = Effect {
    name: "distortion",
    stage: Stage::Images,
    random: false,
    judge: Judge::Images(judge, change_e),
    mark: |simulated| simulated.distortion = true,
};

/// Places along a side of the detector at which the displacement is looked at.
const PLACES: usize = 13;

fn judge(view: &View, fidelity: &Fidelity) -> Need {
    let (optics, detector) = (&view.camera.optics, &view.camera.detector);
    if optics.projection.is_ideal() {
        return Need::none("the lens has no distortion");
    }
    let ideal = optics.projection.ideal();
    let place = |i: usize, pixels: usize| i as f64 / (PLACES - 1) as f64 * pixels as f64 - 0.5;
    let places = (0..PLACES * PLACES).map(|i| {
        [
            place(i % PLACES, detector.width),
            place(i / PLACES, detector.height),
        ]
    });
    let off = places.filter_map(|at| {
        let [x, y] = optics.project_by(&ideal, &optics.direction(at))?;
        Some((x - at[0]).hypot(y - at[1]))
    });
    // Between two places it is no hundredth more.
    let px = 1.01 * off.fold(0.0, f64::max);
    // The arc tangent is the ideal fisheye's too.
    let ns = match optics.projection.model() {
        Model::Fisheye { .. } => 12.0,
        _ => 40.0,
    };
    Need {
        because: format!("it moves images by up to {px:.3} px").into(),
        error: Loss { e: 0.0, px },
        drawn_e: 0.0,
        price_ms: view.looks(fidelity) * ns * 1e-6,
    }
}

fn change_e(scene: &Scene, loss: &Loss) -> f64 {
    let optics = &scene.view.camera.optics;
    let ideal = optics.projection.ideal();
    scene.change_e(|image| {
        let off = [0.0, 0.5, 1.0].map(|part| {
            let seen = scene.seen(&image.source.body, part);
            let [a, b] = [&ideal, &optics.projection].map(|by| optics.project_by(by, &seen));
            // Where one of them has no image, off it goes by as much as any.
            let apart = a.zip(b).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
            apart.unwrap_or(f64::INFINITY)
        });
        let px = 1.1 * off.into_iter().fold(0.0, f64::max);
        Change {
            e: image.inside_e(image.height_e, px) * (STEEPEST_STREAK * px / image.core_px).min(1.0),
            beside_px: px.min(2.0 * loss.px) + 1.0,
        }
    })
}
