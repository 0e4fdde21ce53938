//! `[detector]` of a camera file.

use crate::camera::{Detector, GAIN_E_PER_DN};
use crate::load::{Check, ConfigError};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawDetector {
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

impl RawDetector {
    pub fn validate(self, check: &Check) -> Result<Detector, ConfigError> {
        let range = |key: &str, value, range| check.range(&format!("detector.{key}"), value, range);
        let bits = range("adc_bits", f64::from(self.adc_bits), 1.0..=16.0)? as u8;
        let full_scale = 2f64.powi(i32::from(bits)) - 1.0;
        Ok(Detector {
            width: range("width_px", f64::from(self.width_px), 1.0..=8192.0)? as usize,
            height: range("height_px", f64::from(self.height_px), 1.0..=8192.0)? as usize,
            pitch_m: range("pixel_um", self.pixel_um, 0.1..=1e4)? * 1e-6,
            quantum_efficiency: range("quantum_efficiency", self.quantum_efficiency, 0.0..=1.0)?,
            dark_e_s: range("dark_e_s", self.dark_e_s, 0.0..=1e9)?,
            read_noise_e: range("read_noise_e", self.read_noise_e, 0.0..=1e6)?,
            full_well_e: range("full_well_e", self.full_well_e, 1.0..=1e9)?,
            gain_e_per_dn: range("gain_e_per_dn", self.gain_e_per_dn, GAIN_E_PER_DN)?,
            offset_dn: range("offset_dn", self.offset_dn, 0.0..=full_scale)?,
            bits,
        })
    }
}
