//! Full well: a pixel holds no more charge than this.

use super::{Effect, Stage, Verdict, per_pixel};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// Full well.
pub const FULL_WELL: Effect = Effect {
    name: "full well",
    stage: Stage::Charge,
    judge,
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    let full = scene.camera.detector.full_well_e;
    // The brightest pixel that could be: all sources' light on one. Ten sigma above it nothing is drawn.
    let light: f64 = scene.sources.iter().map(|s| s.electrons).sum::<f64>() + scene.background_e();
    if light + 10.0 * light.sqrt() + 10.0 < full {
        return Verdict::Skip {
            why: "all light together does not fill one pixel",
            error_e: 0.0,
        };
    }
    Verdict::Run {
        because: "a source may fill a pixel",
        price_ms: per_pixel(scene, 0.2),
        pass: Box::new(move |tile| {
            tile.electrons
                .iter_mut()
                .for_each(|e| *e = e.min(full as f32));
        }),
    }
}
