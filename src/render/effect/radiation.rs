//! Radiation: the charge that particles leave along their tracks through the detector.
//!
//! ```text
//! N_xy <- N_xy + sum over events of the charge left in the pixel
//! ```
//!
//! The events are drawn once, in the scene, for pixels and label. `camera::radiation` has their
//! equations and sources, `sky::radiation` their number by orbit. Their charge is added after shot
//! noise: its scatter is that of the energy loss.
//! Reference: see those modules.
//! Validity: charged particles alone; no damage to pixels, no persistence.
//! Price: proportional to the pixels of the events.

use super::cause::{counted, three_digits};
use super::{Assessment, Effect, ErrorBound, Pass};
use crate::camera::Flux;
use crate::fidelity::Fidelity;
use crate::scene::bounds::greatest;
use crate::scene::{EffectId, Scene, columns_e, drawn_e};
use crate::sky::radiation::{FREE_SPACE, flux};

/// Cosmic rays and trapped protons.
pub(crate) const RADIATION: Effect =
    Effect::charge(EffectId::Radiation, "radiation", assess).random();

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let hits = scene.struck.hits().count();
    let assessment = if scene.view.camera.radiation.is_none() {
        Assessment::none("the camera file has no [radiation]")
    } else if hits == 0 {
        Assessment::none(format!("no particle comes, {}", rate(scene)))
    } else {
        let all = counted(scene.events.len(), "particle");
        let because = format!("{all} on the detector, {}", rate(scene));
        let error = ErrorBound::of_pixel(overflow_e(scene));
        Assessment::new(because, error, hits as f64 * 3e-6)
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        let (first, pixels) = (tile.first, tile.electrons.len());
        for (pixel, e) in scene.struck.among(first..first + pixels) {
            tile.electrons[pixel as usize - first] += e as f32;
        }
    }));
    (assessment, pass)
}

/// The expected number of particles, and its source.
fn rate(scene: &Scene) -> String {
    let (view, camera) = (&scene.view, &scene.view.camera);
    let Some(radiation) = &camera.radiation else {
        return String::new();
    };
    let (flux, by) = match (radiation.flux, &view.vehicle.orbit) {
        (Flux::Fixed(flux), _) => (flux, ""),
        (Flux::ByOrbit, Some(state)) => {
            let flux = flux(&state.position_m, view.exposure.mid);
            (flux, " by the orbit")
        }
        (Flux::ByOrbit, None) => (
            FREE_SPACE,
            ", free space's: the observer has no position (observer.orbit)",
        ),
    };
    let expected = radiation.expected_events(&camera.detector, flux, view.exposure.duration_s);
    let (expected, flux) = (three_digits(expected), three_digits(flux));
    format!("{expected} expected at {flux} /cm^2/s{by}")
}

/// Bound of the charge of all hits that a pixel holds, e-: its own, and in blooming columns the
/// overflow of full neighbours.
fn overflow_e(scene: &Scene) -> f64 {
    let (detector, blooming) = (&scene.view.camera.detector, &scene.blooming);
    let max_e = scene.struck.max_e().min(blooming.max_e);
    if !blooming.spills() {
        return max_e;
    }
    // The charge of each column, and of its most charged pixel.
    let mut struck = vec![[0.0f64; 2]; detector.width];
    let hits = scene.struck.hits();
    for (pixel, e) in hits.take_while(|_| !scene.is_cancelled()) {
        let e = f64::from(e);
        let [all, greatest] = &mut struck[pixel as usize % detector.width];
        (*all, *greatest) = (*all + e, greatest.max(e));
    }
    let passed = greatest(scene, &blooming.columns, |columns| {
        let expected = columns_e(scene, columns, &scene.simulated);
        let columns = expected.chunks_exact(detector.height).zip(columns);
        let passed = columns.map(|(expected, column)| {
            let [all, greatest] = struck[*column];
            let charge = drawn_e(expected.iter().sum()) + all;
            let full = (charge / detector.full_well_e).floor();
            all.min(greatest * (1.0 + full))
        });
        passed.fold(0.0, f64::max)
    });
    // Blooming moves whole electrons.
    max_e.max((passed + 2.0).min(blooming.max_e))
}
