//! Packets on a serial line: RFC 1055 SLIP around packet and CRC-32.
//!
//! A frame on the line is `END, escaped(packet, CRC-32 big-endian), END`. END never occurs inside, so the receiver is
//! back in step at the next END after any garbage. Two ENDs in a row are an empty frame and mean nothing.

use crate::crc::crc32;
use crate::packet::MAX_PACKET;
use core::fmt;

/// Ends a frame, and opens it too, to flush line noise.
pub const END: u8 = 0xC0;
/// Announces an escaped octet.
pub const ESC: u8 = 0xDB;
/// After ESC: an END octet of the data.
pub const ESC_END: u8 = 0xDC;
/// After ESC: an ESC octet of the data.
pub const ESC_ESC: u8 = 0xDD;

const CRC_LENGTH: usize = 4;

/// A decoder's buffer size that holds every packet.
pub const BUFFER: usize = MAX_PACKET + CRC_LENGTH;

/// Most octets on the line for a packet of `length` octets: every octet escaped, END on both sides.
pub const fn max_encoded_length(length: usize) -> usize {
    2 * (length + CRC_LENGTH) + 2
}

/// Hands the octets of one frame to `put`, in the order of the line.
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

/// Why octets between two ENDs are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// No packet and CRC-32 fit in so few octets.
    TooShort {
        /// Octets between the ENDs, unescaped.
        found: usize,
    },
    /// More octets than the decoder's buffer holds.
    TooLong {
        /// Octets that it holds.
        limit: usize,
    },
    /// ESC before something other than ESC_END or ESC_ESC.
    BadEscape {
        /// The octet after ESC.
        found: u8,
    },
    /// The CRC-32 does not fit.
    BadCrc32 {
        /// The last four octets.
        found: u32,
        /// The checksum of the octets before them.
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

/// Finds frames in a stream of octets; holds packets of up to `N - 4` octets. [`BUFFER`] holds every packet.
#[derive(Debug, Clone)]
pub struct Decoder<const N: usize> {
    buffer: [u8; N],
    length: usize,
    escaped: bool,
    /// What went wrong in the present frame; its other octets are skipped.
    error: Option<FrameError>,
}

impl<const N: usize> Decoder<N> {
    /// Waits for the first frame.
    pub const fn new() -> Self {
        Self {
            buffer: [0; N],
            length: 0,
            escaped: false,
            error: None,
        }
    }

    /// Takes one octet from the line; at the END of a frame that is not empty, gives its packet or what is wrong.
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
        Some(match broken {
            Some(error) => Err(error),
            None => check(frame),
        })
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
