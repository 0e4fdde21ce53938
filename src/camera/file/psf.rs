//! `[optics.psf]` of a camera file.

use crate::camera::Psf;
use crate::load::{Check, ConfigError};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPsf {
    kind: String,
    sigma_px: Option<f64>,
}

impl RawPsf {
    pub fn validate(self, check: &Check) -> Result<Psf, ConfigError> {
        let needed = |key: &str, value: Option<f64>, range| match value {
            Some(value) => check.range(&format!("optics.psf.{key}"), value, range),
            None => Err(check.explain(
                &format!("optics.psf.{key}"),
                format!("a PSF of kind {:?} needs it", self.kind),
            )),
        };
        match self.kind.as_str() {
            "gaussian" => Ok(Psf::gaussian(needed(
                "sigma_px",
                self.sigma_px,
                0.01..=10.0,
            )?)),
            other => Err(check.refuse("optics.psf.kind", format!("{other:?}"), "\"gaussian\"")),
        }
    }
}
