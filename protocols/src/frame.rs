//! The packets of one frame (header, pixels, labels, end), and the rules between their fields.

use crate::error::{DecodeError, EncodeError};
pub use crate::generated::codes::{AttitudeSource, Overrun, Packing, SyncState};
pub use crate::generated::ends::{FrameEnd, Timing};
pub use crate::generated::frames::{FrameHeader, LabelPart, PixelBlock};
use crate::output::{LabelLevel, MAX_WINDOW, PixelLevel};
use crate::packet::same_length;
use crate::pixels::{
    self, LABEL_TEXT_PER_PART, has_valid_part_length, is_padded, packed_length, pixels_per_block,
    unpack,
};
use crate::rice;
use crate::rules::rule;

impl Packing {
    /// The shortest packing for digital numbers of `bits` bits.
    pub const fn for_bits(bits: u8) -> Self {
        if bits <= 12 {
            Self::Bits12
        } else {
            Self::Bits16
        }
    }
}

impl FrameHeader {
    /// Number of pixels of the frame.
    pub const fn pixels(&self) -> u32 {
        self.width as u32 * self.height as u32
    }

    /// Number of packets with pixels; `None` with compression, which decides the number.
    pub const fn blocks_due(&self) -> Option<u32> {
        match self.pixel_level {
            PixelLevel::None => Some(0),
            PixelLevel::Windows => {
                match pixels::windows_per_block(self.packing, self.window_size) {
                    0 => None,
                    per_block => Some((self.windows as u32).div_ceil(per_block as u32)),
                }
            }
            PixelLevel::Frame => Some(pixels::blocks_in_frame(self.pixels(), self.packing)),
            PixelLevel::Compressed => None,
        }
    }

    /// Number of packets of the frame: header, pixels, labels and [`FrameEnd`].
    pub const fn packets(&self) -> u32 {
        self.blocks
            .saturating_add(self.label_parts as u32)
            .saturating_add(2)
    }

    /// Refuses fields that contradict each other. Every decoded header has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        fits_packing(self.bits, self.packing)?;
        let size = u16::from(self.window_size);
        let windows = match self.pixel_level {
            PixelLevel::Windows => {
                let max = self.width.min(self.height).min(MAX_WINDOW.into());
                (1..=max).contains(&size)
            }
            _ => size == 0 && self.windows == 0,
        };
        rule(
            windows,
            "FrameHeader.window_size",
            "must be 1 to 25 and fit the frame, or be 0 like windows",
        )?;
        let blocks = match self.blocks_due() {
            Some(blocks) => self.blocks == blocks,
            None => (1..=self.pixels().div_ceil(rice::BLOCK as u32)).contains(&self.blocks),
        };
        rule(
            blocks,
            "FrameHeader.blocks",
            "must be as many packets as its pixels or windows take",
        )?;
        let parts = match self.label_level {
            LabelLevel::None => (self.label_bytes == 0).then_some(0),
            LabelLevel::Objects => {
                let length = pixels::OBJECT_LENGTH as u32;
                let objects = u16::try_from(self.label_bytes / length).ok();
                let whole = self.label_bytes.is_multiple_of(length);
                objects.filter(|_| whole).map(pixels::object_parts)
            }
            LabelLevel::Text => pixels::label_parts(self.label_bytes),
        };
        rule(
            parts == Some(self.label_parts),
            "FrameHeader.label_parts",
            "must be as many full parts as hold label_bytes",
        )?;
        let ordered = self.exposure_start <= self.exposure_end;
        rule(
            ordered,
            "FrameHeader.exposure_end",
            "must not be earlier than exposure_start",
        )
    }
}

impl Default for FrameEnd {
    /// The end of a frame that is in time, by the emulator's own clock, with the attitude of
    /// mid-exposure.
    fn default() -> Self {
        Self {
            frame: 0,
            pixels_crc32: 0,
            trigger: 0,
            attitude_source: AttitudeSource::Exact,
            overrun: Overrun::None,
            sync: SyncState::Free,
            in_time: true,
            timing: Timing::default(),
            clock_offset_s: 0.0,
        }
    }
}

impl PixelBlock<'_> {
    /// Writes its pixels to their position in `frame` (all pixels, row by row). Returns false and
    /// writes nothing if they do not fit.
    #[must_use]
    pub fn place(&self, frame: &mut [u16]) -> bool {
        let (first, count) = (self.first_pixel as usize, usize::from(self.count));
        let rest = frame.get_mut(first..).unwrap_or_default();
        let Some(pixels) = rest.get_mut(..count) else {
            return false;
        };
        self.data.len() == packed_length(self.packing, count)
            && unpack(self.packing, self.data, pixels) == count
    }

    /// Refuses pixels that contradict `count` or `index`. Every decoded block has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        let (size, count) = (pixels_per_block(self.packing), usize::from(self.count));
        rule(
            count <= size,
            "PixelBlock.count",
            "must be at least 1 and at most a full block",
        )?;
        rule(
            u64::from(self.first_pixel) == u64::from(self.index) * size as u64,
            "PixelBlock.first_pixel",
            "must be index times the pixels of a full block",
        )?;
        let length = packed_length(self.packing, count);
        same_length("PixelBlock", Self::FIELDS_LENGTH, self.data.len(), length)?;
        rule(
            is_padded(self.packing, count, self.data),
            "PixelBlock.data",
            "must end with four zero bits after an odd last pixel",
        )
    }

    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        let count = usize::from(self.count);
        let first = u64::from(self.index) * pixels_per_block(self.packing) as u64;
        let what = if self.data.len() != packed_length(self.packing, count) {
            "PixelBlock.count and length of its data"
        } else if count == 0 || u64::from(self.first_pixel) != first {
            "PixelBlock.index, first_pixel and count"
        } else {
            return Ok(());
        };
        Err(EncodeError::Inconsistent { what })
    }
}

impl LabelPart<'_> {
    /// Position of its first byte in the whole text.
    pub const fn offset(&self) -> usize {
        self.part as usize * LABEL_TEXT_PER_PART
    }

    const fn has_valid_part_length(&self) -> bool {
        has_valid_part_length(self.part, self.parts, self.text.len(), LABEL_TEXT_PER_PART)
    }

    /// Refuses a text whose length contradicts the numbers. Every decoded part has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        rule(
            self.has_valid_part_length(),
            "Labels.part",
            "must be below parts, with a full text unless it is the last",
        )
    }

    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        if self.has_valid_part_length() {
            return Ok(());
        }
        Err(EncodeError::Inconsistent {
            what: "Labels.part, parts and length of the text",
        })
    }
}

/// Refuses digital numbers that exceed their packing.
pub(crate) fn fits_packing(bits: u8, packing: Packing) -> Result<(), DecodeError> {
    rule(bits <= packing.code(), "bits", "must fit the packing")
}
