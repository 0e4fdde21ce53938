//! `[optics.stray]` of a camera file.

use super::angles::{FIELD, FIELD_DEG, rising_angles};
use crate::camera::Stray;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, Number};
use skyloop_base::load::{Check, ConfigError, Fixed, Limit};

/// The Sun's radius as seen from the Earth, deg.
const SUN_RADIUS_DEG: f64 = 0.27;
/// Default margin of the Sun's exclusion angle beyond the field, deg.
const MARGIN_DEG: f64 = 10.0;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawStray {
    /// Point-source transmittance, [[angle, transmittance], ...]: irradiance on the detector over
    /// that on the aperture, transmission included, by angle from the boresight. Monotone cubics in
    /// its logarithm between, constant beyond: end with an entry such as [105, 1e-12]. Without it
    /// no light is scattered (deg)
    pst: Option<Vec<Fixed<f64, 2>>>,
    /// Angle from the boresight within which the Sun saturates the frame; at least 0.27 deg beyond
    /// the corner of the field, default: 10 deg beyond it. The field ends where vignetting blocks
    /// all light (deg)
    sun_exclusion_deg: Option<f64>,
}

/// Limits of the keys; the minimum of sun_exclusion_deg follows from the field of view.
pub(crate) const LIMITS: &[Limit] = &[
    ("optics.stray.sun_exclusion_deg", Number(0.0..=180.0)),
    ("optics.stray.pst[][0]", Number(FIELD_DEG)),
    ("optics.stray.pst[][1]", Number(1e-12..=1.0)),
    ("optics.stray.pst", Count(1..=usize::MAX)),
];

impl RawStray {
    /// For a camera whose image contains light from up to `field_deg` from the boresight.
    pub fn validate(
        raw: Option<RawStray>,
        field_deg: f64,
        check: &Check,
    ) -> Result<Stray, ConfigError> {
        let default_deg = (field_deg + MARGIN_DEG).min(180.0);
        let Some(raw) = raw else {
            return Ok(Stray::new(&[], default_deg.to_radians()));
        };
        if raw.pst.is_none() && raw.sun_exclusion_deg.is_none() {
            let reason = "is empty: set pst = [[angle, transmittance], ...] or sun_exclusion_deg, or leave it out";
            return Err(check.explain("optics.stray", reason));
        }
        let mut table = Vec::new();
        if let Some(pst) = raw.pst {
            let (key, points) = ("optics.stray.pst", Fixed::all(pst));
            if points.is_empty() {
                return Err(check.refuse(key, "[]", "at least one [angle, transmittance]"));
            }
            rising_angles(key, &points, LIMITS, check)?;
            falling(key, &points, check)?;
            table = points;
        }
        let min_deg = (field_deg + SUN_RADIUS_DEG).min(180.0);
        let key = "optics.stray.sun_exclusion_deg";
        let exclusion_deg = raw.sun_exclusion_deg.unwrap_or(default_deg);
        let exclusion_deg = check.limit(LIMITS, key, exclusion_deg)?;
        if !(min_deg..=180.0).contains(&exclusion_deg) {
            let allowed = format!(
                "{:.2} to 180 deg: the Sun is never in the image, whose corner is {field_deg:.2} deg from the boresight by \
                 optics.focal_length_mm, detector.pixel_um, detector.width_px and detector.height_px",
                (min_deg * 100.0).ceil() / 100.0
            );
            let error = check.refuse(key, exclusion_deg, allowed);
            return Err(error.needs(FIELD));
        }
        let rad: Vec<[f64; 2]> = table
            .into_iter()
            .map(|[deg, pst]| [deg.to_radians(), pst])
            .collect();
        Ok(Stray::new(&rad, exclusion_deg.to_radians()))
    }
}

/// Refuses a transmittance that rises with the angle.
fn falling(key: &str, points: &[[f64; 2]], check: &Check) -> Result<(), ConfigError> {
    match points.windows(2).position(|pair| pair[1][1] > pair[0][1]) {
        Some(i) => {
            let (entry, given) = (format!("{key}[{}]", i + 1), format!("{:?}", points[i + 1]));
            let allowed = format!(
                "no greater than at the point before it, {:?}: a point-source transmittance falls with the angle from the boresight",
                points[i]
            );
            Err(check.refuse(&entry, given, allowed).needs(&[key]))
        }
        None => Ok(()),
    }
}
