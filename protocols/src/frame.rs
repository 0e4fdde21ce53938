//! The packets of one frame: its header, its pixels, its labels.

use crate::command::positive;
use crate::error::{DecodeError, EncodeError};
use crate::output::{LabelLevel, MAX_WINDOW, PixelLevel, label_level, pixel_level};
use crate::pixels::{self, LABEL_TEXT_PER_PART, packed_length, pixels_per_block, unpack};
use crate::time::WireTime;
use crate::wire::{Reader, Writer, wire_enum};

wire_enum! {
    /// How pixels are laid out in a `PixelBlock`; the code is the number of bits a pixel takes.
    pub enum Packing: u8 {
        /// Two pixels in three octets, first bit first.
        Bits12 = 12,
        /// Two octets a pixel, big-endian.
        Bits16 = 16,
    }
}

impl Packing {
    /// The tighter packing that holds digital numbers of `bits` bits.
    pub const fn for_bits(bits: u8) -> Self {
        if bits <= 12 {
            Self::Bits12
        } else {
            Self::Bits16
        }
    }
}

/// Opens a frame. [`Header::time`](crate::Header::time) is the middle of its exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameHeader {
    /// Number of the frame since the emulator started.
    pub frame: u32,
    /// [`Attitude::sequence`](crate::Attitude::sequence) of the attitude that it shows.
    pub attitude_sequence: u32,
    /// Columns, at least 1.
    pub width: u16,
    /// Rows, at least 1.
    pub height: u16,
    /// Bits of a digital number, 1 to 16.
    pub bits: u8,
    /// How its pixels are packed, if not compressed.
    pub packing: Packing,
    /// Which of its pixels follow.
    pub pixel_level: PixelLevel,
    /// Which of its labels follow.
    pub label_level: LabelLevel,
    /// Columns and rows of a window; 0 without windows.
    pub window_size: u8,
    /// How many windows there are.
    pub windows: u16,
    /// How many packets with pixels follow: [`FrameHeader::blocks_due`].
    pub blocks: u32,
    /// How many packets with labels follow them: [`pixels::label_parts`], [`pixels::object_parts`].
    pub label_parts: u16,
    /// Octets of label text or of object records in all parts together.
    pub label_bytes: u32,
    /// First instant of the exposure.
    pub exposure_start: WireTime,
    /// Last instant of the exposure.
    pub exposure_end: WireTime,
    /// Seed of the noise.
    pub seed: u64,
    /// Conversion gain, electrons per digital number, above 0.
    pub gain_e_per_dn: f64,
    /// Digital number of a pixel without any electrons, DN.
    pub offset_dn: f64,
    /// CRC-32 of all pixels of the frame in order, each as a big-endian 16-bit number, whatever of them follows.
    pub pixels_crc32: u32,
}

/// A run of pixels. [`Header::time`](crate::Header::time) is that of its frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBlock<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the block in its frame, from 0.
    pub index: u32,
    /// Place of its first pixel in the frame: row * width + column.
    pub first_pixel: u32,
    /// Number of its pixels, at least 1.
    pub count: u16,
    /// How they are packed.
    pub packing: Packing,
    /// The packed pixels.
    pub data: &'a [u8],
}

/// A part of a frame's labels: JSON, byte for byte the frame's line of `labels.jsonl`, without a newline.
/// [`Header::time`](crate::Header::time) is that of its frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelPart<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the part, from 0.
    pub part: u16,
    /// How many parts there are.
    pub parts: u16,
    /// Its octets: [`LABEL_TEXT_PER_PART`] of them, fewer in the last part. A cut may fall inside a UTF-8 character.
    pub text: &'a [u8],
}

impl FrameHeader {
    /// Pixels of the frame.
    pub const fn pixels(&self) -> u32 {
        self.width as u32 * self.height as u32
    }

    /// Packets with pixels that follow; `None` where compression decides.
    pub const fn blocks_due(&self) -> Option<u32> {
        match self.pixel_level {
            PixelLevel::None => Some(0),
            PixelLevel::Windows => {
                match pixels::windows_per_block(self.packing, self.window_size) {
                    0 => None,
                    most => Some((self.windows as u32).div_ceil(most as u32)),
                }
            }
            PixelLevel::Frame => Some(pixels::blocks_in_frame(self.pixels(), self.packing)),
            PixelLevel::Compressed => None,
        }
    }

    /// Refuses fields that contradict each other. Every decoded header has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        geometry(self.width, self.height, self.bits, self.packing)?;
        let size = u16::from(self.window_size);
        let windows = match self.pixel_level {
            PixelLevel::Windows => {
                let most = self.width.min(self.height).min(MAX_WINDOW.into());
                (1..=most).contains(&size)
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
            None => (1..=self.pixels()).contains(&self.blocks),
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
        )?;
        positive("FrameHeader.gain_e_per_dn", self.gain_e_per_dn)?;
        rule(
            self.offset_dn.is_finite(),
            "FrameHeader.offset_dn",
            "must be finite",
        )
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        Ok(Self {
            frame: reader.u32()?,
            attitude_sequence: reader.u32()?,
            width: reader.u16()?,
            height: reader.u16()?,
            bits: reader.u8()?,
            packing: packing(reader)?,
            pixel_level: pixel_level(reader)?,
            label_level: label_level(reader)?,
            window_size: reader.u8()?,
            windows: reader.u16()?,
            blocks: reader.u32()?,
            label_parts: reader.u16()?,
            label_bytes: reader.u32()?,
            exposure_start: WireTime(reader.u64()?),
            exposure_end: WireTime(reader.u64()?),
            seed: reader.u64()?,
            gain_e_per_dn: reader.f64()?,
            offset_dn: reader.f64()?,
            pixels_crc32: reader.u32()?,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u32(self.frame)?;
        writer.u32(self.attitude_sequence)?;
        writer.u16(self.width)?;
        writer.u16(self.height)?;
        writer.u8(self.bits)?;
        writer.u8(self.packing.code())?;
        writer.u8(self.pixel_level.code())?;
        writer.u8(self.label_level.code())?;
        writer.u8(self.window_size)?;
        writer.u16(self.windows)?;
        writer.u32(self.blocks)?;
        writer.u16(self.label_parts)?;
        writer.u32(self.label_bytes)?;
        writer.u64(self.exposure_start.0)?;
        writer.u64(self.exposure_end.0)?;
        writer.u64(self.seed)?;
        writer.f64(self.gain_e_per_dn)?;
        writer.f64(self.offset_dn)?;
        writer.u32(self.pixels_crc32)
    }
}

impl<'a> PixelBlock<'a> {
    /// Writes its pixels to their place in `frame` (row by row, all pixels of the frame); false, and nothing written, if
    /// they lie beyond it.
    #[must_use]
    pub fn place(&self, frame: &mut [u16]) -> bool {
        let (first, count) = (self.first_pixel as usize, usize::from(self.count));
        let Some(pixels) = frame
            .get_mut(first..)
            .and_then(|rest| rest.get_mut(..count))
        else {
            return false;
        };
        if self.data.len() != packed_length(self.packing, count) {
            return false;
        }
        unpack(self.packing, self.data, pixels) == count
    }

    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let (frame, index, first_pixel) = (reader.u32()?, reader.u32()?, reader.u32()?);
        let (count, packing) = (reader.u16()?, packing(reader)?);
        let size = pixels_per_block(packing);
        let pixels = usize::from(count);
        rule(
            (1..=size).contains(&pixels),
            "PixelBlock.count",
            "must be at least 1 and at most a full block",
        )?;
        let place = u64::from(index) * size as u64;
        rule(
            u64::from(first_pixel) == place,
            "PixelBlock.first_pixel",
            "must be index times the pixels of a full block",
        )?;
        let data = reader.bytes(packed_length(packing, pixels))?;
        let padding = match (packing, pixels % 2, data.last()) {
            (Packing::Bits12, 1, Some(last)) => last & 0xF,
            _ => 0,
        };
        rule(
            padding == 0,
            "PixelBlock.data",
            "must end with four zero bits after an odd last pixel",
        )?;
        Ok(Self {
            frame,
            index,
            first_pixel,
            count,
            packing,
            data,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if self.data.len() != packed_length(self.packing, usize::from(self.count)) {
            return Err(EncodeError::Inconsistent {
                what: "PixelBlock.count and length of its data",
            });
        }
        let place = u64::from(self.index) * pixels_per_block(self.packing) as u64;
        if self.count == 0 || u64::from(self.first_pixel) != place {
            return Err(EncodeError::Inconsistent {
                what: "PixelBlock.index, first_pixel and count",
            });
        }
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u32(self.first_pixel)?;
        writer.u16(self.count)?;
        writer.u8(self.packing.code())?;
        writer.bytes(self.data)
    }
}

impl<'a> LabelPart<'a> {
    /// Place of its first octet in the whole text.
    pub const fn offset(&self) -> usize {
        self.part as usize * LABEL_TEXT_PER_PART
    }

    const fn is_cut_right(&self) -> bool {
        let last = self.part as u32 + 1 == self.parts as u32;
        self.part < self.parts
            && !self.text.is_empty()
            && (last || self.text.len() == LABEL_TEXT_PER_PART)
    }

    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let label = Self {
            frame: reader.u32()?,
            part: reader.u16()?,
            parts: reader.u16()?,
            text: reader.rest(),
        };
        rule(
            label.is_cut_right(),
            "Labels.part",
            "must be below parts, with a full text unless it is the last",
        )?;
        Ok(label)
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if !self.is_cut_right() {
            return Err(EncodeError::Inconsistent {
                what: "Labels.part, parts and length of the text",
            });
        }
        writer.u32(self.frame)?;
        writer.u16(self.part)?;
        writer.u16(self.parts)?;
        writer.bytes(self.text)
    }
}

pub(crate) fn packing(reader: &mut Reader<'_>) -> Result<Packing, DecodeError> {
    Packing::from_code(reader.u8()?).ok_or(DecodeError::BadValue {
        field: "packing",
        rule: "must be 12 or 16",
    })
}

pub(crate) fn geometry(
    width: u16,
    height: u16,
    bits: u8,
    packing: Packing,
) -> Result<(), DecodeError> {
    rule(
        width > 0 && height > 0,
        "width and height",
        "must be at least 1",
    )?;
    rule(
        (1..=packing.code()).contains(&bits),
        "bits",
        "must be at least 1 and fit the packing",
    )
}

pub(crate) fn rule(
    holds: bool,
    field: &'static str,
    rule: &'static str,
) -> Result<(), DecodeError> {
    if holds {
        Ok(())
    } else {
        Err(DecodeError::BadValue { field, rule })
    }
}
