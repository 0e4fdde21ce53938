//! Aberration drift: stars move because the observer's velocity changes while the shutter is open.
//!
//! ```text
//! du = (dv - (dv . u) u) / c
//! ```
//!
//! First order of aberration (Explanatory Supplement to the Astronomical Almanac, 3rd ed., 2013, section 7.2.3) in the change
//! of velocity dv since mid-exposure. In a low orbit dv grows by some 8 m/s each second: 0.005 arcsec. Objects in orbit have it in
//! their own tracks. Validity: dv runs as a parabola through start, mid and end; the Earth's own acceleration, 0.006 m/s^2, is left out.
//! Price: some ten products each time a star is looked at.

use super::{Effect, Judge, Loss, Need, Stage};
use crate::fidelity::Fidelity;
use crate::scene::{Body, View};

/// The change of the stars' aberration during the exposure.
pub const ABERRATION_DRIFT: Effect = Effect {
    name: "aberration drift",
    stage: Stage::Images,
    random: false,
    judge: Judge::Images(judge),
    mark: |simulated| simulated.aberration_drift = true,
};

fn judge(view: &View, _: &Fidelity) -> Need {
    let [start, end] = view.velocity_change_m_s.map(|dv| dv.norm());
    if start.max(end) == 0.0 {
        return Need::none("no change of the observer's velocity aberrates");
    }
    let stars = view
        .candidates
        .iter()
        .filter_map(|candidate| match &candidate.body {
            Body::Star(star) => Some(star.direction),
            Body::Rso(_) => None,
        });
    let furthest = stars
        .flat_map(|star| [0.0, 1.0].map(|part| view.aberration_drift(&star, part).norm()))
        .fold(0.0, f64::max);
    if furthest == 0.0 {
        return Need::none("there is no star");
    }
    let px = furthest * view.camera.scale_and_corner_px().0;
    Need {
        because: format!("stars move by up to {px:.2e} px from mid-exposure to its ends").into(),
        error: Loss {
            e: view.e_of_shift(px),
            px,
        },
        price_ms: 0.0,
    }
}
