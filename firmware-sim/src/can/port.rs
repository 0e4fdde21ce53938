//! The flight computer's end of a bus: whole packets, over SocketCAN or an adapter.

use super::carrier::{self, Above, Next, Note, Waker};
use super::settings::{self, Settings};
use super::{CanBus, OpenBus, Opener, slcan, socket};
use crate::port::{Notify, Opened, Port, PortError, Scheme};
use skyloop_protocols::can::{Node, Side};
use std::io::{self, ErrorKind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// `can://INTERFACE?bitrate=N&fd=N&load=X`.
pub(crate) const CAN: Scheme = Scheme {
    name: "can",
    example: "can://vcan0?bitrate=500000",
    keys: settings::KEYS,
    open: |address| open("can", Settings::of(address)?, socket::open),
};

/// `slcan://DEVICE?bitrate=N&fd=N&load=X&baud=N`.
pub(crate) const SLCAN: Scheme = Scheme {
    name: "slcan",
    example: "slcan:///dev/NAME?bitrate=500000",
    keys: settings::ADAPTER_KEYS,
    open: |address| open("slcan", slcan::settings(address)?, slcan::open),
};

const REMEDY: &str =
    "check the adapter's cable, the interface (ip link), or what made the line (skyloop pty)";
/// Maximum number of notices, for a line that repeatedly goes down and comes back.
const MAX_NOTICES: u32 = 20;
/// Packets that may wait for sending.
const OUTBOUND: usize = 16;
/// Packets that may wait for reading: many credit windows.
const INBOUND: usize = 1024;
/// After this time a packet is dropped if the bus accepts no frames.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);
/// Time to empty the queue at the end.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// After this silence the emulator is considered gone: a full queue or the end no longer blocks.
const SILENCE: Duration = Duration::from_secs(2);
/// Time to empty the queue at the end in such a silence: a short command needs no reply.
const SILENT_CLOSE_TIMEOUT: Duration = Duration::from_millis(100);

fn open(scheme: &str, settings: Settings, open: OpenBus) -> Opened {
    let link = format!("{scheme}://{}", settings.place);
    let opened = super::open(open, &settings).map_err(|source| PortError::Refused {
        link: link.clone(),
        source,
    });
    let (bus, opener) = opened?;
    let port = CanPort::over(&link, bus, Some(opener), &settings)?;
    Ok(Box::new(port))
}

/// A CAN bus as a packet port.
pub struct CanPort {
    link: String,
    /// None once the port is closed.
    to_bus: Option<SyncSender<Vec<u8>>>,
    from_bus: Receiver<Vec<u8>>,
    settings: Settings,
    waker: Waker,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// Whether the last packet timed out. The next ones do not wait.
    stuck: bool,
    /// Time of the last received packet.
    last_received: Instant,
    /// Whether a lost line is reopened.
    opens_again: bool,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    dropped: AtomicU64,
    gone: Mutex<Option<io::Error>>,
    notify: Mutex<Option<Notify>>,
}

impl Shared {
    /// A poisoned lock is used: its value is valid at any time.
    fn gone(&self) -> MutexGuard<'_, Option<io::Error>> {
        self.gone.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn notify(&self) -> MutexGuard<'_, Option<Notify>> {
        self.notify.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_gone(&self) -> bool {
        self.gone().is_some()
    }

    fn drop_some(&self, more: u32) {
        self.dropped.fetch_add(more.into(), Ordering::Relaxed);
    }
}

impl CanPort {
    fn is_silent(&self) -> bool {
        self.last_received.elapsed() >= SILENCE
    }

    /// Uses an open bus; with an `opener`, a lost bus is reopened.
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
            link: link.into(),
            outbound,
            inbound,
            shared: Arc::clone(&shared),
            notices: 0,
        };
        let node = Node::new(Side::Client, settings.fd);
        let opens_again = opener.is_some();
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
            stuck: false,
            last_received: Instant::now(),
            opens_again,
        })
    }
}

struct End {
    link: String,
    outbound: Receiver<Vec<u8>>,
    inbound: SyncSender<Vec<u8>>,
    shared: Arc<Shared>,
    notices: u32,
}

impl End {
    /// Records that the line is gone or back, and prints a notice.
    fn set_gone(&mut self, error: Option<io::Error>) {
        let text = match &error {
            Some(error) => format!(
                "warning: {}: the line has gone ({error}) and will be reopened: {REMEDY}",
                self.link
            ),
            None => format!("{}: the line is back", self.link),
        };
        *self.shared.gone() = error;
        self.notices += 1;
        if self.notices <= MAX_NOTICES
            && let Some(notify) = &*self.shared.notify()
        {
            notify(&text);
        }
    }
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
            // Queued packets are still sent.
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
            Note::Gone(error) => self.set_gone(Some(error)),
            Note::Back => self.set_gone(None),
            // The queue ends too; `recv` reports that.
            Note::Ended(error) => *self.shared.gone() = Some(error),
            Note::Moved(_) | Note::Trouble(_) => {}
        }
    }
}

impl Port for CanPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let failed = |error| PortError::io(&self.link, "cannot send", error);
        let Some(to_bus) = &self.to_bus else {
            return Err(PortError::Closed);
        };
        let timeout = if self.stuck { 0 } else { 1 };
        let deadline = Instant::now() + SEND_TIMEOUT * timeout;
        let mut packet = packet.to_vec();
        loop {
            // While the line is gone, packets are dropped.
            if self.opens_again && self.shared.is_gone() {
                self.shared.drop_some(1);
                return Ok(());
            }
            let silent = self.is_silent();
            match to_bus.try_send(packet) {
                Ok(()) => {
                    self.stuck = false;
                    self.waker.wake();
                    return Ok(());
                }
                Err(TrySendError::Full(_)) if silent => {
                    self.shared.drop_some(1);
                    return Ok(());
                }
                Err(TrySendError::Full(back)) if Instant::now() < deadline => packet = back,
                Err(TrySendError::Full(_)) => {
                    self.stuck = true;
                    let why =
                        "the bus takes no frames: is another node on it, with the same bit rate?";
                    return Err(failed(io::Error::new(ErrorKind::TimedOut, why)));
                }
                Err(TrySendError::Disconnected(_)) => {
                    let broken = failed(ErrorKind::BrokenPipe.into());
                    return Err(self.gone().unwrap_or(broken));
                }
            }
            std::thread::sleep(Duration::from_micros(500));
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        match self.from_bus.recv_timeout(timeout) {
            Ok(packet) => {
                self.last_received = Instant::now();
                Ok(Some(packet))
            }
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                let broken = ErrorKind::BrokenPipe.into();
                let error = PortError::io(&self.link, "cannot receive", broken);
                Err(self.gone().unwrap_or(error))
            }
        }
    }

    fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }

    fn airtime(&self, bytes: usize) -> Duration {
        self.settings.packet_duration(bytes)
    }

    fn name(&self) -> &str {
        &self.link
    }

    fn gone(&self) -> Option<PortError> {
        let gone = self.shared.gone();
        let error = gone.as_ref()?;
        Some(PortError::Gone {
            link: self.link.clone(),
            source: io::Error::new(error.kind(), error.to_string()),
            remedy: REMEDY,
        })
    }

    fn on_notice(&mut self, notify: Notify) {
        *self.shared.notify() = Some(notify);
    }
}

impl Drop for CanPort {
    fn drop(&mut self) {
        self.to_bus = None;
        self.waker.wake();
        let Some(thread) = self.thread.take() else {
            return;
        };
        let timeout = if self.is_silent() {
            SILENT_CLOSE_TIMEOUT
        } else {
            CLOSE_TIMEOUT
        };
        let deadline = Instant::now() + timeout;
        // On a lost or stuck line, queued packets are dropped.
        while !thread.is_finished()
            && !self.stuck
            && !self.shared.is_gone()
            && Instant::now() < deadline
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        // A thread blocked in a write ends with the process.
        self.shared.stop.store(true, Ordering::Relaxed);
    }
}
