//! `[detector]` of a camera file.

use crate::camera::{Blooming, Detector, GAIN_E_PER_DN, Pattern, PatternFigures};
use crate::load::{Check, ConfigError, Fixed};
use schemars::JsonSchema;
use serde::Deserialize;
use std::ops::RangeInclusive;
use std::sync::Arc;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawDetector {
    /// Columns and rows, 1 to 8192 (px)
    width_px: u32,
    /// Columns and rows, 1 to 8192 (px)
    height_px: u32,
    /// Pixel pitch, 0.3 to 1000 (um)
    pixel_um: f64,
    /// Averaged over the band (peak, for a named band), 0 to 1 (e-/photon)
    quantum_efficiency: f64,
    /// Dark current of a pixel at the reference temperature (e-/s)
    dark_e_s: f64,
    /// That temperature; default 20 (deg C)
    #[serde(default = "room_temperature")]
    dark_reference_c: f64,
    /// The detector's; default: the reference (deg C)
    temperature_c: Option<f64>,
    /// Dark current doubles with every so many; 1 to 100, default 6.5 (K)
    #[serde(default = "doubling")]
    dark_doubling_k: f64,
    /// Sigma of the pixels' relative dark current, lognormal, 0 to 2; default 0
    #[serde(default)]
    dark_nonuniformity: f64,
    /// Share of hot pixels, 0 to 0.1; default 0; needs hot_e_s, as that needs it
    hot_fraction: Option<f64>,
    /// Their mean excess at the reference temperature, exponential (e-/s)
    hot_e_s: Option<f64>,
    /// Sigma of the pixels' relative response, 0 to 0.3; default 0
    #[serde(default)]
    prnu: f64,
    /// Share of dead pixels, which give no charge, 0 to 0.1; default 0
    #[serde(default)]
    dead_fraction: f64,
    /// Further ones, [[column, row], ...] (px)
    #[serde(default)]
    dead_px: Vec<Fixed<u32, 2>>,
    /// Share of stuck pixels, which give one digit, 0 to 0.1; default 0
    stuck_fraction: Option<f64>,
    /// Further ones, [[column, row], ...] (px)
    stuck_px: Option<Vec<Fixed<u32, 2>>>,
    /// That digit, where there are such pixels; default: the largest (DN)
    stuck_dn: Option<f64>,
    /// Rms (e-)
    read_noise_e: f64,
    /// Most charge of a pixel; above the converter's reach it is warned of (e-)
    full_well_e: f64,
    /// "none": what is too much is lost; "column": it spills along its column; default none
    #[serde(default)]
    blooming: String,
    /// Share of the signal that is missing at full well, growing with its square, 0 to 0.5; default 0
    #[serde(default)]
    nonlinearity: f64,
    /// Electrons of one digital number (e-/DN)
    gain_e_per_dn: f64,
    /// Digital number of no charge (DN)
    offset_dn: f64,
    /// 1 to 16 (bit)
    adc_bits: u32,
    /// True: that is meant, no warning; default false
    #[serde(default)]
    adc_clips_first: bool,
}

/// Relative sigmas that a sensor may have. Responses of silicon differ by 0.002 to 0.03; from 0.3 on a Gaussian that is clipped at 0 is none.
const MOST_PRNU: RangeInclusive<f64> = 0.0..=0.3;
/// Dark currents by 0.03 to 0.5; beyond that the tail is that of hot pixels, which have keys of their own.
const MOST_DARK_NONUNIFORMITY: RangeInclusive<f64> = 0.0..=2.0;

/// A converter of which full pixels use less than this is hardly meant.
const LEAST_FILLED: f64 = 0.01;

/// Where dark currents are stated, deg C.
fn room_temperature() -> f64 {
    20.0
}

/// Typical of silicon near room temperature, K.
fn doubling() -> f64 {
    6.5
}

impl RawDetector {
    pub fn validate(self, serial: u64, check: &Check) -> Result<Detector, ConfigError> {
        let range = |key: &str, value, range| check.range(&format!("detector.{key}"), value, range);
        let bits = range("adc_bits", f64::from(self.adc_bits), 1.0..=16.0)? as u8;
        let full_scale = 2f64.powi(i32::from(bits)) - 1.0;
        let width = range("width_px", f64::from(self.width_px), 1.0..=8192.0)? as usize;
        let height = range("height_px", f64::from(self.height_px), 1.0..=8192.0)? as usize;

        let reference = range("dark_reference_c", self.dark_reference_c, -200.0..=150.0)?;
        let temperature = self.temperature_c.unwrap_or(reference);
        let temperature = range("temperature_c", temperature, -200.0..=150.0)?;
        let doubling = range("dark_doubling_k", self.dark_doubling_k, 1.0..=100.0)?;
        let warmth = Detector::dark_growth(temperature - reference, doubling);
        let dark_e_s = range("dark_e_s", self.dark_e_s, 0.0..=1e9)? * warmth;
        let hot_e_s = range("hot_e_s", self.hot_e_s.unwrap_or(0.0), 0.0..=1e9)? * warmth;
        if dark_e_s + hot_e_s > 1e9 {
            let allowed = format!(
                "such that dark current and hot pixels stay below 1e9 e-/s: {:.3e} here",
                dark_e_s + hot_e_s
            );
            return Err(check.refuse("detector.temperature_c", temperature, allowed));
        }
        let listed = |key: &str, pixels: Vec<Fixed<u32, 2>>| {
            let pixels = Fixed::all(pixels);
            let off = |[x, y]: &[u32; 2]| *x as usize >= width || *y as usize >= height;
            match pixels.iter().position(off) {
                None => Ok(pixels),
                Some(i) => {
                    let (key, given) = (format!("detector.{key}[{i}]"), format!("{:?}", pixels[i]));
                    let allowed = format!("a pixel [column, row] below [{width}, {height}]");
                    Err(check.refuse(&key, given, allowed))
                }
            }
        };
        let hot_fraction = self.hot_fraction.unwrap_or(0.0);
        let any_stuck = self.stuck_fraction.is_some() || self.stuck_px.is_some();
        let figures = PatternFigures {
            serial,
            width,
            height,
            prnu: range("prnu", self.prnu, MOST_PRNU)?,
            dark_e_s,
            dark_nonuniformity: range(
                "dark_nonuniformity",
                self.dark_nonuniformity,
                MOST_DARK_NONUNIFORMITY,
            )?,
            hot_fraction: range("hot_fraction", hot_fraction, 0.0..=0.1)?,
            hot_e_s,
            dead_fraction: range("dead_fraction", self.dead_fraction, 0.0..=0.1)?,
            dead_px: listed("dead_px", self.dead_px)?,
            stuck_fraction: range(
                "stuck_fraction",
                self.stuck_fraction.unwrap_or(0.0),
                0.0..=0.1,
            )?,
            stuck_px: listed("stuck_px", self.stuck_px.unwrap_or_default())?,
        };
        let stuck_dn = self.stuck_dn.unwrap_or(full_scale);
        let detector = Detector {
            width,
            height,
            pitch_m: range("pixel_um", self.pixel_um, 0.3..=1e3)? * 1e-6,
            quantum_efficiency: range("quantum_efficiency", self.quantum_efficiency, 0.0..=1.0)?,
            dark_e_s,
            read_noise_e: range("read_noise_e", self.read_noise_e, 0.0..=1e6)?,
            full_well_e: range("full_well_e", self.full_well_e, 1.0..=1e9)?,
            blooming: blooming(&self.blooming, check)?,
            // Beyond a half the response would fall before the well is full.
            nonlinearity: range("nonlinearity", self.nonlinearity, 0.0..=0.5)?,
            gain_e_per_dn: range("gain_e_per_dn", self.gain_e_per_dn, GAIN_E_PER_DN)?,
            offset_dn: range("offset_dn", self.offset_dn, 0.0..=full_scale)?,
            bits,
            stuck_dn: range("stuck_dn", stuck_dn, 0.0..=full_scale)?.round() as u16,
            pattern: Arc::new(Pattern::new(&figures)),
        };
        if self.offset_dn >= full_scale {
            let allowed = format!(
                "below {full_scale}, the largest number of {bits} bits: none is left for charge"
            );
            return Err(check.refuse("detector.offset_dn", self.offset_dn, allowed));
        }
        if self.read_noise_e > self.full_well_e {
            let allowed = format!("at most detector.full_well_e = {} e-", self.full_well_e);
            return Err(check.refuse("detector.read_noise_e", self.read_noise_e, allowed));
        }
        let alone = |key: &str, reason| Err(check.explain(&format!("detector.{key}"), reason));
        if hot_fraction > 0.0 && self.hot_e_s.is_none() {
            return alone(
                "hot_fraction",
                "needs detector.hot_e_s, by how much those are hotter, e-/s",
            );
        }
        if hot_e_s > 0.0 && self.hot_fraction.is_none() {
            return alone(
                "hot_e_s",
                "needs detector.hot_fraction, the share of such pixels",
            );
        }
        if self.stuck_dn.is_some() && !any_stuck {
            let reason =
                "needs detector.stuck_fraction or detector.stuck_px, the pixels that give it";
            return alone("stuck_dn", reason);
        }
        if let Some(warning) = detector
            .converter_clips_first()
            .filter(|_| !self.adc_clips_first)
        {
            check.notice(format_args!(
                "detector.full_well_e = {}: {warning}",
                self.full_well_e
            ));
        }
        let filled = self.full_well_e / detector.gain_e_per_dn / full_scale;
        if filled < LEAST_FILLED {
            check.notice(format_args!(
                "detector.gain_e_per_dn = {}: pixels are full at {:.3} % of the converter's largest number: is it e-/DN (not DN/e-), and \
                 detector.full_well_e in e-?",
                self.gain_e_per_dn,
                100.0 * filled
            ));
        }
        Ok(detector)
    }
}

fn blooming(name: &str, check: &Check) -> Result<Blooming, ConfigError> {
    match name {
        "" | "none" => Ok(Blooming::None),
        "column" => Ok(Blooming::Column),
        other => {
            let given = format!("{other:?}");
            Err(check.refuse("detector.blooming", given, "\"none\" or \"column\""))
        }
    }
}
