//! Serial lines: SLIP frames with CRC-32, two threads a port.

use super::{
    Airtime, BothEnds, Inbound, Intake, Link, LinkError, LinkUrl, Options, Outbound, Outbox, QUEUE,
    Tally, Wire, count, inbox::inbox,
};
use bytes::Bytes;
use serialport::SerialPort;
use skyloop_firmware_sim::serial::SerialPort as FlightComputerPort;
use skyloop_protocols::slip;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

/// Serial lines.
pub const SERIAL: Link = Link {
    scheme: "serial",
    example: "serial:///dev/ttyUSB0?baud=921600",
    open,
    loopback,
};

/// How long a read waits before it looks whether the link is still wanted.
const READ_TIMEOUT: Duration = Duration::from_millis(100);

fn open(url: &LinkUrl, _: &Options) -> Result<Wire, LinkError> {
    url.only(&["baud"])?;
    let baud = url.number("baud", 115_200)?;
    if baud == 0 {
        return Err(url.refuse("baud = 0 must be above 0".to_string()));
    }
    let port = serialport::new(&url.target, baud).timeout(READ_TIMEOUT).open().map_err(|error| {
        LinkError::Io {
            url: url.text.clone(),
            action: "open the port",
            source: error.into(),
            remedy: "check that the device exists, is not in use and may be read and written by you",
        }
    })?;
    let airtime = Some(airtime(baud));
    start(port, &url.text, Some(PathBuf::from(&url.target)), airtime)
}

/// 10 bit times an octet: the packet, its CRC-32, an END on both sides, and an escape for two octets of 256.
fn airtime(baud: u32) -> Airtime {
    Arc::new(move |octets| {
        let framed = octets as f64 + 4.0;
        let octets = framed * (1.0 + 2.0 / 256.0) + 2.0;
        Duration::from_secs_f64(octets * 10.0 / f64::from(baud))
    })
}

/// `device` is where the port was opened, if it has such a place.
fn start(
    port: Box<dyn SerialPort>,
    address: &str,
    device: Option<PathBuf>,
    airtime: Option<Airtime>,
) -> Result<Wire, LinkError> {
    let failed = |action, remedy| {
        move |source| LinkError::Io {
            url: address.to_string(),
            action,
            source,
            remedy,
        }
    };
    let writer = port.try_clone().map_err(|error| {
        failed("open it for two threads", "try again")(std::io::Error::from(error))
    })?;
    let tally = Arc::new(Tally::default());
    let (arrivals, inbox) = inbox(tally.clone());
    let (outbox, departures) = sync_channel(QUEUE);
    let (reading, writing) = (tally.clone(), tally.clone());
    let ended = Arc::new(AtomicBool::new(false));
    let stop = ended.clone();
    let thread = |name: &str| std::thread::Builder::new().name(name.to_string());
    const LIMITS: &str = "check the limits of this process";
    thread("serial-read")
        .spawn(move || read(port, device.as_deref(), &arrivals, &reading, &stop))
        .map_err(failed("start its thread", LIMITS))?;
    let sender = thread("serial-write")
        .spawn(move || {
            write(writer, &departures, &writing);
            ended.store(true, Ordering::Relaxed);
        })
        .map_err(failed("start its thread", LIMITS))?;
    let address = address.to_string();
    let outbox = LineOutbox {
        queue: outbox,
        tally: tally.clone(),
        address: address.clone(),
    };
    Ok(Wire {
        address,
        inbox,
        outbox: Box::new(outbox),
        tally,
        airtime,
        sender: Some(sender),
    })
}

/// The queue to the writer.
struct LineOutbox {
    queue: SyncSender<Bytes>,
    tally: Arc<Tally>,
    address: String,
}

impl Outbox for LineOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        // The line has one client: there is nothing to release.
        let Outbound::Packet { exchange, packet } = what else {
            return Ok(None);
        };
        match self.queue.try_send(packet) {
            Ok(()) => self.tally.queued(),
            Err(TrySendError::Full(packet)) => {
                return Ok(Some(Outbound::Packet { exchange, packet }));
            }
            Err(TrySendError::Disconnected(_)) => {
                return Err(LinkError::Closed(self.address.clone()));
            }
        }
        Ok(None)
    }
}

/// Octets in, packets into the queue, until the writer has ended (the emulator dropped its end).
fn read(
    mut port: Box<dyn SerialPort>,
    device: Option<&Path>,
    arrivals: &Intake,
    tally: &Tally,
    stop: &AtomicBool,
) {
    let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
    let mut buffer = [0; 4096];
    // Frames without a packet since the last packet, and whether there ever was one.
    let (mut bad, mut heard) = (0_u32, false);
    let mut hung_up = false;
    while !stop.load(Ordering::Relaxed) {
        let length = match port.read(&mut buffer) {
            Ok(length) => length,
            Err(error) if is_passing(&error) => 0,
            // Hung up: an adapter that was unplugged takes its device along, but a pseudo-terminal may get
            // its next client.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => {
                if let Some(device) = device.filter(|device| !device.exists()) {
                    tracing::error!("the serial line has gone: {} is no more", device.display());
                    return;
                }
                if device.is_some() && !hung_up {
                    tracing::warn!("nobody holds the other end of the serial line: waiting");
                }
                hung_up = true;
                std::thread::sleep(READ_TIMEOUT);
                continue;
            }
            Err(error) => {
                tracing::error!(%error, "the serial line can no longer be read");
                return;
            }
        };
        hung_up &= length == 0;
        for octet in &buffer[..length] {
            match decoder.push(*octet) {
                None => {}
                Some(Err(_)) => {
                    count(&tally.bad_framing);
                    bad = bad.saturating_add(1);
                    if bad == 8 || (bad == 1 && !heard) {
                        tracing::warn!(
                            "octets come that hold no packet: check the baud rate of both ends, and the framing (SLIP)"
                        );
                    }
                }
                Some(Ok(packet)) => {
                    (bad, heard) = (0, true);
                    let packet = Bytes::copy_from_slice(packet);
                    let inbound = Inbound {
                        exchange: 0,
                        packet,
                        arrived: Instant::now(),
                    };
                    if arrivals.push(inbound).is_err() {
                        return;
                    }
                }
            }
        }
    }
}

/// Packets from the queue onto the line, until the emulator drops its end.
fn write(mut port: Box<dyn SerialPort>, departures: &Receiver<Bytes>, tally: &Tally) {
    let mut line = Vec::with_capacity(slip::max_encoded_length(slip::BUFFER));
    while let Ok(packet) = departures.recv() {
        line.clear();
        slip::encode(&packet, &mut |octet| line.push(octet));
        if let Err(error) = write_whole(port.as_mut(), &line, tally) {
            tracing::error!(%error, "the serial line can no longer be written");
            return;
        }
        tally.done();
    }
}

/// Writes all of `line`, however long its other end takes: then the queue stays full, and it is the emulator
/// that gives frames up, whole. Ends with an error when the line does.
fn write_whole(port: &mut dyn SerialPort, mut line: &[u8], tally: &Tally) -> std::io::Result<()> {
    while !line.is_empty() {
        match port.write(line) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(length) => {
                tally.moved(length);
                line = &line[length..];
            }
            Err(error) if is_passing(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn is_passing(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock
    )
}

#[cfg(unix)]
fn loopback(_: &Options) -> Result<BothEnds, LinkError> {
    use serialport::TTYPort;
    let failed = |action| {
        move |error: serialport::Error| LinkError::Io {
            url: "serial (pseudo-terminal)".to_string(),
            action,
            source: error.into(),
            remedy: "check that /dev/ptmx and /dev/pts exist",
        }
    };
    let (mut master, slave) = TTYPort::pair().map_err(failed("open a pseudo-terminal pair"))?;
    let name = slave
        .name()
        .unwrap_or_else(|| "pseudo-terminal".to_string());
    master
        .set_timeout(READ_TIMEOUT)
        .map_err(failed("set it up"))?;
    let wire = start(Box::new(master), &format!("serial://{name}"), None, None)?;
    let port = FlightComputerPort::over(Box::new(slave)).map_err(|error| LinkError::Io {
        url: name,
        action: "open the client's end",
        source: std::io::Error::other(error),
        remedy: "try again",
    })?;
    Ok((wire, Box::new(port)))
}

#[cfg(not(unix))]
fn loopback(_: &Options) -> Result<BothEnds, LinkError> {
    Err(LinkError::Io {
        url: "serial (pseudo-terminal)".to_string(),
        action: "open a pseudo-terminal pair",
        source: ErrorKind::Unsupported.into(),
        remedy: "this system has none: use --link udp or memory",
    })
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::link::Standstill;
    use serialport::TTYPort;
    use std::sync::mpsc::RecvTimeoutError;

    #[test]
    fn a_device_that_is_no_more_ends_the_link() {
        let (master, slave) = TTYPort::pair().unwrap();
        let device = slave.name().unwrap();
        let port = serialport::new(&device, 115_200).timeout(READ_TIMEOUT);
        let wire = start(
            port.open().unwrap(),
            &device,
            Some(device.clone().into()),
            None,
        )
        .unwrap();
        let quiet = wire.inbox.recv_timeout(3 * READ_TIMEOUT).unwrap_err();
        assert_eq!(quiet, RecvTimeoutError::Timeout);
        // With both ends closed here the pseudo-terminal goes, as an adapter that is unplugged.
        drop((master, slave));
        let gone = wire.inbox.recv_timeout(100 * READ_TIMEOUT).unwrap_err();
        assert_eq!(gone, RecvTimeoutError::Disconnected);
    }

    #[test]
    fn a_packet_takes_ten_bit_times_an_octet() {
        // 1400 octets, 4 of CRC-32, 2 ENDs and 10.97 escapes expected: 14169.7 bits at 9600 a second.
        assert_eq!(airtime(9600)(1400).as_millis(), 1476);
    }

    /// Both ends of a pseudo-terminal: the emulator's with `packets` of 1400 octets queued, and the client's.
    fn with_queued(packets: usize) -> (Wire, TTYPort) {
        let (master, client) = TTYPort::pair().unwrap();
        let mut wire = start(Box::new(master), "serial", None, None).unwrap();
        for _ in 0..packets {
            let packet = Bytes::from(vec![1; 1400]);
            let full = wire.outbox.offer(Outbound::Packet {
                exchange: 0,
                packet,
            });
            assert!(full.unwrap().is_none());
        }
        (wire, client)
    }

    /// Packets lost by closing.
    fn close(mut wire: Wire, patience: Duration) -> u32 {
        let tally = wire.tally.clone();
        wire.close(Standstill::of(&tally, patience));
        tally.lost()
    }

    #[test]
    fn closing_waits_for_a_slow_reader() {
        let (wire, mut client) = with_queued(40);
        let closing = std::thread::spawn(move || close(wire, Duration::from_secs(30)));
        // At first 2 kB/s; the pseudo-terminal lets 4 KiB pass at once.
        let mut pauses = [Duration::from_millis(100); 30].into_iter();
        let mut buffer = [0; 200];
        while !closing.is_finished() {
            let _ = client.read(&mut buffer);
            std::thread::sleep(pauses.next().unwrap_or_default());
        }
        assert_eq!(closing.join().unwrap(), 0);
    }

    #[test]
    fn what_nobody_reads_is_lost_and_counted() {
        let (wire, _client) = with_queued(40);
        let lost = close(wire, Duration::from_millis(500));
        // 40 packets of 1400 octets; a pseudo-terminal holds some 4 to 20 KiB of them.
        assert!((20..40).contains(&lost), "{lost}");
    }
}
