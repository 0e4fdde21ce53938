//! `[optics.psf]` of a camera file.

use super::angles::{FIELD_DEG, rising_angles};
use super::images::{RawImage, grid};
use crate::camera::psf::{Airy, Moffat, Shape, Variation, WIDEST_PX};
use crate::camera::{Band, Projection, Psf};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, Number};
use skyloop_base::load::{Allowed, Check, ConfigError, Fixed, Folder, Kind, Limit, some_tables};
use std::sync::Arc;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPsf {
    /// Point spread function; the width of airy is the mean wavelength of sunlight in the band
    /// times the focal ratio
    kind: String,
    /// gaussian: standard deviation (px)
    sigma_px: Option<f64>,
    /// airy: diameter of the central obscuration as a fraction of the aperture; default: 0
    obscuration: Option<f64>,
    /// moffat: full width at half maximum (px)
    fwhm_px: Option<f64>,
    /// moffat: exponent
    beta: Option<f64>,
    /// image: sampled images, one or a grid of positions; bilinear between positions, the nearest
    /// beyond them; samples sum to 1 within 0.001
    #[serde(default, deserialize_with = "some_tables")]
    images: Option<Vec<RawImage>>,
    /// image: samples per pixel (cells/px)
    oversampling: Option<f64>,
    /// [[angle, factor], ...]: factor of the width by the angle from the boresight, linear between.
    /// With factor and colour of a star sigma_px is at most 100, any other width at most 20 px
    /// (deg)
    width_by_field: Option<Vec<Fixed<f64, 2>>>,
    /// gaussian, moffat: exponent of the width with the mean wavelength of a source in the band;
    /// default: 0 (airy has 1)
    wavelength_exponent: Option<f64>,
}

/// The optics that a point spread function belongs to.
pub(crate) struct Lens<'a> {
    pub focal_px: f64,
    pub principal_px: [f64; 2],
    /// Pitch of the pixels, m.
    pub pitch_m: f64,
    /// Focal length / aperture.
    pub focal_ratio: f64,
    pub band: &'a Band,
    pub projection: &'a Projection,
}

/// Greatest distance of points in a table of widths, deg: interpolation by distance then errs by
/// less than 1e-4 of their rise.
const FINE_DEG: f64 = 0.25;
/// Greatest standard deviation (px) of a Gaussian in the field and for any star: a stamp of some
/// 900 x 900 pixels.
const WIDEST_SIGMA_PX: f64 = 100.0;

/// The keys of each kind in addition to `kind`: required ones, then optional ones.
const KINDS: &[Kind] = &[
    (
        "gaussian",
        &["sigma_px"],
        &["width_by_field", "wavelength_exponent"],
    ),
    ("airy", &[], &["obscuration", "width_by_field"]),
    (
        "moffat",
        &["fwhm_px", "beta"],
        &["width_by_field", "wavelength_exponent"],
    ),
    ("image", &["images", "oversampling"], &[]),
];

pub(crate) const LIMITS: &[Limit] = &[
    ("optics.psf.sigma_px", Number(0.01..=WIDEST_SIGMA_PX)),
    ("optics.psf.fwhm_px", Number(0.02..=WIDEST_PX)),
    ("optics.psf.beta", Number(1.5..=20.0)),
    ("optics.psf.oversampling", Number(1.0..=64.0)),
    ("optics.psf.obscuration", Number(0.0..=0.9)),
    ("optics.psf.wavelength_exponent", Number(-4.0..=4.0)),
    ("optics.psf.width_by_field[][0]", Number(FIELD_DEG)),
    ("optics.psf.width_by_field[][1]", Number(0.1..=10.0)),
    ("optics.psf.width_by_field", Count(1..=usize::MAX)),
    ("optics.psf", Allowed::Kind("kind", KINDS)),
];

/// Keys that determine the width.
const WIDTH: &[&str] = &[
    "optics.psf.kind",
    "optics.psf.width_by_field",
    "optics.psf.wavelength_exponent",
    "optics.band",
    "optics.focal_length_mm",
    "optics.aperture_mm",
    "detector.pixel_um",
];

impl RawPsf {
    pub fn validate(
        self,
        lens: &Lens<'_>,
        check: &Check,
        folder: &Folder,
    ) -> Result<Psf, ConfigError> {
        // The schema of kinds ensures that the required keys are present.
        let number = |key: &str, value: Option<f64>| {
            check.limit(LIMITS, &format!("optics.psf.{key}"), value.unwrap_or(0.0))
        };
        let (shape, width_px) = match self.kind.as_str() {
            "gaussian" => {
                let sigma_px = number("sigma_px", self.sigma_px)?;
                (Shape::Gaussian(sigma_px), sigma_px)
            }
            "airy" => self.airy(lens, check)?,
            "moffat" => {
                let fwhm_px = number("fwhm_px", self.fwhm_px)?;
                let beta = number("beta", self.beta)?;
                (Shape::Moffat(Arc::new(Moffat::new(beta)), fwhm_px), fwhm_px)
            }
            _ => {
                let oversampling = number("oversampling", self.oversampling)?;
                let images = self.images.as_deref().unwrap_or_default();
                let images = grid(images, oversampling, lens.principal_px, check, folder)?;
                (Shape::Images(Arc::new(images)), 0.0)
            }
        };
        let exponent = match &shape {
            Shape::Airy(..) => 1.0,
            _ => self.wavelength_exponent.unwrap_or(0.0),
        };
        let exponent = check.limit(LIMITS, "optics.psf.wavelength_exponent", exponent)?;
        let by_field = self.width_by_field(lens, check)?;
        self.check_width(width_px, &by_field, exponent, lens, check)?;
        let variation = Variation {
            by_field,
            wavelength_exponent: exponent,
            wavelength_ratios: lens.band.wavelength_ratios(),
        };
        Ok(Psf::new(shape, variation))
    }

    /// Refuses a width that is too large to draw in reasonable time anywhere in the field or for
    /// any colour.
    fn check_width(
        &self,
        width_px: f64,
        by_field: &[[f64; 2]],
        exponent: f64,
        lens: &Lens<'_>,
        check: &Check,
    ) -> Result<(), ConfigError> {
        let factors = by_field.iter().map(|[_, factor]| *factor);
        let field = factors.reduce(f64::max).unwrap_or(1.0);
        let ratios = lens.band.wavelength_ratios();
        let colour = ratios
            .map(|ratio| libm::pow(ratio, exponent))
            .into_iter()
            .fold(1.0, f64::max);
        let widest = width_px * field * colour;
        let (key, max, remedy) = match self.kind.as_str() {
            "gaussian" => ("sigma_px", WIDEST_SIGMA_PX, ""),
            "airy" => ("kind", WIDEST_PX, "; enlarge the aperture or the pixels"),
            _ => ("fwhm_px", WIDEST_PX, ""),
        };
        if widest <= max {
            return Ok(());
        }
        let mut reason = format!("the width of {width_px:.2} px comes to {widest:.2} px");
        if field > 1.0 {
            reason += &format!(", by {field} in the field (optics.psf.width_by_field)");
        }
        if colour > 1.0 {
            reason += &format!(", by {colour:.3} with the colour of stars (power {exponent})");
        }
        reason += &format!(": at most {max} px{remedy}");
        let error = check.explain(&format!("optics.psf.{key}"), reason);
        Err(error.needs(WIDTH))
    }

    /// The last angle of the table of widths, deg, if it has several points.
    pub fn last_angle_deg(&self) -> Option<f64> {
        let table = self.width_by_field.as_ref().filter(|t| t.len() > 1)?;
        table.last().map(|Fixed([deg, _])| *deg)
    }

    /// Diffraction by the aperture: its width is wavelength times focal ratio.
    fn airy(&self, lens: &Lens<'_>, check: &Check) -> Result<(Shape, f64), ConfigError> {
        let obscuration = self.obscuration.unwrap_or(0.0);
        let obscuration = check.limit(LIMITS, "optics.psf.obscuration", obscuration)?;
        let width_px = lens.band.reference_m() * lens.focal_ratio / lens.pitch_m;
        let airy = Airy::new(obscuration, &lens.band.spectrum());
        Ok((Shape::Airy(Arc::new(airy), width_px), width_px))
    }

    /// Converts field angles (deg) to distances from the principal point (px). Adds points between,
    /// since interpolation by angle is not linear in distance.
    fn width_by_field(&self, lens: &Lens<'_>, check: &Check) -> Result<Vec<[f64; 2]>, ConfigError> {
        let key = "optics.psf.width_by_field";
        let table = Fixed::all(self.width_by_field.clone().unwrap_or_default());
        if table.is_empty() && self.width_by_field.is_some() {
            return Err(check.refuse(key, "[]", "at least one [angle, factor]"));
        }
        rising_angles(key, &table, LIMITS, check)?;
        let distance = |(i, [deg, factor]): (usize, [f64; 2])| {
            let (sin, cos) = libm::sincos(deg.to_radians());
            let image = lens.projection.image(&Vector3::new(sin, 0.0, cos));
            let [x, y] = image.ok_or_else(|| {
                let end = lens.projection.end_rad().to_degrees();
                let allowed = format!("an angle that has an image: below {end:.2} deg");
                let error = check.refuse(&format!("{key}[{i}][0]"), table[i][0], allowed);
                error.needs(&["optics.projection"])
            })?;
            Ok([lens.focal_px * libm::hypot(x, y), factor])
        };
        let first = table.first().map(|point| (0, *point));
        let between = table.windows(2).enumerate().flat_map(|(i, ends)| {
            let parts = ((ends[1][0] - ends[0][0]) / FINE_DEG).ceil().max(1.0) as usize;
            let point = move |k: usize| {
                let part = k as f64 / parts as f64;
                [0, 1].map(|j| ends[0][j] + (ends[1][j] - ends[0][j]) * part)
            };
            (1..=parts).map(move |k| (i + 1, point(k)))
        });
        first.into_iter().chain(between).map(distance).collect()
    }
}
