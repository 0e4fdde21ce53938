//! A client's end of each link: bytes out, packets in.

use serialport::{SerialPort, TTYPort};
use skyloop_firmware_sim::port::Port;
use skyloop_protocols::slip;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::UdpSocket;
use std::time::{Duration, Instant};

/// A client's end.
pub trait Line {
    /// Sends one packet, which may be invalid.
    fn send(&mut self, packet: &[u8]);
    /// The next packet, or `None` after `timeout`.
    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>>;
}

impl<L: Line + ?Sized> Line for Box<L> {
    fn send(&mut self, packet: &[u8]) {
        (**self).send(packet);
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        (**self).recv(timeout)
    }
}

/// One packet a datagram.
pub struct UdpLine(pub UdpSocket);

impl UdpLine {
    /// A socket connected to `udp://ADDRESS:PORT`.
    pub fn to(address: &str) -> UdpLine {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket
            .connect(address.strip_prefix("udp://").unwrap())
            .unwrap();
        UdpLine(socket)
    }

    /// Another client of the same emulator.
    pub fn another(&self) -> UdpLine {
        UdpLine::to(&format!("udp://{}", self.0.peer_addr().unwrap()))
    }
}

impl Line for UdpLine {
    fn send(&mut self, packet: &[u8]) {
        self.0.send(packet).unwrap();
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        self.0
            .set_read_timeout(Some(timeout.max(Duration::from_millis(1))))
            .unwrap();
        let mut buffer = [0; 2048];
        loop {
            match self.0.recv(&mut buffer) {
                // ICD, section 5.1: the client returns a Challenge unchanged.
                Ok(length) if is_challenge(&buffer[..length]) => {
                    let _ = self.0.send(&buffer[..length]);
                }
                Ok(length) => return Some(buffer[..length].to_vec()),
                // The emulator had closed when a Credit arrived; received packets are still queued.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                Err(_) => return None,
            }
        }
    }
}

/// Whether a packet is a Challenge: APID 0x20B in the last 11 bits of its first two bytes.
pub fn is_challenge(packet: &[u8]) -> bool {
    matches!(packet, [first, second, ..] if [first & 7, *second] == [0x02, 0x0B])
}

/// The in-process link's own port.
pub struct MemoryLine(pub Box<dyn Port + Send>);

impl Line for MemoryLine {
    fn send(&mut self, packet: &[u8]) {
        self.0.send(packet).unwrap();
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        self.0.recv(timeout).unwrap()
    }
}

/// The near end of a pseudo-terminal, in SLIP.
pub struct PtyLine {
    near: TTYPort,
    /// Holds the far end's device open until the emulator opens it by its path.
    _far: Option<TTYPort>,
    decoder: slip::Decoder<{ slip::BUFFER }>,
    packets: VecDeque<Vec<u8>>,
}

/// Opens a serial port. A port that was open in this process shortly before may still be locked: a
/// child process of another test inherits it and holds it until it runs its program.
pub fn open_port(name: &str, baud: u32) -> TTYPort {
    let deadline = Instant::now() + Duration::from_secs(2);
    loop {
        match serialport::new(name, baud).open_native() {
            Err(error)
                if error.kind() == serialport::ErrorKind::NoDevice && Instant::now() < deadline =>
            {
                std::thread::sleep(Duration::from_millis(10));
            }
            opened => return opened.unwrap(),
        }
    }
}

impl PtyLine {
    /// A pseudo-terminal, and the path of its far end.
    pub fn new() -> (PtyLine, String) {
        let (near, far) = TTYPort::pair().unwrap();
        let device = far.name().unwrap();
        let decoder = slip::Decoder::new();
        (
            PtyLine {
                near,
                _far: Some(far),
                decoder,
                packets: VecDeque::new(),
            },
            device,
        )
    }

    /// Opens the port called `name`, as a client does.
    pub fn at(name: &str) -> PtyLine {
        PtyLine {
            near: open_port(name, 115_200),
            _far: None,
            decoder: slip::Decoder::new(),
            packets: VecDeque::new(),
        }
    }

    /// Sends bytes without SLIP.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.near.write_all(bytes).unwrap();
    }
}

impl Line for PtyLine {
    fn send(&mut self, packet: &[u8]) {
        let mut line = Vec::new();
        slip::encode(packet, &mut |byte| line.push(byte));
        self.raw(&line);
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        let deadline = Instant::now() + timeout;
        self.near.set_timeout(Duration::from_millis(10)).unwrap();
        let mut buffer = [0; 4096];
        while self.packets.is_empty() {
            match self.near.read(&mut buffer) {
                Ok(length) => {
                    for byte in &buffer[..length] {
                        if let Some(packet) = self.decoder.push(*byte) {
                            self.packets
                                .push_back(packet.expect("a good serial frame").to_vec());
                        }
                    }
                }
                Err(_) if Instant::now() < deadline => {}
                Err(_) => return None,
            }
        }
        self.packets.pop_front()
    }
}
