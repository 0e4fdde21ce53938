//! ISO-TP (ISO 15765-2:2016): messages longer than a frame, normal addressing. This module has the
//! protocol data units, times and settings of both directions.
//!
//! | PDU | bytes |
//! |---|---|
//! | single frame | `0L` data, L = 1 to 7; in frames of more than 8 bytes `00 LL` data, LL from 8 |
//! | first frame | `1L LL` data, 12-bit length; above 4095 `10 00 LL LL LL LL` data |
//! | consecutive frame | `2N` data, N counts 1 to 15, 0, 1 ... |
//! | flow control | `3S` block size, separation time; S = 0 continue, 1 wait, 2 overflow |

use crate::can::frame::{MAX_CLASSIC_DATA, MAX_DATA, padded_length};

/// Flow status: continue to send.
pub const CONTINUE: u8 = 0;
/// Flow status: wait for another flow control.
pub const WAIT: u8 = 1;
/// Flow status: the message does not fit; aborts it.
pub const OVERFLOW: u8 = 2;
/// Fills frames up to a valid length (ISO 15765-2, 10.4.2: the value with the fewest stuff bits).
pub const PADDING: u8 = 0xCC;

/// Largest length in the 12-bit field of a first frame.
const MAX_SHORT_LENGTH: usize = 0xFFF;

/// One protocol data unit, as found in a frame's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pdu<'a> {
    /// A whole message.
    Single(&'a [u8]),
    /// First part of a message.
    First {
        /// Length of the message.
        length: usize,
        /// First bytes of the message.
        data: &'a [u8],
    },
    /// Later part of a message.
    Consecutive {
        /// Sequence number, modulo 16.
        number: u8,
        /// Next bytes of the message, with padding in its last frame.
        data: &'a [u8],
    },
    /// Flow control, from the receiver of a message to its sender.
    Flow(Flow),
}

/// Flow control of a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flow {
    /// [`CONTINUE`], [`WAIT`] or [`OVERFLOW`]; others are invalid.
    pub status: u8,
    /// Consecutive frames until the next flow control; 0: no further flow control.
    pub block_size: u8,
    /// Minimum time between two consecutive frames, coded as in [`separation_us`].
    pub st_min: u8,
}

impl<'a> Pdu<'a> {
    /// Reads a frame's data. `None`: unknown type, or a length that 9.6.2 to 9.6.5 say to ignore.
    pub fn parse(data: &'a [u8]) -> Option<Self> {
        let (head, rest) = data.split_first()?;
        let low = head & 0xF;
        match head >> 4 {
            0 if data.len() <= MAX_CLASSIC_DATA => {
                let bytes = rest.get(..low.into())?;
                (!bytes.is_empty()).then_some(Self::Single(bytes))
            }
            0 if low == 0 => {
                let (length, rest) = rest.split_first()?;
                let bytes = rest.get(..usize::from(*length))?;
                (bytes.len() >= MAX_CLASSIC_DATA).then_some(Self::Single(bytes))
            }
            1 if data.len() >= MAX_CLASSIC_DATA => Self::first(low, rest),
            2 if !rest.is_empty() => Some(Self::Consecutive {
                number: low,
                data: rest,
            }),
            3 => {
                let [block_size, st_min] = *rest.first_chunk()?;
                Some(Self::Flow(Flow {
                    status: low,
                    block_size,
                    st_min,
                }))
            }
            _ => None,
        }
    }

    fn first(low: u8, rest: &'a [u8]) -> Option<Self> {
        let (second, short) = rest.split_first()?;
        let length = usize::from(low) << 8 | usize::from(*second);
        let (length, data, min_length) = if length > 0 {
            (length, short, 0)
        } else {
            let (long, data) = short.split_first_chunk()?;
            let length = usize::try_from(u32::from_be_bytes(*long)).ok()?;
            (length, data, MAX_SHORT_LENGTH + 1)
        };
        // A message that fits a single frame must not be segmented.
        let single = max_single(rest.len() + 1);
        (length >= min_length && length > single).then_some(Self::First { length, data })
    }
}

/// Transmission settings of one end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameters {
    /// FD frames with bit rate switch.
    pub fd: bool,
    /// TX_DL: bytes of a full frame; 8 on a classic bus, a valid length of FD otherwise.
    pub frame_bytes: usize,
    /// Fills frames shorter than 8 bytes; longer frames are always filled with [`PADDING`].
    pub padding: Option<u8>,
    /// Block size in the flow control of this end; 0: everything at once.
    pub block_size: u8,
    /// Coded separation time in the flow control of this end.
    pub st_min: u8,
    /// N_Bs and N_Cr: longest silence of the other end, µs. Also the longest time from the first
    /// to the last frame of an attitude.
    pub timeout_us: u64,
    /// N_WFTmax: accepted number of successive "wait" flow controls.
    pub most_waits: u8,
}

impl Parameters {
    /// Defaults of the Linux kernel's `can-isotp`.
    pub const CLASSIC: Self = Self {
        fd: false,
        frame_bytes: MAX_CLASSIC_DATA,
        padding: None,
        block_size: 0,
        st_min: 0,
        timeout_us: 1_000_000,
        most_waits: 10,
    };

    /// The same with full FD frames.
    pub const FD: Self = Self {
        fd: true,
        frame_bytes: MAX_DATA,
        ..Self::CLASSIC
    };

    /// Length of a full frame: the next valid length from `frame_bytes` on; 8 on a classic bus.
    pub(crate) fn full(&self) -> usize {
        if self.fd {
            padded_length(self.frame_bytes.max(MAX_CLASSIC_DATA))
        } else {
            MAX_CLASSIC_DATA
        }
    }
}

/// Longest message in a single frame of up to `frame_bytes`.
pub(crate) const fn max_single(frame_bytes: usize) -> usize {
    if frame_bytes > MAX_CLASSIC_DATA {
        frame_bytes - 2
    } else {
        MAX_CLASSIC_DATA - 1
    }
}

/// Separation time, µs: 0 to 127 ms, 100 to 900 µs; reserved codes are 127 ms (ISO 15765-2,
/// 9.6.5.5).
pub const fn separation_us(st_min: u8) -> u64 {
    match st_min {
        0..=0x7F => st_min as u64 * 1000,
        0xF1..=0xF9 => (st_min as u64 - 0xF0) * 100,
        _ => 127_000,
    }
}

/// Buffer for the data of one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    data: [u8; MAX_DATA],
    used: usize,
}

impl Piece {
    pub(crate) fn new(head: &[u8]) -> Self {
        let mut piece = Self {
            data: [PADDING; MAX_DATA],
            used: 0,
        };
        piece.fill(head, MAX_DATA);
        piece
    }

    /// Appends up to a frame length of `max` bytes and returns the number of appended bytes.
    pub(crate) fn fill(&mut self, bytes: &[u8], max: usize) -> usize {
        let count = bytes.len().min(max.saturating_sub(self.used));
        let room = self.data.get_mut(self.used..).unwrap_or_default();
        for (to, from) in room.iter_mut().zip(bytes).take(count) {
            *to = *from;
        }
        self.used += count;
        count
    }

    /// The data, filled up to a valid length.
    pub(crate) fn bytes(&mut self, padding: Option<u8>) -> &[u8] {
        let mut length = padded_length(self.used);
        if let (true, Some(padding)) = (self.used < MAX_CLASSIC_DATA, padding) {
            let rest = self.data.get_mut(self.used..).unwrap_or_default();
            rest.fill(padding);
            length = MAX_CLASSIC_DATA;
        }
        self.data.get(..length).unwrap_or_default()
    }
}
