//! `[timing]` and `[mounting]` of a camera file.

use crate::attitude::Attitude;
use crate::camera::{EXPOSURE_S, RATE_HZ};
use crate::load::{Check, ConfigError};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTiming {
    exposure_s: f64,
    rate_hz: f64,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct RawMounting {
    q_body_to_camera: Option<[f64; 4]>,
}

impl RawTiming {
    /// Exposure time (s) and frames a second (Hz).
    pub fn validate(self, check: &Check) -> Result<(f64, f64), ConfigError> {
        let exposure_s = check.range("timing.exposure_s", self.exposure_s, EXPOSURE_S)?;
        let rate_hz = check.range("timing.rate_hz", self.rate_hz, RATE_HZ)?;
        if rate_hz * exposure_s > 1.0 {
            let most = format!(
                "at most 1 / timing.exposure_s = {}: exposures do not overlap",
                1.0 / exposure_s
            );
            return Err(check.refuse("timing.rate_hz", rate_hz, most));
        }
        Ok((exposure_s, rate_hz))
    }
}

impl RawMounting {
    /// Body to camera.
    pub fn validate(self, check: &Check) -> Result<Attitude, ConfigError> {
        match self.q_body_to_camera {
            None => Ok(Attitude::identity()),
            Some(q) => Attitude::from_xyzw(q)
                .map_err(|error| check.explain("mounting.q_body_to_camera", error)),
        }
    }
}
