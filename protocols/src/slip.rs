//! Packets on a serial line: RFC 1055 SLIP around packet and CRC-32.
//!
//! A frame on the line is `END, escaped(packet, CRC-32 big-endian), END`. END never occurs inside,
//! so the receiver is synchronised again at the next END after garbage. Empty frames are ignored.

use crate::crc::crc32;
use crate::packet::MAX_PACKET;
use core::fmt;

/// Ends a frame, and also starts it, to flush line noise.
pub const END: u8 = 0xC0;
/// Starts an escaped byte.
pub const ESC: u8 = 0xDB;
/// After ESC: an END byte of the data.
pub const ESC_END: u8 = 0xDC;
/// After ESC: an ESC byte of the data.
pub const ESC_ESC: u8 = 0xDD;

const CRC_LENGTH: usize = 4;

/// Buffer size of a decoder for every packet.
pub const BUFFER: usize = MAX_PACKET + CRC_LENGTH;

/// Largest length on the line of a packet of `length` bytes: every byte escaped, END on both sides.
pub const fn max_encoded_length(length: usize) -> usize {
    2 * (length + CRC_LENGTH) + 2
}

/// Passes the bytes of one frame to `put`, in the order of the line.
pub fn encode(packet: &[u8], put: &mut impl FnMut(u8)) {
    put(END);
    for byte in packet.iter().copied().chain(crc32(packet).to_be_bytes()) {
        match byte {
            END => [ESC, ESC_END].into_iter().for_each(&mut *put),
            ESC => [ESC, ESC_ESC].into_iter().for_each(&mut *put),
            _ => put(byte),
        }
    }
    put(END);
}

/// Why bytes between two ENDs are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Too short for a packet and CRC-32.
    TooShort {
        /// Bytes between the ENDs, unescaped.
        found: usize,
    },
    /// Longer than the decoder's buffer.
    TooLong {
        /// Size of the buffer in bytes.
        limit: usize,
    },
    /// ESC before a byte other than ESC_END or ESC_ESC.
    BadEscape {
        /// The byte after ESC.
        found: u8,
    },
    /// Wrong CRC-32.
    BadCrc32 {
        /// The last four bytes.
        found: u32,
        /// The checksum of the bytes before them.
        expected: u32,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { found } => write!(
                f,
                "serial frame of {found} octets is too short for a CRC-32 and a packet"
            ),
            Self::TooLong { limit } => {
                write!(f, "serial frame without an END within {limit} octets")
            }
            Self::BadEscape { found } => write!(
                f,
                "serial frame has {found:#04x} after ESC, only 0xdc and 0xdd may follow"
            ),
            Self::BadCrc32 { found, expected } => {
                write!(
                    f,
                    "serial frame ends with the CRC-32 {found:#010x}, its octets give {expected:#010x}: damaged on the line"
                )
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// Finds frames in a stream of bytes. `N - 4` is the longest packet; [`BUFFER`] fits every packet.
#[derive(Debug, Clone)]
pub struct Decoder<const N: usize> {
    buffer: [u8; N],
    length: usize,
    escaped: bool,
    /// Error of the current frame; its other bytes are skipped.
    error: Option<FrameError>,
}

impl<const N: usize> Decoder<N> {
    /// A decoder at the start of a frame.
    pub const fn new() -> Self {
        Self {
            buffer: [0; N],
            length: 0,
            escaped: false,
            error: None,
        }
    }

    /// Processes one byte from the line; returns a packet or its error at the END of a frame.
    pub fn push(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        match byte {
            END => return self.end(),
            _ if self.error.is_some() => {}
            ESC if !self.escaped => self.escaped = true,
            _ if !self.escaped => self.store(byte),
            ESC_END => self.store(END),
            ESC_ESC => self.store(ESC),
            found => self.error = Some(FrameError::BadEscape { found }),
        }
        None
    }

    fn store(&mut self, byte: u8) {
        self.escaped = false;
        match self.buffer.get_mut(self.length) {
            Some(slot) => {
                *slot = byte;
                self.length += 1;
            }
            None => self.error = Some(FrameError::TooLong { limit: N }),
        }
    }

    fn end(&mut self) -> Option<Result<&[u8], FrameError>> {
        let length = core::mem::take(&mut self.length);
        let escaped = core::mem::take(&mut self.escaped);
        let error = core::mem::take(&mut self.error);
        if length == 0 && !escaped && error.is_none() {
            return None;
        }
        let broken = error.or(escaped.then_some(FrameError::BadEscape { found: END }));
        let frame = self.buffer.get(..length).unwrap_or_default();
        Some(broken.map_or_else(|| check(frame), Err))
    }
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

fn check(frame: &[u8]) -> Result<&[u8], FrameError> {
    match frame.split_last_chunk::<CRC_LENGTH>() {
        Some((packet, crc)) if !packet.is_empty() => {
            let (found, expected) = (u32::from_be_bytes(*crc), crc32(packet));
            if found == expected {
                Ok(packet)
            } else {
                Err(FrameError::BadCrc32 { found, expected })
            }
        }
        _ => Err(FrameError::TooShort { found: frame.len() }),
    }
}
