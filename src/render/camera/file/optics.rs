//! `[optics]` of a camera file.

use super::projection::RawProjection;
use super::psf::{Lens, RawPsf};
use super::stray::RawStray;
use super::vignetting::RawVignetting;
use crate::camera::psf::{Shape, Variation};
use crate::camera::{Band, Detector, Optics, Psf, Stray, Vignetting};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use skyloop_base::load::Allowed::Number;
use skyloop_base::load::{Check, ConfigError, Fixed, Folder, Limit, TextOrList, some_table, table};
use std::ops::RangeInclusive;

/// Usual ratios of focal length to aperture: from Abbe's sine condition to pinholes.
const LIKELY_FOCAL_RATIOS: RangeInclusive<f64> = 0.5..=500.0;

/// Wavelengths of a band.
const BAND_NM: RangeInclusive<f64> = 300.0..=1200.0;

/// Limits of the keys; those of principal_px follow from the detector's size.
pub(crate) const LIMITS: &[Limit] = &[
    ("optics.focal_length_mm", Number(0.5..=1e6)),
    ("optics.aperture_mm", Number(0.01..=1e5)),
    ("optics.transmission", Number(0.0..=1.0)),
    ("optics.band[]", Number(BAND_NM)),
];

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawOptics {
    /// Effective focal length (mm)
    focal_length_mm: f64,
    /// Diameter of the entrance pupil (mm)
    aperture_mm: f64,
    /// Fraction of the light that passes the optics
    transmission: f64,
    /// Band: [from, to], "v" (Bessell 1990) or "silicon" (350 to 1050 nm, a typical sensor) (nm)
    band: RawBand,
    /// Position of the boresight on the detector; default: its centre (px)
    principal_px: Option<Fixed<f64, 2>>,
    /// The point spread function.
    #[serde(deserialize_with = "table")]
    psf: RawPsf,
    /// Projection from directions to pixels; a pinhole without this table.
    #[serde(default, deserialize_with = "some_table")]
    projection: Option<RawProjection>,
    /// Fall of the light towards the edge of the field.
    #[serde(default, deserialize_with = "some_table")]
    vignetting: Option<RawVignetting>,
    /// Scattered light of sources outside the field.
    #[serde(default, deserialize_with = "some_table")]
    stray: Option<RawStray>,
}

#[derive(Debug, JsonSchema)]
#[schemars(untagged)]
enum RawBand {
    Named(#[schemars(extend("enum" = Band::NAMES))] String),
    Nanometres(Fixed<f64, 2>),
}

impl<'de> Deserialize<'de> for RawBand {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(TextOrList {
            expected: "\"v\", \"silicon\" or two wavelengths [from, to] in nm",
            text: RawBand::Named,
            number: None,
            list: RawBand::Nanometres,
        })
    }
}

impl RawOptics {
    pub fn validate(
        self,
        detector: &Detector,
        check: &Check,
        folder: &Folder,
    ) -> Result<Optics, ConfigError> {
        let limit = |key: &str, value| check.limit(LIMITS, &format!("optics.{key}"), value);
        let focal_m = limit("focal_length_mm", self.focal_length_mm)? * 1e-3;
        let aperture_m = limit("aperture_mm", self.aperture_mm)? * 1e-3;
        let lens_ratio = focal_m / aperture_m;
        let principal_px = self.principal_px(detector, check)?;
        let band = self.band.validate(check)?;
        let raw_projection = match self.projection {
            Some(raw) => raw.not_empty(check)?,
            None => RawProjection::default(),
        };
        let projection = raw_projection.validate(check)?;
        let vignetting_deg = self.vignetting.as_ref();
        let vignetting_deg = vignetting_deg.and_then(RawVignetting::last_angle_deg);
        let tables = [
            ("psf.width_by_field", self.psf.last_angle_deg()),
            ("vignetting.table", vignetting_deg),
        ];
        let vignetting = match self.vignetting {
            Some(raw) => raw.validate(check)?,
            None => Vignetting::None,
        };
        let mut optics = Optics {
            focal_px: focal_m / detector.pitch_m,
            principal_px,
            aperture_m,
            transmission: limit("transmission", self.transmission)?,
            psf: Psf::new(Shape::Gaussian(0.1), Variation::default()),
            vignetting,
            band,
            projection,
            stray: Stray::default(),
        };
        let lens = Lens {
            focal_px: optics.focal_px,
            principal_px,
            pitch_m: detector.pitch_m,
            focal_ratio: lens_ratio,
            band: &optics.band,
            projection: &optics.projection,
        };
        let psf = self.psf.validate(&lens, check, folder);
        if psf.is_err() {
            // Angles beyond a fold of the projection have no image: report the fold first.
            raw_projection.check_folds(&optics, detector, check)?;
        }
        optics.psf = psf?;
        raw_projection.check_folds(&optics, detector, check)?;
        raw_projection.check_size(&optics, detector, check);
        if !LIKELY_FOCAL_RATIOS.contains(&lens_ratio) {
            check.notice(format_args!(
                "optics.aperture_mm = {}: with optics.focal_length_mm = {} it is f/{lens_ratio:.3}, where lenses have f/0.5 (an aplanatic \
                 one in air can have no less) to f/500: are both in mm?",
                self.aperture_mm,
                self.focal_length_mm
            ));
        }
        let edge = detector.edge(0.0);
        let edge = edge.map(|at| optics.direction(at).angle(&Vector3::z()));
        let field_deg = edge.fold(0.0, f64::max).to_degrees();
        let lit_deg = field_deg.min(optics.vignetting.end().to_degrees());
        optics.stray = RawStray::validate(self.stray, lit_deg, check)?;
        for (key, last_deg) in tables {
            if let Some(last_deg) = last_deg.filter(|deg| *deg < field_deg / 20.0) {
                check.notice(format_args!(
                    "optics.{key}: it ends at {last_deg} deg, the field at {field_deg:.1} deg: are its angles in degrees?",
                ));
            }
        }
        Ok(optics)
    }

    /// The principal point, px; the detector's centre by default.
    fn principal_px(&self, detector: &Detector, check: &Check) -> Result<[f64; 2], ConfigError> {
        let size = [detector.width as f64, detector.height as f64];
        let centre = size.map(|pixels| (pixels - 1.0) / 2.0);
        let principal_px = match &self.principal_px {
            Some(Fixed(at)) => *at,
            None => centre,
        };
        for (i, pixels) in size.into_iter().enumerate() {
            let key = format!("optics.principal_px[{i}]");
            let inside = check.range(&key, principal_px[i], -pixels..=2.0 * pixels);
            inside.map_err(|error| error.needs(&["detector.width_px", "detector.height_px"]))?;
        }
        Ok(principal_px)
    }
}

impl RawBand {
    fn validate(&self, check: &Check) -> Result<Band, ConfigError> {
        const ALLOWED: &str =
            "\"v\", \"silicon\" or [from, to] in nm with 300 <= from < to <= 1200";
        let (band, given) = match self {
            RawBand::Named(name) => (Band::named(name), format!("{name:?}")),
            RawBand::Nanometres(Fixed([from, to])) => {
                let inside = BAND_NM.contains(from) && from < to && BAND_NM.contains(to);
                let band = inside.then(|| Band::top_hat(from * 1e-9, to * 1e-9));
                (band, format!("[{from}, {to}]"))
            }
        };
        band.ok_or_else(|| check.refuse("optics.band", given, ALLOWED))
    }
}
