//! Full well: a pixel holds no more charge than this.

use super::{Effect, Judge, Need, Pass, Stage};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// Full well.
pub const FULL_WELL: Effect = Effect {
    name: "full well",
    stage: Stage::Charge,
    random: false,
    judge: Judge::Pixels(judge),
    mark: |_| {},
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> (Need, Pass<'s>) {
    let full = scene.view.camera.detector.full_well_e;
    let brightest = scene.peak_e + scene.most_background_e();
    // Ten sigma and ten above its expectation nothing is drawn.
    let most = brightest + 10.0 * brightest.sqrt() + 10.0;
    let need = if most < full {
        Need::none("no pixel fills up")
    } else {
        let over = (brightest - full).max(most - brightest);
        Need::of_pixels(scene, "a source may fill a pixel", over, 0.2)
    };
    let pass = Pass::Tile(Box::new(move |tile| {
        let pixels = tile.electrons.iter_mut();
        pixels.for_each(|e| *e = e.min(full as f32));
    }));
    (need, pass)
}
