//! Vignetting: less light passes the optics off the boresight.
//!
//! ```text
//! N <- N V(angle),   V = cos^4(angle), or a table
//! ```
//!
//! Reference: Born & Wolf, Principles of Optics, 4.8.3; `camera::vignetting` has the law and its
//! assumptions. Each sample of a track has the transmission of its own field angle, so that
//! centroids and electrons are those of the light that passes.
//! Validity: one transmission for the whole of an image. Without the effect a source's light is off
//! by its own loss, and the centroid of a track of length L is off by the covariance of position
//! and transmission over their mean. With transmissions from V_min to V_max, Grüss 1935
//! (Mathematische Zeitschrift 39, 215) bounds it:
//!
//! ```text
//! d = int V (x - <x>) dt / int V dt <= L (V_max - V_min) / (4 V_min)
//! ```
//!
//! (a third of it for a linear V and a constant speed).
//!
//! Price: a few products for each evaluation of a track; an arc tangent with a table.

use super::cause::three_digits;
use super::{Assessment, Effect, ErrorBound};
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    BoundChange, areas_changed_e, areas_transmission_change_e, changed_e, lines_of_sight,
};
use crate::scene::{Body, EffectId, EffectSet, Scene, Source, View, still_evaluations, work};

/// The transmission off the boresight.
pub(crate) const VIGNETTING: Effect =
    Effect::images(EffectId::Vignetting, "vignetting", assess, change);

fn assess(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    let vignetting = &view.camera.optics.vignetting;
    if *vignetting == Vignetting::None {
        return Assessment::none("the optics have no vignetting");
    }
    let [min, max] = vignetting.range(view.camera.cone_rad(0.0));
    let e = view.brightest_px_e(|seen| (1.0 - vignetting.transmission(seen)).abs())
        + areas_e(view, simulated, 1.0 - min);
    if e == 0.0 {
        return Assessment::none(why_none(view, simulated));
    }
    let ns = match vignetting {
        Vignetting::Table(_) => 22.0,
        _ => 4.0,
    };
    let px = view.longest_track_px(view.open_s) * ((max - min) / (4.0 * min)).min(1.0);
    let [min, max] = [min, max].map(|part| three_digits(100.0 * part));
    let because = format!("{min} to {max} % of the light passes");
    Assessment::new(
        because,
        ErrorBound { e, px },
        evaluations(view, fidelity) * ns * 1e-6,
    )
}

/// Estimate of the greatest change of a pixel's area light, e-; at most the fraction `part` of it
/// does not pass. The cos^4 law includes the solid angle of a pixel. Without vignetting each pixel
/// has its own solid angle, which a lens with distortion changes by more than `part`.
fn areas_e(view: &View, simulated: &EffectSet, part: f64) -> f64 {
    if view.camera.optics.vignetting != Vignetting::Cos4 {
        return view.areas_peak_e() * part;
    }
    let mut without = EffectSet::default();
    if simulated.has(EffectId::Distortion) {
        without = without.with(EffectId::Distortion);
    }
    areas_transmission_change_e(view, &without.with(EffectId::Vignetting), &without)
}

/// Why it removes no light.
fn why_none(view: &View, simulated: &EffectSet) -> &'static str {
    if !simulated.has(EffectId::Stars) && !simulated.has(EffectId::Rsos) {
        "stars and objects are switched off"
    } else if view.candidates.is_empty() && !simulated.has(EffectId::Stars) {
        "stars are switched off, and no object is in the field"
    } else if view.candidates.is_empty() {
        "no source is in the field"
    } else if view.brightest_px_e(|_| 1.0) == 0.0 {
        "no source in the field gives light"
    } else {
        "all light passes where the sources stand"
    }
}

/// Number of evaluations of sources.
fn evaluations(view: &View, fidelity: &Fidelity) -> f64 {
    let tracks = |seconds: f64| view.longest_track_px(seconds) > fidelity.skip_px;
    let (exposure_s, readout_s) = (view.exposure.duration_s, view.camera.readout_s());
    let moving = if tracks(exposure_s) {
        work(view, exposure_s, fidelity).evaluations
    } else {
        0.0
    };
    let rolling = if tracks(readout_s / 2.0) {
        work(view, view.open_s, fidelity).rolling_evaluations
    } else {
        0.0
    };
    still_evaluations(view) + moving + rolling
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let (vignetting, simulated) = (&scene.view.camera.optics.vignetting, &scene.simulated);
    let moves = simulated.moves_images();
    let seen = lines_of_sight(scene);
    let passes = |source: &Source| {
        let passes = seen(&source.body).map(|seen| vignetting.transmission(&seen));
        passes
            .iter()
            .fold([1.0f64, 0.0], |[min, max], t| [t.min(min), t.max(max)])
    };
    let radius = |source: &Source| match &source.body {
        Body::Planet(body) if body.elements.len() > 1 => body.angular_radius,
        _ => 0.0,
    };
    let scale = scene.view.scale_and_corner_px.0;
    let off_px = scene.sources.iter().map(|source| {
        let [min, max] = if moves { passes(source) } else { [1.0, 1.0] };
        // 10 % margin for positions between.
        let part = 1.1 * (max - min) / (4.0 * min.max(f64::MIN_POSITIVE));
        // A disc of radius R across which the logarithm of the light changes by c: R c / 8; a part
        // of the disc: up to twice that.
        let [_, seen, _] = seen(&source.body);
        let across = vignetting.change_across(&seen, radius(source));
        source.length_px() * part.min(1.0) + radius(source) * scale * (across / 4.0).min(1.0)
    });
    // The same images exist without the effect.
    let other = simulated.toggled(EffectId::Vignetting);
    let e = changed_e(
        scene,
        &other,
        false,
        |_| Some(0.0),
        |image| {
            let [min, _] = passes(image.source);
            // Relative to the light before the optics, with the same margin.
            let taken = 1.1 * (1.0 - min);
            let clear_e = if simulated.has(EffectId::Vignetting) {
                (image.height_e() / min).min(image.still_e)
            } else {
                image.height_e()
            };
            BoundChange {
                e: clear_e * taken.min(1.0),
                reach_px: 0.0,
            }
        },
    );
    // Skipped vignetting: at least the bound of its assessment.
    let e = if simulated.has(EffectId::Vignetting) {
        e + areas_changed_e(scene, &other, 0.0)
    } else {
        e.max(bound.e)
    };
    ErrorBound {
        e,
        px: off_px.fold(0.0, f64::max),
    }
}
