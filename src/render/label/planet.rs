//! Label members that only the Moon and planets have.

use super::coordinates::ra_dec_deg;
use crate::scene::{EffectId, Scene, Source, VisiblePlanet};
use schemars::JsonSchema;

/// Label members of the Moon and planets, at mid-exposure.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct PlanetLabel {
    /// Distance of its centre from the observer, geometric.
    pub range_km: f64,
    /// Angle Sun - body - observer, geometric.
    pub phase_deg: f64,
    /// Angular radius.
    pub radius_deg: f64,
    /// Fraction of its light that neither the Earth nor its shadow blocks, 0 to 1.
    pub light: f64,
    /// Image of the centre of its disc, [column, row]; null without an image.
    pub centre_px: Option<[f64; 2]>,
    /// Apparent right ascension of the centre of its disc, ICRF axes, from 0 to below 360.
    pub centre_ra_deg: f64,
    /// Apparent declination of the same point.
    pub centre_dec_deg: f64,
}

impl PlanetLabel {
    /// For a body with its image.
    pub(super) fn new(seen: &VisiblePlanet, source: &Source, scene: &Scene) -> PlanetLabel {
        let [centre_ra_deg, centre_dec_deg] = ra_dec_deg(&seen.centre);
        PlanetLabel {
            range_km: seen.range_m * 1e-3,
            phase_deg: seen.phase.to_degrees(),
            radius_deg: seen.angular_radius.to_degrees(),
            light: source.electrons / source.clear_e.max(f64::MIN_POSITIVE),
            centre_px: centre_px(seen, source, scene),
            centre_ra_deg,
            centre_dec_deg,
        }
    }
}

/// The centroid, moved by the offset between the images of both directions at mid-exposure. So it
/// is the same mean over the exposure, and on the same row of a rolling shutter.
fn centre_px(seen: &VisiblePlanet, source: &Source, scene: &Scene) -> Option<[f64; 2]> {
    let optics = &scene.view.camera.optics;
    let projection = optics.projection_if(scene.simulated.has(EffectId::Distortion));
    let pointing = scene.view.pointing(0.0);
    let [light, centre] = [&seen.directions[1], &seen.centre]
        .map(|direction| optics.project_by(&projection, &pointing.rotate(direction)));
    let (light, centre) = (light?, centre?);
    Some([0, 1].map(|axis| source.centroid[axis] + centre[axis] - light[axis]))
}
