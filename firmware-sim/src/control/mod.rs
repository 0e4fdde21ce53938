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
mod body;
mod estimator;
mod law;
mod matching;
#[cfg(test)]
mod simulated;

use std::collections::VecDeque;
use std::time::Duration;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};

pub use self::account::ControlAccount;
pub use self::body::Body;
pub use self::estimator::{Estimate, LEAST_STARS, Pinhole, Star, estimate};
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
    body: Body,
    law: Law,
    /// The stars of the first frame that had enough.
    reference: Vec<Star>,
    /// The latest messages: s after `start`, and what they said.
    said: VecDeque<(f64, Pointing)>,
    account: ControlAccount,
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
            body: Body::at_rest(hold),
            law: Law::default(),
            reference: Vec::new(),
            said: VecDeque::new(),
            account: ControlAccount::new(settings.drift_rad_s.norm()),
        }
    }

    /// Moves the body on to `epoch`, where its rates become those that are steered now; where it points, to be sent.
    pub fn steer(&mut self, epoch: Epoch) -> Pointing {
        /// Messages that frames may still be under way of.
        const REMEMBERED: usize = 4096;
        let now_s = self.since_start(epoch);
        self.body.go_on(now_s - self.moved_s);
        self.law.acts_every(now_s - self.moved_s);
        self.moved_s = now_s;
        if !self.reference.is_empty() {
            self.body.rates_rad_s = self.law.rates(now_s) + self.settings.drift_rad_s;
            self.account.points(now_s, self.error(&self.body.attitude));
        }
        let pointing = Pointing {
            attitude: self.body.attitude,
            rates_rad_s: self.body.rates_rad_s,
        };
        if self.said.len() >= REMEMBERED {
            self.said.pop_front();
        }
        self.said.push_back((now_s, pointing));
        pointing
    }

    /// Takes what a frame shows. The first with enough stars is the one that is to be held.
    pub fn see(&mut self, exposed: &Exposed, detections: &Detections) {
        self.see_stars(exposed, Star::of_all(detections));
    }

    fn see_stars(&mut self, exposed: &Exposed, stars: Vec<Star>) {
        let (mid_s, taken_s) = (
            self.since_start(exposed.mid),
            self.since_start(exposed.taken),
        );
        if self.reference.is_empty() {
            if stars.len() < LEAST_STARS {
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
    pub fn account(&self) -> &ControlAccount {
        &self.account
    }

    /// What came of it.
    #[must_use]
    pub fn into_account(self) -> ControlAccount {
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
        let mut body = Body {
            attitude: pointing.attitude,
            rates_rad_s: pointing.rates_rad_s,
        };
        body.go_on(at_s - said_s);
        Some(self.error(&body.attitude))
    }
}
