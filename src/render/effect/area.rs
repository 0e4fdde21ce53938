//! Shared by the effects of area sources. Their light is rasterized in the scene (`scene::area`)
//! and added here.
//!
//! Clark et al. 2021, Eqs. (3) to (5), the exponent of Eq. (3) corrected to -0.4 m:
//!
//! ```text
//! L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2,   E = L IFOV^2,   N_xy = E QE tau A_app t_int
//! ```
//!
//! with the pixel's true solid angle for IFOV^2, and before the division by the gain.

use super::cause::three_digits;
use super::{Assessment, ErrorBound, LazyBound, Pass};
use crate::scene::bounds::{
    ALL_FULL, area_lit_e, final_change_e, is_flooded_without, transfer_smear_of,
    with_transfer_smear,
};
use crate::scene::{AreaLight, BLURRED_NS, EDGE_NS, EffectId, RasterWork, SPREAD_NS, Scene};

/// Time that a sampled or blurred pixel takes in addition to [`EVEN_NS`], and time of each pixel,
/// ns.
const PIXEL_NS: f64 = 3.3;
const EVEN_NS: f64 = 0.7;

fn raster_ns(work: &RasterWork, light_ns: f64) -> f64 {
    work.lights as f64 * light_ns + work.edges as f64 * EDGE_NS + work.spreads as f64 * SPREAD_NS
}

/// The assessment of an area source: `because` gives the reason; `ns` is the time of one evaluation
/// of its radiance.
pub(super) fn assess<'s>(
    scene: &'s Scene,
    effect: EffectId,
    because: impl Fn(&AreaLight) -> String,
    ns: f64,
) -> (Assessment<'s>, Pass<'s>) {
    let Some(area) = scene.areas.iter().find(|area| area.effect == effect) else {
        return (Assessment::none("there is none in the scene"), Pass::idle());
    };
    if let Some(why) = &area.dark {
        return (Assessment::none(why.clone()), Pass::idle());
    }
    let pixels = scene.view.camera.detector.pixels() as f64;
    let blurred_ns = if area.work.spreads > 0 {
        BLURRED_NS
    } else {
        0.0
    };
    let pixels_ns = pixels * EVEN_NS + area.uneven() as f64 * (PIXEL_NS + blurred_ns);
    let assessment = if is_flooded_without(scene, effect) {
        Assessment::none(format!("{}: {ALL_FULL}", because(area)))
    } else if area.electrons == 0.0 {
        // Too faint to be rasterized.
        Assessment::new(because(area), ErrorBound::of_pixel(area.max_e), 0.0)
    } else {
        let cells_e = || {
            with_transfer_smear(scene, area_lit_e(scene, area), || {
                transfer_smear_of(scene, area)
            })
        };
        let error = LazyBound::of(move || final_change_e(scene, cells_e, effect));
        let estimated_ms = (raster_ns(&area.work, ns) + pixels_ns) * 1e-6;
        Assessment {
            drawn_e: if area.is_thin { 0.0 } else { area.electrons },
            ..Assessment::new(because(area), error, estimated_ms)
        }
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        area.add_to(tile.level, tile.first, tile.electrons);
    }));
    (assessment, pass)
}

/// `up to 75.2 e- a pixel`.
pub(super) fn up_to(area: &AreaLight) -> String {
    format!("up to {} e- a pixel", three_digits(area.max_e))
}
