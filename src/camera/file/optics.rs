//! `[optics]` of a camera file.

use super::projection::RawProjection;
use super::psf::{Lens, RawPsf};
use super::vignetting::RawVignetting;
use crate::camera::psf::{Shape, Variation};
use crate::camera::{Band, Detector, Optics, Psf};
use crate::load::{Check, ConfigError, Fixed, Folder};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawOptics {
    focal_length_mm: f64,
    aperture_mm: f64,
    transmission: f64,
    band: RawBand,
    principal_px: Option<Fixed<f64, 2>>,
    psf: RawPsf,
    #[serde(default)]
    projection: RawProjection,
    #[serde(default)]
    vignetting: RawVignetting,
}

#[derive(Deserialize, Debug)]
#[serde(
    untagged,
    expecting = "band must be \"v\", \"silicon\" or two wavelengths [from, to] in nm"
)]
enum RawBand {
    Named(String),
    Nanometres(Fixed<f64, 2>),
}

impl RawOptics {
    pub fn validate(
        self,
        detector: &Detector,
        check: &Check,
        folder: &Folder,
    ) -> Result<Optics, ConfigError> {
        let range = |key: &str, value, range| check.range(&format!("optics.{key}"), value, range);
        let focal_m = range("focal_length_mm", self.focal_length_mm, 0.01..=1e6)? * 1e-3;
        let aperture_m = range("aperture_mm", self.aperture_mm, 1e-3..=1e5)? * 1e-3;
        let size = [detector.width as f64, detector.height as f64];
        let centre = size.map(|pixels| (pixels - 1.0) / 2.0);
        let principal_px = self.principal_px.map_or(centre, |Fixed(at)| at);
        for (i, pixels) in size.into_iter().enumerate() {
            let key = format!("principal_px[{i}]");
            range(&key, principal_px[i], -pixels..=2.0 * pixels)?;
        }
        let band = self.band.validate(check)?;
        let projection = self.projection.validate(check)?;
        let mut optics = Optics {
            focal_px: focal_m / detector.pitch_m,
            principal_px,
            aperture_m,
            transmission: range("transmission", self.transmission, 0.0..=1.0)?,
            psf: Psf::new(Shape::Gaussian(0.1), Variation::default()),
            vignetting: self.vignetting.validate(check)?,
            band,
            projection,
        };
        let lens = Lens {
            focal_px: optics.focal_px,
            principal_px,
            pitch_m: detector.pitch_m,
            focal_ratio: focal_m / aperture_m,
            band: &optics.band,
            projection: &optics.projection,
        };
        let psf = self.psf.validate(&lens, check, folder);
        if psf.is_err() {
            // Where the field folds, angles have no image: that comes first.
            self.projection.check_folds(&optics, detector, check)?;
        }
        optics.psf = psf?;
        self.projection.check_folds(&optics, detector, check)?;
        Ok(optics)
    }
}

impl RawBand {
    fn validate(&self, check: &Check) -> Result<Band, ConfigError> {
        const ALLOWED: &str =
            "\"v\", \"silicon\" or [from, to] in nm with 300 <= from < to <= 1200";
        let (band, given) = match self {
            RawBand::Named(name) => (Band::named(name), format!("{name:?}")),
            RawBand::Nanometres(Fixed([from, to])) => {
                let inside = *from >= 300.0 && from < to && *to <= 1200.0;
                let band = inside.then(|| Band::top_hat(from * 1e-9, to * 1e-9));
                (band, format!("[{from}, {to}]"))
            }
        };
        band.ok_or_else(|| check.refuse("optics.band", given, ALLOWED))
    }
}
