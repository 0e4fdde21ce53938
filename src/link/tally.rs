//! What a link counts, and whether it moves.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// What a link counts.
#[derive(Debug, Default)]
pub struct Tally {
    /// Packets in the outbound queue, or on their way out of it.
    waiting: AtomicU32,
    /// Octets that have left, modulo 2^32.
    moved: AtomicU32,
    pub(super) foreign: AtomicU32,
    pub(super) dropped: AtomicU32,
    pub(super) bad_framing: AtomicU32,
    pub(super) bad_crc: AtomicU32,
    pub(super) runts: AtomicU32,
    pub(super) oversize: AtomicU32,
    pub(super) reconnects: AtomicU32,
    pub(super) incomplete: AtomicU32,
    pub(super) bus_errors: AtomicU32,
    pub(super) bus_off: AtomicU32,
    pub(super) lost: AtomicU32,
}

impl Tally {
    /// Packets from others than the client.
    pub fn foreign(&self) -> u32 {
        self.foreign.load(Ordering::Relaxed)
    }

    /// Packets thrown away because the inbound queue was full.
    pub fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Serial frames with an escape of nothing.
    pub fn bad_framing(&self) -> u32 {
        self.bad_framing.load(Ordering::Relaxed)
    }

    /// Serial frames with a wrong CRC-32.
    pub fn bad_crc(&self) -> u32 {
        self.bad_crc.load(Ordering::Relaxed)
    }

    /// Frames shorter than any packet.
    pub fn runts(&self) -> u32 {
        self.runts.load(Ordering::Relaxed)
    }

    /// Frames longer than any packet.
    pub fn oversize(&self) -> u32 {
        self.oversize.load(Ordering::Relaxed)
    }

    /// Times that the line was lost and came back.
    pub fn reconnects(&self) -> u32 {
        self.reconnects.load(Ordering::Relaxed)
    }

    /// Attitudes and messages over several CAN frames that never came whole.
    pub fn incomplete(&self) -> u32 {
        self.incomplete.load(Ordering::Relaxed)
    }

    /// Errors that the CAN controller has reported.
    pub fn bus_errors(&self) -> u32 {
        self.bus_errors.load(Ordering::Relaxed)
    }

    /// Times that the CAN controller has left the bus.
    pub fn bus_off(&self) -> u32 {
        self.bus_off.load(Ordering::Relaxed)
    }

    /// Packets whose client had gone or did not read, or that the system refused to send.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Books a packet put into the outbound queue.
    pub(super) fn queued(&self) {
        count(&self.waiting);
    }

    /// Books a packet that has left the queue for good.
    pub(super) fn done(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    /// Books all that waits as lost; how much that is.
    pub(super) fn give_up(&self) -> u32 {
        let left = self.waiting.load(Ordering::Relaxed);
        self.lost.fetch_add(left, Ordering::Relaxed);
        left
    }

    /// Books octets that have left.
    pub(super) fn moved(&self, octets: usize) {
        self.moved.fetch_add(octets as u32, Ordering::Relaxed);
    }
}

/// One more.
pub(super) fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Waits while octets leave, and some time longer.
pub(crate) struct Standstill {
    tally: Arc<Tally>,
    patience: Duration,
    octets: u32,
    since: Instant,
    told: bool,
}

impl Standstill {
    /// Over when nothing has left for `patience`.
    pub fn of(tally: &Arc<Tally>, patience: Duration) -> Standstill {
        Standstill {
            tally: tally.clone(),
            patience,
            octets: tally.moved.load(Ordering::Relaxed),
            since: Instant::now(),
            told: false,
        }
    }

    /// Pauses for a moment; true if nothing has left for so long that nobody takes it.
    pub fn is_over(&mut self) -> bool {
        const SOON: Duration = Duration::from_millis(500);
        std::thread::sleep(Duration::from_millis(2));
        let octets = self.tally.moved.load(Ordering::Relaxed);
        if octets != self.octets {
            (self.octets, self.since) = (octets, Instant::now());
        } else if self.since.elapsed() > SOON && !std::mem::replace(&mut self.told, true) {
            tracing::warn!("waiting for the client to read what is left");
        }
        self.since.elapsed() >= self.patience
    }
}
