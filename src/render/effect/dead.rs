//! Dead pixels: they give no charge.
//!
//! ```text
//! N_xy <- 0   at the dead pixels of the camera's pattern
//! ```
//!
//! Read noise and offset remain. Blooming charge passes over them as over other pixels, and is lost
//! at readout.
//! Reference: none but the definition; the pixels are drawn by the camera's serial number, or
//! listed.
//! Validity: single pixels, up to a tenth of the detector, dead in every frame and at any
//! temperature; no pixels of low response, no dead columns or rows.
//! Price: proportional to their number.

use super::cause::{counted, three_digits};
use super::{Assessment, Effect, ErrorBound, Pass};
use crate::fidelity::Fidelity;
use crate::scene::bounds::held_of;
use crate::scene::{EffectId, Scene, struck_e};

/// Dead pixels.
pub(crate) const DEAD_PIXELS: Effect = Effect::charge(EffectId::DeadPixels, "dead pixels", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let dead = detector.pattern.dead();
    let assessment = if dead.is_empty() {
        Assessment::none("the detector has no dead pixels")
    } else {
        let held = held_of(scene, dead).into_iter().fold(0.0, f64::max);
        let struck = struck_e(scene, dead).fold(0.0, f64::max);
        let all = counted(dead.len(), "dead pixel");
        let because = match held.max(struck) {
            0.0 => format!("{all}, and no charge that they could lose"),
            max_e => format!("{all}, up to {} e- in one", three_digits(max_e)),
        };
        Assessment {
            drawn_e: struck,
            ..Assessment::new(
                because,
                ErrorBound::of_pixel(held),
                dead.len() as f64 * 2e-6,
            )
        }
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        let (first, pixels) = (tile.first, tile.electrons.len());
        let from = dead.partition_point(|pixel| (*pixel as usize) < first);
        let in_tile = dead[from..].iter().map(|pixel| *pixel as usize);
        in_tile
            .take_while(|pixel| *pixel < first + pixels)
            .for_each(|pixel| tile.electrons[pixel - first] = 0.0);
    }));
    (assessment, pass)
}
