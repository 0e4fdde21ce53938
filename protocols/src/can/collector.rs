//! Packets put together again from the plain frames of the [CAN form](crate::can::form).

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

/// Puts packets together again from plain frames.
#[derive(Debug, Clone)]
pub(crate) struct Collector {
    side: Side,
    /// How long the frames of one attitude may take, µs.
    timeout_us: u64,
    packet: [u8; LONGEST],
    words: [u64; FRAMES],
    /// Frames of the present attitude that have come, by their place.
    seen: u16,
    counter: u8,
    /// The present attitude must be whole by then; none is under way otherwise.
    until: Option<u64>,
    /// Counter of the last attitude that has been delivered or counted.
    last: Option<u8>,
    acks: u16,
}

impl Collector {
    /// For the plain frames that this side receives.
    pub(crate) fn new(side: Side, timeout_us: u64) -> Self {
        Self {
            side,
            timeout_us,
            packet: [0; LONGEST],
            words: [0; FRAMES],
            seen: 0,
            counter: 0,
            until: None,
            last: None,
            acks: 0,
        }
    }

    /// When the attitude under way is given up.
    pub(crate) fn wake_at(&self) -> Option<u64> {
        self.until
    }

    /// Gives up an attitude that is not whole in time.
    pub(crate) fn expire(&mut self, now_us: u64, counts: &mut Counts) {
        if self.until.is_some_and(|until| until <= now_us) {
            count(&mut counts.timeouts);
            self.give_up(counts);
        }
    }

    /// Takes a frame with one of the plain frames' identifiers; the packet that it completes.
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
            // Of another length than the form has.
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
                _ => Ok(()), // the emulator's decoder refuses what does not stand alone
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

    /// An attitude begins with its first frame, ends with its last, and is latched if all of them came between and the
    /// CRC of the packet fits. Each that is not is counted once.
    fn attitude(
        &mut self,
        place: usize,
        word: u64,
        now_us: u64,
        counts: &mut Counts,
    ) -> Option<usize> {
        let at_head = place == 0 || place == END;
        let counter = if at_head { word >> 61 } else { word & 7 } as u8;
        let same = self.until.is_some() && counter == self.counter;
        let slot = self.words.get_mut(place)?;
        let repeated = same && self.seen >> place & 1 == 1 && *slot == word;
        if place == 0 && !repeated {
            *slot = word;
            self.give_up(counts);
            (self.seen, self.counter) = (1, counter);
            self.until = Some(now_us.saturating_add(self.timeout_us));
        } else if !same {
            self.give_up(counts);
            // One whose first frame is lost; or a late frame of the last one.
            count(match self.last.replace(counter) == Some(counter) {
                true => &mut counts.ignored,
                false => &mut counts.incomplete,
            });
        } else if repeated {
            count(&mut counts.ignored);
        } else {
            *slot = word;
            self.seen |= 1 << place;
        }
        if !same || place != END {
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
            self.give_up(counts);
            return None;
        }
        self.until = None;
        self.last = Some(self.counter);
        Some(length)
    }

    /// Drops the attitude under way, if there is one.
    fn give_up(&mut self, counts: &mut Counts) {
        if self.until.take().is_some() {
            count(&mut counts.incomplete);
            self.last = Some(self.counter);
        }
    }
}
