//! The CCSDS 133.0-B space packet around every message.
//!
//! | bytes | content |
//! |---|---|
//! | 0-1 | packet version number 000, type (1 towards the emulator), secondary header flag 1, APID (11 bits) |
//! | 2-3 | sequence flags 11, sequence count (14 bits) |
//! | 4-5 | bytes after this field, minus one |
//! | 6-13 | time ([`WireTime`]) |
//! | 14 | format version ([`VERSION`]) |
//! | 15.. | payload |
//! | last 2 | CRC-16/CCITT-FALSE of everything before |

use crate::crc::crc16;
use crate::error::{DecodeError, EncodeError};
use crate::time::WireTime;
use crate::wire::{Reader, Writer};

pub use crate::generated::codes::{MAX_PACKET, VERSION, apid};
pub use crate::wire::CRC_LENGTH;

/// Bytes before the payload: primary header, time, version.
pub const HEADER_LENGTH: usize = 15;
/// Longest payload in bytes.
pub const MAX_PAYLOAD: usize = MAX_PACKET - HEADER_LENGTH - CRC_LENGTH;
/// Sequence counts are taken modulo this: 14 bits.
pub const SEQUENCE_MODULUS: u16 = 1 << 14;

const PRIMARY_LENGTH: usize = 6;
const SECONDARY_HEADER_FLAG: u16 = 1 << 11;
const TYPE_TELECOMMAND: u16 = 1 << 12;
const UNSEGMENTED: u16 = 3 << 14;

/// Content of every packet's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Kind of the message: one of [`apid`].
    pub apid: u16,
    /// Count of packets with this APID, modulo 2^14.
    pub sequence_count: u16,
    /// The time that the message refers to: see the ICD for each message.
    pub time: WireTime,
}

/// APID and sequence count in the first bytes, unchecked, to identify a refused packet in a `Nack`.
/// `None` if there are fewer than four bytes.
pub fn identify(bytes: &[u8]) -> Option<(u16, u16)> {
    let [a, b, c, d] = *bytes.first_chunk()?;
    Some((
        u16::from_be_bytes([a, b]) & 0x7FF,
        u16::from_be_bytes([c, d]) % SEQUENCE_MODULUS,
    ))
}

/// Recomputes the CRC, for test equipment that alters packets on purpose.
pub fn reseal(packet: &mut [u8]) {
    if let Some((before, crc)) = packet.split_last_chunk_mut::<CRC_LENGTH>() {
        *crc = crc16(before).to_be_bytes();
    }
}

/// Checks everything around the payload and returns a reader at its start.
///
/// The order is: length, CRC, versions, flags, APID, type bit. So a damaged packet is always a bad
/// CRC or length.
pub(crate) fn open(bytes: &[u8]) -> Result<(Header, Reader<'_>), DecodeError> {
    let found = bytes.len();
    let length = |expected| DecodeError::BadLength {
        what: "packet",
        found,
        expected,
    };
    if found < HEADER_LENGTH + CRC_LENGTH {
        return Err(length(HEADER_LENGTH + CRC_LENGTH));
    }
    if found > MAX_PACKET {
        return Err(length(MAX_PACKET));
    }
    let (before, crc) = bytes.split_last_chunk().ok_or(length(CRC_LENGTH))?;
    let mut reader = Reader::new(before, 0, "packet");
    let identification = reader.u16()?;
    let sequence = reader.u16()?;
    let stated = PRIMARY_LENGTH + usize::from(reader.u16()?) + 1;
    if stated != found {
        return Err(length(stated));
    }
    let (crc, expected) = (u16::from_be_bytes(*crc), crc16(before));
    if crc != expected {
        return Err(DecodeError::BadCrc {
            found: crc,
            expected,
        });
    }
    version("packet version number", (identification >> 13) as u8, 0)?;
    let time = WireTime(reader.u64()?);
    version("format version", reader.u8()?, VERSION)?;
    if identification & SECONDARY_HEADER_FLAG == 0 {
        return Err(DecodeError::BadHeader {
            field: "secondary header flag in octet 0",
        });
    }
    if sequence & UNSEGMENTED != UNSEGMENTED {
        return Err(DecodeError::BadHeader {
            field: "sequence flags in octet 2",
        });
    }
    let apid = identification & 0x7FF;
    let row = apid::index(apid).ok_or(DecodeError::UnknownApid { apid })?;
    if apid::is_telecommand(apid) != (identification & TYPE_TELECOMMAND != 0) {
        return Err(DecodeError::WrongType { apid });
    }
    let header = Header {
        apid,
        sequence_count: sequence % SEQUENCE_MODULUS,
        time,
    };
    Ok((header, reader.named(apid::ALL[row].1)))
}

/// Refuses a variable part whose length contradicts the other fields.
pub(crate) fn same_length(
    what: &'static str,
    fields: usize,
    found: usize,
    expected: usize,
) -> Result<(), DecodeError> {
    let whole = |rest| HEADER_LENGTH + fields + rest + CRC_LENGTH;
    if found == expected {
        Ok(())
    } else {
        Err(DecodeError::BadLength {
            what,
            found: whole(found),
            expected: whole(expected),
        })
    }
}

fn version(field: &'static str, found: u8, expected: u8) -> Result<(), DecodeError> {
    if found == expected {
        Ok(())
    } else {
        Err(DecodeError::BadVersion {
            field,
            found,
            expected,
        })
    }
}

/// Writes one packet into `buffer` and returns its length; `payload` writes the bytes between
/// header and CRC.
///
/// `sequence_count` is taken modulo 2^14.
pub(crate) fn write(
    apid: u16,
    sequence_count: u16,
    time: WireTime,
    buffer: &mut [u8],
    payload: impl FnOnce(&mut Writer<'_>) -> Result<(), EncodeError>,
) -> Result<usize, EncodeError> {
    let direction = if apid::is_telecommand(apid) {
        TYPE_TELECOMMAND
    } else {
        0
    };
    let mut writer = Writer::new(buffer, MAX_PACKET);
    writer.u16(direction | SECONDARY_HEADER_FLAG | apid)?;
    writer.u16(UNSEGMENTED | (sequence_count % SEQUENCE_MODULUS))?;
    writer.u16(0)?; // the length, known below
    writer.u64(time.0)?;
    writer.u8(VERSION)?;
    payload(&mut writer)?;
    writer.u16(0)?; // the CRC, known below
    let packet = writer.written();
    let length = packet.len();
    // At most MAX_PACKET, which fits 16 bits.
    let field = (length - PRIMARY_LENGTH - 1) as u16;
    if let Some(bytes) = packet.get_mut(4..6) {
        bytes.copy_from_slice(&field.to_be_bytes());
    }
    reseal(packet);
    Ok(length)
}
