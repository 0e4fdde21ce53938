//! Rolling shutter: rows open and close one after the other.
//!
//! Row r collects light for the exposure time t_int around `mid + (r - (rows - 1) / 2) t_row`. An
//! image that moves by v rows a second is exposed for `t_int / (1 - v t_row)`, longer if it moves
//! along with the readout, and its track is tilted. Each sample of a track lights the rows that are
//! open at its time (see `track::rows`).
//! Reference: Liang, Chang and Chen 2008 (IEEE Trans. Image Process. 17, 1323).
//! Validity: a row opens and closes at once over its whole length; light beyond the first and last
//! row is counted as in those rows. Without the effect all rows are exposed like the middle row:
//! images are off by their motion in half the readout time. The light of an image changes by at
//! most `N (0.86 d / s + v t_row)`, with d its motion until its own rows are exposed.
//! Price: four samples of each panel in which rows of an image open or close.

use super::cause::three_digits;
use super::{Assessment, Effect, ErrorBound};
use crate::camera::Shutter;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    BoundChange, STEEPEST_STREAK, areas_changed_e, changed_e, dimming_px, rolled,
};
use crate::scene::{EffectId, EffectSet, Scene, Source, View, work};

/// Rows exposed in turn.
pub(crate) const ROLLING_SHUTTER: Effect =
    Effect::images(EffectId::RollingShutter, "rolling shutter", assess, change);

fn assess(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    let readout_s = view.camera.readout_s();
    if readout_s == 0.0 {
        return Assessment::none(match view.camera.shutter {
            Shutter::Global => "the shutter is global: all rows are exposed together",
            Shutter::FrameTransfer { .. } => "frame transfer: all rows are exposed together",
            Shutter::Rolling { .. } => "the detector has one row",
        });
    }
    let off_px = view.longest_track_px(readout_s) / 2.0;
    let edge_px = view.areas_motion_px(readout_s) / 2.0;
    if off_px + edge_px == 0.0 {
        return Assessment::none("the body's rates are 0, and no object moves across the field");
    }
    if !simulated.moves_images() {
        return Assessment::none("images stand still: neither smear nor aberration drift runs");
    }
    let most_px = three_digits(2.0 * off_px.max(edge_px));
    let because = format!("images move by up to {most_px} px during the readout");
    // With vignetting, the weights along a shifted track differ too.
    let error = ErrorBound {
        // Edges of area light pass over pixels.
        e: view.areas_peak_e() * edge_px.min(1.0),
        px: off_px * (2.0 - evenness(view)),
    };
    Assessment::new(because, error, work(view, view.open_s, fidelity).rolling_ms)
}

/// Ratio of the least to the greatest transmission in the field (1).
fn evenness(view: &View) -> f64 {
    let camera = &view.camera;
    let [min, max] = camera.optics.vignetting.range(camera.cone_rad(0.0));
    min / max.max(f64::MIN_POSITIVE)
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let other = scene.simulated.toggled(EffectId::RollingShutter);
    let enters = scene.simulated.has(EffectId::RollingShutter);
    let dimming = dimming_px(scene);
    let margin_px = |_: &Source| Some(bound.px + 1.0);
    let e = changed_e(scene, &other, enters, margin_px, |image| {
        let (off_px, longer) = if scene.simulated.has(EffectId::Smear) {
            rolled(scene, image, image.length_px)
        } else {
            (bound.px, 0.0)
        };
        let height_e = image.height_e();
        let all_e = image.inside_e(height_e, off_px);
        BoundChange {
            e: image.moved_e(height_e, STEEPEST_STREAK, off_px)
                + all_e * (longer + dimming * off_px).min(1.0),
            reach_px: off_px + 1.0,
        }
    });
    let edge_px = scene.view.areas_motion_px(scene.view.camera.readout_s()) / 2.0;
    let e = e + areas_changed_e(scene, &other, bound.px + edge_px);
    ErrorBound { e, ..*bound }
}
