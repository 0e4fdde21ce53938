//! The Moon. Below a pixel it is a point; a larger disc is divided into points; a disc of too many
//! points is rasterized like an area source.
//!
//! ```text
//! N_xy = sum_k s_k E QE tau A_app t_int PSF(x, y, x_k, y_k),   sum s_k = 1
//! ```
//!
//! with all its light E by Clark et al. 2021, Eq. (1), of the magnitude of Kieffer & Stone 2005
//! (phase and opposition surge), and the shares s of squares half a pixel wide by the law of Lommel
//! and Seeliger (`sky::moon`). Parts behind the Earth or in its shadow are dark; the umbra has no
//! red light of the air.
//! Reference: Kieffer & Stone 2005 (AJ 129, 2887).
//! Validity: no maria, no mountains, no light of the Earth on the night side; turned as its centre
//! moves. A disc of more than 600 squares a side (some 400 px) is rasterized like an area source:
//! within 0.1 % of its law away from limb and terminator; light that the optics spread further than
//! 24 px is distributed evenly over those; a motion of 26 px shifts its centre by 0.07 px.
//! Price: that of a star for each of its points; for a large disc, that of a point for every 42
//! pixels of the detector.

use super::Effect;
use super::point;
use crate::scene::{EffectId, MOON};

/// The Moon.
pub(crate) const THE_MOON: Effect = Effect::light(EffectId::Moon, "moon", |scene, fidelity| {
    point::assess_kind(scene, fidelity, (EffectId::Moon, MOON))
});
