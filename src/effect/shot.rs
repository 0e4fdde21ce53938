//! Shot noise: the electrons of a pixel are a Poisson draw of their expectation (light and dark charge).
//!
//! ```text
//! N_xy <- Poisson(N_xy)
//! ```
//!
//! Reference: the linear model of EMVA Standard 1288, release 4.0 Linear, section 2; the draws are exact at every mean (`rng`). Validity: one
//! electron a photon, so no gain before the charge is read. Price: a draw a pixel; where most pixels hold the same, from a table.

use super::{Effect, Judge, Need, Pass, Stage};
use crate::fidelity::Fidelity;
use crate::rng::{PixelStream, PoissonTable};
use crate::scene::Scene;

/// Shot noise.
pub const SHOT_NOISE: Effect = Effect {
    name: "shot noise",
    stage: Stage::Charge,
    random: true,
    judge: Judge::Pixels(judge),
    mark: |simulated| simulated.shot = true,
};

/// This effect's identity in the noise key.
const STREAM: u8 = 1;

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> (Need, Pass<'s>) {
    let most = scene.brightest_e();
    let need = if most == 0.0 {
        Need::none("there is no light and no dark charge")
    } else {
        // What spills is drawn in other pixels.
        let spill = &scene.spill;
        let columns = || spill.charge_e.iter().map(|e| e.sqrt()).collect();
        let e = spill.shown_of(most.sqrt(), columns);
        Need::of_pixels(scene, "light comes in quanta", e, 20.0)
    };
    // Where dark current is even, most pixels hold nothing but it: one table serves them all.
    let background = scene.common_e();
    let table = PoissonTable::new(f64::from(background));
    let pass = Pass::Tile(Box::new(move |tile| {
        let first = tile.first_pixel();
        for (i, e) in tile.electrons.iter_mut().enumerate() {
            let mut stream = PixelStream::new(tile.key, STREAM, (first + i) as u32);
            *e = match &table {
                Some(table) if *e == background => table.draw(stream.uniform()),
                _ => stream.poisson(f64::from(*e)),
            } as f32;
        }
    }));
    (need, pass)
}
