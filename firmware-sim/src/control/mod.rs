//! The closed loop: a drifting body, and a controller that corrects it from frames.
//!
//! ```text
//! Detections -> estimator -> Law -> rates -> Body -> Attitude -> (emulator) -> Detections
//! ```
//!
//! The emulator receives the true attitude of the body. The controller gets only the centroids of
//! each frame, the time of its exposure, and the focal length of the camera. It sees no label, body
//! state or drift; only [`ControlTelemetry`] compares both sides.
//!
//! The body is at rest until a frame has enough stars; this is the reference frame. Then the drift
//! starts. Rates change only when an attitude is sent, so that each message states the body's
//! motion until the next one.
//!
//! Camera axes are taken as body axes.

mod account;
mod estimator;
mod law;
mod matching;

use std::collections::VecDeque;
use std::time::Duration;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};

pub use self::account::ControlTelemetry;
pub use self::estimator::{Estimate, MIN_STARS, Pinhole, Star, estimate};
pub use self::law::Law;
use crate::detector::Detections;
use crate::pointing::{Pointing, rate_between};

/// Settings of the closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlSettings {
    /// Focal length over pixel pitch, px, above 0: the only known property of the optics.
    pub focal_px: f64,
    /// Disturbance: angular velocity without steering, body axes, rad/s.
    pub drift_rad_s: Vector3<f64>,
}

/// Times and size of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposed {
    /// Middle of its exposure.
    pub mid: Epoch,
    /// Time when its detections are fixed.
    pub taken: Epoch,
    /// Columns and rows of the whole frame.
    pub size: [u16; 2],
}

/// Body, controller and telemetry.
#[derive(Debug)]
pub(crate) struct Control {
    settings: ControlSettings,
    hold: UnitQuaternion<f64>,
    start: Epoch,
    /// Time of the last motion step, s after `start`.
    moved_s: f64,
    body: Pointing,
    law: Law,
    /// Stars of the reference frame.
    reference: Vec<Star>,
    /// Sent attitudes, with time in s after `start`.
    sent_attitudes: VecDeque<(f64, Pointing)>,
    /// Results so far.
    pub telemetry: ControlTelemetry,
}

impl Control {
    /// A body at rest at its target attitude `hold` (ICRF to body) from `start` on.
    #[must_use]
    pub fn new(settings: ControlSettings, hold: UnitQuaternion<f64>, start: Epoch) -> Self {
        Self {
            settings,
            hold,
            start,
            moved_s: 0.0,
            body: Pointing::at_rest(hold),
            law: Law::default(),
            reference: Vec::new(),
            sent_attitudes: VecDeque::new(),
            telemetry: ControlTelemetry::new(settings.drift_rad_s.norm()),
        }
    }

    /// Moves the body to `epoch` and updates its rates. Returns the attitude to send.
    pub fn steer(&mut self, epoch: Epoch) -> Pointing {
        /// Attitudes whose frames may still arrive.
        const REMEMBERED: usize = 4096;
        let now_s = self.since_start(epoch);
        self.body = self.body.after(now_s - self.moved_s);
        // Stops the growth of rounding errors in the norm.
        self.body.attitude.renormalize_fast();
        self.law.set_steer_period(now_s - self.moved_s);
        self.moved_s = now_s;
        if !self.reference.is_empty() {
            self.body.rates_rad_s = self.law.rates(now_s) + self.settings.drift_rad_s;
            self.telemetry
                .add_error(now_s, self.error(&self.body.attitude));
        }
        if self.sent_attitudes.len() >= REMEMBERED {
            self.sent_attitudes.pop_front();
        }
        self.sent_attitudes.push_back((now_s, self.body));
        self.body
    }

    /// Takes the detections of a frame. The first frame with enough stars becomes the reference.
    pub fn take(&mut self, exposed: &Exposed, detections: &Detections) {
        self.take_stars(exposed, Star::of_all(detections));
    }

    fn take_stars(&mut self, exposed: &Exposed, stars: Vec<Star>) {
        let [mid_s, taken_s] = [exposed.mid, exposed.taken].map(|at| self.since_start(at));
        if self.reference.is_empty() {
            if stars.len() < MIN_STARS {
                self.telemetry.starless += 1;
                return;
            }
            self.reference = stars;
            self.law.begin(mid_s);
            self.telemetry.begin(taken_s, self.reference.len());
            return;
        }
        let pinhole = Pinhole::centred(self.settings.focal_px, exposed.size);
        let guess = self.law.latest_error_rad();
        let Some(estimate) = estimate(&pinhole, &self.reference, &stars, guess) else {
            self.telemetry.starless += 1;
            return;
        };
        if !self.law.measured(mid_s, taken_s, estimate.turned_rad) {
            self.telemetry.late += 1;
            return;
        }
        let age = Duration::try_from_secs_f64(taken_s - mid_s).unwrap_or_default();
        let truth = self.error_at(mid_s);
        self.telemetry.frame(age, &estimate, truth);
    }

    fn since_start(&self, epoch: Epoch) -> f64 {
        (epoch - self.start).to_seconds()
    }

    /// Rotation from the target attitude, rad, body axes.
    fn error(&self, attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        rate_between(&self.hold, attitude, 1.0)
    }

    /// The body's error at an earlier time, if still stored.
    fn error_at(&self, at_s: f64) -> Option<Vector3<f64>> {
        let after = self
            .sent_attitudes
            .partition_point(|(sent_s, _)| *sent_s <= at_s);
        let (sent_s, pointing) = self.sent_attitudes.get(after.checked_sub(1)?)?;
        Some(self.error(&pointing.after(at_s - sent_s).attitude))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hifitime::Duration;

    /// Xorshift generator; with seed 0 all numbers are 0.
    pub(super) struct Noise(pub u64);

    impl Noise {
        /// In [0, 1).
        pub fn uniform(&mut self) -> f64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11) as f64 / (1_u64 << 53) as f64
        }

        /// Standard normal, as the sum of twelve uniform numbers.
        pub fn normal(&mut self) -> f64 {
            if self.0 == 0 {
                return 0.0;
            }
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }
    }

    /// Star directions in body axes at zero rotation.
    pub(super) struct Sky(Vec<Vector3<f64>>);

    impl Sky {
        /// Random stars in a frame.
        pub fn around(pinhole: &Pinhole, size: [u16; 2], count: usize, noise: &mut Noise) -> Self {
            let mut position = || size.map(|pixels| f64::from(pixels) * noise.uniform());
            Self((0..count).map(|_| pinhole.direction(position())).collect())
        }

        /// The stars in the frame, with centroid noise of 0.05 px along both axes.
        pub fn stars(
            &self,
            pinhole: &Pinhole,
            size: [u16; 2],
            turned: &UnitQuaternion<f64>,
            noise: &mut Noise,
        ) -> Vec<Star> {
            const SNR: f64 = 20.0;
            let stars = self.0.iter();
            let places = stars.filter_map(|star| pinhole.project(&(turned * star)));
            let [right, bottom] = size.map(f64::from);
            let within = |[x, y]: &[f64; 2]| (0.0..right).contains(x) && (0.0..bottom).contains(y);
            let places: Vec<_> = places.filter(within).collect();
            let star = |[x, y]: [f64; 2]| Star {
                at_px: [x + noise.normal() / SNR, y + noise.normal() / SNR],
                snr: SNR,
            };
            places.into_iter().map(star).collect()
        }
    }

    /// Runs the loop against a drift. Frames come every `period_s` and `late_s` after their middle;
    /// attitudes are sent at 10 Hz.
    fn simulate(period_s: f64, late_s: f64, seconds: f64, drift_deg_s: [f64; 3]) -> Control {
        // 41 arcsec per pixel.
        let (focal_px, size) = (5000.0, [512, 512]);
        let pinhole = Pinhole::centred(focal_px, size);
        let mut noise = Noise(99);
        let sky = Sky::around(&pinhole, size, 50, &mut noise);
        let start = Epoch::from_gregorian_utc_at_midnight(2019, 6, 15);
        let at = |s: f64| start + Duration::from_seconds(s);
        let hold = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
        let settings = ControlSettings {
            focal_px,
            drift_rad_s: Vector3::from(drift_deg_s).map(f64::to_radians),
        };
        let mut control = Control::new(settings, hold, start);
        let (mut frame, mut sent) = (1_u32, 0_u32);
        let mut sent_attitudes: Vec<(f64, Pointing)> = Vec::new();
        for tick in 0..(seconds * 1000.0) as u32 {
            let now_s = f64::from(tick) / 1000.0;
            let mid_s = f64::from(frame) * period_s;
            if now_s >= mid_s + late_s {
                // Like the emulator: extrapolate the last attitude to the middle of the exposure.
                let (sent_s, before) = sent_attitudes
                    .iter()
                    .rev()
                    .find(|(at_s, _)| *at_s <= mid_s)
                    .unwrap();
                let on = UnitQuaternion::from_scaled_axis(-before.rates_rad_s * (mid_s - sent_s));
                let turned = on * before.attitude * hold.inverse();
                let stars = sky.stars(&pinhole, size, &turned, &mut noise);
                let exposed = Exposed {
                    mid: at(mid_s),
                    taken: at(now_s),
                    size,
                };
                control.take_stars(&exposed, stars);
                frame += 1;
            }
            if now_s >= f64::from(sent) * 0.1 {
                sent_attitudes.push((now_s, control.steer(at(now_s))));
                sent += 1;
            }
        }
        control
    }

    #[test]
    fn a_drift_of_0_02_deg_s_is_corrected_to_some_arcseconds() {
        const ARCSEC: f64 = 648_000.0 / std::f64::consts::PI;
        for late_s in [0.02, 0.1, 0.2] {
            let control = simulate(0.1, late_s, 60.0, [0.0, 0.02, 0.0]);
            let telemetry = &control.telemetry;
            println!("latency {late_s} s\n{telemetry}");
            let (rms, off) = (telemetry.rms_rad(), telemetry.estimate_rms_rad());
            let angles = [rms.unwrap(), off.unwrap(), telemetry.worst_rad];
            let [rms, off, worst] = angles.map(|angle| angle * ARCSEC);
            // X-Val: 0.02 deg/s are 72 arcsec/s, 4300 in a minute. A centroid's 0.05 px are 2.1
            // arcsec; over the square root of 50 stars, with the same error in the reference: 0.6
            // arcsec across the boresight. Stars are 0.04 rad from the middle on average, so roll
            // is 25 times worse.
            assert!(telemetry.drifted_rad() * ARCSEC > 4200.0);
            let across = telemetry.boresight_rms_rad().unwrap() * ARCSEC;
            assert!(across < 2.0, "{across}");
            assert!(rms < 20.0 && off < 20.0, "{rms} {off}");
            assert!(worst < 72.0 * 3.0 * (late_s + 0.15) + 20.0, "{worst}");
            assert!(telemetry.used > 580 && telemetry.starless == 0);
        }
    }

    #[test]
    fn a_slow_camera_corrects_a_drift_about_all_axes() {
        let telemetry = simulate(1.0, 0.6, 240.0, [0.01, -0.02, 0.015])
            .telemetry
            .clone();
        let rms = telemetry.rms_rad().unwrap();
        assert!(rms < 0.01 * telemetry.drifted_rad(), "{telemetry}");
    }

    #[test]
    fn many_motion_steps_equal_one() {
        let start = Epoch::from_gregorian_utc_at_midnight(2019, 6, 15);
        let settings = ControlSettings {
            focal_px: 1000.0,
            drift_rad_s: Vector3::zeros(),
        };
        let mut control = Control::new(settings, UnitQuaternion::identity(), start);
        let rates_rad_s = Vector3::new(0.3, -0.2, 0.5);
        control.body.rates_rad_s = rates_rad_s;
        for step in 1..=100_000 {
            control.steer(start + Duration::from_microseconds(100.0 * f64::from(step)));
        }
        // X-Val: dR/dt = -[w x] R: q(t) = exp(-w t / 2).
        let once = UnitQuaternion::from_scaled_axis(-rates_rad_s * 10.0);
        assert!(control.body.attitude.angle_to(&once) < 1e-10);
        assert!((control.body.attitude.norm() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn without_stars_the_body_stays_at_rest_and_the_report_says_so() {
        let start = Epoch::from_gregorian_utc_at_midnight(2019, 6, 15);
        let settings = ControlSettings {
            focal_px: 1000.0,
            drift_rad_s: Vector3::repeat(1e-4),
        };
        let mut control = Control::new(settings, UnitQuaternion::identity(), start);
        let exposed = Exposed {
            mid: start,
            taken: start,
            size: [64, 64],
        };
        for second in 0..10 {
            let pointing = control.steer(start + Duration::from_seconds(f64::from(second)));
            assert_eq!(pointing.rates_rad_s, Vector3::zeros());
            assert_eq!(pointing.attitude, UnitQuaternion::identity());
            control.take_stars(&exposed, Vec::new());
        }
        let report = control.telemetry.to_string();
        assert!(report.contains("none of 10 frames had 4 stars"), "{report}");
    }
}
