//! Parts of a frame for slow lines: windows, objects as numbers, compressed pixels.

use crate::error::{DecodeError, EncodeError};
pub use crate::generated::frames::{CompressedBlock, ObjectPart, ObjectRecord, WindowBlock};
use crate::packet::same_length;
pub use crate::pixels::window_length;
use crate::pixels::{
    OBJECT_LENGTH, OBJECTS_PER_PART, has_valid_part_length, is_padded, windows_per_block,
};
use crate::rules::rule;
use crate::wire::{Reader, Writer};

/// Bytes of an object's identifier.
pub const ID_LENGTH: usize = 16;

/// One window of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window<'a> {
    /// Column of its first pixel in the frame.
    pub column: u16,
    /// Row of its first pixel in the frame.
    pub row: u16,
    /// Its packed pixels.
    pub data: &'a [u8],
}

impl<'a> WindowBlock<'a> {
    /// Its windows, in order.
    pub fn windows(&self) -> impl Iterator<Item = Window<'a>> + use<'a> {
        let length = window_length(self.packing, self.size);
        self.data.chunks_exact(length).filter_map(|bytes| {
            let (position, data) = bytes.split_first_chunk::<4>()?;
            let [a, b, c, d] = *position;
            Some(Window {
                column: u16::from_be_bytes([a, b]),
                row: u16::from_be_bytes([c, d]),
                data,
            })
        })
    }

    /// Refuses windows that contradict `count` or `index`. Every decoded packet has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        let per_block = windows_per_block(self.packing, self.size);
        let count = usize::from(self.count);
        rule(
            count <= per_block,
            "Windows.count",
            "must be at least 1 and at most what fits a packet",
        )?;
        rule(
            u64::from(self.first) == u64::from(self.index) * per_block as u64,
            "Windows.first",
            "must be index times the windows of a full packet",
        )?;
        let length = count * window_length(self.packing, self.size);
        same_length("Windows", Self::FIELDS_LENGTH, self.data.len(), length)?;
        let size = self.size.into();
        rule(
            self.windows()
                .all(|window| is_padded(self.packing, size, window.data)),
            "Windows.data",
            "must end with four zero bits after an odd last pixel",
        )
    }

    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        self.check().map_err(|_| EncodeError::Inconsistent {
            what: "Windows.index, first, count and its data",
        })
    }
}

impl CompressedBlock<'_> {
    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        self.check().map_err(|_| EncodeError::Inconsistent {
            what: "Compressed.count and length of its data",
        })
    }
}

impl ObjectRecord {
    /// The encoded record.
    pub fn to_bytes(&self) -> [u8; OBJECT_LENGTH] {
        let mut bytes = [0; OBJECT_LENGTH];
        let mut writer = Writer::new(&mut bytes, OBJECT_LENGTH);
        // The array is large enough, so the write cannot fail.
        let _ = self.write(&mut writer);
        bytes
    }

    fn from_bytes(bytes: &[u8; OBJECT_LENGTH]) -> Result<Self, DecodeError> {
        Self::read(&mut Reader::new(bytes, 0, "Objects"))
    }
}

impl<'a> ObjectPart<'a> {
    /// Its objects, in order.
    pub fn objects(&self) -> impl Iterator<Item = ObjectRecord> + use<'a> {
        let (records, _) = self.data.as_chunks();
        let objects = records.iter().map(ObjectRecord::from_bytes);
        objects.filter_map(Result::ok)
    }

    const fn has_valid_part_length(&self) -> bool {
        let full = OBJECTS_PER_PART * OBJECT_LENGTH;
        has_valid_part_length(self.part, self.parts, self.data.len(), full)
            && self.data.len() <= full
            && self.data.len().is_multiple_of(OBJECT_LENGTH)
    }

    /// Refuses records that contradict the numbers of the parts or hold unknown codes. Every
    /// decoded part has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        rule(
            self.has_valid_part_length(),
            "Objects.part",
            "must be below parts, with 25 records unless it is the last",
        )?;
        let (records, _) = self.data.as_chunks();
        let mut objects = records.iter().map(ObjectRecord::from_bytes);
        objects.try_for_each(|object| object.map(drop))
    }

    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        self.check().map_err(|_| EncodeError::Inconsistent {
            what: "Objects.part, parts and the records",
        })
    }
}
