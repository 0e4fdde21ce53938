//! Readout: electrons to digital numbers.
//!
//! The factor that Clark et al. 2021 call "eDN", in e-/DN, divides:
//! `DN = round(N / gain + offset)`, held to 0..2^bits - 1.
//!
//! Reference: Clark et al. 2021, Eq. (11); EMVA Standard 1288, release 4.0 Linear, section 2.
//! Validity: steps of one height; no missing codes.
//! Price: a product and a rounding a pixel.

use super::{Assessment, Effect, Pass};
use crate::fidelity::Fidelity;
use crate::kernels::{self, Converter};
use crate::scene::{EffectId, Scene};

/// The converter.
pub const READOUT: Effect = Effect::of_dn(EffectId::Readout, "readout", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let (per_electron, offset) = (1.0 / detector.gain_e_per_dn, detector.offset_dn);
    let max = f64::from(detector.max_dn());
    // Without it there would be no digits at all: not the brightest either, charge and offset.
    let held = scene.brightest_e().min(scene.blooming.most_e);
    let digit = (held * per_electron + offset + 0.5).clamp(0.0, max);
    let all = digit * detector.gain_e_per_dn;
    let because = format!("a frame is digits of {} bits", detector.bits);
    let assessment = Assessment::of_pixels(scene, because, all, 0.25);
    let converter = Converter {
        per_electron,
        offset,
        max: detector.max_dn(),
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        kernels::digitise(tile.level, &converter, tile.electrons, tile.dn);
    }));
    (assessment, pass)
}
