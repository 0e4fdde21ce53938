//! By this machine's clock: the camera's own cadence, whatever the client does.

use super::{Cadence, Clock, Due};
use crate::camera::Camera;
use crate::serve::Latched;
use skyloop_protocols::Mode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The camera's cadence, from the first attitude on.
pub(super) struct Wall {
    cadence: Cadence,
}

impl Wall {
    pub fn new(cadence: Cadence) -> Wall {
        Wall { cadence }
    }
}

impl Clock for Wall {
    fn mode(&self) -> Mode {
        Mode::Wall
    }

    fn cadence(&mut self) -> Option<&mut Cadence> {
        Some(&mut self.cadence)
    }

    fn latched(&mut self, latched: &Latched, _: &Arc<Camera>) {
        self.cadence.set(latched.vehicle.epoch, latched.arrived);
    }

    fn until_due(&self, now: Instant) -> Option<Duration> {
        Some(self.cadence.until_due(now))
    }

    fn take_due(&mut self, camera: &Camera, now: Instant) -> Option<Due> {
        self.cadence.take_due(camera.exposure_s, now)
    }

    fn end(&mut self, now: Instant) -> u32 {
        self.cadence.end(now);
        0
    }

    fn missed(&self) -> u32 {
        self.cadence.missed
    }

    fn awaits_time(&self) -> bool {
        self.cadence.awaits_time()
    }

    fn pause(&mut self, now: Instant) {
        self.cadence.pause(now);
    }

    fn is_paused(&self) -> bool {
        self.cadence.is_paused()
    }

    fn resume(&mut self, now: Instant) {
        self.cadence.resume(now);
    }

    fn clear(&mut self, rate_hz: f64, now: Instant) -> u32 {
        self.cadence.clear(rate_hz, now);
        0
    }
}
