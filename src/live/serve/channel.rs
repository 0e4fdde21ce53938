//! One link of a run, with the state of its client.

use super::delivery::{Delivery, Progress};
use super::exchange::Exchange;
use super::reasons::{name, not_reached};
use super::report_log::ReportLog;
use super::telemetry::{SentFrame, add};
use crate::metrics::Snapshot;
use crate::stats::{FrameCounters, Pending};
use crate::timing::Latencies;
use bytes::{Bytes, BytesMut};
use skyloop_link::{
    FaultEffect, LinkError, Outbound, Roles, Wire, is_of_frame, standstill_timeout,
};
use skyloop_orbit::time::utc_days_since_j2000;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{Direction, MAX_PACKET, Output, Withheld};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Maximum number of answers that wait for room in the link's queue.
const MAX_ANSWERS: usize = 1024;
/// Bytes allocated at once for frame packets; freed with the last packet in them.
const PACKET_BUFFER: usize = 32 * MAX_PACKET;

/// One link of a run.
pub(super) struct Channel {
    pub wire: Wire,
    pub roles: Roles,
    pub counts: SequenceCounts,
    /// Memory for the next frame packets.
    pub packet_buffer: BytesMut,
    pub exchange: Exchange,
    /// Frames to be sent, in this order.
    pub deliveries: VecDeque<Delivery>,
    /// Packets that never entered the link's queue.
    pub lost: u32,
    /// How the requests for its frames ended.
    pub frames: FrameCounters,
    pub latencies: Latencies,
    /// The last frame that was sent completely.
    pub last: Option<SentFrame>,
    /// The last frame, complete or not.
    pub latest: Option<SentFrame>,
    pub report_log: ReportLog,
    pub flow: Flow,
    pub superseded: Superseded,
    /// Whether the link has ended.
    pub gone: bool,
    /// Packets queued after the last frame packet.
    behind: u32,
}

/// When bytes last left a link whose queue holds frame packets.
#[derive(Debug)]
pub(super) struct Flow {
    bytes: u32,
    moved: Instant,
    /// Whether the standstill is reported, and whether Status still shows it.
    pub reported: bool,
    pub in_status: bool,
}

/// Frames that were replaced by newer ones before their cause was known.
#[derive(Debug, Default)]
pub(super) struct Superseded {
    entries: Vec<Pending>,
    /// Number of the last one, and the bytes that had left the link when the first was replaced.
    pub frame: u32,
    pub bytes: u32,
}

impl Channel {
    pub fn new(wire: Wire, roles: Roles, output: Output) -> Channel {
        let exchange = Exchange {
            output,
            ..Exchange::default()
        };
        Channel {
            wire,
            roles,
            counts: SequenceCounts::new(),
            packet_buffer: BytesMut::with_capacity(PACKET_BUFFER),
            exchange,
            deliveries: VecDeque::new(),
            lost: 0,
            frames: FrameCounters::default(),
            latencies: Latencies::default(),
            last: None,
            latest: None,
            report_log: ReportLog::default(),
            flow: Flow {
                bytes: 0,
                moved: Instant::now(),
                reported: false,
                in_status: false,
            },
            superseded: Superseded::default(),
            gone: false,
            behind: 0,
        }
    }

    /// Begins the exchange of another client.
    pub fn open_exchange(&mut self, number: u32, output: Output) {
        self.lose_answers();
        self.settle_superseded(name(Withheld::SlowLink));
        self.exchange = Exchange::open(number, output, self.wire.tally.lost_to_faults());
    }

    /// Restarts the exchange of the same client.
    pub fn reset(&mut self, output: Output, now: Instant) {
        self.settle_superseded(name(Withheld::SlowLink));
        let lost_to_faults = self.wire.tally.lost_to_faults();
        self.exchange.reset(output, lost_to_faults, now);
    }

    /// Queues an answer. If [`MAX_ANSWERS`] already wait, the new one is lost.
    pub fn answer(&mut self, answer: Bytes) -> Result<(), LinkError> {
        if self.exchange.answers.len() >= MAX_ANSWERS {
            add(&mut self.lost, 1);
            if !std::mem::replace(&mut self.exchange.overrun, true) {
                tracing::warn!(
                    "{MAX_ANSWERS} answers wait: the client does not read them, or requests more than the link carries; further answers are lost, and counted"
                );
            }
            return Ok(());
        }
        self.exchange.answers.push_back(answer);
        self.flush().map(|_| ())
    }

    /// How many more answers can be queued.
    pub fn room(&self) -> usize {
        MAX_ANSWERS - self.exchange.answers.len()
    }

    /// Hands waiting answers to the link while it has room; true when nothing waits any more.
    pub fn flush(&mut self) -> Result<bool, LinkError> {
        while let Some(packet) = self.exchange.answers.pop_front() {
            if !self.offer(&packet)? {
                self.exchange.answers.push_front(packet);
                return Ok(false);
            }
        }
        if let Some(requested) = self.exchange.release {
            let exchange = self.exchange.number;
            let back = self.push(Outbound::Release {
                exchange,
                requested,
            })?;
            if back.is_some() {
                return Ok(false);
            }
            self.exchange.release = None;
        }
        Ok(true)
    }

    /// Hands one packet to the link; false if it has no room.
    pub fn offer(&mut self, packet: &Bytes) -> Result<bool, LinkError> {
        let exchange = self.exchange.number;
        let (paid, packet) = (is_of_frame(packet), packet.clone());
        let back = self.push(Outbound::Packet { exchange, packet })?;
        if let Some(Outbound::Packet { .. }) = back {
            return Ok(false);
        }
        self.behind = if paid { 0 } else { self.behind.wrapping_add(1) };
        Ok(true)
    }

    fn push(&mut self, item: Outbound) -> Result<Option<Outbound>, LinkError> {
        let result = self.wire.outbox.offer(item);
        self.gone |= result.is_err();
        result
    }

    /// Whether frame packets are in the link's queue: the client cannot grant credit for them yet.
    pub fn carries_frames(&self) -> bool {
        self.wire.tally.waiting() > self.behind
    }

    /// Evidence that the client takes data.
    pub fn progress(&self) -> Progress {
        Progress {
            credit: self.exchange.credit.granted(),
            bytes: self.wire.tally.bytes(),
        }
    }

    /// Notes whether bytes leave while frame packets wait.
    pub fn watch(&mut self, now: Instant) {
        let bytes = self.wire.tally.bytes();
        if bytes == self.flow.bytes && self.carries_frames() {
            return;
        }
        if self.flow.in_status {
            self.exchange.withheld = Withheld::None;
        }
        self.flow = Flow {
            bytes,
            moved: now,
            reported: false,
            in_status: false,
        };
    }

    /// When bytes last left while frame packets waited.
    pub fn moved(&self) -> Instant {
        self.flow.moved
    }

    /// Whether no byte has left the link for `min`, or for the airtime of a packet if that is
    /// longer. Packets held back by a fault are no standstill.
    pub fn stands_still(&self, min: Duration) -> bool {
        let airtime = self.wire.airtime.as_ref();
        self.flow.moved.elapsed() >= standstill_timeout(airtime, min)
            && !self.wire.tally.is_held_back()
    }

    /// Effects of injected faults on packets in and out, in this exchange.
    pub fn fault_effects(&self) -> [Option<FaultEffect>; 2] {
        let [lost_in, lost_out] = self.exchange.lost_to_faults;
        [(Direction::In, lost_in), (Direction::Out, lost_out)]
            .map(|(direction, before)| self.wire.tally.fault_effect(direction, before))
    }

    /// Whether the client gets no frames: it took nothing for too long, and has not recovered.
    pub fn is_muted(&mut self) -> bool {
        let tally = &self.wire.tally;
        if let Some(mute) = self.exchange.muted {
            let is_over = match mute.why {
                Withheld::NoProof => !tally.awaits_proof(),
                Withheld::NotRead => {
                    mute.has_sent && (tally.bytes() != mute.bytes || tally.waiting() == 0)
                }
                _ => self.exchange.credit.may_send(),
            };
            if is_over {
                self.exchange.muted = None;
            }
        }
        self.exchange.muted.is_some()
    }

    /// How long the packets in the link's queue take to leave, if that is known.
    pub fn backlog(&self) -> Duration {
        let packets = self.wire.tally.waiting();
        self.wire.packet_airtime().saturating_mul(packets)
    }

    pub fn lose_answers(&mut self) {
        let waiting = std::mem::take(&mut self.exchange.answers);
        add(&mut self.lost, waiting.len() as u32);
    }

    /// Adds a delivery. If there are more than `max`, returns the oldest that has not begun.
    pub fn enqueue(&mut self, mut delivery: Delivery, max: usize) -> Option<Delivery> {
        delivery.unproved = self.wire.tally.unproved();
        self.deliveries.push_back(delivery);
        if self.deliveries.len() <= max {
            return None;
        }
        let mut deliveries = self.deliveries.iter();
        let at = deliveries.position(|delivery| !delivery.has_begun())?;
        self.deliveries.remove(at)
    }

    /// Whether the client of an exchange has gone, or another followed.
    pub fn has_gone(&self, exchange: u32) -> bool {
        self.exchange.number != exchange || self.wire.tally.has_ended(exchange)
    }

    /// Whether the present client waits for a frame.
    pub fn awaits(&self, frame: u32) -> bool {
        let mut deliveries = self.deliveries.iter();
        deliveries.any(|delivery| delivery.frame == frame && delivery.is_for(&self.exchange))
    }

    /// Reports in the log and in Status that the client does not get a frame, or will not.
    pub fn report(&mut self, why: Withheld, detail: &str) {
        self.warn(why, &not_reached(why, detail));
    }

    /// Reports in the log and in Status why frames do not come, or come late.
    pub fn warn(&mut self, why: Withheld, message: &str) {
        self.exchange.withheld = why;
        self.exchange.is_in_status = false;
        self.flow.in_status = false;
        self.log(why, message);
    }

    /// Logs a message with the remedy.
    pub fn log(&mut self, why: Withheld, message: &str) {
        let effects = self.fault_effects();
        self.report_log
            .log(&self.wire.address, why, message, effects);
    }

    /// Notes a superseded frame whose cause is not known yet.
    pub fn supersede(&mut self, frame: u32, entry: Pending) {
        if self.superseded.entries.is_empty() {
            self.superseded.bytes = self.wire.tally.bytes();
        }
        self.superseded.frame = frame;
        self.superseded.entries.push(entry);
    }

    /// Whether superseded frames have no cause yet.
    pub fn has_superseded(&self) -> bool {
        !self.superseded.entries.is_empty()
    }

    /// Counts the superseded frames under a cause.
    pub fn settle_superseded(&mut self, cause: &'static str) {
        for entry in std::mem::take(&mut self.superseded.entries) {
            self.frames.withhold(entry, cause);
        }
    }

    /// Its metrics; `frames` includes the skipped exposures.
    pub fn snapshot(&self, frames: FrameCounters) -> Snapshot {
        let mut snapshot = Snapshot::of(&self.latencies);
        (snapshot.requested, snapshot.delivered) = (frames.requested, frames.delivered);
        snapshot.withheld = frames.withheld.into_iter().collect();
        if let Some(SentFrame {
            times, exposure, ..
        }) = &self.latest
        {
            snapshot.attitude_age_s = Some(times.attitude_age_s);
            let has_deadline = times.spare_s != f64::INFINITY;
            snapshot.deadline_spare_s = has_deadline.then_some(times.spare_s);
            snapshot.exposure_s = exposure.map(|exposure| {
                // 1970-01-01 is J2000.0 less 10957.5 days.
                let unix_s = |at| (utc_days_since_j2000(at) + 10_957.5) * 86_400.0;
                [exposure.start, exposure.mid, exposure.end].map(unix_s)
            });
        }
        snapshot
    }
}
