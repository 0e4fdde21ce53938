//! The emulator's end of a CAN bus (SocketCAN or adapter) that carries packets.

use super::error::LinkError;
use super::inbox::{Inbound, InboxSender, inbox};
use super::kind::{AroundBus, Options};
use super::outbox::{self, Outbound};
use super::tally::{Tally, count, is_of_frame};
use super::tx_complete::Unsent;
use super::wire::Wire;
use bytes::Bytes;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::can::carrier::{self, Above, Next, Note};
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::{self, CanBus, OpenBus, Opener, Refusal, Trouble, socket};
use skyloop_protocols::can::{Node, Side};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Instant;

/// Settings of a loopback bus at `place`: by default FD at the highest rates.
///
/// # Errors
/// The reason why an option of the URL is invalid.
pub(super) fn loopback_settings(url: &Address, place: &str) -> Result<Settings, String> {
    let mut settings = Settings::new(place);
    (settings.rates.bitrate, settings.rates.load) = (1_000_000, 1.0);
    if url.value("bitrate").is_none() && socket::carries_fd(place) {
        (settings.fd, settings.rates.data_bitrate) = (true, 8_000_000);
    }
    settings.apply(url)?;
    Ok(settings)
}

/// Opens the bus of `settings` and carries packets over it; reopens it after a loss.
pub(super) fn open(
    url: &Address,
    options: &Options,
    settings: &Settings,
    open: OpenBus,
) -> Result<Wire, LinkError> {
    let opened = can::open(open, settings);
    let (bus, opener) = opened.map_err(|refusal| refused(url, settings, refusal))?;
    start(url, options, bus, Some(opener), settings)
}

/// Carries packets over an open bus; with an `opener` the link survives a lost bus.
pub(super) fn start(
    url: &Address,
    options: &Options,
    bus: Box<dyn CanBus>,
    opener: Option<Opener>,
    settings: &Settings,
) -> Result<Wire, LinkError> {
    let address = format!("{}://{}", url.scheme, settings.describe());
    let tally = Arc::new(Tally::default());
    let (bus, opener) = match &options.bus {
        None => (bus, opener),
        Some(instruments) => around((instruments.at)(&address, &tally), bus, opener),
    };
    let (arrivals, inbox) = inbox(tally.clone());
    let (mut outbox, departures) = outbox::queue(&address, &tally);
    let end = End {
        departures,
        watch: Box::new(arrivals.watch()),
        arrivals,
        tally: tally.clone(),
        address: address.clone(),
        is_error_logged: false,
    };
    let node = Node::new(Side::Emulator, settings.fd);
    let started = carrier::start(&url.scheme, bus, opener, node, settings.rates, end);
    let (waker, sender) = started.map_err(|error| {
        let remedy = "check the limits of this process";
        LinkError::refused(url.text.clone(), "start its threads", error, remedy)
    })?;
    outbox.releases = false;
    outbox.wake = Box::new(move || waker.wake());
    if options.bus.as_ref().is_some_and(|bus| bus.faults) {
        outbox.injects = |_| Ok(());
    }
    let line = settings.clone();
    Ok(Wire {
        airtime: Some(Arc::new(move |bytes| line.packet_duration(bytes))),
        sender: Some(sender),
        ..Wire::new(address, inbox, outbox, tally)
    })
}

/// Wraps instruments around an open bus, and around each reopened one.
fn around(
    around: AroundBus,
    bus: Box<dyn CanBus>,
    opener: Option<Opener>,
) -> (Box<dyn CanBus>, Option<Opener>) {
    let bus = around(bus);
    let opener = opener.map(|mut open| -> Opener { Box::new(move || Ok(around(open()?))) });
    (bus, opener)
}

/// The carrier's access to the queues and counters.
struct End {
    departures: Receiver<Outbound>,
    arrivals: InboxSender,
    watch: Box<dyn Fn() -> bool + Send>,
    tally: Arc<Tally>,
    address: String,
    /// Whether the log already reports errors on the bus.
    is_error_logged: bool,
}

impl Above for End {
    type Packet = Bytes;

    fn next(&mut self) -> Next<Bytes> {
        match self.departures.try_recv() {
            Ok(Outbound::Packet { packet, .. }) => Next::Packet(packet),
            Ok(Outbound::Release { .. }) | Err(TryRecvError::Empty) => Next::Nothing,
            Err(TryRecvError::Disconnected) => Next::Closed,
        }
    }

    fn arrived(&mut self, packet: &[u8], at: Instant) -> bool {
        self.is_error_logged = false;
        self.arrivals.push(Inbound::new(0, packet, at)).is_ok()
    }

    fn is_wanted(&self) -> bool {
        (self.watch)()
    }

    fn ended(&mut self, packet: Bytes, is_sent: bool) {
        if is_sent {
            self.tally.done();
        } else {
            self.tally
                .finish_unsent(is_of_frame(&packet), Unsent::NotRead);
        }
    }

    fn note(&mut self, note: Note) {
        let tally = &self.tally;
        let address = &self.address;
        let add = |counter: &AtomicU32, more| {
            counter.fetch_add(more, Ordering::Relaxed);
        };
        match note {
            Note::Moved(bytes) => tally.moved(bytes),
            Note::Unsent(more) => add(&tally.lost, more),
            Note::Incomplete(more) => add(&tally.incomplete, more),
            Note::Oversize(more) => add(&tally.oversize, more),
            Note::Garbled(more) => add(&tally.bad_framing, more),
            Note::Trouble(Trouble::BusOff) => {
                count(&tally.bus_off);
                count(&tally.bus_errors);
                let restart = if address.starts_with("slcan") {
                    "the adapter is closed and opened again"
                } else {
                    "it waits for a restart (`ip link set NAME type can restart-ms 100` makes it automatic)"
                };
                tracing::warn!("{address}: bus-off, too many errors: {restart}");
            }
            Note::Trouble(Trouble::Restarted) => tracing::warn!("{address}: on the bus again"),
            Note::Trouble(Trouble::Error) => {
                count(&tally.bus_errors);
                if !std::mem::replace(&mut self.is_error_logged, true) {
                    tracing::warn!(
                        "{address}: errors on the bus: check the bit rate, the termination, and that another node acknowledges"
                    );
                }
            }
            Note::Gone(error) => tracing::warn!("{address} is lost ({error}): trying to reopen it"),
            // The other end of a loopback closed.
            Note::Ended(error) => tracing::debug!("{address} has ended: {error}"),
            Note::Back => {
                count(&tally.reconnects);
                tracing::warn!("{address} is back");
            }
        }
    }
}

pub(super) fn refused(url: &Address, settings: &Settings, source: Refusal) -> LinkError {
    let url = if url.target.is_empty() {
        format!("{}://{}", url.scheme, settings.place)
    } else {
        url.text.clone()
    };
    LinkError::Refused { url, source }
}
