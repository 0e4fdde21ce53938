//! `[detector]` of a camera file.

use crate::camera::{Blooming, Detector, GAIN_E_PER_DN, Pattern, PatternStats};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Number, Word};
use skyloop_base::load::{Check, ConfigError, Fixed, Limit, one_of};
use std::ops::RangeInclusive;
use std::sync::Arc;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDetector {
    /// Columns (px)
    width_px: u32,
    /// Rows (px)
    height_px: u32,
    /// Pixel pitch (um)
    pixel_um: f64,
    /// Quantum efficiency: mean over the band, or peak for a named band (e-/photon)
    quantum_efficiency: f64,
    /// Dark current of a pixel at the reference temperature (e-/s)
    dark_e_s: f64,
    /// Reference temperature of dark_e_s (deg C)
    #[serde(default = "room_temperature")]
    dark_reference_c: f64,
    /// Temperature of the detector; default: the reference temperature (deg C)
    temperature_c: Option<f64>,
    /// Rise of temperature that doubles the dark current (K)
    #[serde(default = "doubling")]
    dark_doubling_k: f64,
    /// Sigma of the relative dark current of pixels, lognormal
    #[serde(default)]
    dark_nonuniformity: f64,
    /// Fraction of hot pixels; needs hot_e_s; default: 0
    hot_fraction: Option<f64>,
    /// Mean excess dark current of hot pixels at the reference temperature, exponentially
    /// distributed (e-/s)
    hot_e_s: Option<f64>,
    /// Sigma of the relative response of pixels (PRNU)
    #[serde(default)]
    prnu: f64,
    /// Fraction of dead pixels, which have no charge
    #[serde(default)]
    dead_fraction: f64,
    /// Further dead pixels, [[column, row], ...] (px)
    #[serde(default)]
    dead_px: Vec<Fixed<u32, 2>>,
    /// Fraction of stuck pixels, which have a fixed value; default: 0
    stuck_fraction: Option<f64>,
    /// Further stuck pixels, [[column, row], ...] (px)
    stuck_px: Option<Vec<Fixed<u32, 2>>>,
    /// Value of stuck pixels; default: the largest (DN)
    stuck_dn: Option<f64>,
    /// Read noise, rms (e-)
    read_noise_e: f64,
    /// Full well of a pixel; a warning is given if it exceeds the range of the converter (e-)
    full_well_e: f64,
    /// none: charge above full well is lost; column: it spills along its column
    #[serde(default = "no_blooming")]
    blooming: String,
    /// Fraction of the signal that is missing at full well; it grows with the square of the signal
    #[serde(default)]
    nonlinearity: f64,
    /// Gain (e-/DN)
    gain_e_per_dn: f64,
    /// Value of a pixel without charge (DN)
    offset_dn: f64,
    /// Bits of the converter (bit)
    adc_bits: u32,
    /// The converter clips below full well on purpose: no warning
    #[serde(default)]
    adc_clips_first: bool,
}

/// Relative sigmas of sensors. Responses of silicon differ by 0.002 to 0.03; from 0.3 on clipping
/// at 0 distorts the Gaussian.
const MAX_PRNU: RangeInclusive<f64> = 0.0..=0.3;
/// Dark currents differ by 0.03 to 0.5; wider tails are those of hot pixels, which have own keys.
const MAX_DARK_NONUNIFORMITY: RangeInclusive<f64> = 0.0..=2.0;

/// Limits of the keys; the maximum of offset_dn and stuck_dn follows from adc_bits.
pub(crate) const LIMITS: &[Limit] = &[
    ("detector.offset_dn", Number(0.0..=65535.0)),
    ("detector.stuck_dn", Number(0.0..=65535.0)),
    ("detector.adc_bits", Number(1.0..=16.0)),
    ("detector.width_px", Number(1.0..=8192.0)),
    ("detector.height_px", Number(1.0..=8192.0)),
    ("detector.dark_reference_c", Number(-200.0..=150.0)),
    ("detector.temperature_c", Number(-200.0..=150.0)),
    ("detector.dark_doubling_k", Number(1.0..=100.0)),
    ("detector.dark_e_s", Number(0.0..=1e9)),
    ("detector.hot_e_s", Number(0.0..=1e9)),
    ("detector.prnu", Number(MAX_PRNU)),
    (
        "detector.dark_nonuniformity",
        Number(MAX_DARK_NONUNIFORMITY),
    ),
    ("detector.hot_fraction", Number(0.0..=0.1)),
    ("detector.dead_fraction", Number(0.0..=0.1)),
    ("detector.stuck_fraction", Number(0.0..=0.1)),
    ("detector.pixel_um", Number(0.3..=1e3)),
    ("detector.quantum_efficiency", Number(0.0..=1.0)),
    ("detector.read_noise_e", Number(0.0..=1e6)),
    ("detector.full_well_e", Number(1.0..=1e9)),
    ("detector.nonlinearity", Number(0.0..=0.5)),
    ("detector.gain_e_per_dn", Number(GAIN_E_PER_DN)),
    ("detector.blooming", Word(blooming_names)),
];

/// Smallest plausible part of the converter's range that full pixels use.
const MIN_FILLED: f64 = 0.01;

/// Usual reference temperature of dark currents, deg C.
fn room_temperature() -> f64 {
    20.0
}

/// Typical of silicon near room temperature, K.
fn doubling() -> f64 {
    6.5
}

impl RawDetector {
    pub fn validate(self, serial: u64, check: &Check) -> Result<Detector, ConfigError> {
        let limit = |key: &str, value| check.limit(LIMITS, &format!("detector.{key}"), value);
        let dn = |key: &str, value, max| {
            let value = limit(key, value)?;
            let inside = check.range(&format!("detector.{key}"), value, 0.0..=max);
            inside.map_err(|error| error.needs(&["detector.adc_bits"]))
        };
        let bits = limit("adc_bits", f64::from(self.adc_bits))? as u8;
        let full_scale = 2f64.powi(i32::from(bits)) - 1.0;
        let width = limit("width_px", f64::from(self.width_px))? as usize;
        let height = limit("height_px", f64::from(self.height_px))? as usize;

        let [dark_e_s, hot_e_s] = self.dark_currents(check)?;
        let listed = |key: &str, pixels: &[Fixed<u32, 2>]| {
            let pixels = Fixed::all(pixels.to_vec());
            let off = |[x, y]: &[u32; 2]| *x as usize >= width || *y as usize >= height;
            match pixels.iter().position(off) {
                None => Ok(pixels),
                Some(i) => {
                    let (key, given) = (format!("detector.{key}[{i}]"), format!("{:?}", pixels[i]));
                    let allowed = format!("a pixel [column, row] below [{width}, {height}]");
                    let error = check.refuse(&key, given, allowed);
                    Err(error.needs(&["detector.width_px", "detector.height_px"]))
                }
            }
        };
        let stats = PatternStats {
            serial,
            width,
            height,
            prnu: limit("prnu", self.prnu)?,
            dark_e_s,
            dark_nonuniformity: limit("dark_nonuniformity", self.dark_nonuniformity)?,
            hot_fraction: limit("hot_fraction", self.hot_fraction.unwrap_or(0.0))?,
            hot_e_s,
            dead_fraction: limit("dead_fraction", self.dead_fraction)?,
            dead_px: listed("dead_px", &self.dead_px)?,
            stuck_fraction: limit("stuck_fraction", self.stuck_fraction.unwrap_or(0.0))?,
            stuck_px: listed("stuck_px", self.stuck_px.as_deref().unwrap_or_default())?,
        };
        let stuck_dn = self.stuck_dn.unwrap_or(full_scale);
        let detector = Detector {
            width,
            height,
            pitch_m: limit("pixel_um", self.pixel_um)? * 1e-6,
            quantum_efficiency: limit("quantum_efficiency", self.quantum_efficiency)?,
            dark_e_s,
            read_noise_e: limit("read_noise_e", self.read_noise_e)?,
            full_well_e: limit("full_well_e", self.full_well_e)?,
            blooming: blooming(&self.blooming, check)?,
            // Above 0.5 the response would fall before full well.
            nonlinearity: limit("nonlinearity", self.nonlinearity)?,
            gain_e_per_dn: limit("gain_e_per_dn", self.gain_e_per_dn)?,
            offset_dn: dn("offset_dn", self.offset_dn, full_scale)?,
            bits,
            stuck_dn: dn("stuck_dn", stuck_dn, full_scale)?.round() as u16,
            pattern: Arc::new(Pattern::new(&stats)),
        };
        self.check_keys(full_scale, bits, check)?;
        self.warn(&detector, full_scale, check);
        Ok(detector)
    }

    /// Dark current of a pixel, and mean excess of a hot pixel, at the detector's temperature,
    /// e-/s.
    fn dark_currents(&self, check: &Check) -> Result<[f64; 2], ConfigError> {
        let limit = |key: &str, value| check.limit(LIMITS, &format!("detector.{key}"), value);
        let reference = limit("dark_reference_c", self.dark_reference_c)?;
        let temperature = self.temperature_c.unwrap_or(reference);
        let temperature = limit("temperature_c", temperature)?;
        let doubling = limit("dark_doubling_k", self.dark_doubling_k)?;
        let growth = Detector::dark_growth(temperature - reference, doubling);
        let dark_e_s = limit("dark_e_s", self.dark_e_s)? * growth;
        let hot_e_s = limit("hot_e_s", self.hot_e_s.unwrap_or(0.0))? * growth;
        if dark_e_s + hot_e_s > 1e9 {
            let allowed = format!(
                "such that dark current and hot pixels stay below 1e9 e-/s: {:.3e} here",
                dark_e_s + hot_e_s
            );
            let error = check.refuse("detector.temperature_c", temperature, allowed);
            return Err(error.needs(&[
                "detector.dark_e_s",
                "detector.hot_e_s",
                "detector.dark_reference_c",
                "detector.dark_doubling_k",
            ]));
        }
        Ok([dark_e_s, hot_e_s])
    }

    /// Refuses contradicting keys, and keys without the ones they need.
    fn check_keys(&self, full_scale: f64, bits: u8, check: &Check) -> Result<(), ConfigError> {
        if self.offset_dn >= full_scale {
            let allowed = format!(
                "below {full_scale}, the full scale of {bits} bits: no range is left for the signal"
            );
            let error = check.refuse("detector.offset_dn", self.offset_dn, allowed);
            return Err(error.needs(&["detector.adc_bits"]));
        }
        if self.read_noise_e > self.full_well_e {
            let allowed = format!("at most detector.full_well_e = {} e-", self.full_well_e);
            let error = check.refuse("detector.read_noise_e", self.read_noise_e, allowed);
            return Err(error.needs(&["detector.full_well_e"]));
        }
        let alone = |key: &str, reason, needs: &[&str]| {
            let error = check.explain(&format!("detector.{key}"), reason);
            Err(error.needs(needs))
        };
        let any_stuck = self.stuck_fraction.is_some() || self.stuck_px.is_some();
        if self.hot_fraction.unwrap_or(0.0) > 0.0 && self.hot_e_s.is_none() {
            return alone(
                "hot_fraction",
                "needs detector.hot_e_s, by how much those are hotter, e-/s",
                &["detector.hot_e_s"],
            );
        }
        if self.hot_e_s.unwrap_or(0.0) > 0.0 && self.hot_fraction.is_none() {
            return alone(
                "hot_e_s",
                "needs detector.hot_fraction, the share of such pixels",
                &["detector.hot_fraction"],
            );
        }
        if self.stuck_dn.is_some() && !any_stuck {
            let reason =
                "needs detector.stuck_fraction or detector.stuck_px, the pixels that give it";
            let needs = &["detector.stuck_fraction", "detector.stuck_px"];
            return alone("stuck_dn", reason, needs);
        }
        Ok(())
    }

    fn warn(&self, detector: &Detector, full_scale: f64, check: &Check) {
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
        if filled < MIN_FILLED {
            check.notice(format_args!(
                "detector.gain_e_per_dn = {}: full well is at {:.3} % of the ADC's full scale: is it e-/DN (not DN/e-), and \
                 detector.full_well_e in e-?",
                self.gain_e_per_dn,
                100.0 * filled
            ));
        }
    }
}

/// The blooming modes, by name in the file.
const BLOOMING: [(&str, Blooming); 2] = [("none", Blooming::None), ("column", Blooming::Column)];

fn blooming_names() -> Vec<&'static str> {
    BLOOMING.iter().map(|(name, _)| *name).collect()
}

fn no_blooming() -> String {
    BLOOMING[0].0.to_string()
}

fn blooming(name: &str, check: &Check) -> Result<Blooming, ConfigError> {
    let found = BLOOMING.into_iter().find(|(known, _)| *known == name);
    let refused = || {
        check.refuse(
            "detector.blooming",
            format!("{name:?}"),
            one_of(&blooming_names()),
        )
    };
    found.map(|(_, blooming)| blooming).ok_or_else(refused)
}
