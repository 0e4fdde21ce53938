//! The interface of all kinds of links.

use super::error::{LinkError, OpenError};
use super::tally::Tally;
use super::wire::Wire;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::can::CanBus;
use skyloop_firmware_sim::port::Port;
use skyloop_protocols::Personality;
use skyloop_protocols::personality::NATIVE;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// One kind of link.
pub struct Link {
    /// Scheme of its URLs, and its name in `loopback --link`.
    pub scheme: &'static str,
    /// An example of its URL, for messages.
    pub example: &'static str,
    /// Whether it is a CAN bus: faults and recordings apply to its frames, not to packets.
    pub is_bus: bool,
    /// Options of its URLs, besides `roles`.
    pub keys: &'static [&'static str],
    /// Opens the emulator's end.
    pub open: fn(&Address, &Options) -> Result<Wire, OpenError>,
    /// Opens both ends on this machine.
    pub loopback: fn(&Address, &Options) -> Result<BothEnds, OpenError>,
}

/// The emulator's end and the flight computer's.
pub type BothEnds = (Wire, Box<dyn Port + Send>);

/// How a link treats packets.
#[derive(Clone)]
pub struct Options {
    /// Silence after which another client may replace the present one.
    pub idle: Duration,
    /// The wire language. Only a valid packet makes its sender the client.
    pub personality: &'static Personality,
    /// Instruments between a CAN bus and its link.
    pub bus: Option<BusInstruments>,
}

impl Default for Options {
    /// The native wire language; a client that is silent for 5 s may be replaced.
    fn default() -> Self {
        Self {
            idle: Duration::from_secs(5),
            personality: &NATIVE,
            bus: None,
        }
    }
}

/// Wraps an instrument around an open bus.
pub type AroundBus = Box<dyn Fn(Box<dyn CanBus>) -> Box<dyn CanBus> + Send>;

/// Makes the instrument of a bus from its address and tally.
pub type AtBus = dyn Fn(&str, &Arc<Tally>) -> AroundBus + Send + Sync;

/// Instruments between a CAN bus and its link: faults, a recording.
#[derive(Clone)]
pub struct BusInstruments {
    /// Makes the instruments each time the bus is opened.
    pub at: Arc<AtBus>,
    /// Whether faults are injected.
    pub faults: bool,
}

/// Starts a thread of the link at `url`.
pub(super) fn thread(
    url: &Address,
    name: &str,
    body: impl FnOnce() + Send + 'static,
) -> Result<JoinHandle<()>, LinkError> {
    const REMEDY: &str = "check the limits of this process";
    let thread = std::thread::Builder::new().name(name.to_string());
    let started = thread.spawn(body);
    started.map_err(|error| LinkError::refused(url.text.clone(), "start its thread", error, REMEDY))
}
