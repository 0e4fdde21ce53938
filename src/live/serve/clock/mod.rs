//! The clocks of a run: stepped, by this machine, by the client.

mod cadence;
mod discipline;
mod paced;
mod stepped;

pub use cadence::Cadence;
pub(super) use discipline::SURE_S;

use super::Latched;
use super::receive::Refusal;
use hifitime::Epoch;
use paced::Paced;
use skyloop_config::{Clock as Kind, Run, Trigger};
use skyloop_protocols::{Mode, SyncState};
use skyloop_render::camera::Camera;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stepped::Stepped;

/// Exposures that may wait for their frame; more are refused as busy.
pub(super) const MAX_WAITING: usize = 64;

/// An exposure whose frame is due.
#[derive(Debug, Clone)]
pub struct Due {
    /// Its middle, in the scene's time.
    pub mid: Epoch,
    /// When it ended, or what asked for it came: where latencies begin.
    pub end: Instant,
    /// When its frame is late; none: never.
    pub deadline: Option<Instant>,
    /// Number of the Trigger that asked for it; 0 without.
    pub trigger: u32,
    /// The attitude that asked for it; none: whatever attitudes there are.
    pub latched: Option<Latched>,
    /// The camera as it was set when it was asked for; none: as it is.
    pub camera: Option<Arc<Camera>>,
}

/// A Trigger as it came.
#[derive(Debug, Clone)]
pub struct Asked {
    /// The client's number.
    pub number: u32,
    /// First instant of the exposure.
    pub start: Epoch,
    /// The camera as it is set.
    pub camera: Arc<Camera>,
    /// When it came.
    pub arrived: Instant,
}

/// What a clock goes by for the client's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sync {
    /// Whether it is followed.
    pub state: SyncState,
    /// What it is ahead of this machine's, s, counted from when it was first heard.
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

/// What a time that the client told says of its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    /// It is what it was taken for, or so near that it is followed.
    Fits,
    /// It is off by so much (s; above 0: ahead): late, wrong, or the first of a clock that was set.
    Doubted(f64),
    /// It has jumped, and what came before has no meaning any more.
    Jumped,
}

/// Says which exposure's frame is due.
pub trait Clock: Send {
    /// Its name on the wire.
    fn mode(&self) -> Mode;

    /// The camera's cadence, where frames come by it.
    fn cadence(&mut self) -> Option<&mut Cadence>;

    /// What asks for frames where they do not come by the cadence.
    fn asks(&self) -> &'static str {
        "Trigger"
    }

    /// An attitude was accepted.
    fn latched(&mut self, latched: &Latched, camera: &Arc<Camera>);

    /// A Trigger came.
    fn triggered(&mut self, _: Asked) -> Result<(), Refusal> {
        Err(no_triggers())
    }

    /// Whether as many attitudes wait for their frames as may.
    fn is_full(&self) -> bool {
        false
    }

    /// A time that the client told, and when that came.
    fn hear(&mut self, _: Epoch, _: Instant) -> Heard {
        Heard::Fits
    }

    /// Whether the next time that is told sets the scene's: the first of all, or after a pause.
    fn awaits_time(&self) -> bool {
        false
    }

    /// The client's clock has jumped: how many exposures it had asked for by the time before, which get no frame.
    fn forget(&mut self) -> u32 {
        0
    }

    /// Time until something is due; none: until something comes.
    fn until_due(&self, now: Instant) -> Option<Duration>;

    /// Takes the exposure that is due by `now`.
    fn take_due(&mut self, camera: &Camera, now: Instant) -> Option<Due>;

    /// The run's end: how many exposures waited, which get no frame.
    fn end(&mut self, now: Instant) -> u32;

    /// Exposures that were passed over.
    fn missed(&self) -> u32 {
        0
    }

    /// Nothing is due any more but what has ended, and the scene's time stands still.
    fn pause(&mut self, now: Instant);

    /// Whether it is paused.
    fn is_paused(&self) -> bool;

    /// All goes on after a pause.
    fn resume(&mut self, now: Instant);

    /// Another client, or a Reset: all begins anew, paused or not. How many exposures waited, which get no frame.
    fn clear(&mut self, rate_hz: f64, now: Instant) -> u32;

    /// What it goes by for the client's time.
    fn sync(&self, _: Instant) -> Sync {
        Sync::default()
    }
}

/// The clock of a kind, as `run` has it otherwise.
pub(super) fn of(kind: Kind, run: &Run, rate_hz: f64) -> Box<dyn Clock> {
    let cadence = Cadence::new(rate_hz, run.latency_s.map(Duration::from_secs_f64));
    let packets = run.trigger == Trigger::Packet;
    match kind {
        Kind::Stepped => Box::new(Stepped::new(packets)),
        Kind::Wall => Box::new(Paced::wall(cadence)),
        Kind::External => {
            let holdover = Duration::from_secs_f64(run.holdover_s);
            Box::new(Paced::external(cadence, packets, holdover))
        }
    }
}

fn full(what: &str) -> Refusal {
    Refusal::busy(format!(
        "{MAX_WAITING} {what} already wait for their frames; wait for a frame"
    ))
}

fn no_triggers() -> Refusal {
    Refusal::not_supported(
        "Trigger: frames come of themselves here; set run.trigger = \"packet\", with run.clock \"stepped\" or \"external\"",
    )
}
