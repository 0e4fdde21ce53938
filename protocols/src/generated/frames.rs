// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! The packets of a frame.

use super::codes::{LabelLevel, Packing, PixelLevel};
use crate::error::{DecodeError, EncodeError};
use crate::rules::{positive, rule};
use crate::time::WireTime;
use crate::wire::{Reader, Writer};

/// Opens a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameHeader {
    /// Number of the frame since the emulator started.
    pub frame: u32,
    /// `sequence` of the attitude that it shows.
    pub attitude_sequence: u32,
    /// Columns. Unit: px.
    pub width: u16,
    /// Rows. Unit: px.
    pub height: u16,
    /// Bits of a digital number. Unit: bit.
    pub bits: u8,
    /// Bits that a pixel takes in PixelBlock and Windows. Unit: bit.
    pub packing: Packing,
    /// Which of its pixels follow.
    pub pixel_level: PixelLevel,
    /// Which of its labels follow them.
    pub label_level: LabelLevel,
    /// Columns and rows of a window; 0 without windows. Unit: px.
    pub window_size: u8,
    /// Number of windows; 0 without.
    pub windows: u16,
    /// Packets with pixels that follow: PixelBlock, Windows or Compressed.
    pub blocks: u32,
    /// Packets with labels that follow them: Labels or Objects.
    pub label_parts: u16,
    /// Length of the label text or of all object records; 0: no labels. Unit: octets.
    pub label_bytes: u32,
    /// First instant of the exposure.
    pub exposure_start: WireTime,
    /// Last instant of the exposure.
    pub exposure_end: WireTime,
    /// Seed of the noise.
    pub seed: u64,
    /// Conversion gain. Unit: e-/DN.
    pub gain_e_per_dn: f64,
    /// Digital number of a pixel without any electrons. Unit: DN.
    pub offset_dn: f64,
}

impl FrameHeader {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let attitude_sequence = reader.u32()?;
        let width = reader.u16()?;
        let height = reader.u16()?;
        let bits = reader.u8()?;
        let packing = reader.code(Packing::from_code, "FrameHeader.packing", "must be 12 or 16")?;
        let pixel_level = reader.code(PixelLevel::from_code, "FrameHeader.pixel_level", "must be 0 to 3")?;
        let label_level = reader.code(LabelLevel::from_code, "FrameHeader.label_level", "must be 0 to 2")?;
        let window_size = reader.u8()?;
        let windows = reader.u16()?;
        let blocks = reader.u32()?;
        let label_parts = reader.u16()?;
        let label_bytes = reader.u32()?;
        let exposure_start = reader.time()?;
        let exposure_end = reader.time()?;
        let seed = reader.u64()?;
        let gain_e_per_dn = reader.f64()?;
        let offset_dn = reader.f64()?;
        Ok(Self {
            frame,
            attitude_sequence,
            width,
            height,
            bits,
            packing,
            pixel_level,
            label_level,
            window_size,
            windows,
            blocks,
            label_parts,
            label_bytes,
            exposure_start,
            exposure_end,
            seed,
            gain_e_per_dn,
            offset_dn,
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
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.width), "FrameHeader.width", "must be 1 to 65535")?;
        rule((1..).contains(&self.height), "FrameHeader.height", "must be 1 to 65535")?;
        rule((1..=16).contains(&self.bits), "FrameHeader.bits", "must be 1 to 16")?;
        positive("FrameHeader.gain_e_per_dn", self.gain_e_per_dn, "must be finite and above 0 e-/DN")?;
        rule(self.offset_dn.is_finite(), "FrameHeader.offset_dn", "must be finite")?;
        Ok(())
    }
}

impl FrameHeader {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 69;
}

/// A run of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBlock<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the block in its frame.
    pub index: u32,
    /// Place of its first pixel.
    pub first_pixel: u32,
    /// Number of its pixels; every block but the last is full. Unit: px.
    pub count: u16,
    /// Bits that a pixel takes. Unit: bit.
    pub packing: Packing,
    /// The pixels. Unit: DN.
    pub data: &'a [u8],
}

impl<'a> PixelBlock<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let index = reader.u32()?;
        let first_pixel = reader.u32()?;
        let count = reader.u16()?;
        let packing = reader.code(Packing::from_code, "PixelBlock.packing", "must be 12 or 16")?;
        let data = reader.rest();
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
        self.check_layout()?;
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u32(self.first_pixel)?;
        writer.u16(self.count)?;
        writer.u8(self.packing.code())?;
        writer.bytes(self.data)?;
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.count), "PixelBlock.count", "must be 1 to 65535")?;
        Ok(())
    }
}

impl PixelBlock<'_> {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 15;
}

/// A part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without its last member `files` and without a newline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelPart<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the part; its text begins at octet part * 1375 of the whole.
    pub part: u16,
    /// As label_parts.
    pub parts: u16,
    /// 1375 octets, fewer in the last part only.
    pub text: &'a [u8],
}

impl<'a> LabelPart<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let part = reader.u16()?;
        let parts = reader.u16()?;
        let text = reader.rest();
        Ok(Self {
            frame,
            part,
            parts,
            text,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.check_layout()?;
        writer.u32(self.frame)?;
        writer.u16(self.part)?;
        writer.u16(self.parts)?;
        writer.bytes(self.text)?;
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.parts), "LabelPart.parts", "must be 1 to 65535")?;
        rule((1..=1375).contains(&self.text.len()), "LabelPart.text", "must be 1 to 1375 octets")?;
        Ok(())
    }
}

impl LabelPart<'_> {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 8;
}

/// Square windows cut out of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowBlock<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the packet among those with pixels.
    pub index: u32,
    /// Number of its first window in the frame.
    pub first: u16,
    /// Number of its windows; every packet but the last is full.
    pub count: u8,
    /// Columns and rows of a window. Unit: px.
    pub size: u8,
    /// Bits that a pixel takes. Unit: bit.
    pub packing: Packing,
    /// So many records of the same length.
    pub data: &'a [u8],
}

impl<'a> WindowBlock<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let index = reader.u32()?;
        let first = reader.u16()?;
        let count = reader.u8()?;
        let size = reader.u8()?;
        let packing = reader.code(Packing::from_code, "WindowBlock.packing", "must be 12 or 16")?;
        let data = reader.rest();
        Ok(Self {
            frame,
            index,
            first,
            count,
            size,
            packing,
            data,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.check_layout()?;
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u16(self.first)?;
        writer.u8(self.count)?;
        writer.u8(self.size)?;
        writer.u8(self.packing.code())?;
        writer.bytes(self.data)?;
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.count), "WindowBlock.count", "must be 1 to 255")?;
        rule((1..=25).contains(&self.size), "WindowBlock.size", "must be 1 to 25")?;
        Ok(())
    }
}

impl WindowBlock<'_> {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 13;
}

/// Records of the brightest objects in a frame, brightest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjectPart<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the part.
    pub part: u16,
    /// As label_parts.
    pub parts: u16,
    /// The records.
    pub data: &'a [u8],
}

impl<'a> ObjectPart<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let part = reader.u16()?;
        let parts = reader.u16()?;
        let data = reader.rest();
        Ok(Self {
            frame,
            part,
            parts,
            data,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.check_layout()?;
        writer.u32(self.frame)?;
        writer.u16(self.part)?;
        writer.u16(self.parts)?;
        writer.bytes(self.data)?;
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.parts), "ObjectPart.parts", "must be 1 to 65535")?;
        Ok(())
    }
}

impl ObjectPart<'_> {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 8;
}

/// One object of the labels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectRecord {
    /// 0: a star; 1: a resident space object.
    pub is_rso: bool,
    /// 1: its centroid is in the frame; 2: it is in the frame, lit, not occulted and bright enough.
    pub in_frame: bool,
    /// 1: its centroid is in the frame; 2: it is in the frame, lit, not occulted and bright enough.
    pub visible: bool,
    /// Its `id` in ASCII, zeros after it; cut if longer.
    pub id: [u8; 16],
    /// Column of its centroid. Unit: px.
    pub x_px: f64,
    /// Row of its centroid. Unit: px.
    pub y_px: f64,
    /// Columns that its image moves during the exposure. Unit: px.
    pub dx_px: f32,
    /// Rows that its image moves during the exposure. Unit: px.
    pub dy_px: f32,
    /// Its magnitude. Unit: mag.
    pub mag: f32,
    /// Signal-to-noise ratio.
    pub snr: f32,
    /// Electrons on the detector. Unit: e-.
    pub electrons: f32,
}

impl ObjectRecord {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let kind = reader.flags(1, "ObjectRecord.kind", "must be 0 or 1")?;
        let flags = reader.flags(3, "ObjectRecord.flags", "must be 0 to 3")?;
        let id = reader.array()?;
        let x_px = reader.f64()?;
        let y_px = reader.f64()?;
        let dx_px = reader.f32()?;
        let dy_px = reader.f32()?;
        let mag = reader.f32()?;
        let snr = reader.f32()?;
        let electrons = reader.f32()?;
        Ok(Self {
            is_rso: kind & 1 != 0,
            in_frame: flags & 1 != 0,
            visible: flags & 2 != 0,
            id,
            x_px,
            y_px,
            dx_px,
            dy_px,
            mag,
            snr,
            electrons,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(u8::from(self.is_rso))?;
        writer.u8(u8::from(self.in_frame) | u8::from(self.visible) << 1)?;
        writer.bytes(&self.id)?;
        writer.f64(self.x_px)?;
        writer.f64(self.y_px)?;
        writer.f32(self.dx_px)?;
        writer.f32(self.dy_px)?;
        writer.f32(self.mag)?;
        writer.f32(self.snr)?;
        writer.f32(self.electrons)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        Ok(())
    }
}

impl ObjectRecord {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 54;
}

/// A run of pixels, losslessly compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CompressedBlock<'a> {
    /// The frame that it belongs to.
    pub frame: u32,
    /// Number of the packet among those with pixels.
    pub index: u32,
    /// Place of its first pixel.
    pub first_pixel: u32,
    /// Number of its pixels. Unit: px.
    pub count: u16,
    /// The code.
    pub data: &'a [u8],
}

impl<'a> CompressedBlock<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let index = reader.u32()?;
        let first_pixel = reader.u32()?;
        let count = reader.u16()?;
        let data = reader.rest();
        Ok(Self {
            frame,
            index,
            first_pixel,
            count,
            data,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.check_layout()?;
        writer.u32(self.frame)?;
        writer.u32(self.index)?;
        writer.u32(self.first_pixel)?;
        writer.u16(self.count)?;
        writer.bytes(self.data)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.count), "CompressedBlock.count", "must be 1 to 65535")?;
        rule((1..=1369).contains(&self.data.len()), "CompressedBlock.data", "must be 1 to 1369 octets")?;
        Ok(())
    }
}

impl CompressedBlock<'_> {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 14;
}
