//! `[timing]` and `[mounting]` of a camera file.

use crate::attitude::Attitude;
use crate::camera::shutter::SHUTTERS;
use crate::camera::{EXPOSURE_S, RATE_HZ, Shutter};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Needs, Number};
use skyloop_base::load::{Allowed, Check, ConfigError, Fixed, Kind, Limit, one_of};
use std::ops::RangeInclusive;

/// 10 degrees: a larger rotation is a different mounting.
const MISALIGNMENT_ARCSEC: RangeInclusive<f64> = -36_000.0..=36_000.0;

pub(crate) const LIMITS: &[Limit] = &[
    ("timing.exposure_s", Number(EXPOSURE_S)),
    ("timing.rate_hz", Number(RATE_HZ)),
    ("timing.row_us", Number(1e-3..=1e6)),
    ("timing", Allowed::Kind("shutter", KINDS)),
    ("timing", Needs(["row_us", "shutter"])),
    (
        "mounting.misalignment_arcsec[]",
        Number(MISALIGNMENT_ARCSEC),
    ),
];

/// Shutters and their required key.
const KINDS: &[Kind] = &[
    ("global", &[], &[]),
    ("rolling", &["row_us"], &[]),
    ("frame-transfer", &["row_us"], &[]),
];

/// Shortest plausible time for a row, us.
const SHORTEST_ROW_US: f64 = 0.1;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawTiming {
    /// Exposure time (s)
    exposure_s: f64,
    /// Frame rate (Hz)
    rate_hz: f64,
    /// rolling: row after row from row 0, the middle row around epoch_mid; frame-transfer: all rows
    /// together, with light during the shift below the cover; default: global
    shutter: Option<String>,
    /// Time from row to row of a rolling shutter, or of the shift of one row in frame transfer (us)
    row_us: Option<f64>,
}

#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawMounting {
    /// Unit quaternion [x, y, z, w] from body to camera; default: identity
    q_body_to_camera: Option<Fixed<f64, 4>>,
    /// Rotation of the mounted camera about its own axes, [x, y, z]; labels have the true
    /// q_body_to_camera (arcsec)
    misalignment_arcsec: Option<Fixed<f64, 3>>,
}

/// `[timing]`, checked.
pub(crate) struct Timing {
    pub exposure_s: f64,
    pub rate_hz: f64,
    pub shutter: Shutter,
}

impl RawTiming {
    /// The timing of a detector with this many rows.
    pub fn validate(self, rows: usize, check: &Check) -> Result<Timing, ConfigError> {
        let exposure_s = check.limit(LIMITS, "timing.exposure_s", self.exposure_s)?;
        let rate_hz = check.limit(LIMITS, "timing.rate_hz", self.rate_hz)?;
        let shutter = self.shutter(check)?;
        let period_s = shutter.period_s(rows, exposure_s);
        if rate_hz * period_s > 1.0 {
            let rows_read = match shutter {
                Shutter::Global => String::new(),
                _ => format!(", and {rows} rows of timing.row_us are read in the time of a frame"),
            };
            let reason = format!(
                "at most {} Hz with timing.exposure_s = {exposure_s} s: exposures do not overlap{rows_read}; lower the rate or shorten the exposure",
                1.0 / period_s
            );
            let mut needs = vec!["timing.exposure_s", "timing.row_us", "timing.shutter"];
            if shutter != Shutter::Global {
                needs.push("detector.height_px");
            }
            return Err(check
                .refuse("timing.rate_hz", rate_hz, reason)
                .needs(&needs));
        }
        if self.row_us.is_some_and(|us| us < SHORTEST_ROW_US) {
            check.notice(format_args!(
                "timing.row_us = {}: less than {SHORTEST_ROW_US} us a row is faster than detectors are: is it in us?",
                self.row_us.unwrap_or_default()
            ));
        }
        Ok(Timing {
            exposure_s,
            rate_hz,
            shutter,
        })
    }

    fn shutter(&self, check: &Check) -> Result<Shutter, ConfigError> {
        let row_s = match self.row_us {
            Some(us) => check.limit(LIMITS, "timing.row_us", us)? * 1e-6,
            None => 0.0,
        };
        let name = self.shutter.as_deref().unwrap_or("global");
        let unknown = || check.refuse("timing.shutter", format!("{name:?}"), one_of(&SHUTTERS));
        Shutter::named(name, row_s).ok_or_else(unknown)
    }
}

impl RawMounting {
    /// Body to camera: the mounting, then the rotation of the camera about its own axes.
    pub fn validate(self, check: &Check) -> Result<Attitude, ConfigError> {
        let mounting = match self.q_body_to_camera {
            None => Attitude::identity(),
            Some(Fixed(q)) => Attitude::from_xyzw(q)
                .map_err(|error| check.explain("mounting.q_body_to_camera", error))?,
        };
        let Some(Fixed(arcsec)) = self.misalignment_arcsec else {
            return Ok(mounting);
        };
        let key = "mounting.misalignment_arcsec";
        let turn = check.each_limit(LIMITS, key, arcsec)?;
        let turn = turn.map(|value| (value / 3600.0).to_radians());
        Ok(mounting.turned(&turn.into(), 1.0))
    }
}
