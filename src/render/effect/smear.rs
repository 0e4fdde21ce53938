//! Smear: images move while the shutter is open, by the body's rates and by motion along orbits.
//!
//! A source's light is spread over its true track, `N_xy = N int PSF(x - x(t), y - y(t)) dt /
//! t_int`: the same time on equal parts of the exposure, so a slow part of the track is brighter
//! (see `track`). Without the effect each image stands still at its place of mid-exposure, half the
//! track's length L from the ends. A pixel's light then errs by at most `min(1, L^2 / (24 s^2) +
//! 0.61 b / s)` of the still image's peak, for a PSF of width s (second order of the integral) and
//! a centroid error b. A rolling shutter adds its own shift of moving images.
//!
//! Reference: the integral above, compared with direct integration.
//! Validity: body rates are constant during the exposure; an object's own track is a parabola.
//! Price: the pixels of an image once for each step of half a PSF's width along its track.

use super::cause::{STILL_IN_FLOOD, three_digits};
use super::{Assessment, Effect, ErrorBound};
use crate::fidelity::Fidelity;
use crate::scene::bounds::{BoundChange, STEEPEST, areas_changed_e, changed_e, dimming_px, rolled};
use crate::scene::{EffectId, EffectSet, Scene, Source, View, areas_smear_ms, work};

/// Motion during the exposure.
pub(crate) const SMEAR: Effect = Effect::images(EffectId::Smear, "smear", assess, change);

fn assess(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    if view.still_in_flood {
        return Assessment::none(STILL_IN_FLOOD);
    }
    let length_px = view.longest_track_px(view.exposure.duration_s);
    let edge_px = view.areas_motion_px(view.exposure.duration_s);
    // Without smear images also stand still for a rolling shutter.
    let rolled_px = match view.camera.readout_s() {
        0.0 => 0.0,
        readout_s => view.longest_track_px(readout_s) / 2.0,
    };
    if length_px + edge_px == 0.0 {
        return Assessment::none("the body's rates are 0, and no object moves across the field");
    }
    let moving_ms = |seconds: f64| work(view, seconds, fidelity).moving_ms;
    // Tracks below the tolerance are points.
    let estimated_ms = if length_px <= fidelity.skip_px {
        0.0
    } else if simulated.has(EffectId::AberrationDrift) {
        moving_ms(view.exposure.duration_s) - moving_ms(0.0)
    } else {
        moving_ms(view.exposure.duration_s)
    };
    let most_px = three_digits(length_px.max(edge_px));
    let because = format!("images move by up to {most_px} px");
    let error = ErrorBound {
        // An edge smeared over d px changes by at most `d^2 / 24` of its curvature, which is below
        // 0.7 of the pixel's light.
        e: view.areas_peak_e() * (edge_px * edge_px / 16.0).min(1.0),
        px: length_px / 2.0 + rolled_px,
    };
    Assessment::new(because, error, estimated_ms + areas_smear_ms(view))
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let simulated = &scene.simulated;
    // Without smear images have the ends of their true tracks, unless they drift.
    let own = simulated.has(EffectId::Smear) || !simulated.has(EffectId::AberrationDrift);
    let mut other = simulated.toggled(EffectId::Smear);
    if other.has(EffectId::Smear) {
        other = if scene.view.camera.readout_s() > 0.0 {
            other.with(EffectId::RollingShutter)
        } else {
            other.without(EffectId::RollingShutter)
        };
    }
    // A still image lies on its track, except that a rolling shutter exposes its parts at other
    // times.
    let enters = simulated.has(EffectId::Smear) && simulated.has(EffectId::RollingShutter);
    let moved_px = if simulated.has(EffectId::Smear) {
        scene.view.longest_track_px(scene.view.camera.readout_s()) / 2.0
    } else {
        bound.px
    };
    let dimming = dimming_px(scene);
    let margin_px = |_: &Source| Some(moved_px + 1.0);
    let e = changed_e(scene, &other, enters, margin_px, |image| {
        let (length_px, bend_px) = if own {
            (image.length_px, image.bend_px())
        } else {
            (2.0 * bound.px, 2.0 * bound.px)
        };
        let (rolled_px, longer) = rolled(scene, image, length_px);
        let moved = if simulated.has(EffectId::Smear) {
            rolled_px
        } else {
            rolled_px + length_px / 2.0
        };
        let all_e = image.inside_e(image.still_e, moved + length_px / 2.0);
        let e = image.spread_e(image.still_e, length_px)
            + image.moved_e(image.still_e, STEEPEST, bend_px + rolled_px)
            + all_e * (longer + dimming * (moved + length_px / 2.0)).min(1.0);
        BoundChange {
            e: e.min(all_e),
            reach_px: moved + 1.0,
        }
    });
    let edge_px = scene.view.areas_motion_px(scene.view.exposure.duration_s);
    let e = e + areas_changed_e(scene, &other, (2.0 * bound.px + edge_px).powi(2) / 3.0);
    ErrorBound { e, ..*bound }
}
