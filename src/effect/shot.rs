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
        let e = most.min(scene.spill.most_e).sqrt().max(spilt_e(scene));
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

/// A bound (e- rms) of the noise of what spills: of what a pixel shows the variance is at most that of all draws of its column
/// (Efron and Stein 1981, Annals of Statistics 9, 586), of which it shows a part each.
fn spilt_e(scene: &Scene) -> f64 {
    if !scene.spill.spills() {
        return 0.0;
    }
    let height = scene.view.camera.detector.height;
    let charge = scene.columns_e(&scene.spill.columns, &scene.simulated);
    let columns = charge.chunks_exact(height);
    columns
        .map(|column| column.iter().sum::<f64>().sqrt())
        .fold(0.0, f64::max)
}
