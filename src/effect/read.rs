//! Read noise: a normal draw a pixel, added to the charge when it is read.

use super::{Effect, Stage, Verdict, per_pixel};
use crate::fidelity::Fidelity;
use crate::rng::PixelStream;
use crate::scene::Scene;

/// Read noise.
pub const READ_NOISE: Effect = Effect {
    name: "read noise",
    stage: Stage::Charge,
    judge,
};

/// This effect's identity in the noise key.
const STREAM: u8 = 2;

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    let sigma = scene.camera.detector.read_noise_e;
    if !scene.noise {
        return Verdict::Skip {
            why: "noise is switched off",
            error_e: 0.0,
        };
    }
    if sigma == 0.0 {
        return Verdict::Skip {
            why: "the detector reads without noise",
            error_e: 0.0,
        };
    }
    Verdict::Run {
        because: "the detector has read noise",
        price_ms: per_pixel(scene, 20.0),
        pass: Box::new(move |tile| {
            let first = tile.first_pixel();
            for (i, e) in tile.electrons.iter_mut().enumerate() {
                let mut stream = PixelStream::new(tile.key, STREAM, (first + i) as u32);
                *e += (sigma * stream.normal()) as f32;
            }
        }),
    }
}
