//! Pixel response: the charge per unit of light differs from pixel to pixel.
//!
//! ```text
//! N_xy <- g_xy N_xy,   g = 1 + prnu N(0, 1), clipped at 0
//! ```
//!
//! Reference: photo-response non-uniformity of EMVA Standard 1288 release 4.0; the map belongs to
//! the camera (`camera::pattern`).
//! Validity: a response that does not depend on wavelength, and no pattern of rows and columns.
//! Price: a product a pixel.

use super::cause::{no_light, three_digits};
use super::{Assessment, Effect, Pass};
use crate::fidelity::Fidelity;
use crate::scene::bounds::{ALL_FULL, final_change_e, is_flooded_without, lit_where};
use crate::scene::{EffectId, Scene};

/// Photo-response non-uniformity.
pub(crate) const PIXEL_RESPONSE: Effect =
    Effect::light(EffectId::PixelResponse, "pixel response", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let pattern = &scene.view.camera.detector.pattern;
    let Some(response) = pattern.response() else {
        let why = "all pixels respond alike (detector.prnu)";
        return (Assessment::none(why), Pass::idle());
    };
    let off = |pixel| (pattern.response_of(pixel) - 1.0).abs();
    let own = EffectId::PixelResponse;
    let worst = final_change_e(scene, || lit_where(scene, off), own);
    let assessment = if is_flooded_without(scene, own) {
        Assessment::none(ALL_FULL)
    } else if worst == 0.0 {
        Assessment::none(no_light(scene))
    } else {
        let percent = three_digits(100.0 * pattern.worst_response());
        let because = format!("pixels differ by up to {percent} %");
        Assessment::of_pixels(scene, because, worst, 0.2)
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        let first = tile.first;
        for (e, g) in tile.electrons.iter_mut().zip(&response[first..]) {
            *e *= g;
        }
    }));
    (assessment, pass)
}
