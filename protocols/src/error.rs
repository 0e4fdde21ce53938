//! What can be wrong with a packet, and the reason codes that say so on the wire.

pub use crate::generated::codes::Reason;
use core::fmt;

/// Why octets are not a packet; `Display` says what, where and the remedy.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DecodeError {
    /// The CRC-16 at the end is not that of the octets before it.
    BadCrc {
        /// The last two octets.
        found: u16,
        /// The checksum of the octets before them.
        expected: u16,
    },
    /// A packet version number other than 0, or a format version other than ours.
    BadVersion {
        /// `"packet version number"` (octet 0) or `"format version"` (octet 14).
        field: &'static str,
        /// The version that the packet states.
        found: u8,
        /// The version that is spoken here.
        expected: u8,
    },
    /// A length that does not fit.
    BadLength {
        /// What has the wrong length.
        what: &'static str,
        /// Its length in octets.
        found: usize,
        /// The length that its layout asks for, in octets: at least (too short) or at most (too long).
        expected: usize,
    },
    /// An APID that is not one of the kinds which this end receives.
    UnknownApid {
        /// The APID of the packet.
        apid: u16,
    },
    /// A known APID with the type bit of the other direction.
    WrongType {
        /// The APID of the packet.
        apid: u16,
    },
    /// A header flag other than the only one in use.
    BadHeader {
        /// The flag.
        field: &'static str,
    },
    /// An opcode that no `Command` packet has.
    UnknownOpcode {
        /// The opcode.
        opcode: u8,
    },
    /// The quaternion is not of unit length, within the tolerance.
    QuaternionNotUnit {
        /// The square of its norm.
        norm_squared: f64,
    },
    /// A NaN or an infinity in an attitude or a state.
    NotFinite {
        /// The field.
        field: &'static str,
    },
    /// A value that its field does not allow.
    BadValue {
        /// The message and its field.
        field: &'static str,
        /// What the field allows.
        rule: &'static str,
    },
}

impl DecodeError {
    /// The reason code that tells the sender.
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

/// Why a message cannot be laid out as a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EncodeError {
    /// The caller's buffer is too small.
    BufferTooSmall {
        /// Octets that the packet needs so far.
        needed: usize,
        /// Octets that the buffer has.
        available: usize,
    },
    /// More than fits one packet or one field.
    TooLong {
        /// What is too long.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The longest that fits.
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
