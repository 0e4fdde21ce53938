//! Dark current: its mean is added to the light, and shot noise covers both.

use super::{Effect, Judge, Need, Pass, Stage};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// Dark charge, the same for every pixel.
pub const DARK_CURRENT: Effect = Effect {
    name: "dark current",
    stage: Stage::Light,
    random: false,
    judge: Judge::Pixels(judge),
    mark: |simulated| simulated.dark = true,
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> (Need, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let dark_e = detector.dark_e(scene.view.exposure.duration_s);
    let need = if dark_e == 0.0 {
        Need::none("the detector has no dark current")
    } else {
        let because = format!("{:.3} e-/s a pixel", detector.dark_e_s);
        Need::of_pixels(scene, because, dark_e, 0.2)
    };
    let pass = Pass::Tile(Box::new(move |tile| {
        tile.electrons.iter_mut().for_each(|e| *e += dark_e as f32);
    }));
    (need, pass)
}
