//! In step: each attitude, or each trigger, gives its frame, as fast as that can be made.

use super::{Asked, Cadence, Clock, Due, MAX_WAITING, full};
use crate::serve::Latched;
use crate::serve::receive::Refusal;
use skyloop_orbit::time::seconds;
use skyloop_protocols::Mode;
use skyloop_render::camera::Camera;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Exposures in the order in which they were asked for.
pub(super) struct Stepped {
    /// Whether triggers ask for frames, and not attitudes.
    packets: bool,
    waiting: VecDeque<Due>,
    /// Whether all wait until that is over.
    paused: bool,
}

impl Stepped {
    pub fn new(packets: bool) -> Stepped {
        Stepped {
            packets,
            waiting: VecDeque::new(),
            paused: false,
        }
    }
}

impl Clock for Stepped {
    fn mode(&self) -> Mode {
        Mode::Stepped
    }

    fn cadence(&mut self) -> Option<&mut Cadence> {
        None
    }

    fn asks(&self) -> &'static str {
        if self.packets { "Trigger" } else { "Attitude" }
    }

    fn latched(&mut self, latched: &Latched, camera: &Arc<Camera>) {
        if self.packets {
            return;
        }
        self.waiting.push_back(Due {
            mid: latched.vehicle.epoch,
            end: latched.arrived,
            deadline: None,
            trigger: 0,
            latched: Some(latched.clone()),
            camera: Some(camera.clone()),
        });
    }

    fn triggered(&mut self, asked: Asked) -> Result<(), Refusal> {
        if !self.packets {
            return Err(super::no_triggers());
        }
        if self.waiting.len() >= MAX_WAITING {
            return Err(full("triggers"));
        }
        self.waiting.push_back(Due {
            mid: asked.start + seconds(asked.camera.exposure_s / 2.0),
            end: asked.arrived,
            deadline: None,
            trigger: asked.number,
            latched: None,
            camera: Some(asked.camera),
        });
        Ok(())
    }

    fn is_full(&self) -> bool {
        !self.packets && self.waiting.len() >= MAX_WAITING
    }

    fn until_due(&self, _: Instant) -> Option<Duration> {
        (!self.paused && !self.waiting.is_empty()).then_some(Duration::ZERO)
    }

    fn take_due(&mut self, _: &Camera, _: Instant) -> Option<Due> {
        if self.paused {
            return None;
        }
        self.waiting.pop_front()
    }

    fn end(&mut self, _: Instant) -> u32 {
        self.waiting.drain(..).count() as u32
    }

    fn pause(&mut self, _: Instant) {
        self.paused = true;
    }

    fn is_paused(&self) -> bool {
        self.paused
    }

    fn resume(&mut self, now: Instant) {
        self.paused = false;
        // They have waited for this, and for nothing of ours.
        for due in &mut self.waiting {
            due.end = due.end.max(now);
        }
    }

    fn clear(&mut self, _: f64, now: Instant) -> u32 {
        self.paused = false;
        self.end(now)
    }
}
