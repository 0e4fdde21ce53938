//! The flight computer's end of a bus: whole packets, over SocketCAN or an adapter.

use super::carrier::{self, Above, Next, Note, Waker};
use super::settings::Settings;
use super::{CanBus, Opener, slcan, socket};
use crate::port::{OpenError, Port, PortError, Refusal, Scheme};
use skyloop_protocols::can::{Node, Side};
use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// `can://INTERFACE?bitrate=N&fd=N&load=X`.
pub const CAN: Scheme = Scheme {
    name: "can",
    example: "can://vcan0?bitrate=500000",
    open: |text| {
        let settings =
            Settings::parse(text, &["bitrate", "fd", "load"]).map_err(OpenError::Wrong)?;
        open("can", settings, socket::open)
    },
};

/// `slcan://DEVICE?bitrate=N&fd=N&load=X&baud=N`.
pub const SLCAN: Scheme = Scheme {
    name: "slcan",
    example: "slcan:///dev/NAME?bitrate=500000",
    open: |text| {
        let mut settings =
            Settings::parse(text, &["bitrate", "fd", "load", "baud"]).map_err(OpenError::Wrong)?;
        settings.baud.get_or_insert(slcan::BAUD);
        slcan::commands(&settings).map_err(OpenError::Wrong)?;
        open("slcan", settings, slcan::open)
    },
};

/// Packets that may wait to be sent.
const OUTBOUND: usize = 16;
/// Packets that may wait to be read: many credit windows.
const INBOUND: usize = 1024;
/// How long a packet waits for a bus that takes nothing: it is gone then.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);
/// How long what is queued may take to leave at the end.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

type OpenBus = fn(&Settings) -> Result<Box<dyn CanBus>, Refusal>;

fn open(
    scheme: &str,
    settings: Settings,
    open: OpenBus,
) -> Result<Box<dyn Port + Send>, OpenError> {
    let link = format!("{scheme}://{}", settings.place);
    let bus = open(&settings).map_err(|source| PortError::Refused {
        link: link.clone(),
        source,
    })?;
    let again = settings.clone();
    let opener: Opener = Box::new(move || open(&again));
    Ok(Box::new(CanPort::over(
        &link,
        bus,
        Some(opener),
        &settings,
    )?))
}

/// A bus that carries packets.
pub struct CanPort {
    link: String,
    /// None once it is closed.
    to_bus: Option<SyncSender<Vec<u8>>>,
    from_bus: Receiver<Vec<u8>>,
    settings: Settings,
    waker: Waker,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What both ends see.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    dropped: AtomicU64,
}

impl Shared {
    fn drop_some(&self, more: u32) {
        self.dropped.fetch_add(more.into(), Ordering::Relaxed);
    }
}

impl CanPort {
    /// Takes over an open bus; with an `opener` it survives that the bus goes.
    ///
    /// # Errors
    /// [`PortError::Io`] if the system gives no threads.
    pub fn over(
        link: &str,
        bus: Box<dyn CanBus>,
        opener: Option<Opener>,
        settings: &Settings,
    ) -> Result<Self, PortError> {
        let (to_bus, outbound) = sync_channel(OUTBOUND);
        let (inbound, from_bus) = sync_channel(INBOUND);
        let shared = Arc::new(Shared::default());
        let end = End {
            outbound,
            inbound,
            shared: Arc::clone(&shared),
        };
        let node = Node::new(Side::Client, settings.fd);
        let (waker, thread) =
            carrier::start("skyloop-fc can", bus, opener, node, settings.rates, end)
                .map_err(|error| PortError::io(link, "cannot start its threads", error))?;
        Ok(Self {
            link: link.into(),
            to_bus: Some(to_bus),
            from_bus,
            settings: settings.clone(),
            waker,
            shared,
            thread: Some(thread),
        })
    }
}

/// The carrier's end.
struct End {
    outbound: Receiver<Vec<u8>>,
    inbound: SyncSender<Vec<u8>>,
    shared: Arc<Shared>,
}

impl Above for End {
    type Packet = Vec<u8>;

    fn next(&mut self) -> Next<Vec<u8>> {
        match self.outbound.try_recv() {
            Ok(packet) => Next::Packet(packet),
            Err(TryRecvError::Empty) => Next::Nothing,
            Err(TryRecvError::Disconnected) => Next::Closed,
        }
    }

    fn arrived(&mut self, packet: &[u8], _: Instant) -> bool {
        match self.inbound.try_send(packet.to_vec()) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.shared.drop_some(1);
                true
            }
            // What is queued to leave still does.
            Err(TrySendError::Disconnected(_)) => true,
        }
    }

    fn is_wanted(&self) -> bool {
        !self.shared.stop.load(Ordering::Relaxed)
    }

    fn note(&mut self, note: Note) {
        match note {
            Note::Unsent(more)
            | Note::Incomplete(more)
            | Note::Oversize(more)
            | Note::Garbled(more) => {
                self.shared.drop_some(more);
            }
            Note::Moved(_)
            | Note::Done
            | Note::Trouble(_)
            | Note::Gone(_)
            | Note::Back
            | Note::Ended(_) => {}
        }
    }
}

impl Port for CanPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let failed =
            |kind: ErrorKind| PortError::io(&self.link, "cannot send", io::Error::from(kind));
        let Some(to_bus) = &self.to_bus else {
            return Err(PortError::Closed);
        };
        let deadline = Instant::now() + SEND_TIMEOUT;
        let mut packet = packet.to_vec();
        loop {
            match to_bus.try_send(packet) {
                Ok(()) => {
                    self.waker.wake();
                    return Ok(());
                }
                Err(TrySendError::Full(back)) if Instant::now() < deadline => packet = back,
                Err(TrySendError::Full(_)) => return Err(failed(ErrorKind::TimedOut)),
                Err(TrySendError::Disconnected(_)) => return Err(failed(ErrorKind::BrokenPipe)),
            }
            std::thread::sleep(Duration::from_micros(500));
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        match self.from_bus.recv_timeout(timeout) {
            Ok(packet) => Ok(Some(packet)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                let gone = ErrorKind::BrokenPipe.into();
                Err(PortError::io(&self.link, "cannot receive", gone))
            }
        }
    }

    fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }

    fn airtime(&self, octets: usize) -> Duration {
        self.settings.packet_duration(octets)
    }

    fn name(&self) -> &str {
        &self.link
    }
}

impl Drop for CanPort {
    fn drop(&mut self) {
        self.to_bus = None;
        self.waker.wake();
        let Some(thread) = self.thread.take() else {
            return;
        };
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        while !thread.is_finished() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
        // A thread that the system holds in a write ends with the process.
        self.shared.stop.store(true, Ordering::Relaxed);
    }
}
