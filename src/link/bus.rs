//! Packets on a CAN bus (SocketCAN or adapter): the emulator's end of a carrier.

use super::error::LinkError;
use super::inbox::{Inbound, Intake, inbox};
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

/// The bus of a loopback at `place`: FD at the highest rates, unless the URL says otherwise.
///
/// # Errors
/// The reason, if an option is wrong.
pub(super) fn loopback_settings(url: &Address, place: &str) -> Result<Settings, String> {
    let mut settings = Settings::new(place);
    (settings.rates.bitrate, settings.rates.load) = (1_000_000, 1.0);
    if url.value("bitrate").is_none() && socket::carries_fd(place) {
        (settings.fd, settings.rates.data_bitrate) = (true, 8_000_000);
    }
    settings.apply(url)?;
    Ok(settings)
}

/// Opens the bus of `settings`, reopens it when it is gone, and carries packets over it.
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

/// Carries packets over an open bus; with an `opener` the link survives that the bus goes.
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
        told: false,
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

/// Puts instruments around an open bus, and each time it is opened again.
fn around(
    around: AroundBus,
    bus: Box<dyn CanBus>,
    opener: Option<Opener>,
) -> (Box<dyn CanBus>, Option<Opener>) {
    let bus = around(bus);
    let opener = opener.map(|mut open| -> Opener { Box::new(move || Ok(around(open()?))) });
    (bus, opener)
}

/// The carrier's end.
struct End {
    departures: Receiver<Outbound>,
    arrivals: Intake,
    watch: Box<dyn Fn() -> bool + Send>,
    tally: Arc<Tally>,
    address: String,
    /// Whether the log tells already that the bus is in trouble.
    told: bool,
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
        self.told = false;
        self.arrivals.push(Inbound::new(0, packet, at)).is_ok()
    }

    fn is_wanted(&self) -> bool {
        (self.watch)()
    }

    fn ended(&mut self, packet: Bytes, is_sent: bool) {
        if is_sent {
            self.tally.done();
        } else {
            self.tally.let_go(is_of_frame(&packet), Unsent::NotRead);
        }
    }

    fn note(&mut self, note: Note) {
        let tally = &self.tally;
        let address = &self.address;
        let some = |counter: &AtomicU32, more| {
            counter.fetch_add(more, Ordering::Relaxed);
        };
        match note {
            Note::Moved(bytes) => tally.moved(bytes),
            Note::Unsent(more) => some(&tally.lost, more),
            Note::Incomplete(more) => some(&tally.incomplete, more),
            Note::Oversize(more) => some(&tally.oversize, more),
            Note::Garbled(more) => some(&tally.bad_framing, more),
            Note::Trouble(Trouble::BusOff) => {
                count(&tally.bus_off);
                count(&tally.bus_errors);
                let restart = if address.starts_with("slcan") {
                    "the adapter is closed and opened again"
                } else {
                    "it waits for a restart (`ip link set NAME type can restart-ms 100` makes it automatic)"
                };
                tracing::warn!(
                    "{address}: bus-off, the controller has left the bus after too many errors: {restart}"
                );
            }
            Note::Trouble(Trouble::Restarted) => tracing::warn!("{address}: on the bus again"),
            Note::Trouble(Trouble::Error) => {
                count(&tally.bus_errors);
                if !std::mem::replace(&mut self.told, true) {
                    tracing::warn!(
                        "{address}: errors on the bus: check its bit rate, its termination, and that another node is there to acknowledge"
                    );
                }
            }
            Note::Gone(error) => tracing::warn!("{address} has gone ({error}): waiting for it"),
            // The other end of a loopback has hung up.
            Note::Ended(error) => tracing::debug!("{address} has ended: {error}"),
            Note::Back => {
                count(&tally.reconnects);
                tracing::warn!("{address} is back");
            }
        }
    }
}

/// The error for a bus that cannot be opened.
pub(super) fn refused(url: &Address, settings: &Settings, source: Refusal) -> LinkError {
    let url = if url.target.is_empty() {
        format!("{}://{}", url.scheme, settings.place)
    } else {
        url.text.clone()
    };
    LinkError::Refused { url, source }
}
