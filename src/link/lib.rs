//! The links. Each carries whole packets both ways between its own threads and two bounded queues; of what a
//! packet means a link knows at most whether it is valid or of a frame. Adding one is a file here and a line in [`LINKS`].

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bus;
mod can;
pub mod capture;
mod departed;
mod every;
pub mod fault;
mod inbox;
mod line;
#[cfg(target_os = "linux")]
mod low_latency;
mod memory;
#[cfg(target_os = "linux")]
mod name;
mod outbox;
mod pace;
#[cfg(target_os = "linux")]
mod paced;
#[cfg(target_os = "linux")]
mod pseudo;
#[cfg(target_os = "linux")]
mod pty;
mod relay;
mod serial;
mod slcan;
mod tally;
mod udp;
mod url;

pub use departed::{Exit, Mark, Unsent};
pub use every::Every;
pub use inbox::{Inbox, Intake};
#[cfg(target_os = "linux")]
pub use pty::Pair;
pub use relay::{Relay, relay};
pub use tally::Tally;
pub use tally::{Harm, SOON, Standstill, is_of_frame, patience};
pub use url::LinkUrl;

use bytes::Bytes;
use skyloop_firmware_sim::can::CanBus;
use skyloop_firmware_sim::port::{Port, Refusal};
pub use skyloop_firmware_sim::roles::Roles;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{FaultKind, MAX_PACKET, Personality};
use std::borrow::Cow;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tally::count;
use thiserror::Error;

/// Every link.
pub const LINKS: &[Link] = &[
    memory::MEMORY,
    udp::UDP,
    serial::SERIAL,
    #[cfg(target_os = "linux")]
    pty::PTY,
    can::CAN,
    slcan::SLCAN,
];

/// One kind of link.
pub struct Link {
    /// Scheme of its URLs, and its name in `loopback --link`.
    pub scheme: &'static str,
    /// An example of its URL, for messages.
    pub example: &'static str,
    /// Whether it is a CAN bus: faults and recordings stand at its frames, not at the packets.
    pub is_bus: bool,
    /// The options that its URLs may have, besides `roles`.
    pub keys: &'static [&'static str],
    /// Opens the emulator's end.
    pub open: fn(&LinkUrl, &Options) -> Result<Wire, LinkError>,
    /// Opens both ends on this machine.
    pub loopback: fn(&LinkUrl, &Options) -> Result<BothEnds, LinkError>,
}

/// The emulator's end and the flight computer's.
pub type BothEnds = (Wire, Box<dyn Port + Send>);

/// Time on the wire of one packet of so many octets, all that the link adds to it included.
pub type Airtime = Arc<dyn Fn(usize) -> Duration + Send + Sync>;

/// What a link is told about packets.
#[derive(Clone)]
pub struct Options {
    /// After this silence a client may be replaced by another.
    pub idle: Duration,
    /// The wire language. Only a packet that it can read makes its sender the client.
    pub personality: &'static Personality,
    /// What stands between a CAN bus and its link.
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

/// Puts something around an open bus.
pub type AroundBus = Box<dyn Fn(Box<dyn CanBus>) -> Box<dyn CanBus> + Send>;

/// Makes what is put around a bus at an address whose link has this tally.
pub type AtBus = dyn Fn(&str, &Arc<Tally>) -> AroundBus + Send + Sync;

/// What stands between a CAN bus and its link: faults, a recording.
#[derive(Clone)]
pub struct BusInstruments {
    /// What is put around the bus, each time it is opened.
    pub at: Arc<AtBus>,
    /// Whether faults are injected.
    pub faults: bool,
}

/// Packets in a queue; beyond this the sender waits and the receiver drops the oldest (and counts).
pub const QUEUE: usize = 256;

/// How long the end of a run waits for its threads to let go.
const PARTING: Duration = Duration::from_millis(100);

/// A packet from a client.
#[derive(Debug, Clone)]
pub struct Inbound {
    /// Which exchange it belongs to: another number is another client.
    pub exchange: u32,
    /// The packet.
    pub packet: Bytes,
    /// When it had arrived whole.
    pub arrived: Instant,
}

impl Inbound {
    fn new(exchange: u32, packet: &[u8], arrived: Instant) -> Inbound {
        let packet = Bytes::copy_from_slice(packet);
        Inbound {
            exchange,
            packet,
            arrived,
        }
    }
}

/// Something for the link to do.
#[derive(Debug, Clone)]
pub enum Outbound {
    /// Send this packet, if its exchange still stands.
    Packet {
        /// Which exchange it answers.
        exchange: u32,
        /// The packet.
        packet: Bytes,
    },
    /// End the exchange, unless its client has sent something since: the next client may come at once.
    Release {
        /// Which exchange.
        exchange: u32,
        /// When the client asked for it.
        asked: Instant,
    },
}

/// What stands before the reason in the answer to a fault that is refused.
pub const FAULT_REFUSED: &str = "Fault: ";

/// Why a link injects no faults.
const NO_FAULTS: &str =
    "no faults are injected here: start the emulator with --faults or --fault-log";

/// The queue to a link.
pub trait Outbox: Send {
    /// Queues `what`; gives it back if the queue is full. Fails only by [`LinkError::Closed`].
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError>;

    /// Whether faults of this kind can be switched live; else why not, and the remedy.
    fn injects(&self, _: FaultKind) -> Result<(), Cow<'static, str>> {
        Err(NO_FAULTS.into())
    }
}

/// The emulator's end of an open link.
pub struct Wire {
    /// Where it listens, for people.
    pub address: String,
    /// What arrives.
    pub inbox: Inbox,
    /// What leaves.
    pub outbox: Box<dyn Outbox>,
    /// What the link counts.
    pub tally: Arc<Tally>,
    /// How long one packet takes, where the line is what limits; none where it is not.
    pub airtime: Option<Airtime>,
    /// The thread that sends, if the link has one; it ends when the outbox is gone and its queue empty.
    pub sender: Option<JoinHandle<()>>,
}

/// Notes that a client has come.
struct ClientSeen {
    is_valid: fn(&[u8]) -> bool,
    seen: Arc<AtomicBool>,
}

impl inbox::Observer for ClientSeen {
    fn taken(&self, inbound: &Inbound, _: bool) {
        if (self.is_valid)(&inbound.packet) {
            self.seen.store(true, Ordering::Relaxed);
        }
    }
}

impl Wire {
    /// A link without a rate of its own and without a thread that sends.
    fn new(
        address: String,
        inbox: Inbox,
        outbox: impl Outbox + 'static,
        tally: Arc<Tally>,
    ) -> Wire {
        Wire {
            address,
            inbox,
            outbox: Box::new(outbox),
            tally,
            airtime: None,
            sender: None,
        }
    }

    /// How long the longest packet takes, where that is known.
    pub fn packet_airtime(&self) -> Duration {
        let airtime = self.airtime.as_ref();
        airtime.map_or(Duration::ZERO, |airtime| airtime(MAX_PACKET))
    }

    /// Sets `seen` when a valid packet of a client comes, as `is_valid` says.
    pub fn note_client(&mut self, is_valid: fn(&[u8]) -> bool, seen: &Arc<AtomicBool>) {
        self.inbox.observe(Box::new(ClientSeen {
            is_valid,
            seen: seen.clone(),
        }));
    }

    /// Lets what is queued leave, until `standstill` is over; what is left then is lost.
    pub fn close(&mut self, mut standstill: Standstill) {
        // Without an outbox the sender ends when its queue is empty.
        self.outbox = Box::new(Closed);
        let Some(sender) = self.sender.take() else {
            return;
        };
        while !sender.is_finished() && !standstill.is_over() {}
        let why = standstill.why(self.airtime.as_ref());
        let left = self.tally.give_up(why);
        if left > 0 {
            let why = match why {
                Unsent::HeldBack => "a fault holds packets back",
                Unsent::NotProved => "the client has not proved its address",
                Unsent::RunEnded => "the run ends before the link has carried them",
                _ => "the client has not read them",
            };
            tracing::warn!(
                "{}: {left} packets are lost (lost_outbound): {why}",
                self.address
            );
        }
        // What stands before the link lets go of it now, and the link of what it made: its name.
        let given_up = Instant::now();
        while !sender.is_finished() && given_up.elapsed() < PARTING {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The outbox of a closed wire.
struct Closed;

impl Outbox for Closed {
    fn offer(&mut self, _: Outbound) -> Result<Option<Outbound>, LinkError> {
        Err(LinkError::Closed("closed".to_string()))
    }
}

/// Why a link cannot be opened or used.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The URL is not one.
    #[error("link {url:?}: {reason}; write for example {examples}")]
    Url {
        /// As given.
        url: String,
        /// What is wrong with it.
        reason: String,
        /// URLs that would be right.
        examples: String,
    },
    /// The system refuses.
    #[error("link {url}: {source}")]
    Refused {
        /// As given.
        url: String,
        /// What was tried, what the system says, what to do.
        source: Refusal,
    },
    /// The link's own threads have ended.
    #[error("link {0}: it has closed; open it again")]
    Closed(String),
}

impl LinkError {
    /// The system refuses `action` for the link at `url`.
    fn refused(url: String, action: &'static str, source: io::Error, remedy: &str) -> LinkError {
        let remedy = remedy.to_string();
        let source = Refusal {
            action,
            source,
            remedy,
        };
        LinkError::Refused { url, source }
    }
}

/// Opens the emulator's end of the link that `url` names.
pub fn open(url: &str, options: &Options) -> Result<Wire, LinkError> {
    open_parsed(&LinkUrl::parse(url)?, options)
}

fn open_parsed(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    (of(url)?.open)(url, options)
}

/// Opens the emulator's ends of a run's links. One of them, and no more, brings the truth.
pub fn open_all(urls: &[String], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    opened(&places(urls)?, options)
}

/// Opens the emulator's ends of a further camera's links, which bring its frames and not the truth.
pub fn open_further(urls: &[String], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    opened(&further_places(urls)?, options)
}

/// Errors: those of [`open_all`] that need no opening.
pub fn check_all(urls: &[String]) -> Result<(), LinkError> {
    places(urls).map(drop)
}

/// Errors: those of [`open_further`] that need no opening.
pub fn check_further(urls: &[String]) -> Result<(), LinkError> {
    further_places(urls).map(drop)
}

/// Whether a URL has the scheme of a link.
///
/// Errors: it has none, or an unknown one.
pub fn check_scheme(text: &str) -> Result<(), LinkError> {
    of(&LinkUrl::parse(text)?).map(drop)
}

/// A link's place and what travels over it.
type Place = (LinkUrl, Roles);

fn opened(places: &[Place], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    let places = places.iter();
    places
        .map(|(url, roles)| Ok((open_parsed(url, options)?, *roles)))
        .collect()
}

fn places(urls: &[String]) -> Result<Vec<Place>, LinkError> {
    let parsed = urls.iter().map(|url| LinkUrl::parse(url));
    let parsed: Vec<LinkUrl> = parsed.collect::<Result<_, _>>()?;
    // A mistyped `roles` would else be told as what its lack leads to.
    for url in &parsed {
        of(url)?;
    }
    let roles = parsed.iter().map(LinkUrl::roles);
    let roles: Vec<Roles> = roles.collect::<Result<_, _>>()?;
    let mut truth = parsed.iter().zip(&roles).filter(|(_, roles)| roles.truth);
    match (truth.next(), truth.next(), parsed.first()) {
        (_, Some((second, _)), _) => {
            let reason = "a second link for the truth; give it roles=pixels+labels";
            return Err(second.refuse_roles(reason, "pixels+labels"));
        }
        (None, None, Some(first)) => {
            let reason =
                "no link has the role truth, so no attitude could come; give one roles=truth";
            return Err(first.refuse_roles(reason, "truth"));
        }
        _ => {}
    }
    Ok(parsed.into_iter().zip(roles).collect())
}

fn further_places(urls: &[String]) -> Result<Vec<Place>, LinkError> {
    let place = |text: &String| {
        let url = LinkUrl::parse(text)?;
        of(&url)?;
        let roles = url.roles()?;
        if roles.truth && roles != Roles::ALL {
            let reason = "a further camera hears of the vehicle over the first one's link; give it roles=pixels+labels, or none";
            return Err(url.refuse_roles(reason, "pixels+labels"));
        }
        let truth = false;
        Ok((url, Roles { truth, ..roles }))
    };
    urls.iter().map(place).collect()
}

/// Opens both ends of the link that `text` names: a scheme, and options behind a question mark.
pub fn loopback(text: &str, options: &Options) -> Result<BothEnds, LinkError> {
    let url = LinkUrl::parse_loopback(text)?;
    (of(&url)?.loopback)(&url, options)
}

/// Locks data that is still valid after a panic of another thread.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a thread of the link that `url` names.
fn thread(
    url: &LinkUrl,
    name: &str,
    body: impl FnOnce() + Send + 'static,
) -> Result<JoinHandle<()>, LinkError> {
    const REMEDY: &str = "check the limits of this process";
    let thread = std::thread::Builder::new().name(name.to_string());
    let started = thread.spawn(body);
    started.map_err(|error| url.failed("start its thread", error, REMEDY))
}

/// The link of a URL, whose options it has.
fn of(url: &LinkUrl) -> Result<&'static Link, LinkError> {
    let link = by_scheme(&url.scheme)
        .ok_or_else(|| url.refuse(format!("unknown scheme {:?}", url.scheme)))?;
    url.only(link.keys)?;
    Ok(link)
}

fn by_scheme(scheme: &str) -> Option<&'static Link> {
    LINKS.iter().find(|link| link.scheme == scheme)
}

/// Whether a link, by URL or scheme, is a CAN bus.
pub fn is_bus(text: &str) -> bool {
    let scheme = text.split([':', '?']).next();
    LINKS
        .iter()
        .any(|link| link.is_bus && Some(link.scheme) == scheme)
}

fn examples() -> String {
    LINKS
        .iter()
        .map(|link| link.example)
        .filter(|example| example.contains("://"))
        .collect::<Vec<_>>()
        .join(" or ")
}

/// What tests of several links use.
#[cfg(test)]
pub(crate) mod fixture {
    use super::{Options, Outbound, Wire};
    use bytes::Bytes;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::slip;
    use std::time::Duration;

    pub const PATIENCE: Duration = Duration::from_secs(20);

    /// Packets of the native language and no bus.
    pub fn options() -> Options {
        Options {
            idle: PATIENCE,
            personality: &NATIVE,
            bus: None,
        }
    }

    /// A packet as a line carries it.
    pub fn framed(packet: &[u8]) -> Vec<u8> {
        let mut line = Vec::new();
        slip::encode(packet, &mut |octet| line.push(octet));
        line
    }

    /// Queues a packet, which must find room.
    pub fn offer(wire: &mut Wire, exchange: u32, packet: &[u8]) {
        let packet = Bytes::copy_from_slice(packet);
        let full = wire.outbox.offer(Outbound::Packet { exchange, packet });
        assert!(full.unwrap().is_none());
    }
}
