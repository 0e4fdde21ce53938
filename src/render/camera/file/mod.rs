//! The camera file: TOML keys with units to a validated [`Camera`]. A file a table.

mod detector;
mod images;
mod optics;
mod projection;
mod psf;
mod radiation;
mod stray;
mod timing;
mod vignetting;

use super::Camera;
use detector::RawDetector;
use optics::RawOptics;
use radiation::RawRadiation;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::{
    Allowed, CAMERAS, Check, ConfigError, END, EXAMPLE_CAMERA, Folder, Limit, Noticed, nearest,
    read_noticed, schema_of, some_table, table,
};
use std::ops::RangeInclusive;
use timing::{RawMounting, RawTiming};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    /// As labels and FITS give it
    name: String,
    /// Serial number: another one is another fixed pattern; default 1
    #[serde(default = "first")]
    serial: u64,
    /// Lens, filter and image.
    #[serde(deserialize_with = "table")]
    optics: RawOptics,
    /// The sensor and its electronics.
    #[serde(deserialize_with = "table")]
    detector: RawDetector,
    /// Particles that cross the sensor; none without this table.
    #[serde(default, deserialize_with = "some_table")]
    radiation: Option<RawRadiation>,
    /// Exposures.
    #[serde(deserialize_with = "table")]
    timing: RawTiming,
    /// From body axes to camera axes.
    #[serde(default, deserialize_with = "table")]
    mounting: RawMounting,
}

/// The serial number of cameras that give none.
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

/// The JSON Schema of camera files.
pub fn schema() -> schemars::Schema {
    schema_of::<RawCamera>("skyloop camera file", LIMITS)
}

/// See [`Camera::load_noticed`].
pub fn load(name: &str, folder: &Folder) -> Result<Noticed<Camera>, ConfigError> {
    let embedded = CAMERAS.contains(&name);
    // Files that the camera's names are in its own folder.
    let (found, beside) = match folder {
        _ if embedded => {
            let embedded = Folder::Embedded("cameras");
            (embedded.read(&format!("{name}.toml")), embedded)
        }
        Folder::Disk(path) => (folder.read(name), Folder::of(&path.join(name))),
        Folder::Embedded(_) => (folder.read(name), folder.clone()),
    };
    let (file, text) = found.map_err(|error| name_the_cameras(error, name))?;
    parse(&file, &text, &beside)
}

/// The camera of a text; `file` is its name in messages, `folder` that of the files that it names.
pub fn parse(file: &str, text: &str, folder: &Folder) -> Result<Noticed<Camera>, ConfigError> {
    read_noticed(file, text, EXAMPLE_CAMERA, LIMITS, |raw, check| {
        validate(raw, check, folder)
    })
}

/// A camera that is neither built in nor a file: the remedy lists those that are.
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

/// Angles from the boresight, deg.
const FIELD_DEG: RangeInclusive<f64> = 0.0..=180.0;

/// Keys that the field of view follows from.
const FIELD: &[&str] = &[
    "optics.focal_length_mm",
    "optics.principal_px",
    "optics.projection",
    "optics.psf",
    "optics.vignetting",
    "detector.pixel_um",
    "detector.width_px",
    "detector.height_px",
];

/// Refuses a table of angles (deg) that do not rise, or of angles and values outside of their limits.
fn rising_angles(
    key: &str,
    table: &[[f64; 2]],
    limits: &[Limit],
    check: &Check,
) -> Result<(), ConfigError> {
    for (i, [deg, value]) in table.iter().enumerate() {
        check.limit(limits, &format!("{key}[{i}][0]"), *deg)?;
        check.limit(limits, &format!("{key}[{i}][1]"), *value)?;
    }
    match table.windows(2).position(|pair| pair[1][0] <= pair[0][0]) {
        Some(i) => {
            let (entry, given) = (format!("{key}[{}]", i + 1), format!("{:?}", table[i + 1]));
            let allowed = format!(
                "at a greater angle than the point before it, {:?}",
                table[i]
            );
            Err(check.refuse(&entry, given, allowed).needs(&[key]))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
