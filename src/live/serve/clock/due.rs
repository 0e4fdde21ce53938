//! Inputs and results of a clock.

use crate::serve::history::Latched;
use crate::serve::refusal::Refusal;
use hifitime::Epoch;
use skyloop_protocols::SyncState;
use skyloop_render::camera::Camera;
use std::sync::Arc;
use std::time::Instant;

/// Maximum number of exposures that wait for their frames; more are refused as busy.
pub(crate) const MAX_WAITING: usize = 64;

/// An exposure whose frame is due.
#[derive(Debug, Clone)]
pub(crate) struct Due {
    /// Mid-exposure, in scene time.
    pub mid: Epoch,
    /// Its end, or the arrival of the packet that requested it. Latencies start here.
    pub end: Instant,
    /// Deadline of its frame; none: the frame is never late.
    pub deadline: Option<Instant>,
    /// Number of the Trigger that requested it; 0 if none did.
    pub trigger: u32,
    /// The attitude that requested it; none: the history is used.
    pub latched: Option<Latched>,
    /// Camera settings at the time of the request; none: the present ones.
    pub camera: Option<Arc<Camera>>,
}

/// A Trigger as received.
#[derive(Debug, Clone)]
pub(crate) struct TriggerRequest {
    /// The client's number.
    pub number: u32,
    /// First instant of the exposure.
    pub start: Epoch,
    /// The camera settings on arrival.
    pub camera: Arc<Camera>,
    /// When it arrived.
    pub arrived: Instant,
}

/// How a clock follows the client's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sync {
    /// Synchronization state.
    pub state: SyncState,
    /// Client's clock minus this machine's, s, relative to the first observation.
    pub offset_s: f64,
}

impl Default for Sync {
    fn default() -> Sync {
        Sync {
            state: SyncState::Free,
            offset_s: 0.0,
        }
    }
}

/// How a time stamp of the client compares with its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TimeCheck {
    /// It agrees, or differs so little that the clock is slewed.
    Consistent,
    /// It differs by this much (s; above 0: ahead): late, wrong, or the first after a clock step.
    Doubtful(f64),
    /// The client's clock was stepped. Earlier attitudes and triggers are void.
    Jumped,
}

pub(super) fn full(requests: &str) -> Refusal {
    Refusal::busy(format!(
        "{MAX_WAITING} {requests} already wait for their frames; wait for a frame"
    ))
}

pub(super) fn no_triggers() -> Refusal {
    Refusal::not_supported(
        "Trigger: frames need no Trigger here; set run.trigger = \"packet\", with run.clock \"stepped\" or \"external\"",
    )
}
