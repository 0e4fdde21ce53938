//! Packets over a serial line or a pseudo-terminal: SLIP frames.

use std::io::{self, ErrorKind};
use std::ops::RangeInclusive;
use std::time::Duration;

use skyloop_protocols::slip;

use crate::address::Address;
use crate::port::{Port, PortError, Refusal, Scheme};
use crate::reader::{READ_TIMEOUT, Reader};

/// How long a write may be stuck: a line whose other end does not read is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);

/// What brings a device back; it is not waited for.
const REMEDY: &str = "check its cable, or what made the device (skyloop run on pty://, skyloop pty), and start again";

/// Baud rates that a line may have. At the lowest a packet takes 1.5 s: the first must come within the 2 s after
/// which the emulator mutes a client that grants no credit.
const BAUD: RangeInclusive<u32> = 9_600..=3_000_000;

/// `serial://PATH?baud=N`.
pub const SERIAL: Scheme = Scheme {
    name: "serial",
    example: "serial:///dev/NAME?baud=115200",
    keys: &["baud"],
    open: |address| {
        let baud = baud_of(address, 115_200)?;
        Ok(Box::new(SerialPort::open(&address.target, baud)?))
    },
};

/// The baud rate that an address states; `default` where it does not.
///
/// # Errors
/// The reason, if it is no valid baud rate.
pub fn baud_of(address: &Address, default: u32) -> Result<u32, String> {
    Ok(address.whole_in("baud", BAUD)?.unwrap_or(default))
}

/// A serial port that carries packets.
pub struct SerialPort {
    link: String,
    line: Box<dyn serialport::SerialPort>,
    /// Bit/s; none: not known.
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

    /// Takes over an open serial port.
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
        let reader = Reader::start("skyloop-fc serial", move |intake| {
            let count = input.read(&mut chunk)?;
            for byte in &chunk[..count] {
                match decoder.push(*byte) {
                    None => {}
                    Some(Err(_)) => intake.lose(1),
                    Some(Ok(packet)) => intake.take(packet),
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

    /// A line that is only stuck is there still.
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
        const AROUND: usize = 6;
        /// Start bit, octet, stop bit.
        const BITS: f64 = 10.0;
        let baud = self.baud.filter(|baud| *baud > 0).map(f64::from);
        baud.map_or(Duration::ZERO, |baud| {
            Duration::from_secs_f64(BITS * (bytes + AROUND) as f64 / baud)
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
    fn a_pseudo_terminal_carries_packets_and_garbage_is_counted() {
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
        // More than the 20,480 octets that a pseudo-terminal swallows before it blocks: the thread must read on.
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
    fn a_device_that_goes_is_named_with_the_remedy() {
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
