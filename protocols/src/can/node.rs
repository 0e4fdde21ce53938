//! One end of the bus: space packets on one side, CAN frames on the other, no I/O and no clock of its own.
//!
//! The caller hands in packets ([`Node::send`]) and received frames ([`Node::receive`]), and asks for frames to send
//! ([`Node::next_frame`]) whenever the bus takes one: after each `send` and `receive`, and at [`Node::wake_at`]. Times are
//! microseconds of any clock that does not run backwards.

use crate::can::frame::CanFrame;

/// Which end of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Takes commands and attitudes.
    Emulator,
    /// The flight computer.
    Client,
}

/// The two ways over the bus. A packet waits only for earlier ones of its lane, and for those of its APID.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lane {
    /// Plain frames that the DBC describes: attitudes, short commands, Acks.
    Plain,
    /// Whole packets by ISO-TP: all others.
    Long,
}

/// The lane still has a packet under way: send this one again later. [`Node::lane`] tells which lane a packet takes, so
/// that a caller can keep a queue for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Busy(pub Lane);

/// What went wrong since the start, modulo 2^32.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Received ISO-TP messages given up because of a wrong sequence number.
    pub sequence_errors: u32,
    /// Messages given up because the other end fell silent: either direction, and attitudes.
    pub timeouts: u32,
    /// Attitudes and ISO-TP messages that began to arrive and were never whole, for any reason.
    pub incomplete: u32,
    /// Packets that did not get through to the other end: it fell silent, waits too long or has no room.
    pub unsent: u32,
    /// Messages announced as longer than any packet, refused.
    pub oversize: u32,
    /// Frames that mean nothing here: unknown identifiers, lengths or types, late or repeated parts.
    pub ignored: u32,
}

/// One end of the bus.
#[derive(Debug, Clone)]
pub struct Node {
    counts: Counts,
}

impl Node {
    /// Nothing sent, nothing received. `fd`: send FD frames with bit rate switch; both formats are received always.
    pub fn new(_side: Side, _fd: bool) -> Self {
        Self {
            counts: Counts::default(),
        }
    }

    /// Which lane a packet takes.
    pub fn lane(&self, _packet: &[u8]) -> Lane {
        Lane::Long
    }

    /// Takes a packet, to be cut into frames.
    ///
    /// # Errors
    /// [`Busy`]: its lane, or its APID on the other one, has a packet under way.
    pub fn send(&mut self, _packet: &[u8], _now_us: u64) -> Result<(), Busy> {
        Err(Busy(Lane::Long))
    }

    /// The next frame to send, if any is due. A frame once given counts as sent.
    pub fn next_frame(&mut self, _now_us: u64) -> Option<CanFrame> {
        None
    }

    /// When [`next_frame`](Self::next_frame) is to be called even if nothing is sent or received: a frame falls due (0: one
    /// is due) or a timer ends.
    pub fn wake_at(&self) -> Option<u64> {
        None
    }

    /// Takes a frame from the bus; the packet that it completes.
    pub fn receive(&mut self, _frame: &CanFrame, _now_us: u64) -> Option<&[u8]> {
        None
    }

    /// Whether a lane has nothing under way.
    pub fn is_idle(&self, _lane: Lane) -> bool {
        true
    }

    /// What went wrong so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }
}
