//! One end of the bus: space packets on one side, CAN frames on the other, no I/O and no clock of its own.
//!
//! The caller hands in packets ([`Node::send`]) and received frames ([`Node::receive`]), and asks for frames to send
//! ([`Node::next_frame`]) whenever the bus takes one: after each `send` and `receive`, and at [`Node::wake_at`]. Times are
//! microseconds of any clock that does not run backwards.
//!
//! Packets of one APID keep their order. An attitude may overtake a long command: a client whose command must act on its
//! next attitude waits for the Ack.

use crate::can::collector::{Collector, is_plain};
use crate::can::counts::count;
pub use crate::can::counts::{Counts, Side};
use crate::can::form::{FROM_EMULATOR, Frames, TO_EMULATOR};
use crate::can::frame::CanFrame;
use crate::can::isotp::{Parameters, Pdu};
use crate::can::receiver::Receiver;
use crate::can::sender::Sender;
use crate::packet::{MAX_PACKET, identify};

/// The two ways over the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lane {
    /// Plain frames that the DBC describes: attitudes, short commands, Acks.
    Plain,
    /// Whole packets by ISO-TP: all others.
    Long,
}

/// This lane still has a packet under way that goes first: send the new one again later. A caller with a queue for each lane
/// ([`Node::lane`]) lets neither wait for the other.
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
    /// A plain packet has gone since the last frame of the long lane, whose turn it is.
    long_turn: bool,
    counts: Counts,
}

impl Node {
    /// Nothing sent, nothing received. `fd`: send FD frames with bit rate switch; both formats are received always.
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

    /// The same with other settings of ISO-TP.
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

    /// Which lane a packet takes.
    pub fn lane(&self, packet: &[u8]) -> Lane {
        match Frames::of(packet, 0) {
            Some(_) => Lane::Plain,
            None => Lane::Long,
        }
    }

    /// Takes a packet, to be cut into frames. Any octets are taken: what is no packet travels whole, and the other end sees
    /// what is wrong with it; more than [`MAX_PACKET`] of them count as `unsent`.
    ///
    /// # Errors
    /// [`Busy`]: its lane has a packet under way, or the other lane one of the same APID.
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

    /// The next frame to send, if any is due. A frame once given counts as sent.
    ///
    /// A plain packet goes first, and its frames follow each other; between two of them the long lane has one frame.
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

    /// When [`next_frame`](Self::next_frame) is to be called even if nothing is sent or received: a frame falls due (0: one
    /// is due) or a timer ends.
    pub fn wake_at(&self) -> Option<u64> {
        let timers = [
            self.plain.map(|_| 0),
            self.sender.wake_at(),
            self.receiver.wake_at(),
            self.collector.wake_at(),
        ];
        timers.into_iter().flatten().min()
    }

    /// Takes a frame from the bus; the packet that it completes.
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

    /// What went wrong so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn expire(&mut self, now_us: u64) {
        self.sender.expire(now_us, &mut self.counts);
        self.receiver.expire(now_us, &mut self.counts);
        self.collector.expire(now_us, &mut self.counts);
    }
}
