//! Readout: electrons to digital numbers.
//!
//! The gain ("eDN" of Clark et al. 2021), in e-/DN, divides the charge:
//! `DN = round(N / gain + offset)`, clamped to 0..2^bits - 1.
//!
//! Reference: Clark et al. 2021, Eq. (11); EMVA Standard 1288, release 4.0 Linear, section 2.
//! Validity: steps of one height; no missing codes.
//! Price: a product and a rounding a pixel.

use super::{Assessment, Effect, Pass};
use crate::fidelity::Fidelity;
use crate::kernels::{self, Converter};
use crate::scene::{EffectId, Scene};

/// The converter.
pub(crate) const READOUT: Effect = Effect::of_dn(EffectId::Readout, "readout", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let (per_electron, offset) = (1.0 / detector.gain_e_per_dn, detector.offset_dn);
    let max = f64::from(detector.max_dn());
    // Without it there are no digital numbers: the error is the brightest one.
    let held = scene.brightest_e().min(scene.blooming.max_e);
    let brightest_dn = (held * per_electron + offset + 0.5).clamp(0.0, max);
    let all_e = brightest_dn * detector.gain_e_per_dn;
    let because = format!("charge is digitised to {} bits", detector.bits);
    let assessment = Assessment::of_pixels(scene, because, all_e, 0.25);
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
