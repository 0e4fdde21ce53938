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
use crate::load::{
    Allowed, CAMERAS, Check, ConfigError, EXAMPLE_CAMERA, Folder, Limit, Noticed, nearest,
    read_noticed, schema_of,
};
use detector::RawDetector;
use optics::RawOptics;
use radiation::RawRadiation;
use schemars::JsonSchema;
use serde::Deserialize;
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
    optics: RawOptics,
    /// The sensor and its electronics.
    detector: RawDetector,
    /// Particles that cross the sensor; none without this table.
    radiation: Option<RawRadiation>,
    /// Exposures.
    timing: RawTiming,
    /// From body axes to camera axes.
    #[serde(default)]
    mounting: RawMounting,
}

/// The serial number of cameras that give none.
fn first() -> u64 {
    1
}

/// The limits of all keys.
const LIMITS: &[&[Limit]] = &[
    &[("name", Allowed::Length(1..=60))],
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
    read_noticed(file, text, EXAMPLE_CAMERA, |raw, check| {
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
    let length = raw.name.trim().chars().count();
    if !(1..=60).contains(&length) || raw.name.contains(char::is_control) {
        let allowed = "a name of 1 to 60 printable characters: labels and FITS headers give it";
        return Err(check.refuse("name", format!("{:?}", raw.name.trim()), allowed));
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

/// Refuses a table of angles (deg) that do not rise, or of angles and values outside of their limits.
fn rising_angles(
    key: &str,
    table: &[[f64; 2]],
    limits: &[Limit],
    check: &Check,
) -> Result<(), ConfigError> {
    for (i, [deg, value]) in table.iter().enumerate() {
        check.limit_in(limits, "deg", &format!("{key}[{i}][0]"), *deg)?;
        check.limit(limits, &format!("{key}[{i}][1]"), *value)?;
    }
    match table.windows(2).position(|pair| pair[1][0] <= pair[0][0]) {
        Some(i) => {
            let (key, given) = (format!("{key}[{}]", i + 1), format!("{:?}", table[i + 1]));
            let allowed = format!(
                "at a greater angle than the point before it, {:?}",
                table[i]
            );
            Err(check.refuse(&key, given, allowed))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{agree, both};

    /// The text of a camera file, with these tables for the point spread function and whatever follows it.
    fn file(psf: &str) -> String {
        format!(
            r#"
name = "X"
[optics]
focal_length_mm = 20.0
aperture_mm = 10.0
transmission = 0.8
band = [400.0, 900.0]
projection = {{ model = "brown-conrady", k = [0.001], p = [0.0, 0.0], strength = 1.0 }}
vignetting = {{ table = [[0.0, 1.0], [40.0, 0.5]] }}
stray = {{ pst = [[0.0, 1e-3], [90.0, 1e-9]], sun_exclusion_deg = 40.0 }}
psf = {psf}
[detector]
width_px = 64
height_px = 64
pixel_um = 5.0
quantum_efficiency = 0.5
dark_e_s = 10.0
dark_reference_c = 20.0
temperature_c = 20.0
dark_doubling_k = 6.5
dark_nonuniformity = 0.1
hot_fraction = 0.001
hot_e_s = 100.0
prnu = 0.01
dead_fraction = 0.001
stuck_fraction = 0.001
read_noise_e = 5.0
full_well_e = 10000.0
blooming = "column"
nonlinearity = 0.01
gain_e_per_dn = 3.0
offset_dn = 30.0
stuck_dn = 4095.0
adc_bits = 12
[radiation]
flux_cm2_s = 1.0
thickness_um = 10.0
energy_mev = 534.0
diffusion_um = 1.0
readout_s = 0.01
[timing]
exposure_s = 0.1
rate_hz = 5.0
shutter = "rolling"
row_us = 10.0
[mounting]
misalignment_arcsec = [0.0, 0.0, 0.0]
"#
        )
    }

    const GAUSSIAN: &str = "{ kind = \"gaussian\", sigma_px = 0.8, width_by_field = [[0.0, 1.0], [2.0, 1.5]], wavelength_exponent = 1.0 }";

    fn load(text: &str) -> Option<String> {
        let read = parse("camera.toml", text, &Folder::current());
        read.err().map(|error| error.to_string())
    }

    #[test]
    fn the_schema_has_the_loaders_limits() {
        let bases = [
            GAUSSIAN,
            "{ kind = \"airy\", obscuration = 0.3 }",
            "{ kind = \"moffat\", fwhm_px = 2.0, beta = 2.5 }",
            "{ kind = \"image\", images = [{ file = \"no\", at_px = [1.0, 1.0] }], oversampling = 4.0 }",
        ]
        .map(file);
        agree(
            &schema(),
            LIMITS,
            &bases.each_ref().map(String::as_str),
            load,
        );
    }

    #[test]
    fn schema_and_loader_agree_on_keys_that_go_together() {
        let base = file(GAUSSIAN);
        for (from, to, is_valid) in [
            ("X", "X", true),
            ("sigma_px = 0.8, ", "", false),
            ("sigma_px = 0.8", "fwhm_px = 0.8", false),
            ("kind = \"gaussian\"", "kind = \"airy\"", false),
            (
                "vignetting = { table",
                "vignetting = { cos4 = true, table",
                false,
            ),
            (
                "vignetting = { table",
                "vignetting = { cos4 = false, table",
                true,
            ),
            ("band = [400.0, 900.0]", "band = \"v\"", true),
            ("band = [400.0, 900.0]", "band = \"w\"", false),
            ("flux_cm2_s = 1.0", "flux_cm2_s = \"orbit\"", true),
            ("flux_cm2_s = 1.0", "flux_cm2_s = \"all\"", false),
        ] {
            assert!(base.contains(from), "{from}");
            both(&schema(), &base.replacen(from, to, 1), load, is_valid);
        }
        for name in CAMERAS {
            let (_, text) = Folder::Embedded("cameras")
                .read(&format!("{name}.toml"))
                .unwrap();
            let load = |text: &str| {
                parse(name, text, &Folder::Embedded("cameras"))
                    .err()
                    .map(|e| e.to_string())
            };
            both(&schema(), &text, load, true);
        }
    }
}
