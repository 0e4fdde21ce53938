//! Packets over UDP: one a datagram.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use skyloop_protocols::MAX_PACKET;

use crate::port::{OpenError, Port, PortError, Scheme};

/// `udp://ADDRESS:PORT`.
pub const UDP: Scheme = Scheme {
    name: "udp",
    example: "udp://127.0.0.1:PORT",
    open: |address| {
        let wrong = |_| OpenError::Wrong(format!("\"{address}\" is no IP address and port"));
        let address = address.parse().map_err(wrong)?;
        Ok(Box::new(UdpPort::connect(address)?))
    },
};

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
