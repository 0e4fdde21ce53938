//! The receiving side of ISO-TP: reassembles one message at a time and sends flow control.

use crate::can::counts::{Counts, count};
use crate::can::isotp::{CONTINUE, OVERFLOW, Parameters, Pdu, Piece};
use crate::packet::MAX_PACKET;

#[derive(Debug, Clone)]
pub(crate) struct Receiver {
    message: [u8; MAX_PACKET],
    length: usize,
    received: usize,
    /// Sequence number that the next consecutive frame must have.
    number: u8,
    /// RX_DL: bytes of the first frame, and of all but the last.
    frame_bytes: usize,
    /// Consecutive frames until the next flow control; 0: no further flow control.
    left: u8,
    /// Deadline of the next frame; `None` without a message.
    deadline: Option<u64>,
    /// Flow status to send.
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
            deadline: None,
            reply: None,
        }
    }

    /// Time of the next frame to send (0: now) or of the timeout.
    pub(crate) fn wake_at(&self) -> Option<u64> {
        if self.is_due() {
            Some(0)
        } else {
            self.deadline
        }
    }

    pub(crate) fn is_due(&self) -> bool {
        self.reply.is_some()
    }

    /// Drops the message if the sender has been silent for N_Cr.
    pub(crate) fn expire(&mut self, now_us: u64, counts: &mut Counts) {
        if self.deadline.is_some_and(|deadline| deadline <= now_us) {
            count(&mut counts.timeouts);
            self.abandon(counts);
        }
    }

    /// The flow control that is due. N_Cr starts anew.
    pub(crate) fn next(&mut self, parameters: &Parameters, now_us: u64) -> Option<Piece> {
        let status = self.reply.take()?;
        if self.deadline.is_some() {
            self.restart_timer(parameters, now_us);
        }
        let flow = [0x30 | status, parameters.block_size, parameters.st_min];
        Some(Piece::new(&flow))
    }

    /// Processes a frame of `frame_bytes` and returns the message that it completes. An unexpected
    /// single or first frame drops the current message and starts a new one (9.8.3, table of
    /// unexpected PDUs).
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
                self.abandon(counts);
                self.length = data.len();
                self.received = 0;
                self.append(data);
            }
            Pdu::First { length, .. } if length > MAX_PACKET => {
                self.abandon(counts);
                count(&mut counts.oversize);
                self.reply = Some(OVERFLOW);
                return None;
            }
            Pdu::First { length, data } => {
                self.abandon(counts);
                (self.length, self.received) = (length, 0);
                (self.number, self.frame_bytes) = (1, frame_bytes);
                self.append(data);
                self.request_block(parameters, now_us);
                return None;
            }
            Pdu::Consecutive { number, data } => {
                if !self.expects(data, frame_bytes) {
                    count(&mut counts.ignored);
                    return None;
                }
                if number != self.number {
                    count(&mut counts.sequence_errors);
                    self.abandon(counts);
                    return None;
                }
                self.number = (number + 1) % 16;
                self.append(data);
                if self.received < self.length {
                    self.await_next(parameters, now_us);
                    return None;
                }
                self.deadline = None;
            }
            Pdu::Flow(_) => return None,
        }
        self.message.get(..self.length)
    }

    /// A consecutive frame is as long as the first; only the last may be shorter.
    fn expects(&self, data: &[u8], frame_bytes: usize) -> bool {
        let last = self.length - self.received <= data.len();
        let fits = frame_bytes == self.frame_bytes || last && frame_bytes < self.frame_bytes;
        self.deadline.is_some() && fits
    }

    fn await_next(&mut self, parameters: &Parameters, now_us: u64) {
        if self.left == 1 {
            self.request_block(parameters, now_us);
        } else {
            self.left = self.left.saturating_sub(1);
            self.restart_timer(parameters, now_us);
        }
    }

    fn request_block(&mut self, parameters: &Parameters, now_us: u64) {
        self.left = parameters.block_size;
        self.reply = Some(CONTINUE);
        self.restart_timer(parameters, now_us);
    }

    fn restart_timer(&mut self, parameters: &Parameters, now_us: u64) {
        self.deadline = Some(now_us.saturating_add(parameters.timeout_us));
    }

    fn append(&mut self, data: &[u8]) {
        let room = self.message.get_mut(self.received..self.length);
        for (to, from) in room.unwrap_or_default().iter_mut().zip(data) {
            *to = *from;
            self.received += 1;
        }
    }

    /// Drops the current message, if there is one.
    fn abandon(&mut self, counts: &mut Counts) {
        self.reply = None;
        if self.deadline.take().is_some() {
            count(&mut counts.incomplete);
        }
    }
}
