//! Non-linearity: the signal per electron falls as a pixel fills up.
//!
//! ```text
//! N <- N (1 - a N / full well)
//! ```
//!
//! `a` is the share of the signal that is missing at full well.
//! Reference: Janesick 2007, Photon Transfer, ch. 7; EMVA Standard 1288 release 4.0 measures such a
//! bend. It is the first term of a source follower whose gain falls with its signal.
//! Validity: `a` up to 1/2, beyond which the signal would decrease; smooth bends, no kinks at low
//! signal.
//! Price: two products a pixel.

use super::cause::three_digits;
use super::{Assessment, Effect, Pass};
use crate::fidelity::Fidelity;
use crate::scene::{EffectId, Scene, drawn_e};

/// Non-linearity of the pixels' amplifiers.
pub(crate) const NON_LINEARITY: Effect =
    Effect::charge(EffectId::NonLinearity, "non-linearity", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let share = detector.nonlinearity;
    let held = |e: f64| e.min(scene.blooming.max_e);
    let missing = |e: f64| held(e) - detector.response_e(held(e));
    let brightest = scene.brightest_e();
    let assessment = if share == 0.0 {
        Assessment::none("the detector is linear (detector.nonlinearity)")
    } else {
        let max_e = drawn_e(brightest) + scene.struck.max_e();
        let because = format!(
            "the response is {} % low at full well, {} % low in the brightest pixel",
            three_digits(100.0 * share),
            three_digits(100.0 * missing(max_e) / held(max_e))
        );
        Assessment {
            drawn_e: missing(max_e),
            ..Assessment::of_pixels(scene, because, missing(brightest), 0.7)
        }
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        for e in tile.electrons.iter_mut() {
            *e = detector.response_e(f64::from(*e)) as f32;
        }
    }));
    (assessment, pass)
}
