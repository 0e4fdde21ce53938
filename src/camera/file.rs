//! The camera file: TOML keys with units to a validated [`Camera`].

use super::{Band, Camera, Detector, EXPOSURE_S, GAIN_E_PER_DN, GaussianPsf, Optics, RATE_HZ};
use crate::attitude::Attitude;
use crate::load::{CAMERAS, Check, ConfigError, Folder, parse};
use serde::Deserialize;

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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOptics {
    focal_length_mm: f64,
    aperture_mm: f64,
    transmission: f64,
    band: RawBand,
    psf_sigma_px: f64,
    principal_px: Option<[f64; 2]>,
}

#[derive(Deserialize, Debug)]
#[serde(
    untagged,
    expecting = "band must be \"v\", \"silicon\" or two wavelengths [from, to] in nm"
)]
enum RawBand {
    Named(String),
    Nanometres([f64; 2]),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDetector {
    width_px: u32,
    height_px: u32,
    pixel_um: f64,
    quantum_efficiency: f64,
    dark_e_s: f64,
    read_noise_e: f64,
    full_well_e: f64,
    gain_e_per_dn: f64,
    offset_dn: f64,
    adc_bits: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTiming {
    exposure_s: f64,
    rate_hz: f64,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawMounting {
    q_body_to_camera: Option<[f64; 4]>,
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
    let (o, d, t) = (&raw.optics, &raw.detector, &raw.timing);
    let length = raw.name.trim().chars().count();
    if !(1..=60).contains(&length) || raw.name.contains(char::is_control) {
        let allowed = "a name of 1 to 60 printable characters: labels and FITS headers give it";
        return Err(check.refuse("name", format!("{:?}", raw.name.trim()), allowed));
    }
    let focal_m = check.range("optics.focal_length_mm", o.focal_length_mm, 0.01..=1e6)? * 1e-3;
    let pitch_m = check.range("detector.pixel_um", d.pixel_um, 0.1..=1e4)? * 1e-6;
    let width = check.range("detector.width_px", f64::from(d.width_px), 1.0..=8192.0)? as usize;
    let height = check.range("detector.height_px", f64::from(d.height_px), 1.0..=8192.0)? as usize;
    let centre = [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0];
    let principal_px = o.principal_px.unwrap_or(centre);
    for (value, pixels) in principal_px.into_iter().zip([width as f64, height as f64]) {
        check.range("optics.principal_px", value, -pixels..=2.0 * pixels)?;
    }
    let bits = check.range("detector.adc_bits", f64::from(d.adc_bits), 1.0..=16.0)? as u8;
    let full_scale = 2f64.powi(i32::from(bits)) - 1.0;
    let detector = Detector {
        width,
        height,
        pitch_m,
        quantum_efficiency: check.range(
            "detector.quantum_efficiency",
            d.quantum_efficiency,
            0.0..=1.0,
        )?,
        dark_e_s: check.range("detector.dark_e_s", d.dark_e_s, 0.0..=1e9)?,
        read_noise_e: check.range("detector.read_noise_e", d.read_noise_e, 0.0..=1e6)?,
        full_well_e: check.range("detector.full_well_e", d.full_well_e, 1.0..=1e9)?,
        gain_e_per_dn: check.range("detector.gain_e_per_dn", d.gain_e_per_dn, GAIN_E_PER_DN)?,
        offset_dn: check.range("detector.offset_dn", d.offset_dn, 0.0..=full_scale)?,
        bits,
    };
    let optics = Optics {
        focal_px: focal_m / pitch_m,
        principal_px,
        aperture_m: check.range("optics.aperture_mm", o.aperture_mm, 1e-3..=1e5)? * 1e-3,
        transmission: check.range("optics.transmission", o.transmission, 0.0..=1.0)?,
        band: band(&o.band, check)?,
        psf: GaussianPsf {
            sigma_px: check.range("optics.psf_sigma_px", o.psf_sigma_px, 0.01..=10.0)?,
        },
    };
    let mounting = match raw.mounting.q_body_to_camera {
        None => Attitude::identity(),
        Some(q) => Attitude::from_xyzw(q)
            .map_err(|error| check.explain("mounting.q_body_to_camera", error))?,
    };
    let exposure_s = check.range("timing.exposure_s", t.exposure_s, EXPOSURE_S)?;
    let rate_hz = check.range("timing.rate_hz", t.rate_hz, RATE_HZ)?;
    if rate_hz * exposure_s > 1.0 {
        let most = format!(
            "at most 1 / timing.exposure_s = {}: exposures do not overlap",
            1.0 / exposure_s
        );
        return Err(check.refuse("timing.rate_hz", rate_hz, most));
    }
    Ok(Camera {
        name: raw.name,
        mounting,
        optics,
        detector,
        exposure_s,
        rate_hz,
    })
}

fn band(raw: &RawBand, check: &Check) -> Result<Band, ConfigError> {
    const ALLOWED: &str = "\"v\", \"silicon\" or [from, to] in nm with 300 <= from < to <= 1200";
    let (band, given) = match raw {
        RawBand::Named(name) => (Band::named(name), format!("{name:?}")),
        RawBand::Nanometres([from, to]) => {
            let inside = *from >= 300.0 && from < to && *to <= 1200.0;
            let band = inside.then(|| Band::top_hat(from * 1e-9, to * 1e-9));
            (band, format!("[{from}, {to}]"))
        }
    };
    band.ok_or_else(|| check.refuse("optics.band", given, ALLOWED))
}
