//! The sending side of ISO-TP: one message at a time, paced by the receiver's flow control.

use crate::can::counts::{Counts, count};
use crate::can::isotp::{CONTINUE, Flow, Parameters, Piece, WAIT, max_single, separation_us};
use crate::packet::MAX_PACKET;

#[derive(Debug, Clone)]
pub(crate) struct Sender {
    message: [u8; MAX_PACKET],
    length: usize,
    sent: usize,
    /// Sequence number of the next consecutive frame.
    number: u8,
    /// Successive "wait" flow controls.
    waits: u8,
    state: State,
}

#[derive(Debug, Clone, Copy)]
enum State {
    Idle,
    /// The single or first frame is due.
    Begin,
    /// Awaits flow control until this time.
    Waiting(u64),
    /// Sends consecutive frames.
    Sending {
        /// Frames until the next flow control; `None` without one.
        left: Option<u8>,
        gap_us: u64,
        next_at: u64,
    },
}

impl Sender {
    pub(crate) const fn new() -> Self {
        Self {
            message: [0; MAX_PACKET],
            length: 0,
            sent: 0,
            number: 0,
            waits: 0,
            state: State::Idle,
        }
    }

    pub(crate) fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// The current message.
    pub(crate) fn message(&self) -> Option<&[u8]> {
        self.message.get(..self.length).filter(|_| !self.is_idle())
    }

    /// Replaces the current message. An empty or too long message leaves nothing to send.
    pub(crate) fn start(&mut self, message: &[u8]) {
        self.state = State::Idle;
        if let Some(room) = self.message.get_mut(..message.len())
            && !message.is_empty()
        {
            room.copy_from_slice(message);
            self.length = message.len();
            self.sent = 0;
            self.state = State::Begin;
        }
    }

    /// Time of the next frame (0: now) or of the timeout.
    pub(crate) fn wake_at(&self) -> Option<u64> {
        match self.state {
            State::Idle => None,
            State::Begin => Some(0),
            State::Waiting(until) => Some(until),
            State::Sending { next_at, .. } => Some(next_at),
        }
    }

    pub(crate) fn is_due(&self, now_us: u64) -> bool {
        match self.state {
            State::Begin => true,
            State::Sending { next_at, .. } => next_at <= now_us,
            State::Idle | State::Waiting(_) => false,
        }
    }

    /// Drops the message if the receiver has been silent for N_Bs.
    pub(crate) fn expire(&mut self, now_us: u64, counts: &mut Counts) {
        if matches!(self.state, State::Waiting(until) if until <= now_us) {
            count(&mut counts.timeouts);
            self.abandon(counts);
        }
    }

    /// The data of the next frame, if it is due.
    pub(crate) fn next(&mut self, parameters: &Parameters, now_us: u64) -> Option<Piece> {
        match self.state {
            State::Idle | State::Waiting(_) => None,
            State::Begin => Some(self.begin(parameters, now_us)),
            State::Sending { next_at, .. } if next_at > now_us => None,
            State::Sending { left, gap_us, .. } => {
                let mut piece = Piece::new(&[0x20 | self.number]);
                self.number = (self.number + 1) % 16;
                self.append(&mut piece, parameters);
                let left = left.map(|left| left.saturating_sub(1));
                if self.sent == self.length || left == Some(0) {
                    self.pause(parameters, now_us);
                } else {
                    let next_at = now_us.saturating_add(gap_us);
                    self.state = State::Sending {
                        left,
                        gap_us,
                        next_at,
                    };
                }
                Some(piece)
            }
        }
    }

    fn begin(&mut self, parameters: &Parameters, now_us: u64) -> Piece {
        // At most MAX_PACKET, which fits 12 bits.
        let length = self.length as u16;
        let mut piece = if self.length <= max_single(0) {
            Piece::new(&[length as u8])
        } else if self.length <= max_single(parameters.full()) {
            Piece::new(&[0, length as u8])
        } else {
            Piece::new(&(0x1000 | length).to_be_bytes())
        };
        self.append(&mut piece, parameters);
        (self.number, self.waits) = (1, 0);
        self.pause(parameters, now_us);
        piece
    }

    /// Awaits flow control, unless the message is complete.
    fn pause(&mut self, parameters: &Parameters, now_us: u64) {
        self.state = if self.sent == self.length {
            State::Idle
        } else {
            State::Waiting(now_us.saturating_add(parameters.timeout_us))
        };
    }

    fn append(&mut self, piece: &mut Piece, parameters: &Parameters) {
        let rest = self.message.get(self.sent..self.length);
        self.sent += piece.fill(rest.unwrap_or_default(), parameters.full());
    }

    /// Applies flow control. Block size and separation time hold until the next one (9.6.5.6).
    pub(crate) fn flow(
        &mut self,
        flow: Flow,
        parameters: &Parameters,
        now_us: u64,
        counts: &mut Counts,
    ) {
        if !matches!(self.state, State::Waiting(_)) {
            return count(&mut counts.ignored);
        }
        match flow.status {
            CONTINUE => {
                self.waits = 0;
                self.state = State::Sending {
                    left: (flow.block_size > 0).then_some(flow.block_size),
                    gap_us: separation_us(flow.st_min),
                    next_at: now_us,
                };
            }
            WAIT if self.waits < parameters.most_waits => {
                self.waits += 1;
                self.state = State::Waiting(now_us.saturating_add(parameters.timeout_us));
            }
            // Too many waits (N_WFT_OVRN), overflow (N_BUFFER_OVFLW) or invalid (N_INVALID_FS).
            _ => self.abandon(counts),
        }
    }

    fn abandon(&mut self, counts: &mut Counts) {
        self.state = State::Idle;
        count(&mut counts.unsent);
    }
}
