//! Reassembles packets from the plain frames of the [CAN form](crate::can::form).

use crate::can::counts::{Counts, Side, count};
use crate::can::form::{
    ATTITUDE_BEGIN, ATTITUDE_END, END, FRAMES, LONGEST, SHORT_ACK, SHORT_COMMAND, has_state,
    rebuild,
};
use crate::can::frame::CanFrame;
use crate::command::Opcode;
use crate::packet::{self, apid};
use crate::time::WireTime;
use crate::wire::Writer;

/// Whether this side receives plain frames with this identifier.
pub(crate) const fn is_plain(side: Side, id: u32) -> bool {
    match side {
        Side::Emulator => matches!(id, ATTITUDE_BEGIN..=ATTITUDE_END | SHORT_COMMAND),
        Side::Client => id == SHORT_ACK,
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Collector {
    side: Side,
    /// Longest time from the first to the last frame of an attitude, µs.
    timeout_us: u64,
    packet: [u8; LONGEST],
    words: [u64; FRAMES],
    /// Received frames of the current attitude, a bit for each index.
    seen: u16,
    counter: u8,
    /// Deadline of the current attitude; `None` without one.
    deadline: Option<u64>,
    /// Counter of the last attitude that was delivered or counted as incomplete.
    last: Option<u8>,
    acks: u16,
}

impl Collector {
    pub(crate) fn new(side: Side, timeout_us: u64) -> Self {
        Self {
            side,
            timeout_us,
            packet: [0; LONGEST],
            words: [0; FRAMES],
            seen: 0,
            counter: 0,
            deadline: None,
            last: None,
            acks: 0,
        }
    }

    /// Deadline of the current attitude.
    pub(crate) fn wake_at(&self) -> Option<u64> {
        self.deadline
    }

    /// Drops the current attitude after its deadline.
    pub(crate) fn expire(&mut self, now_us: u64, counts: &mut Counts) {
        if self.deadline.is_some_and(|deadline| deadline <= now_us) {
            count(&mut counts.timeouts);
            self.abandon(counts);
        }
    }

    /// Processes a plain frame and returns the packet that it completes.
    pub(crate) fn receive(
        &mut self,
        frame: &CanFrame,
        now_us: u64,
        counts: &mut Counts,
    ) -> Option<&[u8]> {
        let data = frame.payload();
        let byte = |at| data.get(at).copied().unwrap_or(0);
        let word = u64::from_be_bytes(core::array::from_fn(byte));
        let length = match (self.side, frame.id, data.len()) {
            (Side::Emulator, ATTITUDE_BEGIN..=ATTITUDE_END, 8) => {
                self.attitude((frame.id - ATTITUDE_BEGIN) as usize, word, now_us, counts)?
            }
            (Side::Emulator, SHORT_COMMAND, 7) => self.command(word)?,
            (Side::Client, SHORT_ACK, 4) => self.ack((word >> 32) as u32)?,
            // Wrong length.
            _ => {
                count(&mut counts.malformed);
                return None;
            }
        };
        self.packet.get(..length)
    }

    fn command(&mut self, word: u64) -> Option<usize> {
        let (opcode, sequence_count) = ((word >> 56) as u8, (word >> 40) as u16);
        let payload = |writer: &mut Writer<'_>| {
            writer.u8(opcode)?;
            match Opcode::from_code(opcode) {
                Some(Opcode::Credit) => writer.u32((word >> 8) as u32),
                _ => Ok(()), // the emulator's decoder refuses a missing argument
            }
        };
        let (time, buffer) = (WireTime(0), &mut self.packet);
        packet::write(apid::COMMAND, sequence_count, time, buffer, payload).ok()
    }

    fn ack(&mut self, answered: u32) -> Option<usize> {
        let own = self.acks;
        self.acks = own.wrapping_add(1);
        let payload = |writer: &mut Writer<'_>| writer.u32(answered);
        packet::write(apid::ACK, own, WireTime(0), &mut self.packet, payload).ok()
    }

    /// An attitude is complete if all frames arrived between its first and its last, and the CRC of
    /// the packet is correct. Each incomplete attitude is counted once.
    fn attitude(
        &mut self,
        index: usize,
        word: u64,
        now_us: u64,
        counts: &mut Counts,
    ) -> Option<usize> {
        let counter_first = index == 0 || index == END;
        let counter = if counter_first { word >> 61 } else { word & 7 } as u8;
        let same = self.deadline.is_some() && counter == self.counter;
        let slot = self.words.get_mut(index)?;
        let repeated = same && self.seen >> index & 1 == 1 && *slot == word;
        if index == 0 && !repeated {
            *slot = word;
            self.abandon(counts);
            (self.seen, self.counter) = (1, counter);
            self.deadline = Some(now_us.saturating_add(self.timeout_us));
        } else if !same {
            self.abandon(counts);
            // Either a late frame of the last attitude, or an attitude without its first frame.
            let is_late = self.last.replace(counter) == Some(counter);
            count(if is_late {
                &mut counts.ignored
            } else {
                &mut counts.incomplete
            });
        } else if repeated {
            count(&mut counts.ignored);
        } else {
            *slot = word;
            self.seen |= 1 << index;
        }
        if !same || index != END {
            return None;
        }
        let whole = if has_state(&self.words) {
            0xFFFF
        } else {
            0x81FF
        };
        let length = rebuild(&self.words, &mut self.packet)?;
        let crc = ((word >> 16) as u16).to_be_bytes();
        if self.seen != whole || !self.packet.get(..length)?.ends_with(&crc) {
            self.abandon(counts);
            return None;
        }
        self.deadline = None;
        self.last = Some(self.counter);
        Some(length)
    }

    /// Drops the current attitude, if there is one.
    fn abandon(&mut self, counts: &mut Counts) {
        if self.deadline.take().is_some() {
            count(&mut counts.incomplete);
            self.last = Some(self.counter);
        }
    }
}
