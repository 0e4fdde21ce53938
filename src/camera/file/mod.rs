//! The camera file: TOML keys with units to a validated [`Camera`]. A file a table.

mod detector;
mod optics;
mod psf;
mod timing;

use super::Camera;
use crate::load::{CAMERAS, Check, ConfigError, Folder, parse};
use detector::RawDetector;
use optics::RawOptics;
use serde::Deserialize;
use timing::{RawMounting, RawTiming};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    name: String,
    optics: RawOptics,
    detector: RawDetector,
    timing: RawTiming,
    #[serde(default)]
    mounting: RawMounting,
}

/// See [`Camera::load`].
pub fn load(name: &str, folder: &Folder) -> Result<Camera, ConfigError> {
    let (file, text) = if CAMERAS.contains(&name) {
        Folder::Embedded("cameras").read(&format!("{name}.toml"))?
    } else {
        folder
            .read(name)
            .map_err(|error| name_the_cameras(error, name))?
    };
    let raw: RawCamera = parse(&file, &text)?;
    validate(raw, &Check { file: &file })
}

/// A camera that is neither built in nor a file: the remedy lists those that are.
fn name_the_cameras(error: ConfigError, name: &str) -> ConfigError {
    match error {
        ConfigError::Read { file, source, .. } => ConfigError::Read {
            file: format!("camera {name:?} ({file})"),
            source,
            remedy: format!(
                "name a camera file or one of the built-in cameras: {}",
                CAMERAS.join(", ")
            ),
        },
        other => other,
    }
}

fn validate(raw: RawCamera, check: &Check) -> Result<Camera, ConfigError> {
    let length = raw.name.trim().chars().count();
    if !(1..=60).contains(&length) || raw.name.contains(char::is_control) {
        let allowed = "a name of 1 to 60 printable characters: labels and FITS headers give it";
        return Err(check.refuse("name", format!("{:?}", raw.name.trim()), allowed));
    }
    let detector = raw.detector.validate(check)?;
    let optics = raw.optics.validate(&detector, check)?;
    let mounting = raw.mounting.validate(check)?;
    let timing = raw.timing.validate(detector.height, check)?;
    Ok(Camera {
        name: raw.name,
        mounting,
        optics,
        detector,
        exposure_s: timing.exposure_s,
        rate_hz: timing.rate_hz,
        shutter: timing.shutter,
    })
}
