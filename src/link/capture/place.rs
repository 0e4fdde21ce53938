//! Position of a packet within its frame.

use skyloop_protocols::packet::{HEADER_LENGTH, reseal};
use skyloop_protocols::{Personality, Reply};

/// Position of a packet: ordered by frame, then within the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Position {
    /// Number of the frame.
    pub frame: u32,
    /// 0 header, 1 pixels, 2 labels, 3 end.
    part: u8,
    /// Index within a part of several packets.
    pub number: Option<u32>,
}

impl Position {
    /// After all others.
    pub const LAST: Position = Position {
        frame: u32::MAX,
        part: u8::MAX,
        number: None,
    };

    /// The position of a frame packet that decodes to `reply`; `None` for an answer.
    pub fn of(reply: &Reply<'_>, packet: &[u8]) -> Option<Position> {
        let (part, number) = match reply {
            Reply::FrameHeader(_) => (0, None),
            Reply::PixelBlock(block) => (1, Some(block.index)),
            Reply::Windows(block) => (1, Some(block.index)),
            Reply::Compressed(block) => (1, Some(block.index)),
            Reply::Labels(labels) => (2, Some(labels.part.into())),
            Reply::Objects(objects) => (2, Some(objects.part.into())),
            Reply::FrameEnd(_) => (3, None),
            Reply::Status(_) | Reply::Ack(_) | Reply::Nack(_) | Reply::Challenge(_) => return None,
        };
        // All frame packets start with the frame number.
        let frame = packet.get(HEADER_LENGTH..)?.first_chunk()?;
        Some(Position {
            frame: u32::from_be_bytes(*frame),
            part,
            number,
        })
    }
}

/// The position of a packet in its frame; `None` for an answer.
pub(crate) fn position_of(personality: &Personality, packet: &[u8]) -> Option<Position> {
    let sealed = sealed(packet);
    let (_, reply) = (personality.decode_reply)(&sealed).ok()?;
    Position::of(&reply, packet)
}

/// The packet with a corrected CRC: a recording may have been edited by hand.
pub(crate) fn sealed(packet: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    reseal(&mut packet);
    packet
}
