//! Radiation: the charge that particles leave along their tracks through the detector.
//!
//! ```text
//! N_xy <- N_xy + sum over events of the charge left in the pixel
//! ```
//!
//! The events are drawn once, in the scene, and read here and by the label: `camera::radiation` has their equations and
//! sources, `sky::radiation` their number by orbit. Their charge comes after shot noise, which it does not follow: its scatter is that of
//! the energy loss. Reference: there. Validity: charged particles alone, and pixels that keep no memory of them. Price: by the pixels of the events.

use super::{Effect, Judge, Loss, Need, Pass, Stage};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// Cosmic rays and trapped protons.
pub const RADIATION: Effect = Effect {
    name: "radiation",
    stage: Stage::Charge,
    random: true,
    judge: Judge::Pixels(judge),
    mark: |simulated| simulated.radiation = true,
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> (Need, Pass<'s>) {
    let mut hits: Vec<(u32, u32)> = (scene.events.iter())
        .flat_map(|event| event.pixels.iter().copied())
        .collect();
    hits.sort_unstable();
    let most = hits
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| same.iter().map(|(_, e)| f64::from(*e)).sum())
        .fold(0.0, f64::max);
    let width = scene.view.camera.detector.width;
    let e = scene.spill.shown_of(most, || {
        let mut columns = vec![0.0; width];
        for (pixel, e) in &hits {
            columns[*pixel as usize % width] += f64::from(*e);
        }
        columns
    });
    let need = if scene.view.camera.radiation.is_none() {
        Need::none("the camera is not exposed to radiation")
    } else if hits.is_empty() {
        Need::none("no particle crosses the detector")
    } else {
        Need {
            because: format!("{} particles cross the detector", scene.events.len()).into(),
            error: Loss { e, px: 0.0 },
            price_ms: hits.len() as f64 * 3e-6,
        }
    };
    let pass = Pass::Tile(Box::new(move |tile| {
        let (first, pixels) = (tile.first_pixel(), tile.electrons.len());
        let from = hits.partition_point(|(pixel, _)| (*pixel as usize) < first);
        let here = hits[from..].iter();
        for (pixel, e) in here.take_while(|(pixel, _)| (*pixel as usize) < first + pixels) {
            tile.electrons[*pixel as usize - first] += *e as f32;
        }
    }));
    (need, pass)
}
