//! Shot noise: the electrons of a pixel are a Poisson draw of their expectation (light and dark charge).
//!
//! ```text
//! N_xy <- Poisson(N_xy)
//! ```
//!
//! Reference: the linear model of EMVA Standard 1288, release 4.0 Linear, section 2; the draws are exact at every mean (`rng`). Validity: one
//! electron a photon, so no gain before the charge is read. Price: a draw a pixel, from a table where it holds what most hold,
//! else of its own, by inversion or by rejection.

use super::cause::{digits, no_light};
use super::{Effect, Judge, Loss, Need, Pass, Stage};
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
    let no_dark = if scene.simulated.dark {
        "no dark current"
    } else {
        "dark current is switched off"
    };
    let need = if most == 0.0 {
        Need::none(format!("{}; {no_dark}", no_light(scene)))
    } else {
        let e = most.min(scene.spill.most_e).sqrt().max(spilt_e(scene));
        Need {
            because: format!(
                "charge comes in electrons, up to {} in a pixel",
                digits(most)
            )
            .into(),
            error: Loss { e, px: 0.0 },
            drawn_e: 0.0,
            price_ms: price_ms(scene),
        }
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

/// Pixels, and pixels of each footprint, that are looked at for the price.
const LOOKED_AT: [usize; 2] = [256, 8];
/// ns of a draw from the table: of a small mean most are its first entry, and foreseen.
fn table_ns(mean: f64) -> f64 {
    4.5 + 17.5 * mean.min(1.0)
}

/// What drawing takes, ms.
fn price_ms(scene: &Scene) -> f64 {
    let (pixels, common) = (scene.view.camera.detector.pixels(), scene.common_e());
    let has_table = PoissonTable::covers(f64::from(common));
    // Some pixels of all, at a step that is no multiple of the columns.
    let step = (pixels / LOOKED_AT[0]) | 1;
    let looked = (0..pixels).step_by(step);
    let count = looked.len().max(1) as f64;
    let dark_ns = looked.map(|pixel| match scene.background_of(pixel) {
        e if has_table && e as f32 == common => table_ns(e),
        e => draw_ns(e),
    });
    let dark_ns = dark_ns.sum::<f64>() / count;

    let (background, mut touched, mut lit_ns) = (scene.background_e(), 0.0, 0.0);
    for (i, source) in scene.sources.iter().enumerate() {
        let shares = source.footprint.shares();
        if shares.is_empty() || source.electrons == 0.0 {
            continue;
        }
        let each = shares.len() as f64 / LOOKED_AT[1] as f64;
        for k in 0..LOOKED_AT[1] {
            // Any places; 7919 is a prime.
            let share = shares[(7919 * (i + k) + k * shares.len() / LOOKED_AT[1]) % shares.len()];
            lit_ns += each * draw_ns(background + source.electrons * f64::from(share));
        }
        touched += shares.len() as f64;
    }
    // Footprints overlap as by chance.
    let lit = pixels as f64 * (1.0 - libm::exp(-touched / pixels as f64));
    (lit * lit_ns / f64::max(touched, 1.0) + (pixels as f64 - lit) * dark_ns) * 1e-6
}

/// ns of a draw of its own: by inversion each electron is a step, and a branch that is hard to foresee; by rejection
/// the greater part is accepted at once, the greater the larger the mean.
fn draw_ns(mean: f64) -> f64 {
    match mean {
        0.0 => 1.8,
        ..10.0 => 20.0 + 22.0 * libm::sqrt(mean).min(2.1),
        _ => 40.0 + 45.0 * (20.0 / mean).min(1.0),
    }
}
