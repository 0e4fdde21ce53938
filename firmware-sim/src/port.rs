//! The flight computer's end of a link: whole packets out, whole packets in.

use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

use skyloop_protocols::EncodeError;
use thiserror::Error;

/// A link that carries packets. An implementation keeps packet boundaries; it may lose, repeat or damage packets.
pub trait Port {
    /// Sends one packet.
    ///
    /// # Errors
    /// [`PortError`] when the link is gone.
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError>;

    /// Waits for the next packet, `timeout` at most; `None` if none came.
    ///
    /// # Errors
    /// [`PortError`] when the link is gone.
    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError>;

    /// Packets that the link itself had to drop: damaged ones, or a full queue.
    fn dropped(&self) -> u64 {
        0
    }

    /// How long the line takes for a packet of so many octets; zero if the line is not what limits, or not known.
    fn airtime(&self, octets: usize) -> Duration {
        let _ = octets;
        Duration::ZERO
    }

    /// Packets that may be under way to it at once: as many as it takes while nobody reads.
    fn window(&self) -> u32 {
        64
    }

    /// What to call it, for people.
    fn name(&self) -> &str {
        "a link"
    }

    /// Why nothing passes, if the line has gone and is waited for; what is sent meanwhile is lost, and counted as dropped.
    fn gone(&self) -> Option<PortError> {
        None
    }

    /// Whom to tell at once, from any thread, that the line has gone or is back.
    fn on_news(&mut self, tell: Tell) {
        drop(tell);
    }

    /// Whether the other end's system has said that nobody listens there.
    fn is_unheard(&self) -> bool {
        false
    }
}

/// Takes a line of text for people.
pub type Tell = Box<dyn Fn(&str) + Send>;

impl<P: Port + ?Sized> Port for Box<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        (**self).send(packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        (**self).recv(timeout)
    }

    fn dropped(&self) -> u64 {
        (**self).dropped()
    }

    fn airtime(&self, octets: usize) -> Duration {
        (**self).airtime(octets)
    }

    fn window(&self) -> u32 {
        (**self).window()
    }

    fn name(&self) -> &str {
        (**self).name()
    }

    fn gone(&self) -> Option<PortError> {
        (**self).gone()
    }

    fn on_news(&mut self, tell: Tell) {
        (**self).on_news(tell);
    }

    fn is_unheard(&self) -> bool {
        (**self).is_unheard()
    }
}

/// Why a link cannot be opened or used.
#[derive(Debug, Error)]
pub enum PortError {
    /// The other end of an in-process link was dropped.
    #[error("the other end of the link is gone")]
    Closed,
    /// The operating system refuses.
    #[error("{link}: {what}: {source}")]
    Io {
        /// The link's address.
        link: String,
        /// What was tried.
        what: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The line that the link runs over has gone.
    #[error("{link}: the line has gone ({source}): {remedy}")]
    Gone {
        /// The link's address.
        link: String,
        /// The system's answer.
        source: io::Error,
        /// What to do.
        remedy: &'static str,
    },
    /// It cannot be opened, for a reason that has a remedy.
    #[error("{link}: {source}")]
    Refused {
        /// The link's address.
        link: String,
        /// What was tried, and what to do.
        source: Refusal,
    },
    /// A message that does not fit a packet.
    #[error("cannot lay out a packet: {0}")]
    Encode(#[from] EncodeError),
    /// The text names no link.
    #[error("\"{text}\" names no link: {reason}; give {examples}")]
    Address {
        /// The text.
        text: String,
        /// What is wrong with it.
        reason: String,
        /// Addresses that would be right.
        examples: String,
    },
}

impl PortError {
    /// What the system answered when `what` was tried on `link`.
    pub(crate) fn io(link: &str, what: &'static str, source: io::Error) -> Self {
        Self::Io {
            link: link.into(),
            what,
            source,
        }
    }
}

/// Why a device or an interface cannot be opened, and what to do.
#[derive(Debug, Error)]
#[error("cannot {action}: {source}; {remedy}")]
pub struct Refusal {
    /// What was tried.
    pub action: &'static str,
    /// The system's answer.
    pub source: io::Error,
    /// What to do.
    pub remedy: String,
}

impl Refusal {
    /// Why the serial port `path` cannot be opened.
    #[must_use]
    pub fn of_serial_port(path: &str, error: serialport::Error) -> Self {
        let place = Path::new(path);
        let text = error.description.to_lowercase();
        let remedy = if !place.exists() {
            "check that the device exists: its name and its cable"
        } else if place.is_dir() || place.is_file() || text.contains("typewriter") {
            "this is no serial port: name a device such as /dev/ttyUSB0"
        } else if matches!(
            error.kind(),
            serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied)
        ) {
            "you may not use the device: join the group that owns it (see ls -l; often dialout)"
        } else if text.contains("busy") || text.contains("lock") {
            "another program has it open: end that one, or choose another port"
        } else {
            "check that the device is a serial port and takes this baud rate"
        };
        Self {
            action: "open the serial port",
            source: error.into(),
            remedy: remedy.to_string(),
        }
    }
}

/// A kind of link that an address can name.
pub struct Scheme {
    /// What its addresses begin with, before `://`.
    pub name: &'static str,
    /// An address, for messages.
    pub example: &'static str,
    /// Opens what stands behind `://`.
    pub open: fn(&str) -> Result<Box<dyn Port + Send>, OpenError>,
}

/// Why the rest of an address opens nothing.
pub enum OpenError {
    /// It is no address of this scheme.
    Wrong(String),
    /// It cannot be opened.
    Failed(PortError),
}

impl From<PortError> for OpenError {
    fn from(error: PortError) -> Self {
        Self::Failed(error)
    }
}

/// Packets through memory, between two threads of a process.
#[derive(Debug)]
pub struct ChannelPort {
    to_emulator: Sender<Vec<u8>>,
    from_emulator: Receiver<Vec<u8>>,
}

impl ChannelPort {
    /// A port over the two directions of a channel pair.
    #[must_use]
    pub fn new(to_emulator: Sender<Vec<u8>>, from_emulator: Receiver<Vec<u8>>) -> Self {
        Self {
            to_emulator,
            from_emulator,
        }
    }
}

impl Port for ChannelPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        self.to_emulator
            .send(packet.to_vec())
            .map_err(|_| PortError::Closed)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        match self.from_emulator.recv_timeout(timeout) {
            Ok(packet) => Ok(Some(packet)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(PortError::Closed),
        }
    }
}
