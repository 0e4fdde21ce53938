//! The planets: points of light.
//!
//! `N_xy = E_obj QE tau A_app t_int PSF(x, y, x_obj, y_obj)` by Clark et al. 2021, Eqs. (1), (2),
//! as for stars, with the magnitudes of Mallama & Hilton 2018 (`sky::planets`).
//! Reference: Simon et al. 1994 (A&A 282, 663) for positions; Mallama & Hilton 2018 (Astronomy and
//! Computing 25, 10).
//! Validity: position errors up to 89 arcsec (Saturn), 10 for the inner planets, 51 for Mars; in
//! the Sun's colour; no discs (Venus may have 1 arcmin), no moons.
//! Price: that of a star for each.

use super::Effect;
use super::point;
use crate::scene::EffectId;

/// The planets.
pub(crate) const PLANETS: Effect =
    Effect::light(EffectId::Planets, "planets", |scene, fidelity| {
        point::assess_kind(scene, fidelity, (EffectId::Planets, "planet"))
    });
