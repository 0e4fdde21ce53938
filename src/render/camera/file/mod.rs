//! The camera file: TOML keys with units to a validated [`Camera`]. One source file per table.

mod angles;
mod detector;
mod images;
mod optics;
mod projection;
mod psf;
mod radiation;
mod stray;
mod timing;
mod vignetting;

use crate::camera::Camera;
use detector::RawDetector;
use optics::RawOptics;
use radiation::RawRadiation;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::{
    Allowed, CAMERAS, Check, ConfigError, END, EXAMPLE_CAMERA, Folder, Limit, Noticed, nearest,
    read_noticed, schema_of, some_table, table,
};
use timing::{RawMounting, RawTiming};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    /// Name in labels and FITS headers
    name: String,
    /// Serial number, the key of the fixed pattern
    #[serde(default = "first")]
    serial: u64,
    /// Lens, filter and point spread function.
    #[serde(deserialize_with = "table")]
    optics: RawOptics,
    /// The sensor and its electronics.
    #[serde(deserialize_with = "table")]
    detector: RawDetector,
    /// Particles that cross the detector; none without this table.
    #[serde(default, deserialize_with = "some_table")]
    radiation: Option<RawRadiation>,
    /// Exposure, rate and shutter.
    #[serde(deserialize_with = "table")]
    timing: RawTiming,
    /// Orientation of the camera on the body.
    #[serde(default, deserialize_with = "table")]
    mounting: RawMounting,
}

/// The default serial number.
fn first() -> u64 {
    1
}

/// The limits of all keys.
const LIMITS: &[&[Limit]] = &[
    &[
        ("name", Allowed::Length(1..=60)),
        ("name", Allowed::Form(printable)),
    ],
    detector::LIMITS,
    images::LIMITS,
    optics::LIMITS,
    projection::LIMITS,
    psf::LIMITS,
    radiation::LIMITS,
    stray::LIMITS,
    timing::LIMITS,
    vignetting::LIMITS,
];

/// Texts without control characters (C0, DEL and C1) that are not blank.
fn printable() -> String {
    let controls = r"\x00-\x1f\x7f-\x9f";
    format!(r"^[^{controls}]*[^\s{controls}][^{controls}]*{END}")
}

impl Camera {
    /// Reads `name`: a bare name of `configs/cameras/` (also embedded), or a file in `folder`.
    pub fn load(name: &str, folder: &Folder) -> Result<Camera, ConfigError> {
        let (camera, notices) = Camera::load_noticed(name, folder)?;
        for notice in notices {
            tracing::warn!("{notice}");
        }
        Ok(camera)
    }

    /// The same, but returns warnings about valid yet unlikely values, one line each, instead of
    /// logging them.
    pub fn load_noticed(name: &str, folder: &Folder) -> Result<(Camera, Vec<String>), ConfigError> {
        let embedded = CAMERAS.contains(&name);
        // A camera file names other files relative to its own folder.
        let (found, own_folder) = match folder {
            _ if embedded => {
                let embedded = Folder::Embedded("cameras");
                (embedded.read(&format!("{name}.toml")), embedded)
            }
            Folder::Disk(path) => (folder.read(name), Folder::of(&path.join(name))),
            Folder::Embedded(_) => (folder.read(name), folder.clone()),
        };
        let (file, text) = found.map_err(|error| name_the_cameras(error, name))?;
        parse(&file, &text, &own_folder)
    }

    /// The JSON Schema of camera files.
    pub fn schema() -> schemars::Schema {
        schema_of::<RawCamera>("skyloop camera file", LIMITS)
    }

    /// Reads the text of a camera file called `file`, which names no other files, with its
    /// warnings.
    pub fn parse_noticed(file: &str, text: &str) -> Result<(Camera, Vec<String>), ConfigError> {
        parse(file, text, &Folder::current())
    }
}

/// The camera of a text; `file` is its name in messages, `folder` resolves the files that it names.
fn parse(file: &str, text: &str, folder: &Folder) -> Result<Noticed<Camera>, ConfigError> {
    read_noticed(file, text, EXAMPLE_CAMERA, LIMITS, |raw, check| {
        validate(raw, check, folder)
    })
}

/// For a camera that is neither built in nor a file: adds a remedy with the built-in names.
fn name_the_cameras(error: ConfigError, name: &str) -> ConfigError {
    match error {
        ConfigError::Read { file, source, .. } => ConfigError::Read {
            file: format!("camera {name:?} ({file})"),
            source,
            remedy: format!(
                "{}name a camera file or one of the built-in cameras: {}",
                nearest(name, CAMERAS)
                    .map_or(String::new(), |meant| format!("did you mean {meant}? ")),
                CAMERAS.join(", ")
            ),
        },
        other => other,
    }
}

fn validate(raw: RawCamera, check: &Check, folder: &Folder) -> Result<Camera, ConfigError> {
    let length = raw.name.chars().count();
    let is_blank = raw.name.trim().is_empty();
    if !(1..=60).contains(&length) || is_blank || raw.name.contains(char::is_control) {
        let allowed = "a name of 1 to 60 printable characters: labels and FITS headers give it";
        return Err(check.refuse("name", format!("{:?}", raw.name), allowed));
    }
    let detector = raw.detector.validate(raw.serial, check)?;
    let optics = raw.optics.validate(&detector, check, folder)?;
    let mounting = raw.mounting.validate(check)?;
    let timing = raw.timing.validate(detector.height, check)?;
    let radiation = raw
        .radiation
        .map(|r| r.validate(&detector, &timing, check))
        .transpose()?;
    let dark_e = detector.dark_e(timing.exposure_s);
    if dark_e >= detector.full_well_e {
        check.notice(format_args!(
            "detector.dark_e_s: at detector.temperature_c {dark_e:.3e} e- come in timing.exposure_s, and detector.full_well_e is {}: dark \
             current fills every pixel",
            detector.full_well_e
        ));
    }
    Ok(Camera {
        name: raw.name,
        serial: raw.serial,
        mounting,
        optics,
        detector,
        radiation,
        exposure_s: timing.exposure_s,
        rate_hz: timing.rate_hz,
        shutter: timing.shutter,
    })
}

#[cfg(test)]
mod tests;
