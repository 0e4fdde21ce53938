//! Dark current: its mean is added to the light, and shot noise covers both.
//!
//! ```text
//! N_xy <- N_xy + d_xy t,   d(T) = d(T_ref) 2^((T - T_ref) / T_double)
//! ```
//!
//! The map d belongs to the camera (`camera::pattern`): lognormal, with hot pixels.
//! `Detector::dark_growth` has the temperature law.
//! Reference: Widenhorn et al. 2002 (Proc. SPIE 4669, 193), with the range of a constant doubling
//! temperature.
//! Validity: one temperature for the whole detector, the same in every frame; hot pixels that
//! flicker (random telegraph signals) are left out.
//! Price: a sum a pixel, half again with a map.

use super::cause::{counted, three_digits};
use super::{Assessment, Effect, LazyBound, Pass};
use crate::fidelity::Fidelity;
use crate::scene::bounds::{ALL_FULL, final_change_e, is_flooded_without, of_cells};
use crate::scene::{EffectId, Scene};

/// Dark charge.
pub(crate) const DARK_CURRENT: Effect =
    Effect::light(EffectId::DarkCurrent, "dark current", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let pattern = &scene.view.camera.detector.pattern;
    let seconds = scene.view.exposure.duration_s;
    let (mean, max_e_s) = (pattern.dark_mean_e_s(), pattern.dark_max_e_s());
    let assessment = if max_e_s == 0.0 {
        Assessment::none("the detector has no dark current (detector.dark_e_s)")
    } else if is_flooded_without(scene, EffectId::DarkCurrent) {
        Assessment::none(ALL_FULL)
    } else {
        let mut because = format!("{} e-/s a pixel", three_digits(mean));
        if !pattern.hot().is_empty() {
            because += &format!(", with {}", counted(pattern.hot().len(), "hot pixel"));
        }
        let ns = pattern.dark_e_s().map_or(0.12, |_| 0.3);
        let error = move || {
            // The hottest pixels may fill up.
            let columns = 0..scene.view.camera.detector.width;
            let columns = columns.map(|column| pattern.dark_max_of_column(column) * seconds);
            let cells_e = || of_cells(&columns.collect::<Vec<f64>>());
            final_change_e(scene, cells_e, EffectId::DarkCurrent)
        };
        Assessment {
            // Even a small expectation gives electrons in some pixels.
            drawn_e: mean * seconds * scene.view.camera.detector.pixels() as f64,
            error: LazyBound::of(error),
            ..Assessment::of_pixels(scene, because, 0.0, ns)
        }
    };
    let pass = match pattern.dark_e_s() {
        Some(map) => Pass::Pixels(Box::new(move |tile| {
            let first = tile.first;
            for (e, dark) in tile.electrons.iter_mut().zip(&map[first..]) {
                *e += (f64::from(*dark) * seconds) as f32;
            }
        })),
        None => Pass::Pixels(Box::new(move |tile| {
            let dark_e = (mean * seconds) as f32;
            tile.electrons.iter_mut().for_each(|e| *e += dark_e);
        })),
    };
    (assessment, pass)
}
