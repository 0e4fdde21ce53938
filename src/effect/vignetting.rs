//! Vignetting: less light passes the optics off the boresight.
//!
//! ```text
//! N <- N V(angle),   V = cos^4(angle), or a table
//! ```
//!
//! Reference: Born & Wolf, Principles of Optics, 4.8.3; `camera::vignetting` has the law and what is assumed. Each sample of a
//! track has the transmission of its own field angle, so that centroids and electrons are those of the light that passes. Validity: the spread of one image is dimmed as
//! its middle is. Without it a source's light errs by what its own angle takes. Price: a few products, or the arc tangent of a
//! table, each time a track is looked at.

use super::{Effect, Judge, Loss, Need, Stage};
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::scene::{Change, Scene, View};

/// The transmission off the boresight.
pub const VIGNETTING: Effect = Effect {
    name: "vignetting",
    stage: Stage::Images,
    random: false,
    judge: Judge::Images(judge, change_e),
    mark: |simulated| simulated.vignetting = true,
};

fn judge(view: &View, fidelity: &Fidelity) -> Need {
    let vignetting = &view.camera.optics.vignetting;
    if *vignetting == Vignetting::None {
        return Need::none("the optics let as much light pass everywhere");
    }
    let [least, most] = vignetting.range(view.camera.cone_rad(0.0));
    let e = view.brightest_px_e(|seen| (1.0 - vignetting.transmission(seen)).abs());
    if e == 0.0 {
        return Need::none("it takes no light of any source");
    }
    let ns = match vignetting {
        Vignetting::Table(_) => 40.0,
        _ => 15.0,
    };
    Need {
        because: format!(
            "{:.1} to {:.1} % of the light passes",
            100.0 * least,
            100.0 * most
        )
        .into(),
        error: Loss { e, px: 0.0 },
        drawn_e: 0.0,
        price_ms: view.looks(fidelity) * ns * 1e-6,
    }
}

fn change_e(scene: &Scene, _: &Loss) -> f64 {
    let vignetting = &scene.view.camera.optics.vignetting;
    scene.change_e(|image| {
        let body = &image.source.body;
        let passes = [0.0, 0.5, 1.0].map(|part| vignetting.transmission(&scene.seen(body, part)));
        let least = passes.into_iter().fold(1.0, f64::min);
        // Of the light that would arrive; a tenth more, for what a track passes between.
        let taken = 1.1 * (1.0 - least);
        let clear_e = if scene.simulated.vignetting {
            (image.height_e / least).min(image.still_e)
        } else {
            image.height_e
        };
        Change {
            e: clear_e * taken.min(1.0),
            beside_px: 0.0,
        }
    })
}
