//! Dark current: its mean is added to the light, and shot noise covers both.

use super::{Effect, Stage, Verdict, per_pixel};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// Dark charge, the same for every pixel.
pub const DARK_CURRENT: Effect = Effect {
    name: "dark current",
    stage: Stage::Light,
    judge,
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    let dark_e = scene.camera.detector.dark_e(scene.exposure.duration_s);
    if dark_e == 0.0 {
        return Verdict::Skip {
            why: "the detector has no dark current",
            error_e: 0.0,
        };
    }
    Verdict::Run {
        because: "the detector has dark current",
        price_ms: per_pixel(scene, 0.2),
        pass: Box::new(move |tile| tile.electrons.iter_mut().for_each(|e| *e += dark_e as f32)),
    }
}
