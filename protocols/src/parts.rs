//! Parts of a frame for narrow lines: windows, objects as numbers, compressed pixels.

use crate::error::{DecodeError, EncodeError};
use crate::frame::{Packing, packing, rule};
use crate::output::MAX_WINDOW;
use crate::pixels::{OBJECT_LENGTH, OBJECTS_PER_PART, packed_length, windows_per_block};
use crate::wire::{Reader, Writer};

/// Octets of an object's identifier.
pub const ID_LENGTH: usize = 16;

/// Windows of a frame. [`Header::time`](crate::Header::time) is that of its frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowBlock<'a> {
    /// The frame that they belong to.
    pub frame: u32,
    /// Number of this packet among the frame's pixel packets, from 0.
    pub index: u32,
    /// Number of its first window in the frame.
    pub first: u16,
    /// Number of its windows, at least 1.
    pub count: u8,
    /// Columns and rows of each window.
    pub size: u8,
    /// How their pixels are packed.
    pub packing: Packing,
    /// Each window: column and row of its first pixel, then its pixels row by row, packed.
    pub data: &'a [u8],
}

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

/// Octets of one window: its place and its pixels.
pub const fn window_length(packing: Packing, size: u8) -> usize {
    4 + packed_length(packing, size as usize * size as usize)
}

impl<'a> WindowBlock<'a> {
    /// Its windows, in order.
    pub fn windows(&self) -> impl Iterator<Item = Window<'a>> + use<'a> {
        let length = window_length(self.packing, self.size);
        self.data.chunks_exact(length).filter_map(|octets| {
            let (place, data) = octets.split_first_chunk::<4>()?;
            let [a, b, c, d] = *place;
            Some(Window {
                column: u16::from_be_bytes([a, b]),
                row: u16::from_be_bytes([c, d]),
                data,
            })
        })
    }

    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let (frame, index, first) = (reader.u32()?, reader.u32()?, reader.u16()?);
        let (count, size, packing) = (reader.u8()?, reader.u8()?, packing(reader)?);
        rule(
            (1..=MAX_WINDOW).contains(&size),
            "Windows.size",
            "must be 1 to 25",
        )?;
        let most = windows_per_block(packing, size);
        rule(
            (1..=most).contains(&usize::from(count)),
            "Windows.count",
            "must be at least 1 and at most what fits a packet",
        )?;
        rule(
            u64::from(first) == u64::from(index) * most as u64,
            "Windows.first",
            "must be index times the windows of a full packet",
        )?;
        let data = reader.bytes(usize::from(count) * window_length(packing, size))?;
        let block = Self {
            frame,
            index,
            first,
            count,
            size,
            packing,
            data,
        };
        rule(
            block
                .windows()
                .all(|window| is_padded(packing, size, window.data)),
            "Windows.data",
            "must end with four zero bits after an odd last pixel",
        )?;
        Ok(block)
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        let most = windows_per_block(self.packing, self.size);
        let fits = (1..=most).contains(&usize::from(self.count))
            && u64::from(self.first) == u64::from(self.index) * most as u64;
        let length = usize::from(self.count) * window_length(self.packing, self.size);
        if !fits || self.data.len() != length {
            return Err(EncodeError::Inconsistent {
                what: "Windows.index, first, count and length of its data",
            });
        }
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u16(self.first)?;
        writer.u8(self.count)?;
        writer.u8(self.size)?;
        writer.u8(self.packing.code())?;
        writer.bytes(self.data)
    }
}

/// Whether the bits after an odd last pixel of 12 bits are 0.
fn is_padded(packing: Packing, size: u8, data: &[u8]) -> bool {
    match (packing, size % 2, data.last()) {
        (Packing::Bits12, 1, Some(last)) => last & 0xF == 0,
        _ => true,
    }
}

/// A run of compressed pixels ([`rice`](crate::rice)). [`Header::time`](crate::Header::time) is that of its frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CompressedBlock<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the block in its frame, from 0.
    pub index: u32,
    /// Place of its first pixel in the frame: row * width + column.
    pub first_pixel: u32,
    /// Number of its pixels, at least 1.
    pub count: u16,
    /// The code.
    pub data: &'a [u8],
}

impl<'a> CompressedBlock<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let block = Self {
            frame: reader.u32()?,
            index: reader.u32()?,
            first_pixel: reader.u32()?,
            count: reader.u16()?,
            data: reader.rest(),
        };
        rule(block.count > 0, "Compressed.count", "must be at least 1")?;
        rule(
            !block.data.is_empty(),
            "Compressed.data",
            "must not be empty",
        )?;
        Ok(block)
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if self.count == 0 || self.data.is_empty() {
            return Err(EncodeError::Inconsistent {
                what: "Compressed.count and length of its data",
            });
        }
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u32(self.first_pixel)?;
        writer.u16(self.count)?;
        writer.bytes(self.data)
    }
}

/// A part of a frame's brightest objects. [`Header::time`](crate::Header::time) is that of its frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjectPart<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the part, from 0.
    pub part: u16,
    /// How many parts there are.
    pub parts: u16,
    /// The records: [`OBJECTS_PER_PART`] of them, fewer in the last part; see [`ObjectPart::objects`].
    pub data: &'a [u8],
}

/// One object of a frame; the same numbers as in the label text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectRecord {
    /// Whether it is a resident space object; else a star.
    pub is_rso: bool,
    /// Whether its centroid lies in the frame.
    pub in_frame: bool,
    /// Whether it is in frame, lit, not occulted and bright enough.
    pub visible: bool,
    /// `HIP 80351`, `NORAD 44322` and so on, filled with zeros.
    pub id: [u8; ID_LENGTH],
    /// Centroid over the exposure, column, px.
    pub x_px: f64,
    /// Centroid over the exposure, row, px.
    pub y_px: f64,
    /// Columns that it moves during the exposure, px.
    pub dx_px: f32,
    /// Rows that it moves during the exposure, px.
    pub dy_px: f32,
    /// Magnitude V; NaN: nothing is reflected.
    pub mag: f32,
    /// Signal-to-noise ratio.
    pub snr: f32,
    /// Expected electrons of the exposure.
    pub electrons: f32,
}

impl ObjectRecord {
    /// Its octets.
    pub fn to_octets(&self) -> [u8; OBJECT_LENGTH] {
        let mut octets = [0; OBJECT_LENGTH];
        let mut writer = Writer::new(&mut octets, OBJECT_LENGTH);
        // The array has room for all.
        let _ = self.write(&mut writer);
        octets
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(u8::from(self.is_rso))?;
        writer.u8(u8::from(self.in_frame) | u8::from(self.visible) << 1)?;
        writer.bytes(&self.id)?;
        writer.f64s(&[self.x_px, self.y_px])?;
        [self.dx_px, self.dy_px, self.mag, self.snr, self.electrons]
            .iter()
            .try_for_each(|number| writer.u32(number.to_bits()))
    }

    fn read(octets: &[u8; OBJECT_LENGTH]) -> Result<Self, DecodeError> {
        let mut reader = Reader::new(octets, 0, "Objects");
        let (kind, flags) = (reader.u8()?, reader.u8()?);
        rule(kind <= 1, "Objects.kind", "must be 0 or 1")?;
        rule(flags <= 3, "Objects.flags", "must be 0 to 3")?;
        let mut id = [0; ID_LENGTH];
        id.copy_from_slice(reader.bytes(ID_LENGTH)?);
        let [x_px, y_px] = reader.f64s()?;
        let mut f32 = || reader.u32().map(f32::from_bits);
        Ok(Self {
            is_rso: kind == 1,
            in_frame: flags & 1 != 0,
            visible: flags & 2 != 0,
            id,
            x_px,
            y_px,
            dx_px: f32()?,
            dy_px: f32()?,
            mag: f32()?,
            snr: f32()?,
            electrons: f32()?,
        })
    }
}

impl<'a> ObjectPart<'a> {
    /// Its objects, in order.
    pub fn objects(&self) -> impl Iterator<Item = ObjectRecord> + use<'a> {
        let (records, _) = self.data.as_chunks::<OBJECT_LENGTH>();
        records
            .iter()
            .filter_map(|octets| ObjectRecord::read(octets).ok())
    }

    const fn is_cut_right(&self) -> bool {
        let last = self.part as u32 + 1 == self.parts as u32;
        let full = self.data.len() == OBJECTS_PER_PART * OBJECT_LENGTH;
        self.part < self.parts
            && !self.data.is_empty()
            && self.data.len().is_multiple_of(OBJECT_LENGTH)
            && self.data.len() <= OBJECTS_PER_PART * OBJECT_LENGTH
            && (last || full)
    }

    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let part = Self {
            frame: reader.u32()?,
            part: reader.u16()?,
            parts: reader.u16()?,
            data: reader.rest(),
        };
        rule(
            part.is_cut_right(),
            "Objects.part",
            "must be below parts, with 25 records unless it is the last",
        )?;
        let (records, _) = part.data.as_chunks::<OBJECT_LENGTH>();
        records
            .iter()
            .try_for_each(|octets| ObjectRecord::read(octets).map(drop))?;
        Ok(part)
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if !self.is_cut_right() {
            return Err(EncodeError::Inconsistent {
                what: "Objects.part, parts and length of the records",
            });
        }
        writer.u32(self.frame)?;
        writer.u16(self.part)?;
        writer.u16(self.parts)?;
        writer.bytes(self.data)
    }
}
