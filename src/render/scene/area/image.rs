//! From an area source to its light on the pixels.

use super::area_light::AreaLight;
use super::blur::Blur;
use super::full::Full;
use super::plane::Plane;
use super::radiance::Area;
use super::raster_work::RasterWork;
use super::rasterize::rasterize;
use crate::fidelity::Fidelity;
use crate::scene::blooming::flooding_e;
use crate::scene::bounds::cells::CELL;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::view::View;
use std::borrow::Cow;

/// Whether `e` electrons or less on every pixel are within the tolerance, and all of it together
/// is lost in noise. No weighting of the pixels has a greater signal-to-noise ratio than
///
/// ```text
/// snr^2 = sum e^2 / (e + read^2 + gain^2 / 12)
/// ```
fn is_too_thin(view: &View, e: f64, simulated: &EffectSet, fidelity: &Fidelity) -> bool {
    let detector = &view.camera.detector;
    let read_e = simulated.only_with(EffectId::ReadNoise, detector.read_noise_e);
    let noise = e + read_e * read_e + detector.quantisation_variance();
    let snr = (detector.pixels() as f64 * e * e / noise.max(f64::MIN_POSITIVE)).sqrt();
    e <= fidelity.skip_e && snr <= fidelity.skip_snr
}

/// Whether dark current alone, or area light alone, fills every pixel of a frame with those
/// effects.
pub fn is_flooded(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> bool {
    let detector = &view.camera.detector;
    let dark_e = detector.pattern.dark_min_e_s() * view.exposure.duration_s;
    let is_dark = simulated.has(EffectId::FullWell)
        && simulated.has(EffectId::DarkCurrent)
        && dark_e >= flooding_e(detector);
    is_dark || Full::is_all(view, simulated, fidelity)
}

/// The light of an area source on the pixels of a frame with those effects; area light fills the
/// pixels of `full`.
pub fn lit_by(
    view: &View,
    area: &Area,
    simulated: &EffectSet,
    full: &Full,
    fidelity: &Fidelity,
) -> AreaLight {
    let none = |dark: Option<Cow<'static, str>>| AreaLight {
        effect: area.effect,
        dark,
        light: None,
        ends: Vec::new(),
        electrons: 0.0,
        max_e: area.peak_e,
        is_thin: true,
        work: RasterWork::default(),
    };
    let radiance = match &area.radiance {
        Ok(radiance) => radiance.as_ref(),
        Err(why) => return none(Some(why.clone())),
    };
    if radiance.edge().is_none() && is_too_thin(view, area.peak_e, simulated, fidelity) {
        return none(None);
    }
    let plane = Plane::new(view, simulated, radiance.turning());
    let has_edges = radiance.edge().is_some();
    let blur = Blur::new(&view.camera, area.peak_e, has_edges, fidelity);
    let (light, work) = rasterize(radiance, &plane, &blur, full, fidelity);
    let electrons = light.sum();
    if electrons == 0.0 {
        return none(Some(area.unlit.into()));
    }
    let ends = light.ends_of(CELL);
    let max = ends.iter().map(|[_, max]| *max);
    let max_e = f64::from(max.fold(0.0, f32::max));
    AreaLight {
        effect: area.effect,
        dark: None,
        light: Some(light),
        ends,
        electrons,
        max_e,
        is_thin: is_too_thin(view, max_e, simulated, fidelity),
        work,
    }
}
