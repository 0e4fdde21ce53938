//! The flight computer's end of a link: sends and receives whole packets.

use std::io;
use std::path::Path;
use std::time::Duration;

use skyloop_protocols::EncodeError;
use thiserror::Error;

use crate::address::{Address, OpenError};

/// A link that carries packets. It keeps packet boundaries, and may lose, repeat or damage packets.
/// A lost link is a [`PortError`].
pub trait Port {
    /// Sends one packet.
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError>;

    /// Waits for the next packet, at most for `timeout`.
    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError>;

    /// Packets dropped by the link: damaged, or without buffer space.
    fn dropped(&self) -> u64 {
        0
    }

    /// Transmission time of a packet; zero if the line is not the limit or its speed is unknown.
    fn airtime(&self, _bytes: usize) -> Duration {
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

    /// The error of a line that is down and being reopened; packets sent meanwhile are dropped.
    fn gone(&self) -> Option<PortError> {
        None
    }

    /// Sets the callback for a line that goes down or comes back; it is called from any thread.
    fn on_notice(&mut self, _notify: Notify) {}

    /// Whether the other host has reported a closed port.
    fn is_refused(&self) -> bool {
        false
    }
}

/// Callback that takes a line of text.
pub(crate) type Notify = Box<dyn Fn(&str) + Send>;

/// Errors of a link.
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
    /// The line of the link is gone.
    #[error("{link}: the line has gone ({source}): {remedy}")]
    Gone {
        link: String,
        source: io::Error,
        remedy: &'static str,
    },
    /// The link cannot be opened; there is a remedy.
    #[error("{link}: {source}")]
    Refused { link: String, source: Refusal },
    /// A message too long for a packet.
    #[error("cannot lay out a packet: {0}")]
    Encode(#[from] EncodeError),
    /// The text is no address of a link.
    #[error("\"{text}\" names no link: {reason}; give {examples}")]
    Address {
        text: String,
        reason: String,
        examples: String,
    },
}

impl PortError {
    /// The system's error of the attempt `what` on `link`.
    pub(crate) fn io(link: &str, what: &'static str, source: io::Error) -> Self {
        Self::Io {
            link: link.into(),
            what,
            source,
        }
    }
}

/// Reason and remedy for a device or interface that cannot be opened.
#[derive(Debug, Error)]
#[error("cannot {action}: {source}; {remedy}")]
pub struct Refusal {
    /// Attempted action.
    pub action: &'static str,
    /// The system's error.
    pub source: io::Error,
    /// Remedy.
    pub remedy: String,
}

impl Refusal {
    /// Reason why the serial port `path` cannot be opened.
    #[must_use]
    pub fn of_serial_port(path: &str, error: serialport::Error) -> Self {
        let device = Path::new(path);
        let text = error.description.to_lowercase();
        let remedy = if !device.exists() {
            "check that the device exists: its name and its cable"
        } else if device.is_dir() || device.is_file() || text.contains("typewriter") {
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

/// An open link, or the error.
pub(crate) type Opened = Result<Box<dyn Port + Send>, OpenError<PortError>>;

/// A kind of link, as named in addresses.
pub(crate) struct Scheme {
    /// Scheme of its addresses, before `://`.
    pub name: &'static str,
    /// An address, for messages.
    pub example: &'static str,
    /// Options of its addresses, without `roles`.
    pub keys: &'static [&'static str],
    /// Opens the link of an address.
    pub open: fn(&Address) -> Opened,
}

impl From<PortError> for OpenError<PortError> {
    fn from(error: PortError) -> Self {
        Self::Failed(error)
    }
}
