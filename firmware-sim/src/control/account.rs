//! Telemetry of a closed loop: the body's error, and the error of its estimate.

use std::fmt;
use std::time::Duration;

use nalgebra::Vector3;

use super::estimator::{Estimate, MIN_STARS};
use crate::times::Times;

const ARCSEC: f64 = 648_000.0 / std::f64::consts::PI;

/// Statistics of a closed loop.
#[derive(Clone, Debug, Default)]
pub struct ControlTelemetry {
    /// Magnitude of the drift rate, rad/s.
    pub drift_rad_s: f64,
    /// Number of stars in the reference frame; 0 before the first one.
    pub reference_stars: usize,
    /// Frames used for steering.
    pub used: u32,
    /// Frames with too few matched stars.
    pub starless: u32,
    /// Frames received after a later one.
    pub late: u32,
    /// From the middle of the exposure to the end of the detection.
    pub latencies: Times,
    /// Start of the drift, s after the mission's start.
    begun_s: f64,
    /// Time of the last error sample, s after the start of the drift.
    since_drift_start_s: f64,
    /// Largest error of the body, rad.
    pub worst_rad: f64,
    errors: Series,
    /// Errors of the boresight (+Z) alone.
    across: Series,
    /// Sum of squared differences between estimated and true errors, rad^2, and their number.
    differences: (f64, u32),
    /// Sums over the frames used; residuals in px.
    stars: u64,
    residuals_px: f64,
}

impl ControlTelemetry {
    pub(super) fn new(drift_rad_s: f64) -> Self {
        Self {
            drift_rad_s,
            ..Self::default()
        }
    }

    pub(super) fn begin(&mut self, at_s: f64, stars: usize) {
        (self.begun_s, self.reference_stars) = (at_s, stars);
    }

    pub(super) fn add_error(&mut self, at_s: f64, error: Vector3<f64>) {
        self.since_drift_start_s = (at_s - self.begun_s).max(0.0);
        self.worst_rad = self.worst_rad.max(error.norm());
        self.errors
            .add(self.since_drift_start_s, error.norm_squared());
        self.across
            .add(self.since_drift_start_s, error.xy().norm_squared());
    }

    /// Adds a frame, with the body's error in the middle of its exposure if that is known.
    pub(super) fn frame(
        &mut self,
        age: Duration,
        estimate: &Estimate,
        truth: Option<Vector3<f64>>,
    ) {
        self.used += 1;
        self.latencies.add(age);
        self.stars += estimate.stars as u64;
        self.residuals_px += estimate.residual_px;
        if let Some(truth) = truth {
            self.differences.0 += (estimate.turned_rad - truth).norm_squared();
            self.differences.1 += 1;
        }
    }

    /// Rms of the body's error over the last half of the flight, rad; `None` before the drift.
    #[must_use]
    pub fn rms_rad(&self) -> Option<f64> {
        self.errors.rms_from(self.since_drift_start_s / 2.0)
    }

    /// Rms error of the boresight (+Z) alone, without the roll about it, rad.
    #[must_use]
    pub(crate) fn boresight_rms_rad(&self) -> Option<f64> {
        self.across.rms_from(self.since_drift_start_s / 2.0)
    }

    /// Rms of the difference between estimated and true errors, rad; `None` without any.
    #[must_use]
    pub fn estimate_rms_rad(&self) -> Option<f64> {
        let (sum, count) = self.differences;
        (count > 0).then(|| (sum / f64::from(count)).sqrt())
    }

    /// Error that the drift alone would have caused, rad.
    #[must_use]
    pub fn drifted_rad(&self) -> f64 {
        self.drift_rad_s * self.since_drift_start_s
    }
}

impl fmt::Display for ControlTelemetry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            used,
            starless,
            late,
            reference_stars,
            since_drift_start_s,
            ..
        } = self;
        let (Some(rms), Some(across)) = (self.rms_rad(), self.boresight_rms_rad()) else {
            return writeln!(
                f,
                "closed loop      not begun: none of {starless} frames had {MIN_STARS} stars; expose longer, or hold \
                 another attitude"
            );
        };
        let angles = [rms, across, self.worst_rad, self.drifted_rad()];
        let [rms, across, worst, drifted] = angles.map(|angle| angle * ARCSEC);
        write!(
            f,
            "closed loop      pointing error rms {rms:.2} arcsec over the last half ({across:.2} across the boresight), \
             worst {worst:.2}; without control {drifted:.1} in {since_drift_start_s:.1} s\n\
             steered by       {used} frames, {starless} without enough stars, {late} late"
        )?;
        let ms = |fraction| Some(self.latencies.quantile(fraction)?.as_secs_f64() * 1e3);
        if let (Some(off), Some(p50), Some(max)) = (self.estimate_rms_rad(), ms(0.5), ms(1.0)) {
            let frames = f64::from(self.used.max(1));
            let (stars, residual) = (self.stars as f64 / frames, self.residuals_px / frames);
            let off = off * ARCSEC;
            write!(
                f,
                "; estimated error off by {off:.2} arcsec rms ({stars:.0} of {reference_stars} stars, residual \
                 {residual:.3} px); from mid-exposure p50 {p50:.1} ms, max {max:.1} ms"
            )?;
        }
        writeln!(f)
    }
}

/// Sums of a quantity over time bins. When the bins are full, their width doubles.
#[derive(Clone, Debug, PartialEq)]
struct Series {
    bin_s: f64,
    bins: Vec<(f64, u64)>,
}

impl Default for Series {
    fn default() -> Self {
        Self {
            bin_s: 0.01,
            bins: Vec::new(),
        }
    }
}

/// Sum and number over several bins.
fn total(bins: &[(f64, u64)]) -> (f64, u64) {
    let bins = bins.iter();
    bins.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

impl Series {
    fn add(&mut self, at_s: f64, value: f64) {
        const MAX: usize = 4096;
        while at_s / self.bin_s >= MAX as f64 {
            self.bin_s *= 2.0;
            self.bins = self.bins.chunks(2).map(total).collect();
        }
        let bin = (at_s / self.bin_s) as usize;
        if bin >= self.bins.len() {
            self.bins.resize(bin + 1, (0.0, 0));
        }
        if let Some((sum, count)) = self.bins.get_mut(bin) {
            *sum += value;
            *count += 1;
        }
    }

    /// Root mean square from a time on, rounded up to a bin.
    fn rms_from(&self, from_s: f64) -> Option<f64> {
        let first = (from_s / self.bin_s).ceil() as usize;
        let first = first.min(self.bins.len().saturating_sub(1));
        let (sum, count) = total(self.bins.get(first..)?);
        (count > 0).then(|| (sum / count as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_covers_the_last_half_of_any_flight() {
        for seconds in [1.0, 100.0, 1e5] {
            let mut telemetry = ControlTelemetry::new(1e-4);
            assert!(telemetry.to_string().contains("not begun"));
            telemetry.begin(5.0, 10);
            for index in 0..2000 {
                let at = f64::from(index) / 2000.0 * seconds;
                let error = if index < 1000 { 3e-4 } else { 4e-5 };
                telemetry.add_error(5.0 + at, Vector3::x() * error);
            }
            let rms = telemetry.rms_rad().unwrap();
            assert!((rms - 4e-5).abs() < 1e-9, "{seconds}: {rms}");
            assert_eq!(telemetry.worst_rad, 3e-4);
            assert!((telemetry.drifted_rad() / seconds - 1e-4).abs() < 1e-6);
            assert!(telemetry.errors.bins.len() <= 4096);
        }
    }
}
