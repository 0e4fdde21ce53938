//! The receiving side of ISO-TP: puts one message at a time together and asks for the rest of it.

use crate::can::counts::{Counts, count};
use crate::can::isotp::{CONTINUE, OVERFLOW, Parameters, Pdu, Piece};
use crate::packet::MAX_PACKET;

/// Receives one message.
#[derive(Debug, Clone)]
pub(crate) struct Receiver {
    message: [u8; MAX_PACKET],
    length: usize,
    received: usize,
    /// Sequence number that the next consecutive frame must have.
    number: u8,
    /// RX_DL: octets of the first frame, and so of all but the last.
    frame_bytes: usize,
    /// Consecutive frames until the next flow control; 0: no more of them.
    left: u8,
    /// A message is under way, until this time without a frame.
    until: Option<u64>,
    /// Flow status to be sent.
    reply: Option<u8>,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self {
            message: [0; MAX_PACKET],
            length: 0,
            received: 0,
            number: 0,
            frame_bytes: 0,
            left: 0,
            until: None,
            reply: None,
        }
    }

    /// When it has a frame or gives up waiting.
    pub(crate) fn wake_at(&self) -> Option<u64> {
        if self.is_due() { Some(0) } else { self.until }
    }

    pub(crate) fn is_due(&self) -> bool {
        self.reply.is_some()
    }

    /// Gives up if the sender has been silent for N_Cr.
    pub(crate) fn expire(&mut self, now_us: u64, counts: &mut Counts) {
        if self.until.is_some_and(|until| until <= now_us) {
            count(&mut counts.timeouts);
            self.give_up(counts);
        }
    }

    /// The flow control that is due. N_Cr runs from here.
    pub(crate) fn next(&mut self, parameters: &Parameters, now_us: u64) -> Option<Piece> {
        let status = self.reply.take()?;
        if self.until.is_some() {
            self.until = Some(now_us.saturating_add(parameters.timeout_us));
        }
        let flow = [0x30 | status, parameters.block_size, parameters.st_min];
        Some(Piece::new(&flow))
    }

    /// Takes a frame of the message's direction, of `frame_octets`; the message that it completes. An unexpected single
    /// or first frame ends the message under way and begins its own (9.8.3, table of unexpected PDUs).
    pub(crate) fn receive(
        &mut self,
        pdu: Pdu<'_>,
        frame_bytes: usize,
        parameters: &Parameters,
        now_us: u64,
        counts: &mut Counts,
    ) -> Option<&[u8]> {
        match pdu {
            Pdu::Single(data) => {
                self.give_up(counts);
                self.length = data.len();
                self.received = 0;
                self.append(data);
            }
            Pdu::First { length, .. } if length > MAX_PACKET => {
                self.give_up(counts);
                count(&mut counts.oversize);
                self.reply = Some(OVERFLOW);
                return None;
            }
            Pdu::First { length, data } => {
                self.give_up(counts);
                (self.length, self.received) = (length, 0);
                (self.number, self.frame_bytes) = (1, frame_bytes);
                self.append(data);
                self.ask(parameters, now_us);
                return None;
            }
            Pdu::Consecutive { number, data } => {
                if !self.expects(data, frame_bytes) {
                    count(&mut counts.ignored);
                    return None;
                }
                if number != self.number {
                    count(&mut counts.sequence_errors);
                    self.give_up(counts);
                    return None;
                }
                self.number = (number + 1) % 16;
                self.append(data);
                if self.received < self.length {
                    self.go_on(parameters, now_us);
                    return None;
                }
                self.until = None;
            }
            Pdu::Flow(_) => return None,
        }
        self.message.get(..self.length)
    }

    /// A consecutive frame is as long as the first; only the last may be shorter.
    fn expects(&self, data: &[u8], frame_bytes: usize) -> bool {
        let last = self.length - self.received <= data.len();
        let fits = frame_bytes == self.frame_bytes || last && frame_bytes < self.frame_bytes;
        self.until.is_some() && fits
    }

    fn go_on(&mut self, parameters: &Parameters, now_us: u64) {
        match self.left {
            1 => self.ask(parameters, now_us),
            left => {
                self.left = left.saturating_sub(1);
                self.until = Some(now_us.saturating_add(parameters.timeout_us));
            }
        }
    }

    fn ask(&mut self, parameters: &Parameters, now_us: u64) {
        self.left = parameters.block_size;
        self.reply = Some(CONTINUE);
        self.until = Some(now_us.saturating_add(parameters.timeout_us));
    }

    fn append(&mut self, data: &[u8]) {
        let room = self.message.get_mut(self.received..self.length);
        for (to, from) in room.unwrap_or_default().iter_mut().zip(data) {
            *to = *from;
            self.received += 1;
        }
    }

    /// Drops the message under way, if there is one.
    fn give_up(&mut self, counts: &mut Counts) {
        self.reply = None;
        if self.until.take().is_some() {
            count(&mut counts.incomplete);
        }
    }
}
