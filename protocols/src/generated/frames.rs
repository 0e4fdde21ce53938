// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! The packets of a frame.

use super::codes::{AttitudeSource, LabelLevel, Overrun, Packing, PixelLevel, SyncState};
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
        positive("FrameHeader.gain_e_per_dn", self.gain_e_per_dn)?;
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

/// A part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without a newline.
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

/// Closes a frame: what is known only when all of it has been rendered and sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameEnd {
    /// The frame that it belongs to.
    pub frame: u32,
    /// CRC-32 of all pixels of the frame in order, each as u16, whatever is sent of them.
    pub pixels_crc32: u32,
    /// Number of the Trigger that asked for it; 0: none did.
    pub trigger: u32,
    /// What its attitude was made of.
    pub attitude_source: AttitudeSource,
    /// What was done about its being late.
    pub overrun: Overrun,
    /// What the emulator went by for the client's time.
    pub sync: SyncState,
    /// 1: it left before its deadline.
    pub in_time: bool,
    /// Its times.
    pub timing: Timing,
    /// What the client's clock is ahead of the emulator's own, counted from when it was first heard; 0 where the emulator keeps its own time. Unit: s.
    pub clock_offset_s: f64,
}

impl FrameEnd {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let frame = reader.u32()?;
        let pixels_crc32 = reader.u32()?;
        let trigger = reader.u32()?;
        let attitude_source = reader.code(AttitudeSource::from_code, "FrameEnd.attitude_source", "must be 0 to 6")?;
        let overrun = reader.code(Overrun::from_code, "FrameEnd.overrun", "must be 0 to 3")?;
        let sync = reader.code(SyncState::from_code, "FrameEnd.sync", "must be 0 to 3")?;
        let flags = reader.flags(1, "FrameEnd.flags", "must be 0 or 1")?;
        let timing = Timing::read(reader)?;
        let clock_offset_s = reader.f64()?;
        Ok(Self {
            frame,
            pixels_crc32,
            trigger,
            attitude_source,
            overrun,
            sync,
            in_time: flags & 1 != 0,
            timing,
            clock_offset_s,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u32(self.frame)?;
        writer.u32(self.pixels_crc32)?;
        writer.u32(self.trigger)?;
        writer.u8(self.attitude_source.code())?;
        writer.u8(self.overrun.code())?;
        writer.u8(self.sync.code())?;
        writer.u8(u8::from(self.in_time))?;
        self.timing.write(writer)?;
        writer.f64(self.clock_offset_s)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.timing.check()?;
        rule(self.clock_offset_s.is_finite(), "FrameEnd.clock_offset_s", "must be finite")?;
        Ok(())
    }
}

impl FrameEnd {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 48;
}

/// When a frame's attitude held, its pixels were ready and its packets left; by the stepped clock all but the attitude's age is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Timing {
    /// Middle of the exposure minus the time of the attitude; below 0: it is of the future. Unit: s.
    pub attitude_age_s: f32,
    /// From the trigger (the exposure's end, or the attitude's arrival if that is later) until the first pixel was ready. Unit: s.
    pub first_pixel_s: f32,
    /// From the trigger until the last pixel was ready. Unit: s.
    pub last_pixel_s: f32,
    /// From the trigger until the FrameHeader was handed to the link. Unit: s.
    pub first_octet_s: f32,
    /// From the trigger until the packet before FrameEnd was handed to the link. Unit: s.
    pub last_octet_s: f32,
    /// Time left until the deadline when FrameEnd was handed to the link; below 0: late by so much. Unit: s.
    pub spare_s: f32,
}

impl Timing {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let attitude_age_s = reader.f32()?;
        let first_pixel_s = reader.f32()?;
        let last_pixel_s = reader.f32()?;
        let first_octet_s = reader.f32()?;
        let last_octet_s = reader.f32()?;
        let spare_s = reader.f32()?;
        Ok(Self {
            attitude_age_s,
            first_pixel_s,
            last_pixel_s,
            first_octet_s,
            last_octet_s,
            spare_s,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.f32(self.attitude_age_s)?;
        writer.f32(self.first_pixel_s)?;
        writer.f32(self.last_pixel_s)?;
        writer.f32(self.first_octet_s)?;
        writer.f32(self.last_octet_s)?;
        writer.f32(self.spare_s)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule(self.attitude_age_s.is_finite(), "Timing.attitude_age_s", "must be finite")?;
        rule(self.first_pixel_s.is_finite(), "Timing.first_pixel_s", "must be finite")?;
        rule(self.last_pixel_s.is_finite(), "Timing.last_pixel_s", "must be finite")?;
        rule(self.first_octet_s.is_finite(), "Timing.first_octet_s", "must be finite")?;
        rule(self.last_octet_s.is_finite(), "Timing.last_octet_s", "must be finite")?;
        rule(self.spare_s.is_finite(), "Timing.spare_s", "must be finite")?;
        Ok(())
    }
}

impl Timing {
    /// Octets of its fields, the rest of variable length aside.
    pub const FIELDS_LENGTH: usize = 24;
}
