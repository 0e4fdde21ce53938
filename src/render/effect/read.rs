//! Read noise of the amplifier.
//!
//! ```text
//! N_xy <- N_xy + sigma N(0, 1)
//! ```
//!
//! Reference: the linear model of EMVA Standard 1288, release 4.0 Linear, section 2.
//! Validity: white noise, the same for all pixels; no pattern of rows, no random telegraph signals.
//! Price: a normal draw a pixel.

use super::cause::three_digits;
use super::{Assessment, Effect, Pass};
use crate::fidelity::Fidelity;
use crate::kernels;
use crate::scene::{EffectId, Scene};

/// Read noise.
pub(crate) const READ_NOISE: Effect =
    Effect::charge(EffectId::ReadNoise, "read noise", assess).random();

/// This effect's identity in the noise key.
const STREAM: u8 = 2;

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let sigma = scene.view.camera.detector.read_noise_e;
    let assessment = if sigma == 0.0 {
        Assessment::none("the detector reads without noise (detector.read_noise_e)")
    } else {
        Assessment::of_pixels(scene, format!("{} e- rms", three_digits(sigma)), sigma, 0.9)
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        let (level, key, first) = (tile.level, tile.key, tile.first);
        kernels::read_noise(level, key, STREAM, first, sigma as f32, tile.electrons);
    }));
    (assessment, pass)
}
