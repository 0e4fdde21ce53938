//! Packets on a serial line or pseudo-terminal: SLIP frames in both directions.

use super::error::LinkError;
use super::inbox::{Gone, Inbound, InboxSender, inbox};
use super::kind::thread;
use super::outbox::{self, Outbound};
use super::tally::{Airtime, Tally, count};
use super::tx_complete::Unsent;
use super::wire::Wire;
use skyloop_firmware_sim::address::Address;
use skyloop_protocols::slip::{self, FrameError};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// Interval at which the threads of a line check for the end of the link.
pub(super) const READ_TIMEOUT: Duration = Duration::from_millis(100);

/// Time of a packet at 10 bit times a byte, with CRC-32, two ENDs, and escapes for 2 bytes in 256.
pub(super) fn airtime(baud: u32) -> Airtime {
    Arc::new(move |bytes| {
        let framed = bytes as f64 + 4.0;
        let bytes = framed * (1.0 + 2.0 / 256.0) + 2.0;
        Duration::from_secs_f64(bytes * 10.0 / f64::from(baud))
    })
}

/// Starts the two threads of the line at `address`, named `NAME-read` and `NAME-write`. `read` runs
/// until its flag is set at the end of `write`. `write` gets the queue, and a function that returns
/// whether the emulator's end is open.
pub(super) fn start(
    url: &Address,
    name: &str,
    address: String,
    tally: &Arc<Tally>,
    read: impl FnOnce(PacketReader, &AtomicBool) + Send + 'static,
    write: impl FnOnce(&Receiver<Outbound>, &dyn Fn() -> bool) + Send + 'static,
) -> Result<Wire, LinkError> {
    let (arrivals, inbox) = inbox(tally.clone());
    let (mut outbox, departures) = outbox::queue(&address, tally);
    outbox.releases = false;
    let ended = Arc::new(AtomicBool::new(false));
    let stop = ended.clone();
    let wanted = arrivals.watch();
    let reader = PacketReader::new(arrivals, tally.clone());
    thread(url, &format!("{name}-read"), move || read(reader, &stop))?;
    let sender = thread(url, &format!("{name}-write"), move || {
        write(&departures, &wanted);
        ended.store(true, Ordering::Relaxed);
    })?;
    Ok(Wire {
        sender: Some(sender),
        ..Wire::new(address, inbox, outbox, tally.clone())
    })
}

/// Decodes bytes to packets.
pub(super) struct PacketReader {
    decoder: slip::Decoder<{ slip::BUFFER }>,
    /// Number of invalid frames since the last packet.
    bad: u32,
    /// Whether a packet has ever arrived.
    has_received: bool,
    arrivals: InboxSender,
    tally: Arc<Tally>,
}

impl PacketReader {
    pub fn new(arrivals: InboxSender, tally: Arc<Tally>) -> PacketReader {
        PacketReader {
            decoder: slip::Decoder::new(),
            bad: 0,
            has_received: false,
            arrivals,
            tally,
        }
    }

    /// Drops an incomplete frame after a loss of the line.
    pub fn restart(&mut self) {
        self.decoder = slip::Decoder::new();
    }

    /// Queues the packets that end in `bytes`; counts invalid frames.
    pub fn receive(&mut self, bytes: &[u8], exchange: u32) -> Result<(), Gone> {
        for byte in bytes {
            match self.decoder.push(*byte) {
                None => {}
                Some(Err(error)) => {
                    count(match error {
                        FrameError::TooShort { .. } => &self.tally.runts,
                        FrameError::TooLong { .. } => &self.tally.oversize,
                        FrameError::BadEscape { .. } => &self.tally.bad_framing,
                        FrameError::BadCrc32 { .. } => &self.tally.bad_crc,
                    });
                    tracing::debug!("skipped: {error}");
                    self.bad = self.bad.saturating_add(1);
                    if self.bad == 8 || (self.bad == 1 && !self.has_received) {
                        tracing::warn!(
                            "received bytes contain no packet: check the baud rate of both ends, and the framing \
                             (SLIP, with a CRC-32 after the packet); -v logs the error of each frame"
                        );
                    }
                }
                Some(Ok(packet)) => {
                    (self.bad, self.has_received) = (0, true);
                    let inbound = Inbound::new(exchange, packet, Instant::now());
                    self.arrivals.push(inbound)?;
                }
            }
        }
        Ok(())
    }
}

/// Result of writing a frame.
pub(super) enum Put {
    Sent,
    /// Not sent completely.
    Lost(Unsent),
    /// The emulator has closed its end.
    Unwanted,
}

/// Writes queued packets to the line until the emulator closes. `put` gets the exchange, the bytes,
/// and whether the line was idle before.
pub(super) fn write(
    departures: &Receiver<Outbound>,
    tally: &Tally,
    mut put: impl FnMut(u32, &[u8], bool) -> Put,
) {
    let mut line = Vec::with_capacity(slip::max_encoded_length(slip::BUFFER));
    loop {
        let (next, idle) = match departures.try_recv() {
            Err(TryRecvError::Empty) => (departures.recv().ok(), true),
            next => (next.ok(), false),
        };
        // Releases never come: a line has a single client.
        let Some(Outbound::Packet { exchange, packet }) = next else {
            return;
        };
        line.clear();
        slip::encode(&packet, &mut |byte| line.push(byte));
        match put(exchange, &line, idle) {
            Put::Sent => tally.done(),
            Put::Lost(why) => tally.lose(&packet, why),
            Put::Unwanted => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{TIMEOUT, framed};

    #[test]
    fn line_ends_with_its_emulator() {
        let url = Address::parse("serial://none").unwrap();
        let (done, ended) = std::sync::mpsc::channel();
        let read = move |_: PacketReader, stop: &AtomicBool| {
            while !stop.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            done.send(()).unwrap();
        };
        let write = |departures: &Receiver<Outbound>, _: &dyn Fn() -> bool| {
            while departures.recv().is_ok() {}
        };
        let wire = start(&url, "line", String::new(), &Arc::default(), read, write).unwrap();
        drop(wire);
        ended.recv_timeout(TIMEOUT).unwrap();
    }

    #[test]
    fn packet_takes_ten_bit_times_per_byte() {
        // 1400 bytes, 4 of CRC-32, 2 ENDs and 10.97 escapes: 14169.7 bits at 9600 bit/s.
        assert_eq!(airtime(9600)(1400).as_millis(), 1476);
    }

    #[test]
    fn invalid_frames_are_counted_by_kind_and_skipped() {
        let tally = Arc::new(Tally::default());
        let (inbox_sender, inbox) = inbox(tally.clone());
        let mut reader = PacketReader::new(inbox_sender, tally.clone());
        let good = framed(b"packet");
        let mut damaged = good.clone();
        damaged[2] ^= 1;
        let frames: [(&[u8], [u32; 4]); 5] = [
            (&[slip::END, 1, 2, 3, slip::END], [1, 0, 0, 0]),
            (&[7; slip::BUFFER + 1], [1, 0, 0, 0]),
            (&[slip::END, slip::ESC, 1, 2, slip::END], [1, 1, 1, 0]),
            (&damaged, [1, 1, 1, 1]),
            (&good, [1, 1, 1, 1]),
        ];
        for (frame, expected) in frames {
            reader.receive(frame, 5).unwrap();
            let found = tally.counters();
            let counts = [
                found.runts,
                found.oversize,
                found.bad_framing,
                found.bad_crc,
            ];
            assert_eq!(counts, expected);
        }
        let inbound = inbox.try_recv().unwrap();
        assert_eq!((&inbound.packet[..], inbound.exchange), (&b"packet"[..], 5));
        assert!(inbox.try_recv().is_err());
    }
}
