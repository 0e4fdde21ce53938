//! Packets as SLIP frames on a serial line or pseudo-terminal.

use std::io::{self, ErrorKind};
use std::ops::RangeInclusive;
use std::time::Duration;

use skyloop_protocols::slip;

use crate::address::Address;
use crate::port::{Port, PortError, Refusal, Scheme};
use crate::reader::{READ_TIMEOUT, Reader};

/// Time-out of a write: a line that accepts nothing this long is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);

/// Remedy for a lost device, which is not reopened.
const REMEDY: &str = "check its cable, or what made the device (skyloop run on pty://, skyloop pty), and start again";

/// Valid baud rates. At the lowest one a packet takes 1.5 s: the first must arrive within 2 s,
/// before the emulator mutes a client without grants.
const BAUD: RangeInclusive<u32> = 9_600..=3_000_000;

/// `serial://PATH?baud=N`.
pub(crate) const SERIAL: Scheme = Scheme {
    name: "serial",
    example: "serial:///dev/NAME?baud=115200",
    keys: &["baud"],
    open: |address| {
        let baud = baud_of(address, 115_200)?;
        Ok(Box::new(SerialPort::open(&address.target, baud)?))
    },
};

/// The baud rate of an address, or `default`.
///
/// # Errors
/// The reason, if the baud rate is invalid.
pub fn baud_of(address: &Address, default: u32) -> Result<u32, String> {
    Ok(address.whole_in("baud", BAUD)?.unwrap_or(default))
}

/// A serial port as a packet port.
pub struct SerialPort {
    link: String,
    line: Box<dyn serialport::SerialPort>,
    /// Bit/s, if known.
    baud: Option<u32>,
    reader: Reader,
}

impl SerialPort {
    /// Opens a serial device or pseudo-terminal: 8 bits, no parity, one stop bit, no flow control.
    ///
    /// # Errors
    /// [`PortError::Io`] with the path.
    pub fn open(path: &str, baud: u32) -> Result<Self, PortError> {
        let line = serialport::new(path, baud).timeout(READ_TIMEOUT).open();
        Self::over(line.map_err(|error| PortError::Refused {
            link: path.to_string(),
            source: Refusal::of_serial_port(path, error),
        })?)
    }

    /// Uses an open serial port.
    ///
    /// # Errors
    /// [`PortError::Io`] if its handle cannot be shared with the reader thread.
    pub fn over(mut line: Box<dyn serialport::SerialPort>) -> Result<Self, PortError> {
        let link = line.name().unwrap_or_else(|| "serial port".into());
        let set_up = |error: serialport::Error| {
            PortError::io(&link, "cannot set up the serial port", error.into())
        };
        let mut input = line.try_clone().map_err(set_up)?;
        input.set_timeout(READ_TIMEOUT).map_err(set_up)?;
        line.set_timeout(WRITE_TIMEOUT).map_err(set_up)?;
        let baud = line.baud_rate().ok();
        let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
        let mut chunk = [0; 4096];
        let reader = Reader::start("skyloop-fc serial", move |sink| {
            let count = input.read(&mut chunk)?;
            for byte in &chunk[..count] {
                match decoder.push(*byte) {
                    None => {}
                    Some(Err(_)) => sink.lose(1),
                    Some(Ok(packet)) => sink.take(packet),
                }
            }
            Ok(())
        })
        .map_err(|error| PortError::io(&link, "cannot start the reader thread", error))?;
        Ok(Self {
            link,
            line,
            baud,
            reader,
        })
    }

    /// The error of a send or receive. A time-out means that the line is blocked, not gone.
    fn failed(&self, what: &'static str, source: io::Error) -> PortError {
        if source.kind() == ErrorKind::TimedOut {
            return PortError::io(&self.link, what, source);
        }
        PortError::Gone {
            link: self.link.clone(),
            source,
            remedy: REMEDY,
        }
    }
}

impl Port for SerialPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let mut bytes = Vec::with_capacity(slip::max_encoded_length(packet.len()));
        slip::encode(packet, &mut |byte| bytes.push(byte));
        self.line
            .write_all(&bytes)
            .map_err(|error| self.failed("cannot send", error))
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let received = self.reader.recv(timeout);
        received.map_err(|error| self.failed("cannot receive", error))
    }

    fn dropped(&self) -> u64 {
        self.reader.dropped()
    }

    fn airtime(&self, bytes: usize) -> Duration {
        /// CRC-32 and two ENDs.
        const OVERHEAD: usize = 6;
        /// Start bit, 8 data bits, stop bit.
        const BITS_PER_BYTE: f64 = 10.0;
        let baud = self.baud.filter(|baud| *baud > 0).map(f64::from);
        baud.map_or(Duration::ZERO, |baud| {
            Duration::from_secs_f64(BITS_PER_BYTE * (bytes + OVERHEAD) as f64 / baud)
        })
    }

    fn name(&self) -> &str {
        &self.link
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use serialport::TTYPort;
    use std::io::{Read, Write};

    #[test]
    fn pseudo_terminals_carry_packets_and_noise_is_counted() {
        let (mut master, slave) = TTYPort::pair().unwrap();
        serialport::SerialPort::set_timeout(&mut master, Duration::from_secs(5)).unwrap();
        let mut port = SerialPort::over(Box::new(slave)).unwrap();

        let packet: Vec<u8> = (0..=255).collect();
        port.send(&packet).unwrap();
        let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
        let mut byte = [0; 1];
        let received = (0..2000).find_map(|_| {
            master.read_exact(&mut byte).unwrap();
            let packet = decoder.push(byte[0])?;
            Some(packet.unwrap().to_vec())
        });
        assert_eq!(received.as_ref(), Some(&packet));

        master.write_all(b"line noise\xC0").unwrap();
        let mut line = Vec::new();
        slip::encode(&packet, &mut |byte| line.push(byte));
        // More than the 20,480 bytes that a pseudo-terminal buffers: the thread must read
        // concurrently.
        for _ in 0..200 {
            master.write_all(&line).unwrap();
        }
        for _ in 0..200 {
            let received = port.recv(Duration::from_secs(5)).unwrap();
            assert_eq!(received.as_ref(), Some(&packet));
        }
        assert_eq!(port.dropped(), 1);
    }

    #[test]
    fn lost_devices_are_reported_with_a_remedy() {
        let (master, slave) = TTYPort::pair().unwrap();
        let mut port = SerialPort::over(Box::new(slave)).unwrap();
        drop(master);
        let begin = std::time::Instant::now();
        let error = loop {
            if let Err(error) = port.recv(Duration::from_millis(10)) {
                break error.to_string();
            }
            assert!(begin.elapsed() < Duration::from_secs(5));
        };
        let sent = port.send(&[1; 100]).unwrap_err().to_string();
        for error in [error, sent] {
            assert!(error.contains("the line has gone ("), "{error}");
            assert!(error.contains("check its cable"), "{error}");
        }
    }
}
