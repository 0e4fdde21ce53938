//! The closed loop: a body that drifts, and a controller that holds it by what the frames show.
//!
//! ```text
//! Detections -> estimator -> Law -> rates -> Body -> Attitude -> (emulator) -> Detections
//! ```
//!
//! The body is the truth that the emulator is told. The controller knows the centroids of each frame, the time of its exposure and the
//! focal length of its camera; it never sees a label, the body or the drift. Only the [`ControlAccount`] compares both sides.
//!
//! The body stands still until a frame shows enough stars: that frame is what all others are compared with. Then the drift begins. The
//! rates change only when an attitude leaves, so that each message says exactly how the body turns until the next.
//!
//! The camera's axes are taken for the body's.

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

/// What the loop is flown with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlSettings {
    /// Focal length of the camera over the pitch of its pixels, px, above 0: all that is known of its optics.
    pub focal_px: f64,
    /// What turns the body beside the steering: angular velocity, body axes, rad/s.
    pub drift_rad_s: Vector3<f64>,
}

/// When and where a frame was exposed and taken.
#[derive(Clone, Copy, Debug)]
pub struct Exposed {
    /// Middle of its exposure.
    pub mid: Epoch,
    /// Now: when its detections are fixed.
    pub taken: Epoch,
    /// Columns and rows of the whole frame.
    pub size: [u16; 2],
}

/// Body and controller, and what came of them.
#[derive(Debug)]
pub struct Control {
    settings: ControlSettings,
    hold: UnitQuaternion<f64>,
    start: Epoch,
    /// When the body was moved last, s after `start`.
    moved_s: f64,
    body: Pointing,
    law: Law,
    /// The stars of the first frame that had enough.
    reference: Vec<Star>,
    /// The latest messages: s after `start`, and what they said.
    said: VecDeque<(f64, Pointing)>,
    account: ControlTelemetry,
}

impl Control {
    /// A body at rest that is to hold `hold` (ICRF to body) from `start` on.
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
            said: VecDeque::new(),
            account: ControlTelemetry::new(settings.drift_rad_s.norm()),
        }
    }

    /// Moves the body on to `epoch`, where its rates become those that are steered now; where it points, to be sent.
    pub fn steer(&mut self, epoch: Epoch) -> Pointing {
        /// Messages that frames may still be under way of.
        const REMEMBERED: usize = 4096;
        let now_s = self.since_start(epoch);
        self.body = self.body.after(now_s - self.moved_s);
        // Or rounding adds up in the norm.
        self.body.attitude.renormalize_fast();
        self.law.acts_every(now_s - self.moved_s);
        self.moved_s = now_s;
        if !self.reference.is_empty() {
            self.body.rates_rad_s = self.law.rates(now_s) + self.settings.drift_rad_s;
            self.account.points(now_s, self.error(&self.body.attitude));
        }
        if self.said.len() >= REMEMBERED {
            self.said.pop_front();
        }
        self.said.push_back((now_s, self.body));
        self.body
    }

    /// Takes what a frame shows. The first with enough stars is the one that is to be held.
    pub fn see(&mut self, exposed: &Exposed, detections: &Detections) {
        self.see_stars(exposed, Star::of_all(detections));
    }

    fn see_stars(&mut self, exposed: &Exposed, stars: Vec<Star>) {
        let [mid_s, taken_s] = [exposed.mid, exposed.taken].map(|at| self.since_start(at));
        if self.reference.is_empty() {
            if stars.len() < MIN_STARS {
                self.account.starless += 1;
                return;
            }
            self.reference = stars;
            self.law.begin(mid_s);
            self.account.begins(taken_s, self.reference.len());
            return;
        }
        let pinhole = Pinhole::centred(self.settings.focal_px, exposed.size);
        let guess = self.law.expected();
        let Some(estimate) = estimate(&pinhole, &self.reference, &stars, guess) else {
            self.account.starless += 1;
            return;
        };
        if !self.law.measured(mid_s, taken_s, estimate.turned_rad) {
            self.account.late += 1;
            return;
        }
        let age = Duration::try_from_secs_f64(taken_s - mid_s).unwrap_or_default();
        let truth = self.truth(mid_s);
        self.account.frame(age, &estimate, truth);
    }

    /// What came of it so far.
    #[must_use]
    pub fn account(&self) -> &ControlTelemetry {
        &self.account
    }

    /// What came of it.
    #[must_use]
    pub fn into_account(self) -> ControlTelemetry {
        self.account
    }

    fn since_start(&self, epoch: Epoch) -> f64 {
        (epoch - self.start).to_seconds()
    }

    /// By what the body is turned from where it is to be, rad, body axes.
    fn error(&self, attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        rate_between(&self.hold, attitude, 1.0)
    }

    /// The same at an instant that lies behind, if that is remembered.
    fn truth(&self, at_s: f64) -> Option<Vector3<f64>> {
        let after = self.said.partition_point(|(said_s, _)| *said_s <= at_s);
        let (said_s, pointing) = self.said.get(after.checked_sub(1)?)?;
        Some(self.error(&pointing.after(at_s - said_s).attitude))
    }
}

/// A camera without an emulator: stars as centroids with noise, and a loop around them.
#[cfg(test)]
mod tests {
    use super::*;
    use hifitime::Duration;

    /// Xorshift numbers; from the seed 0 none: all are 0.
    pub(super) struct Noise(pub u64);

    impl Noise {
        /// In [0, 1).
        pub fn uniform(&mut self) -> f64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11) as f64 / (1_u64 << 53) as f64
        }

        /// Standard normal, by twelve of them.
        pub fn normal(&mut self) -> f64 {
            if self.0 == 0 {
                return 0.0;
            }
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }
    }

    /// Directions in the axes of a body that is not turned.
    pub(super) struct Sky(Vec<Vector3<f64>>);

    impl Sky {
        /// So many stars in a frame.
        pub fn around(pinhole: &Pinhole, size: [u16; 2], count: usize, noise: &mut Noise) -> Self {
            let mut place = || size.map(|pixels| f64::from(pixels) * noise.uniform());
            Self((0..count).map(|_| pinhole.direction(place())).collect())
        }

        /// What a frame shows of it, each centroid with a noise of 0.05 px along both axes.
        pub fn stars(
            &self,
            pinhole: &Pinhole,
            size: [u16; 2],
            turned: &UnitQuaternion<f64>,
            noise: &mut Noise,
        ) -> Vec<Star> {
            const SNR: f64 = 20.0;
            let stars = self.0.iter();
            let places = stars.filter_map(|star| pinhole.place(&(turned * star)));
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

    /// Holds against a drift for some time with frames every `period_s`, taken `late_s` after their middle; attitudes leave at 10 Hz.
    fn fly(period_s: f64, late_s: f64, seconds: f64, drift_deg_s: [f64; 3]) -> Control {
        // 41 arcsec a pixel.
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
        let mut said: Vec<(f64, Pointing)> = Vec::new();
        for tick in 0..(seconds * 1000.0) as u32 {
            let now_s = f64::from(tick) / 1000.0;
            let mid_s = f64::from(frame) * period_s;
            if now_s >= mid_s + late_s {
                // As an emulator that carries the message before on to the middle of the exposure.
                let (said_s, before) = said.iter().rev().find(|(at_s, _)| *at_s <= mid_s).unwrap();
                let on = UnitQuaternion::from_scaled_axis(-before.rates_rad_s * (mid_s - said_s));
                let turned = on * before.attitude * hold.inverse();
                let stars = sky.stars(&pinhole, size, &turned, &mut noise);
                let exposed = Exposed {
                    mid: at(mid_s),
                    taken: at(now_s),
                    size,
                };
                control.see_stars(&exposed, stars);
                frame += 1;
            }
            if now_s >= f64::from(sent) * 0.1 {
                said.push((now_s, control.steer(at(now_s))));
                sent += 1;
            }
        }
        control
    }

    #[test]
    fn a_simulated_camera_holds_a_drift_of_0_02_deg_s_to_some_arcseconds() {
        const ARCSEC: f64 = 648_000.0 / std::f64::consts::PI;
        for late_s in [0.02, 0.1, 0.2] {
            let control = fly(0.1, late_s, 60.0, [0.0, 0.02, 0.0]);
            let account = control.account();
            println!("latency {late_s} s\n{account}");
            let (rms, off) = (account.rms_rad(), account.estimate_rms_rad());
            let angles = [rms.unwrap(), off.unwrap(), account.worst_rad];
            let [rms, off, worst] = angles.map(|angle| angle * ARCSEC);
            // X-Val: 0.02 deg/s are 72 arcsec/s, 4300 in a minute. A centroid's 0.05 px are 2.1 arcsec: over the square root of 50 stars, and as
            // much of the reference again, 0.6 arcsec across the boresight. Stars lie 0.04 rad from the middle on average, so that the turn
            // about it is known 25 times worse.
            assert!(account.drifted_rad() * ARCSEC > 4200.0);
            let across = account.across_rms_rad().unwrap() * ARCSEC;
            assert!(across < 2.0, "{across}");
            assert!(rms < 20.0 && off < 20.0, "{rms} {off}");
            assert!(worst < 72.0 * 3.0 * (late_s + 0.15) + 20.0, "{worst}");
            assert!(account.used > 580 && account.starless == 0);
        }
    }

    #[test]
    fn a_drift_about_all_axes_and_a_slow_camera() {
        let account = fly(1.0, 0.6, 240.0, [0.01, -0.02, 0.015]).account().clone();
        let rms = account.rms_rad().unwrap();
        assert!(rms < 0.01 * account.drifted_rad(), "{account}");
    }

    #[test]
    fn many_steps_of_the_body_are_one() {
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
    fn without_stars_the_body_stands_still_and_that_is_told() {
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
            control.see_stars(&exposed, Vec::new());
        }
        let told = control.account().to_string();
        assert!(told.contains("none of 10 frames had 4 stars"), "{told}");
    }
}
