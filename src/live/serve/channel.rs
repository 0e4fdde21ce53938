//! One link, and what its client has agreed with the emulator.

use super::add;
use super::deliver::Delivery;
use super::leaving::Left;
use super::passed::Passed;
use super::withheld::{Messages, name};
use crate::stats::FrameAccount;
use crate::timing::Latencies;
use bytes::{Bytes, BytesMut};
use skyloop_link::{Harm, LinkError, Outbound, Roles, Wire, is_of_frame, patience};
use skyloop_protocols::credit::CreditAccount;
use skyloop_protocols::sequence::{GapDetector, SequenceCounts};
use skyloop_protocols::{Direction, MAX_PACKET, Output, Positions, Withheld};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Answers that may wait for room in the link's queue.
pub(super) const MAX_ANSWERS: usize = 1024;
/// Bytes of a piece of memory for packets of frames: it is given back when the last packet in it is.
const PAPER: usize = 32 * MAX_PACKET;
/// Frames of which packets can be sent again: the present one and the one before.
const KEPT_FRAMES: usize = 2;

/// One link of a run.
pub(super) struct Channel {
    pub wire: Wire,
    pub roles: Roles,
    pub counts: SequenceCounts,
    /// Memory for the next packets of its frames.
    pub paper: BytesMut,
    pub exchange: Exchange,
    /// Frames on their way, the first to be sent first.
    pub deliveries: VecDeque<Delivery>,
    /// Packets that never got into the link's queue.
    pub lost: u32,
    /// How the requests for its frames ended.
    pub frames: FrameAccount,
    /// When its frames were where.
    pub latencies: Latencies,
    /// Of the frame that left it last whole.
    pub last: Option<Left>,
    /// Of the last frame, which may not have left.
    pub latest: Option<Left>,
    /// What the log says about frames that its client does not get.
    pub messages: Messages,
    pub flow: Flow,
    pub passed: Passed,
    /// Whether the link has ended.
    pub gone: bool,
    /// Packets that the link got after the last frame packet.
    behind: u32,
}

/// What one client has agreed with the emulator on a link.
#[derive(Debug, Default)]
pub(super) struct Exchange {
    pub number: u32,
    /// Whether its client has sent a valid packet: nobody else gets frames.
    pub heard: bool,
    /// Set where its client took nothing for too long: it gets no frames.
    pub deaf: Option<Deaf>,
    /// Why its client has not got the last frame whole.
    pub withheld: Withheld,
    /// Whether a Status has brought that reason.
    pub is_in_status: bool,
    /// Whether its client has sent a valid Trigger.
    pub triggered: bool,
    pub credit: CreditAccount,
    /// What its client granted first.
    pub window: Option<u32>,
    /// The most that it has granted at once since.
    pub step: u32,
    pub gaps: GapDetector,
    /// What each frame brings.
    pub output: Output,
    /// Where windows lie; empty: around the brightest stars.
    pub positions: Option<Positions>,
    /// The last frames, for those who ask again.
    pub kept: VecDeque<Kept>,
    /// Packets in and out that faults had lost when it began.
    lost_to_faults: [u32; 2],
    /// Counts Resets, so that a frame under way notices one.
    pub resets: u32,
    /// Answers for which the link has no room yet, oldest first.
    answers: VecDeque<Bytes>,
    /// Whether answers had to be dropped.
    overrun: bool,
    /// When the client asked to be released, until the link has been told.
    release: Option<Instant>,
}

/// Why a client gets no frames until it takes some again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deaf {
    pub why: Withheld,
    /// Bytes that had left its link.
    pub bytes: u32,
    /// Whether it has sent a packet since.
    pub heard: bool,
}

/// When bytes left a link last in whose queue packets of frames wait.
#[derive(Debug)]
pub(super) struct Flow {
    bytes: u32,
    moved: Instant,
    /// Whether it is reported that none leaves, and whether Status still says so.
    pub reported: bool,
    pub in_status: bool,
}

/// A frame's packets as they were sent.
#[derive(Debug)]
pub(super) struct Kept {
    pub frame: u32,
    pub packets: Vec<Bytes>,
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
            paper: BytesMut::with_capacity(PAPER),
            exchange,
            deliveries: VecDeque::new(),
            lost: 0,
            frames: FrameAccount::default(),
            latencies: Latencies::default(),
            last: None,
            latest: None,
            messages: Messages::default(),
            flow: Flow {
                bytes: 0,
                moved: Instant::now(),
                reported: false,
                in_status: false,
            },
            passed: Passed::default(),
            gone: false,
            behind: 0,
        }
    }

    /// Another client: nothing of the last one's is left.
    pub fn open_exchange(&mut self, number: u32, output: Output) {
        self.lose_answers();
        self.count_open(name(Withheld::SlowLink));
        self.exchange = Exchange {
            number,
            lost_to_faults: self.wire.tally.lost_to_faults(),
            output,
            ..Exchange::default()
        };
    }

    /// The same client begins anew: only its answers are left.
    pub fn reset(&mut self, output: Output, asked: Instant) {
        self.count_open(name(Withheld::SlowLink));
        let before = std::mem::take(&mut self.exchange);
        self.exchange = Exchange {
            number: before.number,
            heard: true,
            lost_to_faults: self.wire.tally.lost_to_faults(),
            resets: before.resets.wrapping_add(1),
            // What the link lacks it lacks still.
            deaf: before
                .deaf
                .filter(|deaf| matches!(deaf.why, Withheld::NoProof | Withheld::NotRead)),
            answers: before.answers,
            overrun: before.overrun,
            release: Some(asked),
            output,
            ..Exchange::default()
        };
    }

    /// Queues an answer behind those that wait. A client that takes nothing loses answers beyond [`MAX_ANSWERS`].
    pub fn answer(&mut self, answer: Bytes) -> Result<(), LinkError> {
        if self.exchange.answers.len() >= MAX_ANSWERS {
            add(&mut self.lost, 1);
            if !std::mem::replace(&mut self.exchange.overrun, true) {
                tracing::warn!(
                    "{MAX_ANSWERS} answers wait: the client does not read them, or asks for more than the link carries; more are lost, and counted"
                );
            }
            return Ok(());
        }
        self.exchange.answers.push_back(answer);
        self.flush().map(|_| ())
    }

    /// Answers that still fit.
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
        if let Some(asked) = self.exchange.release {
            let exchange = self.exchange.number;
            let back = self.give(Outbound::Release { exchange, asked })?;
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
        let back = self.give(Outbound::Packet { exchange, packet })?;
        let Some(Outbound::Packet { .. }) = back else {
            self.behind = if paid { 0 } else { self.behind.wrapping_add(1) };
            return Ok(true);
        };
        Ok(false)
    }

    fn give(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let given = self.wire.outbox.offer(what);
        self.gone |= given.is_err();
        given
    }

    /// Whether frame packets, sent again or not, have been given to the link and have not left it: the client cannot
    /// grant for them yet.
    pub fn carries_frames(&self) -> bool {
        self.wire.tally.waiting() > self.behind
    }

    /// Looks whether bytes leave while packets of frames wait.
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

    /// When bytes left last, as far as packets of frames waited.
    pub fn moved(&self) -> Instant {
        self.flow.moved
    }

    /// Whether for `least` no byte has left its link, where a packet takes less on it. A fault that holds packets back is no standstill.
    pub fn stands_still(&self, least: Duration) -> bool {
        let airtime = self.wire.airtime.as_ref();
        self.flow.moved.elapsed() >= patience(airtime, least) && !self.wire.tally.is_held_back()
    }

    /// What faults do to packets in and out, and have done in this exchange.
    pub fn harm(&self) -> [Option<Harm>; 2] {
        let [lost_in, lost_out] = self.exchange.lost_to_faults;
        [(Direction::In, lost_in), (Direction::Out, lost_out)]
            .map(|(direction, before)| self.wire.tally.harm(direction, before))
    }

    /// Whether its client gets no frames: it took nothing for too long, and what it lacked then it lacks still.
    pub fn is_deaf(&mut self) -> bool {
        let tally = &self.wire.tally;
        let is_over = |deaf: Deaf| match deaf.why {
            Withheld::NoProof => !tally.awaits_proof(),
            Withheld::NotRead => {
                deaf.heard && (tally.bytes() != deaf.bytes || tally.waiting() == 0)
            }
            _ => self.exchange.credit.may_send(),
        };
        if self.exchange.deaf.is_some_and(is_over) {
            self.exchange.deaf = None;
        }
        self.exchange.deaf.is_some()
    }

    /// How long what the link has got takes until it has left, where that is known.
    pub fn backlog(&self) -> Duration {
        let packets = self.wire.tally.waiting();
        self.wire.packet_airtime().saturating_mul(packets)
    }

    /// Counts the answers that wait as lost.
    pub fn lose_answers(&mut self) {
        add(
            &mut self.lost,
            self.exchange.answers.drain(..).count() as u32,
        );
    }

    /// Takes the oldest frame out that waits behind others, where more than `most` are on their way.
    pub fn make_way(&mut self, most: usize) -> Option<Delivery> {
        if self.deliveries.len() <= most {
            return None;
        }
        let at = self
            .deliveries
            .iter()
            .position(|delivery| !delivery.has_begun())?;
        self.deliveries.remove(at)
    }

    /// Whether the client of an exchange has gone, or was followed by another.
    pub fn has_gone(&self, exchange: u32) -> bool {
        self.exchange.number != exchange || self.wire.tally.has_ended(exchange)
    }

    /// Whether its client waits for that frame.
    pub fn awaits(&self, frame: u32) -> bool {
        let mut deliveries = self.deliveries.iter();
        deliveries.any(|delivery| delivery.frame == frame && delivery.is_for(&self.exchange))
    }

    /// Makes room for the packets of another frame.
    pub fn keep(&mut self, frame: u32) {
        while self.exchange.kept.len() >= KEPT_FRAMES {
            self.exchange.kept.pop_front();
        }
        self.exchange.kept.push_back(Kept {
            frame,
            packets: Vec::new(),
        });
    }
}
