//! Shot noise: the electrons of a pixel are a Poisson draw of their expectation (light and dark
//! charge).
//!
//! ```text
//! N_xy <- Poisson(N_xy)
//! ```
//!
//! Reference: the linear model of EMVA Standard 1288, release 4.0 Linear, section 2; the draws are
//! Poisson's within the tolerance `poisson_tv` (`rng::poisson`).
//! Validity: one electron a photon, so no gain before the charge is read.
//! Price: a draw a pixel, by search at small means, else by an expansion.

use super::cause::{no_light, three_digits};
use super::{Assessment, Effect, ErrorBound, Pass};
use crate::fidelity::Fidelity;
use crate::kernels;
use crate::scene::bounds::greatest;
use crate::scene::{EffectId, Scene, columns_e};
use skyloop_base::rng::poisson::Switch;

/// Shot noise.
pub(crate) const SHOT_NOISE: Effect =
    Effect::charge(EffectId::ShotNoise, "shot noise", assess).random();

/// This effect's identity in the noise key.
const STREAM: u8 = 1;

fn assess<'s>(scene: &'s Scene, fidelity: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let max_e = scene.brightest_e();
    let no_dark = if scene.simulated.has(EffectId::DarkCurrent) {
        "no dark current"
    } else {
        "dark current is switched off"
    };
    let assessment = if max_e == 0.0 {
        Assessment::none(format!("{}; {no_dark}", no_light(scene)))
    } else {
        let e = max_e
            .min(scene.blooming.max_e)
            .sqrt()
            .max(bloomed_noise_e(scene));
        let max_e = three_digits(max_e);
        let because = format!("charge comes in electrons, up to {max_e} in a pixel");
        Assessment::new(because, ErrorBound::of_pixel(e), estimated_ms(scene))
    };
    let switch = Switch::within(fidelity.poisson_tv);
    let pass = Pass::Pixels(Box::new(move |tile| {
        let (level, key, first) = (tile.level, tile.key, tile.first);
        kernels::shot_noise(level, key, STREAM, first, switch, tile.electrons);
    }));
    (assessment, pass)
}

/// Bound (e- rms) of the noise of blooming charge. The variance of a pixel is at most that of all
/// draws of its column (Efron and Stein 1981, Annals of Statistics 9, 586), because the pixel holds
/// a part of each.
fn bloomed_noise_e(scene: &Scene) -> f64 {
    if !scene.blooming.spills() {
        return 0.0;
    }
    greatest(scene, &scene.blooming.columns, |columns| {
        let charge = columns_e(scene, columns, &scene.simulated);
        let columns = charge.chunks_exact(scene.view.camera.detector.height);
        columns
            .map(|column| column.iter().sum::<f64>().sqrt())
            .fold(0.0, f64::max)
    })
}

/// Pixels sampled for the estimate of time.
const SAMPLED: usize = 256;

/// Estimated time of drawing, ms, from the means of some pixels. The odd step avoids sampling a
/// single column.
fn estimated_ms(scene: &Scene) -> f64 {
    let pixels = scene.view.camera.detector.pixels();
    let step = (pixels / SAMPLED) | 1;
    let samples = (0..pixels).step_by(step);
    let count = samples.len().max(1) as f64;
    let ns = samples.map(|pixel| draw_ns(scene.background_of(pixel)));
    pixels as f64 * ns.sum::<f64>() / count * 1e-6
}

/// Below this mean (e-) a draw is a search from 0.
const SEARCHED: f64 = 12.0;

/// Time of a draw, ns: all lanes search until the last has its result.
fn draw_ns(mean: f64) -> f64 {
    match mean {
        0.0 => 0.1,
        mean if mean < SEARCHED => 1.5 + 0.14 * mean,
        _ => 1.3,
    }
}
