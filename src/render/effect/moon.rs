//! The Moon: its disc where it is larger than a pixel, cut into points, or laid on the pixels as
//! areas are where that would be too many; else a point.
//!
//! ```text
//! N_xy = sum_k s_k E QE tau A_app t_int PSF(x, y, x_k, y_k),   sum s_k = 1
//! ```
//!
//! with all its light E by Clark et al. 2021, Eq. (1), of the magnitude of Kieffer & Stone 2005
//! (phase and opposition surge), and the shares s of half a pixel's squares by the law of Lommel
//! and Seeliger (`sky::moon`). What the Earth hides and what its shadow covers is dark (in the
//! umbra wholly: the red light of the air is left out).
//! Reference: Kieffer & Stone 2005 (AJ 129, 2887).
//! Validity: no maria, no mountains, no light of the Earth on the night side; turned as its middle
//! moves. A disc of more than 600 squares a side (some 400 px) is laid as areas are: within 0.1 %
//! of its law away from limb and terminator; light that the optics spread further than 24 px lies
//! evenly over those; where it moves by 26 px its centre is 0.07 px off.
//! Price: that of a star for each of its points; of a large one that of a point for every 42 pixels
//! of the detector.

use super::Effect;
use super::point;
use crate::scene::{EffectId, MOON};

/// The Moon.
pub const THE_MOON: Effect = Effect::light(EffectId::Moon, "moon", |scene, fidelity| {
    let own_e = |drawn: &[&_]| point::sources_lit_e(scene, drawn);
    point::assess(scene, fidelity, (EffectId::Moon, MOON), own_e)
});
