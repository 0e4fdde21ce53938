//! Counters of a link, and detection of a standstill.

use super::tx_complete::{TxComplete, Unsent};
use skyloop_protocols::credit::CREDITED_APIDS;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{Counters, Direction, MAX_PACKET};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Effect of faults on packets of one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultEffect {
    /// Some are delayed and have not left yet.
    Delays,
    /// Some were lost or damaged.
    Loses,
}

/// Counters of the fault injection, from which a [`FaultEffect`] follows.
#[derive(Debug, Default)]
struct FaultCounters {
    /// Whether packets are held back now.
    is_held_back: AtomicBool,
    /// Number of lost or damaged packets.
    lost: AtomicU32,
}

/// Time on the wire of one packet of a length in bytes, framing included.
pub type Airtime = Arc<dyn Fn(usize) -> Duration + Send + Sync>;

/// Counters of a link.
#[derive(Debug, Default)]
pub struct Tally {
    /// Packets queued outbound, and packets that have left the queue.
    pub tx_complete: TxComplete,
    /// Bytes that have left, modulo 2^32.
    moved: AtomicU32,
    /// Why waiting packets were abandoned; unset before that.
    given_up: OnceLock<Unsent>,
    /// Whether the client must prove its address before it gets frames.
    awaits_proof: AtomicBool,
    /// Frame packets not sent because the client's address was not proved.
    unproved: AtomicU32,
    /// Effects of faults by direction.
    fault_counters: [FaultCounters; 2],
    /// Number of the exchange whose client has gone; 0: none.
    ended: AtomicU32,
    /// Packets from other senders than the client.
    pub(super) foreign: AtomicU32,
    /// Packets dropped because the inbound queue was full.
    pub(super) dropped: AtomicU32,
    /// Serial frames with an invalid escape.
    pub(super) bad_framing: AtomicU32,
    /// Serial frames with a wrong CRC-32.
    pub(super) bad_crc: AtomicU32,
    /// Frames shorter than any packet.
    pub(super) runts: AtomicU32,
    /// Frames longer than any packet.
    pub(super) oversize: AtomicU32,
    /// How often the line was lost and came back.
    pub(super) reconnects: AtomicU32,
    /// Incomplete messages of several CAN frames.
    pub(super) incomplete: AtomicU32,
    /// Error frames of a CAN bus.
    pub(super) bus_errors: AtomicU32,
    /// How often the CAN controller went off the bus.
    pub(super) bus_off: AtomicU32,
    /// Packets whose client had gone or did not read, or that the system refused to send.
    pub(super) lost: AtomicU32,
}

impl Tally {
    /// Adds the counters of the link.
    pub fn add_to(&self, counters: &mut Counters) {
        for (counted, counter) in [
            (&self.foreign, &mut counters.foreign_packets),
            (&self.dropped, &mut counters.overflows),
            (&self.bad_framing, &mut counters.bad_framing),
            (&self.bad_crc, &mut counters.bad_crc),
            (&self.runts, &mut counters.runts),
            (&self.oversize, &mut counters.oversize),
            (&self.reconnects, &mut counters.reconnects),
            (&self.incomplete, &mut counters.incomplete),
            (&self.bus_errors, &mut counters.bus_errors),
            (&self.bus_off, &mut counters.bus_off),
            (&self.lost, &mut counters.lost_outbound),
        ] {
            *counter = counter.wrapping_add(counted.load(Ordering::Relaxed));
        }
    }

    /// The counters of the link alone.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters::default();
        self.add_to(&mut counters);
        counters
    }

    /// Counts a packet put into the outbound queue.
    pub(super) fn queued(&self) {
        self.tx_complete.queued();
    }

    /// Puts a packet into the outbound queue. Counted first: it may leave before `try_send`
    /// returns.
    pub(super) fn queue<E>(&self, try_send: impl FnOnce() -> Result<(), E>) -> Result<(), E> {
        self.queued();
        try_send().inspect_err(|_| self.tx_complete.refused())
    }

    /// Counts a packet that has left the queue.
    pub(super) fn done(&self) {
        self.tx_complete.done();
    }

    /// Counts a packet that has left the queue unsent. Its frame is not delivered.
    pub(super) fn lose(&self, packet: &[u8], why: Unsent) {
        if !self.is_given_up() {
            // Else all waiting packets are counted already.
            count(&self.lost);
        }
        self.finish_unsent(is_of_frame(packet), why);
    }

    /// Like [`Tally::lose`] for a packet that is already counted as lost.
    pub(super) fn finish_unsent(&self, is_of_frame: bool, why: Unsent) {
        if is_of_frame {
            self.tx_complete.lost(self.why_given_up().unwrap_or(why));
        } else {
            self.tx_complete.done();
        }
    }

    /// Counts all waiting packets as lost; returns their number.
    pub(super) fn give_up(&self, why: Unsent) -> u32 {
        let left = self.waiting();
        self.lost.fetch_add(left, Ordering::Relaxed);
        // It is unset: a link is closed only once.
        let _ = self.given_up.set(why);
        left
    }

    /// Why the waiting packets were lost; `None` before that.
    pub fn why_given_up(&self) -> Option<Unsent> {
        self.given_up.get().copied()
    }

    /// Whether the waiting packets are abandoned.
    pub(super) fn is_given_up(&self) -> bool {
        self.given_up.get().is_some()
    }

    /// Whether the client must prove its address before it gets frames.
    pub fn awaits_proof(&self) -> bool {
        self.awaits_proof.load(Ordering::Relaxed)
    }

    /// Sets whether the client must prove its address.
    pub(super) fn await_proof(&self, awaits: bool) {
        self.awaits_proof.store(awaits, Ordering::Relaxed);
    }

    /// Frame packets removed because the client's address was not proved. They also count as lost.
    pub fn unproved(&self) -> u32 {
        self.unproved.load(Ordering::SeqCst)
    }

    /// Counts a removed packet, before it counts as lost.
    pub(super) fn withhold(&self) {
        self.unproved.fetch_add(1, Ordering::SeqCst);
    }

    /// Whether a fault holds back outgoing packets, so that the client cannot have received them.
    pub fn is_held_back(&self) -> bool {
        let [_, outbound] = &self.fault_counters;
        outbound.is_held_back.load(Ordering::Relaxed)
    }

    /// Effect of faults on a direction since it had lost `before` packets.
    pub fn fault_effect(&self, direction: Direction, before: u32) -> Option<FaultEffect> {
        let counters = self.fault_counters.get(usize::from(direction.code()))?;
        if counters.is_held_back.load(Ordering::Relaxed) {
            return Some(FaultEffect::Delays);
        }
        let lost = counters.lost.load(Ordering::Relaxed);
        (lost != before).then_some(FaultEffect::Loses)
    }

    /// Packets lost or damaged by faults, in and out, modulo 2^32.
    pub fn lost_to_faults(&self) -> [u32; 2] {
        let lost = |counters: &FaultCounters| counters.lost.load(Ordering::Relaxed);
        self.fault_counters.each_ref().map(lost)
    }

    /// Notes whether faults hold back packets of a direction, and adds lost and damaged ones.
    pub(super) fn note_faults(&self, direction: Direction, is_held_back: bool, lost: u32) {
        if let Some(counters) = self.fault_counters.get(usize::from(direction.code())) {
            counters.is_held_back.store(is_held_back, Ordering::Relaxed);
            counters.lost.fetch_add(lost, Ordering::Relaxed);
        }
    }

    /// Whether the client of an exchange has gone.
    pub fn has_ended(&self, exchange: u32) -> bool {
        exchange != 0 && self.ended.load(Ordering::Relaxed) == exchange
    }

    /// Notes that the client of an exchange has gone.
    pub(super) fn end(&self, exchange: u32) {
        self.ended.store(exchange, Ordering::Relaxed);
    }

    /// Packets that have not left yet.
    pub fn waiting(&self) -> u32 {
        self.tx_complete.waiting()
    }

    /// Bytes that have left, modulo 2^32.
    pub fn bytes(&self) -> u32 {
        self.moved.load(Ordering::Relaxed)
    }

    /// Counts bytes that have left.
    pub(super) fn moved(&self, bytes: usize) {
        self.moved.fetch_add(bytes as u32, Ordering::Relaxed);
    }
}

/// Whether a packet belongs to a frame.
pub fn is_of_frame(packet: &[u8]) -> bool {
    identify(packet).is_some_and(|(apid, _)| CREDITED_APIDS.contains(&apid))
}

pub(super) fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Waits until bytes have stopped leaving for some time.
pub struct Standstill {
    tally: Arc<Tally>,
    timeout: Duration,
    bytes: u32,
    begun: Instant,
    /// When bytes last left, as far as known.
    moved: Instant,
    since: Instant,
    until: Instant,
    is_logged: bool,
}

/// Time without bytes that counts as a standstill, and delay before a wait is reported.
pub const SOON: Duration = Duration::from_millis(500);

/// Time without bytes that counts as a standstill: `min`, or twice the airtime of a packet, which
/// may leave in one piece.
pub fn standstill_timeout(airtime: Option<&Airtime>, min: Duration) -> Duration {
    let packet = airtime.map_or(Duration::ZERO, |airtime| airtime(MAX_PACKET));
    min.max(2 * packet)
}

impl Standstill {
    /// Ends when nothing has left for `timeout`. On a slow line that still sends, ends after three
    /// times `timeout`.
    pub fn of(tally: &Arc<Tally>, timeout: Duration) -> Standstill {
        Standstill {
            tally: tally.clone(),
            timeout,
            bytes: tally.bytes(),
            begun: Instant::now(),
            moved: Instant::now(),
            since: Instant::now(),
            until: Instant::now() + 3 * timeout,
            is_logged: false,
        }
    }

    /// Ends at `until` at the latest.
    pub fn until(self, until: Instant) -> Standstill {
        Standstill {
            until: self.until.min(until),
            ..self
        }
    }

    /// Sets when bytes last left.
    pub fn moved(self, moved: Instant) -> Standstill {
        Standstill { moved, ..self }
    }

    /// Why the waiting packets have not left.
    pub(crate) fn why(&self, airtime: Option<&Airtime>) -> Unsent {
        if self.tally.is_held_back() {
            Unsent::HeldBack
        } else if self.tally.awaits_proof() {
            Unsent::NotProved
        } else if self.moved.elapsed() < standstill_timeout(airtime, SOON) {
            Unsent::RunEnded
        } else {
            Unsent::NotRead
        }
    }

    /// Pauses briefly; returns whether the wait is over.
    pub fn is_over(&mut self) -> bool {
        std::thread::sleep(Duration::from_millis(2));
        let (bytes, now) = (self.tally.bytes(), Instant::now());
        if bytes != self.bytes {
            (self.bytes, self.since, self.moved) = (bytes, now, now);
        }
        if self.begun.elapsed() > SOON && !std::mem::replace(&mut self.is_logged, true) {
            let awaited = if self.tally.is_held_back() {
                "packets that a fault holds back"
            } else {
                "the client to read what is queued"
            };
            tracing::warn!(
                "waiting for {awaited}: {:.1} s at most",
                self.until
                    .saturating_duration_since(self.begun)
                    .as_secs_f64()
            );
        }
        // Frames do not leave without proof.
        self.tally.awaits_proof() || self.since.elapsed() >= self.timeout || now >= self.until
    }
}
