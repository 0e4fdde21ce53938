//! Vignetting: less light passes the optics off the boresight.
//!
//! ```text
//! N <- N V(angle),   V = cos^4(angle), or a table
//! ```
//!
//! Reference: Born & Wolf, Principles of Optics, 4.8.3; `camera::vignetting` has the law and what
//! is assumed. Each sample of a track has the transmission of its own field angle, so that
//! centroids and electrons are those of the light that passes.
//! Validity: the spread of one image is dimmed as its middle is. Without it a source's light errs
//! by what its own angle takes, and the centroid of a track of length L, whose light is between
//! V_min and V_max, by the covariance of place and transmission over their mean, which Grüss 1935
//! (Mathematische Zeitschrift 39, 215) bounds:
//!
//! ```text
//! d = int V (x - <x>) dt / int V dt <= L (V_max - V_min) / (4 V_min)     (a third of it where V is linear and the speed even)
//! ```
//!
//! Price: a few products, or the arc tangent of a table, each time a track is looked at.

use super::cause::three_digits;
use super::{Assessment, Effect, ErrorBound};
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    BoundChange, areas_changed_e, areas_taken_e, changed_e, lines_of_sight,
};
use crate::scene::{Body, EffectId, EffectSet, Scene, Source, View, still_looks, work};

/// The transmission off the boresight.
pub const VIGNETTING: Effect = Effect::images(EffectId::Vignetting, "vignetting", assess, change);

fn assess(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    let vignetting = &view.camera.optics.vignetting;
    if *vignetting == Vignetting::None {
        return Assessment::none("the optics have no vignetting");
    }
    let [least, most] = vignetting.range(view.camera.cone_rad(0.0));
    let e = view.brightest_px_e(|seen| (1.0 - vignetting.transmission(seen)).abs())
        + areas_e(view, simulated, 1.0 - least);
    if e == 0.0 {
        return Assessment::none(why_none(view, simulated));
    }
    let ns = match vignetting {
        Vignetting::Table(_) => 22.0,
        _ => 4.0,
    };
    let px = view.longest_track_px(view.open_s) * ((most - least) / (4.0 * least)).min(1.0);
    let [least, most] = [least, most].map(|part| three_digits(100.0 * part));
    let because = format!("{least} to {most} % of the light passes");
    Assessment::new(
        because,
        ErrorBound { e, px },
        looks(view, fidelity) * ns * 1e-6,
    )
}

/// About the most (e-) that it changes a pixel's area light by, `part` (1) of which does not pass
/// at most. The fourth power of the cosine has the pixel's solid angle in it, and of area light
/// stands for that: without it pixels take their own again, from which a lens with distortion is
/// further off than what passes tells.
fn areas_e(view: &View, simulated: &EffectSet, part: f64) -> f64 {
    if view.camera.optics.vignetting != Vignetting::Cos4 {
        return view.areas_peak_e() * part;
    }
    let mut without = EffectSet::default();
    if simulated.has(EffectId::Distortion) {
        without = without.with(EffectId::Distortion);
    }
    areas_taken_e(view, &without.with(EffectId::Vignetting), &without)
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
fn looks(view: &View, fidelity: &Fidelity) -> f64 {
    let tracks = |seconds: f64| view.longest_track_px(seconds) > fidelity.skip_px;
    let (exposure_s, readout_s) = (view.exposure.duration_s, view.camera.readout_s());
    let moving = if tracks(exposure_s) {
        work(view, exposure_s, fidelity).looks
    } else {
        0.0
    };
    let rolling = if tracks(readout_s / 2.0) {
        work(view, view.open_s, fidelity).rolling_looks
    } else {
        0.0
    };
    still_looks(view) + moving + rolling
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let (vignetting, simulated) = (&scene.view.camera.optics.vignetting, &scene.simulated);
    let moves = simulated.moves_images();
    let seen = lines_of_sight(scene);
    let passes = |source: &Source| {
        let passes = seen(&source.body).map(|seen| vignetting.transmission(&seen));
        passes.iter().fold([1.0f64, 0.0], |[least, most], t| {
            [t.min(least), t.max(most)]
        })
    };
    let radius = |source: &Source| match &source.body {
        Body::Wanderer(body) if body.elements.len() > 1 => body.angular_radius,
        _ => 0.0,
    };
    let scale = scene.view.scale_and_corner_px.0;
    let off_px = scene.sources.iter().map(|source| {
        let [least, most] = if moves { passes(source) } else { [1.0, 1.0] };
        // A tenth more, for what a track passes between.
        let part = 1.1 * (most - least) / (4.0 * least.max(f64::MIN_POSITIVE));
        // Of a disc of radius R across which the logarithm of the light changes by c, R c / 8; of a
        // part of it, up to twice that.
        let [_, seen, _] = seen(&source.body);
        let across = vignetting.change_across(&seen, radius(source));
        source.length_px() * part.min(1.0) + radius(source) * scale * (across / 4.0).min(1.0)
    });
    // Without it there are the same images.
    let other = simulated.toggled(EffectId::Vignetting);
    let e = changed_e(
        scene,
        &other,
        false,
        |_| Some(0.0),
        |image| {
            let [least, _] = passes(image.source);
            // Of the light that would arrive; a tenth more again.
            let taken = 1.1 * (1.0 - least);
            let clear_e = if simulated.has(EffectId::Vignetting) {
                (image.height_e() / least).min(image.still_e)
            } else {
                image.height_e()
            };
            BoundChange {
                e: clear_e * taken.min(1.0),
                beside_px: 0.0,
            }
        },
    );
    // Of area light that is so faint that it is skipped, all that it was asked for.
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
