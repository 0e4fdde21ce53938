//! Readout: electrons to digital numbers.
//!
//! The factor that Clark et al. 2021 call "eDN", in e-/DN, divides:
//! `DN = round(N / gain + offset)`, held to 0..2^bits - 1.

use super::{Effect, Stage, Verdict, per_pixel};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// The converter.
pub const READOUT: Effect = Effect {
    name: "readout",
    stage: Stage::Digits,
    judge,
};

fn judge<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    let detector = &scene.camera.detector;
    let (per_electron, offset) = (1.0 / detector.gain_e_per_dn, detector.offset_dn);
    let max = f64::from(detector.max_dn());
    Verdict::Run {
        because: "a frame is digits",
        price_ms: per_pixel(scene, 1.0),
        pass: Box::new(move |tile| {
            for (dn, e) in tile.digits.iter_mut().zip(tile.electrons.iter()) {
                *dn = (f64::from(*e) * per_electron + offset + 0.5).clamp(0.0, max) as u16;
            }
        }),
    }
}
