//! Options of the closed loop.

use anyhow::{Result, bail};
use clap::Args;
use nalgebra::Vector3;
use skyloop_firmware_sim::control::{ControlSettings, ControlTelemetry};
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::text::{parse_numbers, within};
use skyloop_protocols::PixelLevel;

/// Fastest drift about each axis, deg/s: a fifth of the fastest steering rate.
const MAX_DRIFT_DEG_S: f64 = 0.1;
/// Default drift, deg/s.
const DEFAULT_DRIFT_DEG_S: [f64; 3] = [0.01, -0.02, 0.015];

/// Closed-loop options.
#[derive(Clone, Debug, Args)]
pub struct LoopArgs {
    /// Closed loop: hold the attitude against a drift by the detected stars; uses the wall clock
    /// and needs --focal-px
    #[arg(long = "loop")]
    closed: bool,
    /// Focal length of the camera in pixels, the only camera property that the loop uses
    #[arg(long, value_name = "PX", value_parser = within(1.0..=1e7, "px"), allow_negative_numbers = true)]
    focal_px: Option<f64>,
    /// Disturbance rate of the body, deg/s, body axes [default: 0.01,-0.02,0.015]
    #[arg(long, value_name = "x,y,z", value_parser = parse_drift, allow_hyphen_values = true)]
    drift: Option<Vector3<f64>>,
    /// Fail if the rms pointing error over the last half of the run exceeds this, arcsec [default:
    /// no limit]
    #[arg(long, value_name = "ARCSEC", value_parser = within(1e-3..=648_000.0, "arcsec"), allow_negative_numbers = true)]
    max_error: Option<f64>,
}

impl LoopArgs {
    /// Settings of the closed loop, if it is requested.
    pub fn settings(&self, wall: bool, mission: &Mission) -> Result<Option<ControlSettings>> {
        if !self.closed {
            for (given, option) in [
                (self.focal_px.is_some(), "--focal-px"),
                (self.drift.is_some(), "--drift"),
                (self.max_error.is_some(), "--max-error"),
            ] {
                if given {
                    bail!("{option} is for a closed loop only: leave it out, or add --loop");
                }
            }
            return Ok(None);
        }
        if !wall {
            bail!("--loop closes the loop by the wall clock: add --wall");
        }
        if !matches!(mission.profile, Profile::Hold(_)) {
            bail!("--loop holds one attitude: give it by --hold x,y,z,w");
        }
        if mission
            .output
            .is_some_and(|output| output.pixels == PixelLevel::None)
        {
            bail!(
                "--loop steers by pixels, and --output labels brings none: choose windows, compressed or frame"
            );
        }
        let Some(focal_px) = self.focal_px else {
            bail!(
                "--loop needs --focal-px: the camera's focal length over the pitch of its pixels, as 530.8 for fai-nir (13.8 mm over 26 um)"
            );
        };
        let usual = || Vector3::from(DEFAULT_DRIFT_DEG_S).map(f64::to_radians);
        Ok(Some(ControlSettings {
            focal_px,
            drift_rad_s: self.drift.unwrap_or_else(usual),
        }))
    }

    /// The message if the error exceeds `--max-error`.
    #[must_use]
    pub fn broken(&self, control: &ControlTelemetry) -> Option<String> {
        let max = self.max_error?;
        match control.rms_rad().map(|rms| rms.to_degrees() * 3600.0) {
            None => Some(format!("--max-error {max}: the loop was never closed")),
            Some(rms) => (rms > max).then(|| {
                format!("--max-error {max}: the pointing error was {rms:.2} arcsec rms over the last half")
            }),
        }
    }
}

fn parse_drift(text: &str) -> Result<Vector3<f64>, String> {
    let rates = parse_numbers::<3>(text).map_err(|why| format!("{why}: give x,y,z in deg/s"))?;
    if rates.iter().any(|rate| rate.abs() > MAX_DRIFT_DEG_S) {
        return Err(format!(
            "each must be -{MAX_DRIFT_DEG_S} to {MAX_DRIFT_DEG_S} deg/s"
        ));
    }
    Ok(Vector3::from(rates).map(f64::to_radians))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_closed_loops_exceed_any_limit() {
        let args = |max_error| LoopArgs {
            closed: true,
            focal_px: None,
            drift: None,
            max_error,
        };
        let telemetry = ControlTelemetry::default();
        let broken = args(Some(10.0)).broken(&telemetry).unwrap();
        assert!(broken.contains("never closed"), "{broken}");
        assert_eq!(args(None).broken(&telemetry), None);
    }
}
