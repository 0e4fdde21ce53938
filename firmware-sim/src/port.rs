//! The flight computer's end of a link: whole packets out, whole packets in.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use skyloop_protocols::{EncodeError, MAX_PACKET};
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
}

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
    /// A message that does not fit a packet.
    #[error("cannot lay out a packet: {0}")]
    Encode(#[from] EncodeError),
    /// The text names no link.
    #[error(
        "\"{text}\" names no link: {reason}; give udp://127.0.0.1:PORT or serial:///dev/NAME?baud=115200"
    )]
    Address {
        /// The text.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// One packet a datagram.
#[derive(Debug)]
pub struct UdpPort {
    socket: UdpSocket,
    link: String,
}

impl UdpPort {
    /// A socket on a free port that hears `emulator` only. It binds to the loopback address if `emulator` has one.
    ///
    /// # Errors
    /// [`PortError::Io`].
    pub fn connect(emulator: SocketAddr) -> Result<Self, PortError> {
        let link = format!("udp://{emulator}");
        let local: SocketAddr = match (emulator.ip().is_loopback(), emulator.is_ipv4()) {
            (true, true) => ([127, 0, 0, 1], 0).into(),
            (true, false) => (std::net::Ipv6Addr::LOCALHOST, 0).into(),
            (false, true) => ([0, 0, 0, 0], 0).into(),
            (false, false) => (std::net::Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket =
            UdpSocket::bind(local).and_then(|socket| socket.connect(emulator).map(|()| socket));
        match socket {
            Ok(socket) => Ok(Self { socket, link }),
            Err(source) => Err(PortError::Io {
                link,
                what: "cannot open a socket",
                source,
            }),
        }
    }

    fn failed(&self, what: &'static str, source: io::Error) -> PortError {
        PortError::Io {
            link: self.link.clone(),
            what,
            source,
        }
    }
}

impl Port for UdpPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let sent = match self.socket.send(packet) {
            // This answers an earlier datagram that met nobody; this one has not been tried yet.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => self.socket.send(packet),
            sent => sent,
        };
        match sent {
            Ok(_) => Ok(()),
            // Nobody listens: a datagram lost like any other.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(()),
            Err(error) => Err(self.failed("cannot send", error)),
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let deadline = Instant::now() + timeout;
        // One octet more than a packet may have: longer datagrams stay too long, and are refused as such.
        let mut buffer = [0; MAX_PACKET + 1];
        loop {
            let left = deadline
                .saturating_duration_since(Instant::now())
                .max(Duration::from_micros(50));
            self.socket
                .set_read_timeout(Some(left))
                .map_err(|error| self.failed("cannot set a time-out", error))?;
            match self.socket.recv(&mut buffer) {
                Ok(length) => return Ok(Some(buffer[..length].to_vec())),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(None),
                    ErrorKind::Interrupted | ErrorKind::ConnectionRefused
                        if Instant::now() < deadline => {}
                    ErrorKind::Interrupted | ErrorKind::ConnectionRefused => return Ok(None),
                    _ => return Err(self.failed("cannot receive", error)),
                },
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn udp_carries_datagrams_both_ways_and_survives_an_absent_peer() {
        let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = peer.local_addr().unwrap();
        let mut port = UdpPort::connect(address).unwrap();
        port.send(b"ping").unwrap();
        let mut buffer = [0; 16];
        let (length, client) = peer.recv_from(&mut buffer).unwrap();
        assert_eq!(&buffer[..length], b"ping");
        peer.send_to(b"pong", client).unwrap();
        assert_eq!(port.recv(Duration::from_secs(5)).unwrap().unwrap(), b"pong");
        assert_eq!(port.recv(Duration::from_millis(5)).unwrap(), None);
        drop(peer);
        for _ in 0..3 {
            port.send(b"anybody?").unwrap();
            assert_eq!(port.recv(Duration::from_millis(5)).unwrap(), None);
        }
    }
}
