//! Serial ports: SLIP frames with CRC-32, two threads per port. A lost port is reopened.

use super::error::{LinkError, OpenError};
use super::kind::{BothEnds, Link, Options};
use super::line::{self, PacketReader, Put, READ_TIMEOUT, airtime, write};
use super::lock::lock;
#[cfg(target_os = "linux")]
use super::low_latency;
use super::tally::{Airtime, Tally, count};
use super::tx_complete::Unsent;
use super::wire::Wire;
use serialport::SerialPort;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::port::Refusal;
use skyloop_firmware_sim::serial::baud_of;
use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// Serial ports.
pub(crate) const SERIAL: Link = Link {
    scheme: "serial",
    example: "serial:///dev/ttyUSB0?baud=921600",
    is_bus: false,
    keys: &["baud"],
    open,
    loopback,
};

fn open(url: &Address, _: &Options) -> Result<Wire, OpenError> {
    let baud = baud_of(url, 115_200)?;
    let wire = start(url, &url.target, baud, Some(airtime(baud)), false)?;
    Ok(wire)
}

/// Opens the port `path`; in a `loopback`, it closes with its only client.
fn start(
    url: &Address,
    path: &str,
    baud: u32,
    airtime: Option<Airtime>,
    loopback: bool,
) -> Result<Wire, LinkError> {
    let address = format!("serial://{path}?baud={baud}");
    let device = Device {
        path: path.to_string(),
        baud,
        loopback,
    };
    let (input, output) = device.open().map_err(|error| LinkError::Refused {
        url: url.text.clone(),
        source: Refusal::of_serial_port(path, error),
    })?;
    let line = Arc::new(Line {
        device,
        output: Mutex::new(Some(output)),
        back: Condvar::new(),
        losses: AtomicU32::new(0),
        tally: Arc::new(Tally::default()),
    });
    let (reading, tally) = (line.clone(), line.tally.clone());
    let sent = tally.clone();
    let wire = line::start(
        url,
        "serial",
        address,
        &tally,
        move |reader, stop| read(&reading, input, reader, stop),
        move |departures, wanted| {
            write(departures, &sent, |_, bytes, _| line.put(bytes, wanted));
        },
    )?;
    Ok(Wire { airtime, ..wire })
}

struct Device {
    path: String,
    baud: u32,
    /// Whether it closes with the only client of a loopback.
    loopback: bool,
}

type Port = Box<dyn SerialPort>;

impl Device {
    /// Opens a handle for each thread.
    fn open(&self) -> serialport::Result<(Port, Port)> {
        let port = serialport::new(&self.path, self.baud)
            .timeout(READ_TIMEOUT)
            .open_native()?;
        #[cfg(target_os = "linux")]
        if let Err(error) = low_latency::request(&port) {
            tracing::debug!(%error, "{} keeps its driver's latency", self.path);
        }
        let output = port.try_clone()?;
        Ok((Box::new(port), output))
    }
}

/// State shared by the two threads.
struct Line {
    device: Device,
    /// The port to write to. `None` while the writer uses it, and while the device is lost: an open
    /// handle would block the reuse of its name.
    output: Mutex<Option<Port>>,
    back: Condvar,
    /// How often the port was lost: incremented by one thread, compared by the other.
    losses: AtomicU32,
    tally: Arc<Tally>,
}

impl Line {
    /// Counts a loss, unless the number has changed from `known`.
    fn lose(&self, known: u32) {
        let (relaxed, next) = (Ordering::Relaxed, known.wrapping_add(1));
        // On failure the other thread has counted it.
        let _ = self.losses.compare_exchange(known, next, relaxed, relaxed);
    }

    /// Writes all `bytes`, however long that takes: the queue stays full meanwhile, and the
    /// emulator drops whole frames. While the port is lost, packets wait. The reader never waits
    /// for a write.
    fn put(&self, mut bytes: &[u8], wanted: &dyn Fn() -> bool) -> Put {
        let mut output = lock(&self.output);
        let mut port = loop {
            if let Some(port) = output.take() {
                break port;
            }
            if !wanted() {
                return Put::Unwanted;
            }
            let waited = self.back.wait_timeout(output, READ_TIMEOUT);
            (output, _) = waited.unwrap_or_else(PoisonError::into_inner);
        };
        let known = self.losses.load(Ordering::Relaxed);
        drop(output);
        let is_present = || self.losses.load(Ordering::Relaxed) == known;
        while !bytes.is_empty() {
            match port.write(bytes) {
                Ok(length) if length > 0 => {
                    self.tally.moved(length);
                    bytes = &bytes[length..];
                }
                Err(error) if is_transient(&error) && wanted() && is_present() => {}
                _ => {
                    self.lose(known);
                    return Put::Lost(Unsent::Failed);
                }
            }
        }
        let mut output = lock(&self.output);
        if is_present() {
            *output = Some(port);
        }
        Put::Sent
    }
}

/// Reads packets into the queue until the writer has ended (the emulator closed its end).
fn read(line: &Line, port: Port, mut reader: PacketReader, stop: &AtomicBool) {
    let path = &line.device.path;
    let mut buffer = [0; 4096];
    let mut input = Some(port);
    // Whether the line was lost and has not been read since.
    let mut lost = false;
    let mut known = 0;
    while !stop.load(Ordering::Relaxed) {
        let Some(port) = &mut input else {
            std::thread::sleep(READ_TIMEOUT);
            match line.device.open() {
                Ok((reading, writing)) => {
                    input = Some(reading);
                    let mut output = lock(&line.output);
                    known = line.losses.load(Ordering::Relaxed);
                    *output = Some(writing);
                    drop(output);
                    line.back.notify_one();
                }
                Err(error) => tracing::debug!(%error, "{path} is not back"),
            }
            continue;
        };
        let result = match port.read(&mut buffer) {
            Ok(0) => Err(ErrorKind::BrokenPipe.into()),
            Err(error) if is_transient(&error) && line.losses.load(Ordering::Relaxed) == known => {
                Ok(0)
            }
            result => result,
        };
        match result {
            Ok(length) => {
                if std::mem::take(&mut lost) {
                    count(&line.tally.reconnects);
                    tracing::warn!("the serial line {path} is back");
                }
                if reader.receive(&buffer[..length], 0).is_err() {
                    return;
                }
            }
            Err(error) => {
                if !std::mem::replace(&mut lost, true) && !line.device.loopback {
                    tracing::warn!("the serial line {path} is lost ({error}): trying to reopen it");
                }
                line.lose(known);
                *lock(&line.output) = None;
                input = None;
                reader.restart();
            }
        }
    }
}

fn is_transient(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock
    )
}

/// Both ends of a pseudo-terminal, for a loopback.
#[cfg(unix)]
pub(super) fn pseudo_terminal(
    url: &Address,
) -> Result<(serialport::TTYPort, serialport::TTYPort), LinkError> {
    const REMEDY: &str = "check that /dev/ptmx and /dev/pts exist";
    serialport::TTYPort::pair().map_err(|error| {
        let url = url.text.clone();
        LinkError::refused(url, "open a pseudo-terminal pair", error.into(), REMEDY)
    })
}

#[cfg(not(unix))]
pub(super) fn no_pseudo_terminal(url: &Address) -> LinkError {
    const REMEDY: &str = "this system has none: use --link udp or memory";
    let error = ErrorKind::Unsupported.into();
    let url = url.text.clone();
    LinkError::refused(url, "open a pseudo-terminal pair", error, REMEDY)
}

/// The flight computer gets one end of a pseudo-terminal, the emulator opens the other by its name.
#[cfg(unix)]
fn loopback(url: &Address, _: &Options) -> Result<BothEnds, OpenError> {
    use skyloop_firmware_sim::serial::SerialPort as FlightComputerPort;
    let baud = baud_of(url, 115_200)?;
    let (master, slave) = pseudo_terminal(url)?;
    let device = slave.name().unwrap_or_default();
    // A pseudo-terminal ignores the baud rate.
    let wire = start(url, &device, baud, None, true)?;
    drop(slave);
    let port = FlightComputerPort::over(Box::new(master));
    let port = port.map_err(|error| LinkError::no_client(url, error))?;
    Ok((wire, Box::new(port)))
}

#[cfg(not(unix))]
fn loopback(url: &Address, _: &Options) -> Result<BothEnds, OpenError> {
    Err(no_pseudo_terminal(url).into())
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::Standstill;
    use crate::fixture::{TIMEOUT, framed, offer};
    use serialport::TTYPort;
    use std::io::{Read, Write};
    use std::path::Path;
    use std::sync::mpsc::RecvTimeoutError;
    use std::time::Duration;

    /// The emulator's end at `path`.
    fn at(path: &Path) -> Wire {
        let path = path.to_str().unwrap();
        let url = Address::parse(&format!("serial://{path}")).unwrap();
        start(&url, path, 115_200, None, false).unwrap()
    }

    /// Both ends of a pseudo-terminal, the second one as `path`.
    fn named(path: &Path) -> (TTYPort, TTYPort) {
        let (client, device) = TTYPort::pair().unwrap();
        std::os::unix::fs::symlink(device.name().unwrap(), path).unwrap();
        (client, device)
    }

    fn receive(wire: &Wire) -> Vec<u8> {
        wire.inbox.recv_timeout(TIMEOUT).unwrap().packet.to_vec()
    }

    #[test]
    fn lost_port_is_reopened() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let (mut client, mut device) = named(&path);
        let mut wire = at(&path);
        client.write_all(&framed(b"first")).unwrap();
        assert_eq!(receive(&wire), b"first");
        for round in 1..=2 {
            // With both ends closed the pseudo-terminal vanishes, like an unplugged adapter. Its
            // name is removed first: the system reuses the number.
            std::fs::remove_file(&path).unwrap();
            drop((client, device));
            let quiet = wire.inbox.recv_timeout(3 * READ_TIMEOUT).unwrap_err();
            assert_eq!(quiet, RecvTimeoutError::Timeout, "the link stays open");
            offer(&mut wire, 0, b"meanwhile");
            (client, device) = named(&path);
            client.set_timeout(TIMEOUT).unwrap();
            let mut line = [0; 15];
            client.read_exact(&mut line).unwrap();
            assert_eq!(&line[1..10], b"meanwhile", "the queue has waited");
            client.write_all(&framed(b"second")).unwrap();
            assert_eq!(receive(&wire), b"second");
            let counters = wire.tally.counters();
            assert_eq!((counters.reconnects, counters.lost_outbound), (round, 0));
        }
    }

    #[test]
    fn link_without_its_port_can_be_closed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let ends = named(&path);
        let mut wire = at(&path);
        std::fs::remove_file(&path).unwrap();
        drop(ends);
        for _ in 0..5 {
            offer(&mut wire, 0, &[1; 100]);
        }
        wire.close(Standstill::of(&wire.tally, Duration::from_millis(500)));
        assert_eq!(wire.tally.counters().lost_outbound, 5);
    }
}
