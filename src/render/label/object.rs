//! One object in a frame.

use super::coordinates::{km, ra_dec_deg};
use super::planet::PlanetLabel;
use super::visible;
use crate::scene::{Body, Scene, Source, VisiblePlanet, World};
use crate::sky::population::SeenObject;
use schemars::JsonSchema;

/// Kinds of objects.
const STAR: &str = "star";
const RSO: &str = "rso";

/// One object in a frame. Its numbers are rounded to their accuracy.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct ObjectLabel {
    /// `star`, `rso`, `moon` or `planet`.
    #[schemars(extend("enum" = [STAR, RSO, VisiblePlanet::MOON_KIND, VisiblePlanet::PLANET_KIND]))]
    pub kind: &'static str,
    /// `HIP 80351`, `HR n` where there is no HIP, `NORAD 44322`, an OEM's OBJECT_ID, or a name such
    /// as `Moon`.
    pub id: String,
    /// Other names.
    pub names: Vec<String>,
    /// Centroid of the light of the whole exposure, column.
    pub x_px: f64,
    /// Centroid of the light of the whole exposure, row.
    pub y_px: f64,
    /// Position at the start of the exposure, column.
    pub x0_px: f64,
    /// Position at the start of the exposure, row.
    pub y0_px: f64,
    /// Position at the end of the exposure, column.
    pub x1_px: f64,
    /// Position at the end of the exposure, row.
    pub y1_px: f64,
    /// Mean velocity over the exposure, columns.
    pub vx_px_s: f64,
    /// Mean velocity over the exposure, rows.
    pub vy_px_s: f64,
    /// Magnitude V. Of an RSO by Clark et al. 2021, Eq. (9), in full sunlight, mean over the
    /// exposure.
    pub mag: f64,
    /// Magnitude in the band of the light that arrives, `-2.5 log10(E / E_zero)`; null without
    /// light.
    pub band_mag: Option<f64>,
    /// Expected electrons of the whole exposure, also outside the detector.
    pub electrons: f64,
    /// Signal-to-noise ratio on the detector.
    pub snr: f64,
    /// Apparent right ascension of the centre of the light that arrives, ICRF axes, from 0 to below
    /// 360.
    pub ra_deg: f64,
    /// Apparent declination of the same point.
    pub dec_deg: f64,
    /// Whether the centroid lies on the detector.
    pub in_frame: bool,
    /// In the frame, sunlit, not occulted, and with a signal-to-noise ratio of at least
    /// 3 (`VISIBLE_SNR`).
    pub visible: bool,
    /// Reason if it is not visible.
    #[schemars(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Members that only an RSO has.
    #[schemars(flatten)]
    pub rso: Option<RsoLabel>,
    /// Members that only the Moon and planets have.
    #[schemars(flatten)]
    pub planet: Option<PlanetLabel>,
}

/// Members of an RSO's label; geometric, at mid-exposure.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct RsoLabel {
    /// Distance from the observer.
    pub range_km: f64,
    /// Rate of the range; positive when receding.
    pub range_rate_km_s: f64,
    /// Angle Sun - object - observer.
    pub phase_deg: f64,
    /// Fraction of the Sun's disc that lights it, 0 to 1.
    pub illumination: f64,
    /// Position, GCRF.
    pub position_gcrf_km: [f64; 3],
    /// Velocity, GCRF.
    pub velocity_gcrf_km_s: [f64; 3],
}

/// The label of a source.
pub(crate) fn object(source: &Source, scene: &Scene, world: &World) -> ObjectLabel {
    let [x_px, y_px] = source.centroid;
    let ([x0_px, y0_px], [x1_px, y1_px]) = (source.start, source.end);
    let exposure_s = scene.view.exposure.duration_s;
    let rate = |a: f64, b: f64| {
        if exposure_s > 0.0 {
            (b - a) / exposure_s
        } else {
            0.0
        }
    };
    let (kind, id, names) = names_of(&source.body, world);
    let (mag, direction, rso, planet) = match &source.body {
        Body::Star(seen) => {
            let star = &world.stars.catalog().stars()[seen.index];
            (star.v_mag, seen.direction, None, None)
        }
        Body::Rso(seen) => {
            let direction = seen.apparent.direction;
            (seen.mag, direction, Some(rso_label(seen)), None)
        }
        Body::Planet(seen) => {
            let planet = PlanetLabel::new(seen, source, scene);
            (seen.mag, seen.directions[1], None, Some(planet))
        }
    };
    let [ra_deg, dec_deg] = ra_dec_deg(&direction);
    let in_frame = scene.view.camera.detector.contains([x_px, y_px]);
    let reason = visible::why_not_visible(source, scene, in_frame);
    let irradiance =
        source.arriving_e / (scene.view.camera.electrons_per_second_at_zero() * exposure_s);
    ObjectLabel {
        kind,
        id,
        names,
        x_px,
        y_px,
        x0_px,
        y0_px,
        x1_px,
        y1_px,
        vx_px_s: rate(x0_px, x1_px),
        vy_px_s: rate(y0_px, y1_px),
        mag,
        band_mag: (irradiance > 0.0).then(|| -2.5 * libm::log10(irradiance)),
        electrons: source.electrons,
        snr: source.snr,
        ra_deg,
        dec_deg,
        in_frame,
        visible: reason.is_none(),
        reason,
        rso,
        planet,
    }
}

/// Kind, identifier and names.
fn names_of(body: &Body, world: &World) -> (&'static str, String, Vec<String>) {
    match body {
        Body::Star(seen) => {
            let catalog = world.stars.catalog();
            let star = &catalog.stars()[seen.index];
            (STAR, catalog.id(star), catalog.names(star))
        }
        Body::Rso(seen) => {
            let object = &world.population.objects()[seen.index];
            (RSO, object.id.clone(), object.names.clone())
        }
        Body::Planet(seen) => (seen.kind(), seen.name.to_string(), Vec::new()),
    }
}

fn rso_label(seen: &SeenObject) -> RsoLabel {
    let state = &seen.apparent.state;
    RsoLabel {
        range_km: seen.apparent.range_m * 1e-3,
        range_rate_km_s: seen.apparent.range_rate_m_s * 1e-3,
        phase_deg: seen.phase.to_degrees(),
        illumination: seen.illumination,
        position_gcrf_km: km(&state.position_m),
        velocity_gcrf_km_s: km(&state.velocity_m_s),
    }
}
