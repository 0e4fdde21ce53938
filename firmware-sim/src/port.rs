//! The flight computer's end of a link: whole packets out, whole packets in.

use std::io;
use std::path::Path;
use std::time::Duration;

use skyloop_protocols::EncodeError;
use thiserror::Error;

use crate::address::{Address, OpenError};

/// A link that carries packets. An implementation keeps packet boundaries; it may lose, repeat or damage packets.
/// It gives a [`PortError`] when the link is gone.
pub trait Port {
    /// Sends one packet.
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError>;

    /// Waits for the next packet, `timeout` at most; `None` if none came.
    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError>;

    /// Packets that the link dropped: damaged ones, or for want of room.
    fn dropped(&self) -> u64 {
        0
    }

    /// Transmission time of a packet; zero if the line is not the limit or its speed is unknown.
    fn airtime(&self, _octets: usize) -> Duration {
        Duration::ZERO
    }

    /// Credit window: packets that the receive buffer holds.
    fn window(&self) -> u32 {
        64
    }

    /// Name for messages.
    fn name(&self) -> &str {
        "a link"
    }

    /// Why the line is down, while it is reopened; packets sent meanwhile are dropped.
    fn gone(&self) -> Option<PortError> {
        None
    }

    /// Sets the callback for a line that goes down or comes back; it is called from any thread.
    fn on_notice(&mut self, _tell: Tell) {}

    /// Whether the other end's system has reported that no process listens there.
    fn is_unheard(&self) -> bool {
        false
    }
}

/// Callback that takes a line of text.
pub type Tell = Box<dyn Fn(&str) + Send>;

/// Why a link cannot be opened or used.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum PortError {
    /// The other end of an in-process link was dropped.
    #[error("the other end of the link is gone")]
    Closed,
    /// The operating system refuses.
    #[error("{link}: {what}: {source}")]
    Io {
        link: String,
        what: &'static str,
        source: io::Error,
    },
    /// The line that the link runs over has gone.
    #[error("{link}: the line has gone ({source}): {remedy}")]
    Gone {
        link: String,
        source: io::Error,
        remedy: &'static str,
    },
    /// It cannot be opened, for a reason that has a remedy.
    #[error("{link}: {source}")]
    Refused { link: String, source: Refusal },
    /// A message that does not fit a packet.
    #[error("cannot lay out a packet: {0}")]
    Encode(#[from] EncodeError),
    /// The text names no link.
    #[error("\"{text}\" names no link: {reason}; give {examples}")]
    Address {
        text: String,
        reason: String,
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

/// An open link, or why there is none.
pub type Opened = Result<Box<dyn Port + Send>, OpenError<PortError>>;

/// A kind of link that an address can name.
pub struct Scheme {
    /// What its addresses begin with, before `://`.
    pub name: &'static str,
    /// An address, for messages.
    pub example: &'static str,
    /// Options of its addresses, besides `roles`.
    pub keys: &'static [&'static str],
    /// Opens the link of an address.
    pub open: fn(&Address) -> Opened,
}

impl From<PortError> for OpenError<PortError> {
    fn from(error: PortError) -> Self {
        Self::Failed(error)
    }
}
