//! Stepped: each attitude, or each trigger, gives one frame, as fast as it can be rendered.

use super::cadence::Cadence;
use super::due::{Due, MAX_WAITING, TriggerRequest, full, no_triggers};
use super::exposure_clock::ExposureClock;
use crate::serve::history::Latched;
use crate::serve::refusal::Refusal;
use skyloop_orbit::time::seconds;
use skyloop_protocols::Mode;
use skyloop_render::camera::Camera;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Exposures in the order of their requests.
pub(super) struct Stepped {
    /// Whether triggers request frames, and not attitudes.
    by_trigger: bool,
    waiting: VecDeque<Due>,
    paused: bool,
}

impl Stepped {
    pub fn new(by_trigger: bool) -> Stepped {
        Stepped {
            by_trigger,
            waiting: VecDeque::new(),
            paused: false,
        }
    }
}

impl ExposureClock for Stepped {
    fn mode(&self) -> Mode {
        Mode::Stepped
    }

    fn cadence(&mut self) -> Option<&mut Cadence> {
        None
    }

    fn requested_by(&self) -> &'static str {
        if self.by_trigger {
            "Trigger"
        } else {
            "Attitude"
        }
    }

    fn latched(&mut self, latched: &Latched, camera: &Arc<Camera>) {
        if self.by_trigger {
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

    fn triggered(&mut self, request: TriggerRequest) -> Result<(), Refusal> {
        if !self.by_trigger {
            return Err(no_triggers());
        }
        if self.waiting.len() >= MAX_WAITING {
            return Err(full("triggers"));
        }
        self.waiting.push_back(Due {
            mid: request.start + seconds(request.camera.exposure_s / 2.0),
            end: request.arrived,
            deadline: None,
            trigger: request.number,
            latched: None,
            camera: Some(request.camera),
        });
        Ok(())
    }

    fn is_full(&self) -> bool {
        !self.by_trigger && self.waiting.len() >= MAX_WAITING
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
        // The latency of waiting exposures does not include the pause.
        for due in &mut self.waiting {
            due.end = due.end.max(now);
        }
    }

    fn restart(&mut self, _: f64, now: Instant) -> u32 {
        self.paused = false;
        self.end(now)
    }
}
