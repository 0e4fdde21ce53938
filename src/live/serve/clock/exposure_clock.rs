//! The interface of all clocks of a run.

use super::cadence::Cadence;
use super::due::{Due, Sync, TimeCheck, TriggerRequest, no_triggers};
use crate::serve::history::Latched;
use crate::serve::refusal::Refusal;
use hifitime::Epoch;
use skyloop_protocols::Mode;
use skyloop_render::camera::Camera;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Decides which exposure is due.
pub(crate) trait ExposureClock: Send {
    /// Its code on the wire.
    fn mode(&self) -> Mode;

    /// The camera's cadence, if frames follow it.
    fn cadence(&mut self) -> Option<&mut Cadence>;

    /// The packet that requests a frame, if frames do not follow the cadence.
    fn requested_by(&self) -> &'static str {
        "Trigger"
    }

    fn latched(&mut self, latched: &Latched, camera: &Arc<Camera>);

    fn triggered(&mut self, _: TriggerRequest) -> Result<(), Refusal> {
        Err(no_triggers())
    }

    /// Whether the queue of attitudes is full.
    fn is_full(&self) -> bool {
        false
    }

    /// Evaluates a time stamp of the client, and when it arrived.
    fn observe_time(&mut self, _: Epoch, _: Instant) -> TimeCheck {
        TimeCheck::Consistent
    }

    /// Whether the next time stamp sets the scene time: the first of all, or the first after a
    /// pause.
    fn awaits_time(&self) -> bool {
        false
    }

    /// Drops the requested exposures after a step of the client's clock; returns their number.
    fn drop_requests(&mut self) -> u32 {
        0
    }

    /// Time until an exposure is due; none: until a packet comes.
    fn until_due(&self, now: Instant) -> Option<Duration>;

    /// Takes the exposure that is due by `now`.
    fn take_due(&mut self, camera: &Camera, now: Instant) -> Option<Due>;

    /// Ends the run; returns the number of waiting exposures, which get no frame.
    fn end(&mut self, now: Instant) -> u32;

    /// Exposures that were skipped.
    fn missed(&self) -> u32 {
        0
    }

    /// Stops the scene time. Only exposures that have ended are still due.
    fn pause(&mut self, now: Instant);

    fn is_paused(&self) -> bool;

    fn resume(&mut self, now: Instant);

    /// Restarts after a Reset or for another client, not paused. Returns the number of waiting
    /// exposures, which get no frame.
    fn restart(&mut self, rate_hz: f64, now: Instant) -> u32;

    /// How it follows the client's time.
    fn sync(&self, _: Instant) -> Sync {
        Sync::default()
    }
}
