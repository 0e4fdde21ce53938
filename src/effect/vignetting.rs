//! Vignetting: less light passes the optics off the boresight.
//!
//! ```text
//! N <- N V(angle),   V = cos^4(angle), or a table
//! ```
//!
//! Reference: Born & Wolf, Principles of Optics, 4.8.1; `camera::vignetting` has the law. Each sample of a track has the transmission of its own
//! field angle, so that centroids and electrons are those of the light that passes. Validity: the spread of one image is dimmed as
//! its middle is. Without it a source's light errs by what its own angle takes. Price: a few products, or the arc tangent of a
//! table, each time a track is looked at.

use super::{Effect, Judge, Loss, Need, Stage};
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::scene::View;

/// The transmission off the boresight.
pub const VIGNETTING: Effect = Effect {
    name: "vignetting",
    stage: Stage::Images,
    random: false,
    judge: Judge::Images(judge),
    mark: |simulated| simulated.vignetting = true,
};

fn judge(view: &View, _: &Fidelity) -> Need {
    let vignetting = &view.camera.optics.vignetting;
    if *vignetting == Vignetting::None {
        return Need::none("the optics let as much light pass everywhere");
    }
    let [least, most] = vignetting.range(view.camera.cone_rad(0.0));
    let e = view.brightest_px_e(|seen| (1.0 - vignetting.transmission(seen)).abs());
    if e == 0.0 {
        return Need::none("it takes no light of any source");
    }
    Need {
        because: format!(
            "{:.1} to {:.1} % of the light passes",
            100.0 * least,
            100.0 * most
        )
        .into(),
        error: Loss { e, px: 0.0 },
        price_ms: view.looks() * 15e-6,
    }
}
