//! Errors of packets, and their reason codes on the wire.

pub use crate::generated::codes::Reason;
use core::fmt;

/// Why bytes are not a packet; `Display` states the fault, its position and the remedy.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DecodeError {
    /// The CRC-16 at the end is not that of the bytes before it.
    BadCrc {
        /// The last two bytes.
        found: u16,
        /// The checksum of the bytes before them.
        expected: u16,
    },
    /// A packet version number other than 0, or a format version other than ours.
    BadVersion {
        /// `"packet version number"` (byte 0) or `"format version"` (byte 14).
        field: &'static str,
        /// The version that the packet states.
        found: u8,
        /// The only supported version.
        expected: u8,
    },
    /// A length that does not fit.
    BadLength {
        /// The part with the wrong length.
        what: &'static str,
        /// Its length in bytes.
        found: usize,
        /// The length of its layout in bytes: the minimum (too short) or the maximum (too long).
        expected: usize,
    },
    /// An APID that this end does not receive.
    UnknownApid {
        /// The APID of the packet.
        apid: u16,
    },
    /// A known APID with the type bit of the other direction.
    WrongType {
        /// The APID of the packet.
        apid: u16,
    },
    /// A header flag with a value that is not in use.
    BadHeader {
        /// The flag.
        field: &'static str,
    },
    /// An opcode without a command.
    UnknownOpcode {
        /// The opcode.
        opcode: u8,
    },
    /// A quaternion whose norm differs from 1 by more than the tolerance.
    QuaternionNotUnit {
        /// The square of its norm.
        norm_squared: f64,
    },
    /// A NaN or an infinity in an attitude or a state.
    NotFinite {
        /// The field.
        field: &'static str,
    },
    /// A value outside the range of its field.
    BadValue {
        /// The message and its field.
        field: &'static str,
        /// The allowed values.
        rule: &'static str,
    },
}

impl DecodeError {
    /// The reason code for the sender.
    pub const fn reason(&self) -> Reason {
        match self {
            Self::BadCrc { .. } => Reason::BadCrc,
            Self::BadVersion { .. } => Reason::BadVersion,
            Self::BadLength { .. } => Reason::BadLength,
            Self::UnknownApid { .. }
            | Self::WrongType { .. }
            | Self::BadHeader { .. }
            | Self::UnknownOpcode { .. } => Reason::UnknownType,
            Self::QuaternionNotUnit { .. } => Reason::QuaternionNotUnit,
            Self::NotFinite { .. } => Reason::NotFinite,
            Self::BadValue { .. } => Reason::ValueOutOfRange,
        }
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::BadCrc { found, expected } => write!(
                f,
                "CRC-16 is {found:#06x}, the bytes before it give {expected:#06x}: damaged on the way, send it again"
            ),
            Self::BadVersion {
                field,
                found,
                expected,
            } => {
                write!(
                    f,
                    "{field} is {found}, only {expected} is spoken here: send that"
                )
            }
            Self::BadLength {
                what,
                found,
                expected,
            } => write!(
                f,
                "{what} has {found} octets, its length field or layout asks for {} {expected}",
                if found < expected {
                    "at least"
                } else {
                    "at most"
                }
            ),
            Self::UnknownApid { apid } => write!(
                f,
                "APID {apid:#05x} in bytes 0-1 is not received here: see the table of APIDs in the ICD"
            ),
            Self::WrongType { apid } => write!(
                f,
                "type bit in octet 0 does not belong to APID {apid:#05x}: 1 towards the emulator, 0 from it"
            ),
            Self::BadHeader { field } => write!(
                f,
                "{field} has a value that is not in use: see the primary header in the ICD"
            ),
            Self::UnknownOpcode { opcode } => {
                write!(
                    f,
                    "opcode {opcode} in octet 15 is no command: see the table of opcodes in the ICD"
                )
            }
            Self::QuaternionNotUnit { norm_squared } if norm_squared > 1e6 => write!(
                f,
                "Attitude.q_icrf_to_body has the squared norm {norm_squared:.1e}: send big-endian numbers, and a unit quaternion"
            ),
            Self::QuaternionNotUnit { norm_squared } => write!(
                f,
                "Attitude.q_icrf_to_body has the squared norm {norm_squared}: normalise it, 1e-3 off in the norm is the limit"
            ),
            Self::NotFinite { field } => {
                write!(f, "{field} holds a NaN or an infinity: send finite numbers")
            }
            Self::BadValue { field, rule } => write!(f, "{field} {rule}"),
        }
    }
}

impl core::error::Error for DecodeError {}

/// Why a message cannot be encoded as a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EncodeError {
    /// The caller's buffer is too small.
    BufferTooSmall {
        /// Bytes of the packet so far.
        needed: usize,
        /// Bytes of the buffer.
        available: usize,
    },
    /// Too long for one packet or one field.
    TooLong {
        /// The part that is too long.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Its maximum.
        limit: usize,
    },
    /// Two fields that contradict each other.
    Inconsistent {
        /// The message and its fields.
        what: &'static str,
    },
    /// A pixel that does not fit 12 bits.
    PixelTooLarge,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::BufferTooSmall { needed, available } => write!(
                f,
                "buffer of {available} octets is too small for a packet of {needed} or more: MAX_PACKET always does"
            ),
            Self::TooLong { what, found, limit } => {
                write!(f, "{what} is {found} long, at most {limit} fit: split it")
            }
            Self::Inconsistent { what } => write!(f, "{what} contradict each other"),
            Self::PixelTooLarge => {
                write!(f, "pixel above 4095 in 12-bit packing: use Packing::Bits16")
            }
        }
    }
}

impl core::error::Error for EncodeError {}
