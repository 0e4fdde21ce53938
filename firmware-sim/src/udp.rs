//! Packets over UDP: one per datagram.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use skyloop_protocols::packet::{apid, identify};

use crate::datagram::Datagrams;
use crate::port::{Port, PortError, Scheme};
use crate::reader::{READ_TIMEOUT, Reader};

/// `udp://ADDRESS:PORT`.
pub(crate) const UDP: Scheme = Scheme {
    name: "udp",
    example: "udp://127.0.0.1:PORT",
    keys: &[],
    open: |address| {
        let wrong = |_| format!("{:?} is no IP address and port", address.target);
        let emulator = address.target.parse().map_err(wrong)?;
        Ok(Box::new(UdpPort::connect(emulator)?))
    },
};

/// A UDP port: one packet per datagram.
#[derive(Debug)]
pub struct UdpPort {
    socket: UdpSocket,
    link: String,
    reader: Reader,
    /// Whether the other host has reported a closed port.
    is_refused: Arc<AtomicBool>,
    /// Number of packets that the buffers hold.
    window: u32,
}

impl UdpPort {
    /// Opens a socket on a free port for `emulator` only, on the loopback address if `emulator` has
    /// one.
    pub fn connect(emulator: SocketAddr) -> Result<Self, PortError> {
        let link = format!("udp://{emulator}");
        let local: IpAddr = match (emulator.ip().is_loopback(), emulator.is_ipv4()) {
            (true, true) => Ipv4Addr::LOCALHOST.into(),
            (true, false) => Ipv6Addr::LOCALHOST.into(),
            (false, true) => Ipv4Addr::UNSPECIFIED.into(),
            (false, false) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let socket = UdpSocket::bind((local, 0))
            .and_then(|socket| socket.connect(emulator).map(|()| socket))
            .map_err(|error| PortError::io(&link, "cannot open a socket", error))?;
        let is_refused = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_refused);
        let mut window = MIN_WINDOW;
        let reader = socket
            .try_clone()
            .and_then(|socket| {
                socket.set_read_timeout(Some(READ_TIMEOUT))?;
                let mut datagrams = Datagrams::of(&socket)?;
                window = window_of(datagrams.request_buffer(RECEIVE_BUFFER));
                datagrams.join();
                // Longer than any packet, so that an overlong packet is read whole and refused,
                // and joined datagrams fit.
                let mut buffer = vec![0; 1 << 16];
                let answering = socket;
                Reader::start("skyloop-fc udp", move |sink| {
                    let datagram = datagrams
                        .receive(&mut buffer)
                        .inspect_err(|error| note_refusal(&flag, error))?;
                    sink.lose(datagram.lost);
                    let bytes = &buffer[..datagram.length];
                    // An empty datagram is a packet too.
                    for packet in bytes.chunks(datagram.each.max(1)) {
                        if is_challenge(packet) {
                            // If this reply is lost, the emulator repeats the Challenge.
                            let _ = answering.send(packet);
                        } else {
                            sink.take(packet);
                        }
                    }
                    if bytes.is_empty() {
                        sink.take(bytes);
                    }
                    Ok(())
                })
            })
            .map_err(|error| PortError::io(&link, "cannot listen", error))?;
        Ok(Self {
            socket,
            link,
            reader,
            is_refused,
            window,
        })
    }
}

/// Requested receive buffer and a datagram's space in it, bytes; the largest window, packets.
const RECEIVE_BUFFER: usize = 4 << 20;
const DATAGRAM_SPACE: usize = 2304;
const MAX_WINDOW: u32 = 512;
/// Window for the smallest buffer that systems grant.
const MIN_WINDOW: u32 = 64;

/// Window for a receive buffer of this size: three quarters of the packets that fit.
fn window_of(room: Option<usize>) -> u32 {
    let fit = room.map_or(0, |bytes| bytes / DATAGRAM_SPACE * 3 / 4);
    u32::try_from(fit).map_or(MAX_WINDOW, |fit| fit.clamp(MIN_WINDOW, MAX_WINDOW))
}

/// Whether a packet is a Challenge, which is echoed at once (ICD, section 5.1).
fn is_challenge(packet: &[u8]) -> bool {
    identify(packet).is_some_and(|(apid, _)| apid == apid::CHALLENGE)
}

fn note_refusal(is_refused: &AtomicBool, error: &io::Error) {
    if error.kind() == ErrorKind::ConnectionRefused {
        is_refused.store(true, Ordering::Relaxed);
    }
}

impl Port for UdpPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let first = self.socket.send(packet);
        let sent = match first.inspect_err(|error| note_refusal(&self.is_refused, error)) {
            // The error belongs to an earlier datagram to a closed port; this one is not sent yet.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => self.socket.send(packet),
            sent => sent,
        };
        match sent {
            Ok(_) => Ok(()),
            // A closed port: the datagram is lost in transit.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(()),
            Err(error) => Err(PortError::io(&self.link, "cannot send", error)),
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let received = self.reader.recv(timeout);
        received.map_err(|error| PortError::io(&self.link, "cannot receive", error))
    }

    fn dropped(&self) -> u64 {
        self.reader.dropped()
    }

    fn window(&self) -> u32 {
        self.window
    }

    fn name(&self) -> &str {
        &self.link
    }

    fn is_refused(&self) -> bool {
        self.is_refused.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn udp_carries_datagrams_both_ways_and_tolerates_a_closed_peer() {
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
        assert!(!port.is_refused());
        drop(peer);
        for _ in 0..3 {
            port.send(b"ping").unwrap();
            assert_eq!(port.recv(Duration::from_millis(5)).unwrap(), None);
        }
        assert!(port.is_refused() || !cfg!(target_os = "linux"));
    }

    #[test]
    #[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
    fn timed_a_short_wait_is_no_tick_of_the_system() {
        let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut port = UdpPort::connect(peer.local_addr().unwrap()).unwrap();
        let wait = Duration::from_millis(1);
        let waits = (0..50).map(|_| {
            let begin = std::time::Instant::now();
            assert_eq!(port.recv(wait).unwrap(), None);
            begin.elapsed()
        });
        // The shortest of many, because a busy machine lengthens some. A tick is 4 or 10 ms.
        let shortest = waits.min().unwrap();
        let in_time = (wait..3 * wait).contains(&shortest);
        assert!(
            in_time,
            "{shortest:?}: attitudes cannot leave at their rate"
        );
    }
}
