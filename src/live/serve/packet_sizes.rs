//! Number and length of the packets of a frame.

use skyloop_protocols::packet::{CRC_LENGTH, HEADER_LENGTH};
use skyloop_protocols::pixels::{
    COMPRESSED_DATA, LABEL_TEXT_PER_PART, OBJECT_LENGTH, OBJECTS_PER_PART, packed_length,
    pixels_per_block, windows_per_block,
};
use skyloop_protocols::reply::window_length;
use skyloop_protocols::{
    CompressedBlock, FrameEnd, FrameHeader, LabelPart, ObjectPart, Packing, PixelBlock, WindowBlock,
};

/// Packets of the same length.
#[derive(Clone, Copy)]
pub(super) struct Packets {
    pub count: usize,
    /// Length of each, in bytes.
    pub length: usize,
}

/// The first packet of a frame and the last.
pub(super) const HEADER_AND_END: [Packets; 2] = [
    one(FrameHeader::FIELDS_LENGTH),
    one(FrameEnd::FIELDS_LENGTH),
];

const fn one(fields: usize) -> Packets {
    Packets {
        count: 1,
        length: HEADER_LENGTH + fields + CRC_LENGTH,
    }
}

/// The content of a packet, which is divided into items.
#[derive(Clone, Copy)]
pub(super) enum Content {
    Pixels(Packing),
    /// Windows of this size.
    Windows(Packing, u8),
    /// Bytes of compressed pixels.
    Code,
    /// Object records.
    Objects,
    /// Bytes of label text.
    Text,
}

impl Content {
    /// Maximum number of items in a packet.
    fn max_items(self) -> usize {
        match self {
            Content::Pixels(packing) => pixels_per_block(packing),
            Content::Windows(packing, size) => windows_per_block(packing, size).max(1),
            Content::Code => COMPRESSED_DATA,
            Content::Objects => OBJECTS_PER_PART,
            Content::Text => LABEL_TEXT_PER_PART,
        }
    }

    /// A packet with this number of items.
    pub fn packet(self, items: usize) -> Packets {
        one(match self {
            Content::Pixels(packing) => PixelBlock::FIELDS_LENGTH + packed_length(packing, items),
            Content::Windows(packing, size) => {
                WindowBlock::FIELDS_LENGTH + items * window_length(packing, size)
            }
            Content::Code => CompressedBlock::FIELDS_LENGTH + items,
            Content::Objects => ObjectPart::FIELDS_LENGTH + items * OBJECT_LENGTH,
            Content::Text => LabelPart::FIELDS_LENGTH + items,
        })
    }

    /// The packets for all items: full ones, and the rest.
    pub fn packets(self, items: usize) -> impl Iterator<Item = Packets> {
        let max = self.max_items();
        let all = [(items / max, max), (1, items % max)].into_iter();
        let some = all.filter(|(count, items)| *count > 0 && *items > 0);
        some.map(move |(count, items)| Packets {
            count,
            ..self.packet(items)
        })
    }
}
