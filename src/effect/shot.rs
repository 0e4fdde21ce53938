//! Shot noise: the electrons of a pixel are a Poisson draw of their expectation (light and dark charge).

use super::{Effect, Stage, Verdict, per_pixel};
use crate::fidelity::Fidelity;
use crate::rng::{PixelStream, PoissonTable};
use crate::scene::Scene;

/// Shot noise.
pub const SHOT_NOISE: Effect = Effect {
    name: "shot noise",
    stage: Stage::Charge,
    judge,
};

/// This effect's identity in the noise key.
const STREAM: u8 = 1;

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    if !scene.noise {
        return Verdict::Skip {
            why: "noise is switched off",
            error_e: 0.0,
        };
    }
    // Most pixels hold nothing but the background: one table serves them all.
    let background = scene.background_e() as f32;
    let table = PoissonTable::new(f64::from(background));
    Verdict::Run {
        because: "light comes in quanta",
        price_ms: per_pixel(scene, 20.0),
        pass: Box::new(move |tile| {
            let first = tile.first_pixel();
            for (i, e) in tile.electrons.iter_mut().enumerate() {
                let mut stream = PixelStream::new(tile.key, STREAM, (first + i) as u32);
                *e = match &table {
                    Some(table) if *e == background => table.draw(stream.uniform()),
                    _ => stream.poisson(f64::from(*e)),
                } as f32;
            }
        }),
    }
}
