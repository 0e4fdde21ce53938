//! The CAN form: packets as plain frames, whose signals any DBC tool can read. All numbers are
//! big-endian.
//!
//! | frame | content from the first bit |
//! |---|---|
//! | 0x100 | counter 3, has_state 1, spare 12, sequence 32, last 3 bits of the time's fraction, spare 13 |
//! | 0x101 | time: seconds 32, fraction without its last 3 bits 29; counter 3 |
//! | 0x102-0x105, 0x106-0x108 | q x, y, z, w; rates x, y, z: each an f64 in two pieces, 32 and 29; counter 3 |
//! | 0x109-0x10B, 0x10C-0x10E | position, velocity: likewise, with has_state only |
//! | 0x10F | counter 3, spare 13, sequence count of the packet 14, spare 2, CRC-16 of the packet 16, spare 16 |
//! | 0x110 | opcode 8, sequence count 16, argument 32: SingleShot, Reset, Ping, Credit, Pause, Resume |
//! | 0x210 | APID 16 and sequence count 16 of the packet that the Ack answers |
//!
//! An f64 is split into a truncated f32 and the remaining 29 bits of the mantissa: joining them is
//! exact. An attitude with a number outside the range of normal f32 (below 1.2e-38 but not 0, or
//! from 3.4e38 on) is sent by ISO-TP.
//!
//! Short commands and short Acks carry no time: the receiver sets 0. Short Acks carry no sequence
//! count of their own: the receiver counts them.

use crate::can::frame::CanFrame;
use crate::command::Opcode;
use crate::packet::{self, CRC_LENGTH, SEQUENCE_MODULUS, apid};
use crate::time::WireTime;
use crate::wire::Writer;

/// Identifier of an attitude's first frame.
pub const ATTITUDE_BEGIN: u32 = 0x100;
/// Identifier of an attitude's last frame.
pub const ATTITUDE_END: u32 = 0x10F;
/// Identifier of a short command.
pub const SHORT_COMMAND: u32 = 0x110;
/// Identifier of ISO-TP towards the emulator: messages, and flow control of the other direction.
pub const TO_EMULATOR: u32 = 0x120;
/// Identifier of a short Ack.
pub const SHORT_ACK: u32 = 0x210;
/// Identifier of ISO-TP from the emulator.
pub const FROM_EMULATOR: u32 = 0x220;

/// Frames of an attitude with position and velocity.
pub(crate) const FRAMES: usize = 16;
/// Index of the first frame with an f64, and of the first frame of a state.
const FIRST_NUMBER: usize = 2;
pub(crate) const FIRST_OF_STATE: usize = 9;
const NUMBERS: usize = 13;
pub(crate) const END: usize = FRAMES - 1;
/// Longest packet in plain frames: header, sequence, flags, numbers, CRC.
pub(crate) const LONGEST: usize = packet::HEADER_LENGTH + 4 + 1 + 8 * NUMBERS + CRC_LENGTH;

const LOW_BITS: u32 = 29;
const LOW: u64 = (1 << LOW_BITS) - 1;

/// A packet as plain frames, in their order.
#[derive(Debug, Clone, Copy)]
pub struct Frames {
    /// The APID of the packet.
    pub apid: u16,
    words: [u64; FRAMES],
    bytes: u8,
    first_id: u32,
    at: usize,
}

impl Frames {
    /// The frames of a packet, or `None` if it needs ISO-TP. `counter` numbers attitudes, modulo 8.
    pub fn of(packet: &[u8], counter: u8) -> Option<Self> {
        if !matches!(
            packet::identify(packet)?.0,
            apid::ATTITUDE | apid::COMMAND | apid::ACK
        ) {
            return None; // avoids computing the CRC
        }
        let (header, mut reader) = packet::open(packet).ok()?;
        let mut frames = Self {
            apid: header.apid,
            words: [0; FRAMES],
            bytes: 8,
            first_id: ATTITUDE_BEGIN,
            at: 0,
        };
        match header.apid {
            apid::ATTITUDE => {
                let mut numbers = [0.0; NUMBERS];
                let (sequence, flags) = (reader.u32().ok()?, reader.u8().ok()?);
                let used = if flags == 1 {
                    NUMBERS
                } else {
                    FIRST_OF_STATE - FIRST_NUMBER
                };
                for number in numbers.iter_mut().take(used) {
                    *number = reader.f64().ok()?;
                }
                let counter = u64::from(counter % 8);
                let crc = packet.last_chunk().map(|crc| u16::from_be_bytes(*crc))?;
                frames.words = words(sequence, flags, &numbers, counter, header, crc);
                // Only packets that survive the round trip are sent as plain frames.
                let mut buffer = [0; LONGEST];
                let length = rebuild(&frames.words, &mut buffer)?;
                (buffer.get(..length)? == packet).then_some(frames)
            }
            apid::COMMAND => {
                let opcode = reader.u8().ok()?;
                let argument = match Opcode::from_code(opcode)? {
                    Opcode::Credit => reader.u32().ok()?,
                    Opcode::SingleShot
                    | Opcode::Reset
                    | Opcode::Ping
                    | Opcode::Pause
                    | Opcode::Resume => 0,
                    _ => return None,
                };
                reader.finish().ok()?;
                let count = u64::from(header.sequence_count);
                frames.short(
                    SHORT_COMMAND,
                    7,
                    u64::from(opcode) << 48 | count << 32 | u64::from(argument),
                );
                Some(frames)
            }
            apid::ACK => {
                let answered = reader.u32().ok()?;
                reader.finish().ok()?;
                frames.short(SHORT_ACK, 4, answered.into());
                Some(frames)
            }
            _ => None,
        }
    }

    fn short(&mut self, id: u32, bytes: u8, content: u64) {
        (self.first_id, self.bytes) = (id, bytes);
        self.words[0] = content << (64 - 8 * u32::from(bytes));
    }

    /// Returns the next frame.
    pub fn next(&mut self, fd: bool) -> Option<CanFrame> {
        let at = self.at;
        let word = self.words.get(at).filter(|_| !self.is_done())?;
        self.at = if has_state(&self.words) || at + 1 != FIRST_OF_STATE {
            at + 1
        } else {
            END
        };
        let data = word.to_be_bytes();
        CanFrame::new(
            self.first_id + at as u32,
            fd,
            data.get(..self.bytes.into())?,
        )
    }

    /// Whether [`next`](Self::next) has returned the first frame.
    pub fn is_begun(&self) -> bool {
        self.at > 0
    }

    /// Whether [`next`](Self::next) has returned the last frame.
    pub fn is_done(&self) -> bool {
        let count = if self.first_id == ATTITUDE_BEGIN {
            FRAMES
        } else {
            1
        };
        self.at >= count
    }
}

pub(crate) fn has_state(words: &[u64; FRAMES]) -> bool {
    words[0] >> 60 & 1 == 1
}

fn words(
    sequence: u32,
    flags: u8,
    numbers: &[f64; NUMBERS],
    counter: u64,
    header: packet::Header,
    crc: u16,
) -> [u64; FRAMES] {
    let mut words = [0; FRAMES];
    let (has_state, time) = (u64::from(flags & 1), header.time.0);
    words[0] = counter << 61 | has_state << 60 | u64::from(sequence) << 16 | (time & 7) << 13;
    words[1] = time & !7 | counter;
    for (word, number) in words.iter_mut().skip(FIRST_NUMBER).zip(numbers) {
        let (high, low) = split(*number);
        *word = u64::from(high) << 32 | low << 3 | counter;
    }
    words[END] = counter << 61 | u64::from(header.sequence_count) << 34 | u64::from(crc) << 16;
    words
}

/// The bits of the truncated f32, and the remaining 29 bits of the mantissa. A magnitude below the
/// smallest normal f32 becomes 0, one above the largest f32 becomes infinity.
pub fn split(number: f64) -> (u32, u64) {
    let bits = number.to_bits();
    let sign = (bits >> 32) as u32 & 1 << 31;
    let (exponent, mantissa) = (bits >> 52 & 0x7FF, (bits >> LOW_BITS) as u32 & 0x7F_FFFF);
    match exponent {
        0..=896 => (sign, 0),
        897..=1150 => (sign | (exponent as u32 - 896) << 23 | mantissa, bits & LOW),
        _ => (sign | 0xFF << 23, 0),
    }
}

/// Inverse of [`split`].
pub fn join(high: u32, low: u64) -> f64 {
    f64::from_bits(f64::from(f32::from_bits(high)).to_bits() | low & LOW)
}

/// Writes the packet of an attitude's frames into `buffer` and returns its length.
pub(crate) fn rebuild(words: &[u64; FRAMES], buffer: &mut [u8]) -> Option<usize> {
    let [begin, time, numbers @ .., end] = words;
    let time = WireTime(time & !7 | begin >> 13 & 7);
    let state = has_state(words);
    let used = if state {
        NUMBERS
    } else {
        FIRST_OF_STATE - FIRST_NUMBER
    };
    let count = (end >> 34) as u16 % SEQUENCE_MODULUS;
    let payload = |writer: &mut Writer<'_>| {
        writer.u32((begin >> 16) as u32)?;
        writer.u8(state.into())?;
        numbers
            .iter()
            .take(used)
            .try_for_each(|word| writer.f64(join((word >> 32) as u32, word >> 3)))
    };
    packet::write(apid::ATTITUDE, count, time, buffer, payload).ok()
}
