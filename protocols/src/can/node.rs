//! One end of the bus: space packets on one side, CAN frames on the other, without I/O or clock.
//!
//! The caller passes in packets ([`Node::send`]) and received frames ([`Node::receive`]). It takes
//! frames to send from [`Node::next_frame`] when the bus is free: after each `send` and `receive`,
//! and at [`Node::wake_at`]. Times are microseconds of any monotonic clock.
//!
//! Packets of one APID keep their order. An attitude may overtake a long command: if a command must
//! apply to the next attitude, the client must await its Ack.

use crate::can::collector::{Collector, is_plain};
use crate::can::counts::count;
pub use crate::can::counts::{Counts, Side};
use crate::can::form::{FROM_EMULATOR, Frames, TO_EMULATOR};
use crate::can::frame::CanFrame;
use crate::can::isotp::{Parameters, Pdu};
use crate::can::receiver::Receiver;
use crate::can::sender::Sender;
use crate::packet::{MAX_PACKET, identify};

/// The two transmission methods on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lane {
    /// Plain frames that the DBC describes: attitudes, short commands, Acks.
    Plain,
    /// All other packets, by ISO-TP.
    Long,
}

/// This lane is still sending an earlier packet: retry the new one later. With a queue for each
/// lane ([`Node::lane`]) no lane delays the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Busy(pub Lane);

/// One end of the bus.
#[derive(Debug, Clone)]
pub struct Node {
    side: Side,
    parameters: Parameters,
    plain: Option<Frames>,
    /// Counter of the next attitude.
    counter: u8,
    sender: Sender,
    receiver: Receiver,
    collector: Collector,
    /// The long lane sends next, if a frame is due: a plain packet was sent since its last frame.
    long_turn: bool,
    counts: Counts,
}

impl Node {
    /// A node with default settings. `fd`: send FD frames with bit rate switch; both formats are
    /// always received.
    pub fn new(side: Side, fd: bool) -> Self {
        Self::with(
            side,
            if fd {
                Parameters::FD
            } else {
                Parameters::CLASSIC
            },
        )
    }

    /// A node with these settings of ISO-TP.
    pub fn with(side: Side, parameters: Parameters) -> Self {
        Self {
            side,
            parameters,
            plain: None,
            counter: 0,
            sender: Sender::new(),
            receiver: Receiver::new(),
            collector: Collector::new(side, parameters.timeout_us),
            long_turn: false,
            counts: Counts::default(),
        }
    }

    /// The lane of a packet.
    pub fn lane(&self, packet: &[u8]) -> Lane {
        match Frames::of(packet, 0) {
            Some(_) => Lane::Plain,
            None => Lane::Long,
        }
    }

    /// Accepts a packet for transmission. Invalid packets are sent by ISO-TP, so that the receiver
    /// can report their error; more than [`MAX_PACKET`] bytes count as `unsent`.
    ///
    /// # Errors
    /// [`Busy`]: its lane is sending a packet, or the other lane is sending one of the same APID.
    pub fn send(&mut self, packet: &[u8], now_us: u64) -> Result<(), Busy> {
        self.expire(now_us);
        let apid = identify(packet).map(|(apid, _)| apid);
        let of_plain = self.plain.map(|frames| frames.apid);
        let of_long = self.sender.message();
        let of_long = of_long.map(|message| identify(message).map(|(apid, _)| apid));
        let frames = Frames::of(packet, self.counter);
        match (of_plain, of_long) {
            (Some(ahead), _) if frames.is_some() || apid == Some(ahead) => {
                return Err(Busy(Lane::Plain));
            }
            (_, Some(ahead)) if frames.is_none() || apid == ahead => return Err(Busy(Lane::Long)),
            _ => {}
        }
        if frames.is_some() {
            self.plain = frames;
            self.counter = (self.counter + 1) % 8;
        } else if (1..=MAX_PACKET).contains(&packet.len()) {
            self.sender.start(packet);
        } else {
            count(&mut self.counts.unsent);
        }
        Ok(())
    }

    /// The next frame to send, if any is due. A returned frame counts as sent.
    ///
    /// A plain packet has priority, and its frames are consecutive. Between two plain packets the
    /// long lane sends one frame.
    pub fn next_frame(&mut self, now_us: u64) -> Option<CanFrame> {
        self.expire(now_us);
        let long_due = self.receiver.is_due() || self.sender.is_due(now_us);
        let yields = self.long_turn && long_due;
        if let Some(frames) = &mut self.plain
            && (frames.is_begun() || !yields)
        {
            let frame = frames.next(self.parameters.fd);
            if frames.is_done() {
                self.plain = None;
                self.long_turn = true;
            }
            return frame;
        }
        self.long_turn = false;
        let flow = self.receiver.next(&self.parameters, now_us);
        let piece = flow.or_else(|| self.sender.next(&self.parameters, now_us));
        let id = match self.side {
            Side::Emulator => FROM_EMULATOR,
            Side::Client => TO_EMULATOR,
        };
        let Parameters { fd, padding, .. } = self.parameters;
        CanFrame::new(id, fd, piece?.bytes(padding))
    }

    /// Time of the next call of [`next_frame`](Self::next_frame) if nothing is sent or received
    /// before it: a frame becomes due (0: is due now) or a timer expires.
    pub fn wake_at(&self) -> Option<u64> {
        let timers = [
            self.plain.map(|_| 0),
            self.sender.wake_at(),
            self.receiver.wake_at(),
            self.collector.wake_at(),
        ];
        timers.into_iter().flatten().min()
    }

    /// Processes a frame from the bus and returns the packet that it completes.
    pub fn receive(&mut self, frame: &CanFrame, now_us: u64) -> Option<&[u8]> {
        self.expire(now_us);
        let counts = &mut self.counts;
        let long = match self.side {
            Side::Emulator => TO_EMULATOR,
            Side::Client => FROM_EMULATOR,
        };
        let is_ours = !frame.extended && (frame.id == long || is_plain(self.side, frame.id));
        if frame.error || !is_ours {
            count(&mut counts.ignored);
            return None;
        }
        if frame.remote || !frame.is_valid() {
            count(&mut counts.malformed);
            return None;
        }
        if frame.id != long {
            return self.collector.receive(frame, now_us, counts);
        }
        match Pdu::parse(frame.payload()) {
            Some(Pdu::Flow(flow)) => {
                self.sender.flow(flow, &self.parameters, now_us, counts);
                None
            }
            Some(pdu) => {
                self.receiver
                    .receive(pdu, frame.len.into(), &self.parameters, now_us, counts)
            }
            None => {
                count(&mut counts.malformed);
                None
            }
        }
    }

    /// Whether a lane has nothing to send.
    pub fn is_idle(&self, lane: Lane) -> bool {
        match lane {
            Lane::Plain => self.plain.is_none(),
            Lane::Long => self.sender.is_idle(),
        }
    }

    /// Errors so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn expire(&mut self, now_us: u64) {
        self.sender.expire(now_us, &mut self.counts);
        self.receiver.expire(now_us, &mut self.counts);
        self.collector.expire(now_us, &mut self.counts);
    }
}
