//! Where a packet belongs among those of its frame.

use skyloop_protocols::packet::{HEADER_LENGTH, reseal};
use skyloop_protocols::{Personality, Reply};

/// Where a packet belongs: in order of frames, and of the packets of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Its frame.
    pub frame: u32,
    /// Header, pixels, labels, end.
    part: u8,
    /// Its number among the packets of a part that has several.
    pub number: Option<u32>,
}

impl Place {
    /// Behind all others.
    pub const LAST: Place = Place {
        frame: u32::MAX,
        part: u8::MAX,
        number: None,
    };

    /// The place of a packet of a frame, which says `reply`; none for an answer.
    pub fn of(reply: &Reply<'_>, packet: &[u8]) -> Option<Place> {
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
        // The first field of all packets of frames.
        let frame = packet.get(HEADER_LENGTH..)?.first_chunk()?;
        Some(Place {
            frame: u32::from_be_bytes(*frame),
            part,
            number,
        })
    }
}

/// Where a packet belongs in its frame; none for an answer.
pub fn place_of(personality: &Personality, packet: &[u8]) -> Option<Place> {
    let sealed = sealed(packet);
    let (_, reply) = (personality.decode_reply)(&sealed).ok()?;
    Place::of(&reply, packet)
}

/// The packet with a matching CRC: a recording may have been edited by hand.
pub fn sealed(packet: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    reseal(&mut packet);
    packet
}
