//! Smear: images move while the shutter is open, by the body's rates and by motion along orbits.
//!
//! A source's light is spread over its true track, `N_xy = N int PSF(x - x(t), y - y(t)) dt / t_int`: the same time on
//! equal parts of the exposure, so a slow part of the track is brighter (see `track`). Without it each image stands
//! still at the middle of the exposure; its ends are then half the track's length L off, and a pixel's light by at
//! most `min(1, L^2 / (24 s^2))` of the brightest, for a PSF of width s (second order of the integral).
//!
//! Reference: the integral above, held against direct integration. Validity: body rates are constant during the exposure; an object's
//! own track is a parabola. Price: the pixels of an image once more for each step of half a PSF's width along its track.

use super::{Effect, Judge, Loss, Need, Stage};
use crate::fidelity::Fidelity;
use crate::scene::View;

/// Motion during the exposure.
pub const SMEAR: Effect = Effect {
    name: "smear",
    stage: Stage::Images,
    random: false,
    judge: Judge::Images(judge),
    mark: |simulated| simulated.smear = true,
};

fn judge(view: &View, fidelity: &Fidelity) -> Need {
    let length_px = view.longest_track_px(view.exposure.duration_s);
    // What stands still does so for a rolling shutter too, whose rows see it elsewhere.
    let rolled_px = match view.camera.readout_s() {
        0.0 => 0.0,
        readout_s => view.longest_track_px(readout_s) / 2.0,
    };
    let rows = view.camera.detector.height.saturating_sub(1).max(1) as f64;
    let longer = (2.0 * rolled_px / rows).min(1.0);
    if length_px == 0.0 {
        return Need::none("nothing moves during the exposure");
    }
    let width_px = view.camera.optics.psf.core_px();
    let spread = (length_px / width_px).powi(2) / 24.0;
    Need {
        because: format!("images move by up to {length_px:.3} px").into(),
        error: Loss {
            e: view.peak_e() * (spread.min(1.0) + longer) + view.e_of_shift(rolled_px),
            px: length_px / 2.0 + rolled_px,
        },
        price_ms: view
            .work(view.exposure.duration_s, fidelity)
            .moving_ms(view),
    }
}
