//! Counters of a link, and whether bytes still leave it.

use super::tx_complete::{TxComplete, Unsent};
use skyloop_protocols::credit::PAID;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{Counters, Direction, MAX_PACKET};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// What faults do to packets of one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harm {
    /// Some are late, and have not gone on yet.
    Delays,
    /// Some were lost or damaged.
    Loses,
}

/// Likewise, as the faults count it.
#[derive(Debug, Default)]
struct Harmed {
    /// Whether packets are held back now.
    is_held_back: AtomicBool,
    /// Packets that were lost or damaged.
    lost: AtomicU32,
}

/// Time on the wire of one packet of a length in bytes, framing included.
pub type Airtime = Arc<dyn Fn(usize) -> Duration + Send + Sync>;

/// What a link counts.
#[derive(Debug, Default)]
pub struct Tally {
    /// Packets that went into the outbound queue, and that have left it for good.
    pub tx_complete: TxComplete,
    /// Bytes that have left, modulo 2^32.
    moved: AtomicU32,
    /// Why waiting packets were given up; unset before that.
    given_up: OnceLock<Unsent>,
    /// Whether the client is to prove its address before it gets frames.
    awaits_proof: AtomicBool,
    /// Frame packets that did not leave since their client's address was not proved.
    unproved: AtomicU32,
    /// What faults do to packets, by direction.
    harmed: [Harmed; 2],
    /// The exchange whose client has gone, by its number; 0: none.
    ended: AtomicU32,
    /// Packets from others than the client.
    pub(super) foreign: AtomicU32,
    /// Packets thrown away because the inbound queue was full.
    pub(super) dropped: AtomicU32,
    /// Serial frames with an escape of nothing.
    pub(super) bad_framing: AtomicU32,
    /// Serial frames with a wrong CRC-32.
    pub(super) bad_crc: AtomicU32,
    /// Frames shorter than any packet.
    pub(super) runts: AtomicU32,
    /// Frames longer than any packet.
    pub(super) oversize: AtomicU32,
    /// Times that the line was lost and came back.
    pub(super) reconnects: AtomicU32,
    /// Messages over several CAN frames that never came whole.
    pub(super) incomplete: AtomicU32,
    /// Error frames of a CAN bus.
    pub(super) bus_errors: AtomicU32,
    /// Times that the CAN controller went off the bus.
    pub(super) bus_off: AtomicU32,
    /// Packets whose client had gone or did not read, or that the system refused to send.
    pub(super) lost: AtomicU32,
}

impl Tally {
    /// Adds what the link has counted.
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

    /// What the link alone has counted.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters::default();
        self.add_to(&mut counters);
        counters
    }

    /// Books a packet put into the outbound queue.
    pub(super) fn queued(&self) {
        self.tx_complete.queued();
    }

    /// Puts a packet into the outbound queue. Booked first: it may leave before `try_send` returns.
    pub(super) fn queue<E>(&self, try_send: impl FnOnce() -> Result<(), E>) -> Result<(), E> {
        self.queued();
        try_send().inspect_err(|_| self.tx_complete.refused())
    }

    /// Books a packet that has left the queue for good.
    pub(super) fn done(&self) {
        self.tx_complete.done();
    }

    /// Books a packet that has left the queue and was not sent. Its frame is not delivered.
    pub(super) fn lose(&self, packet: &[u8], why: Unsent) {
        if !self.is_given_up() {
            // Else all that waited is counted already.
            count(&self.lost);
        }
        self.let_go(is_of_frame(packet), why);
    }

    /// Books a packet, of a frame or not, that has left the queue, was not sent, and is counted.
    pub(super) fn let_go(&self, is_of_frame: bool, why: Unsent) {
        if is_of_frame {
            self.tx_complete.lost(self.why_given_up().unwrap_or(why));
        } else {
            self.tx_complete.done();
        }
    }

    /// Books all that waits as lost; how much that is.
    pub(super) fn give_up(&self, why: Unsent) -> u32 {
        let left = self.waiting();
        self.lost.fetch_add(left, Ordering::Relaxed);
        // Nobody has set it before: a link is closed once.
        let _ = self.given_up.set(why);
        left
    }

    /// Why all that waited is lost; none before.
    pub fn why_given_up(&self) -> Option<Unsent> {
        self.given_up.get().copied()
    }

    /// Whether all waiting packets are given up.
    pub(super) fn is_given_up(&self) -> bool {
        self.given_up.get().is_some()
    }

    /// Whether the client is to prove its address before it gets frames.
    pub fn awaits_proof(&self) -> bool {
        self.awaits_proof.load(Ordering::Relaxed)
    }

    /// Notes whether it is.
    pub(super) fn await_proof(&self, awaits: bool) {
        self.awaits_proof.store(awaits, Ordering::Relaxed);
    }

    /// Frame packets removed since the client's address was not proved. They count as lost, too.
    pub fn unproved(&self) -> u32 {
        self.unproved.load(Ordering::SeqCst)
    }

    /// Notes that one is removed: before it counts as lost.
    pub(super) fn withhold(&self) {
        self.unproved.fetch_add(1, Ordering::SeqCst);
    }

    /// Whether a fault holds back packets that are to leave: the client cannot have them.
    pub fn is_held_back(&self) -> bool {
        let [_, way_out] = &self.harmed;
        way_out.is_held_back.load(Ordering::Relaxed)
    }

    /// Effect of faults on a direction, which had lost `before` packets; none if there is none.
    pub fn harm(&self, direction: Direction, before: u32) -> Option<Harm> {
        let harmed = self.harmed.get(usize::from(direction.code()))?;
        if harmed.is_held_back.load(Ordering::Relaxed) {
            return Some(Harm::Delays);
        }
        let lost = harmed.lost.load(Ordering::Relaxed);
        (lost != before).then_some(Harm::Loses)
    }

    /// Packets that faults have lost or damaged, in and out, modulo 2^32.
    pub fn lost_to_faults(&self) -> [u32; 2] {
        let lost = |harmed: &Harmed| harmed.lost.load(Ordering::Relaxed);
        self.harmed.each_ref().map(lost)
    }

    /// Books whether faults hold packets of a direction back, and how many more they lost or
    /// damaged.
    pub(super) fn note_harm(&self, direction: Direction, is_held_back: bool, lost: u32) {
        if let Some(harmed) = self.harmed.get(usize::from(direction.code())) {
            harmed.is_held_back.store(is_held_back, Ordering::Relaxed);
            harmed.lost.fetch_add(lost, Ordering::Relaxed);
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

    /// Books bytes that have left.
    pub(super) fn moved(&self, bytes: usize) {
        self.moved.fetch_add(bytes as u32, Ordering::Relaxed);
    }
}

/// Whether a packet is of a frame.
pub fn is_of_frame(packet: &[u8]) -> bool {
    identify(packet).is_some_and(|(apid, _)| PAID.contains(&apid))
}

/// One more.
pub(super) fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Waits while bytes leave, and some time longer.
pub struct Standstill {
    tally: Arc<Tally>,
    timeout: Duration,
    bytes: u32,
    begun: Instant,
    /// When bytes left last, as far as is known.
    moved: Instant,
    since: Instant,
    until: Instant,
    is_logged: bool,
}

/// Silence after which a link stands still, and after which the end of a run reports its wait.
pub const SOON: Duration = Duration::from_millis(500);

/// Silence after which a link stands still: `least`, or twice the time of a packet, which may leave
/// in one piece.
pub fn timeout(airtime: Option<&Airtime>, least: Duration) -> Duration {
    let packet = airtime.map_or(Duration::ZERO, |airtime| airtime(MAX_PACKET));
    least.max(2 * packet)
}

impl Standstill {
    /// Over when nothing has left for `patience`; on a slow line that still moves, after three
    /// times that.
    pub fn of(tally: &Arc<Tally>, patience: Duration) -> Standstill {
        Standstill {
            tally: tally.clone(),
            timeout: patience,
            bytes: tally.bytes(),
            begun: Instant::now(),
            moved: Instant::now(),
            since: Instant::now(),
            until: Instant::now() + 3 * patience,
            is_logged: false,
        }
    }

    /// Over at `until` at the latest.
    pub fn until(self, until: Instant) -> Standstill {
        Standstill {
            until: self.until.min(until),
            ..self
        }
    }

    /// Bytes left last at `moved`.
    pub fn moved(self, moved: Instant) -> Standstill {
        Standstill { moved, ..self }
    }

    /// Why what waits has not left.
    pub fn why(&self, airtime: Option<&Airtime>) -> Unsent {
        if self.tally.is_held_back() {
            Unsent::HeldBack
        } else if self.tally.awaits_proof() {
            Unsent::NotProved
        } else if self.moved.elapsed() < timeout(airtime, SOON) {
            Unsent::RunEnded
        } else {
            Unsent::NotRead
        }
    }

    /// Pauses for a moment; true if waiting any longer is useless.
    pub fn is_over(&mut self) -> bool {
        std::thread::sleep(Duration::from_millis(2));
        let (bytes, now) = (self.tally.bytes(), Instant::now());
        if bytes != self.bytes {
            (self.bytes, self.since, self.moved) = (bytes, now, now);
        }
        if self.begun.elapsed() > SOON && !std::mem::replace(&mut self.is_logged, true) {
            let what = if self.tally.is_held_back() {
                "packets that a fault holds back"
            } else {
                "the client to read what is queued"
            };
            tracing::warn!(
                "waiting for {what}: {:.1} s at most",
                self.until
                    .saturating_duration_since(self.begun)
                    .as_secs_f64()
            );
        }
        // Frames do not leave without proof.
        self.tally.awaits_proof() || self.since.elapsed() >= self.timeout || now >= self.until
    }
}
