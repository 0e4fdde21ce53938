//! What the emulator answers: frames, labels, status, acknowledgements.

use crate::command::positive;
use crate::counters::Counters;
use crate::error::{DecodeError, EncodeError, Reason};
use crate::packet::{self, Header, SEQUENCE_MODULUS, apid};
use crate::pixels::{self, LABEL_TEXT_PER_PART, Pixels, packed_length, pixels_per_block};
use crate::time::WireTime;
use crate::wire::{Reader, Writer, wire_enum};

/// Longest detail text of a `Nack`, octets.
pub const MAX_DETAIL: usize = 200;

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

wire_enum! {
    /// What makes the emulator take a frame.
    pub enum Mode: u8 {
        /// One frame for every attitude.
        Stepped = 0,
        /// The camera's cadence by the wall clock, with the latest attitude.
        Wall = 1,
    }
}

/// Opens a frame. [`Header::time`] is the middle of its exposure.
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
    /// How its pixel blocks are packed.
    pub packing: Packing,
    /// How many pixel blocks follow: [`pixels::blocks_in_frame`].
    pub blocks: u32,
    /// How many label parts follow them: [`pixels::label_parts`].
    pub label_parts: u16,
    /// Octets of label text in all parts together.
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
    /// CRC-32 of all pixels in order, each as a big-endian 16-bit number whatever the packing.
    pub pixels_crc32: u32,
}

/// A run of pixels. [`Header::time`] is that of its frame's header.
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
/// [`Header::time`] is that of its frame's header.
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

/// Settings and counters, sent after the `Ack` of a `Ping`. [`Header::time`] is the emulator's present time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Status {
    /// What makes the emulator take a frame.
    pub mode: Mode,
    /// Columns of the camera.
    pub width: u16,
    /// Rows of the camera.
    pub height: u16,
    /// Bits of a digital number, 1 to 16.
    pub bits: u8,
    /// How its pixel blocks are packed.
    pub packing: Packing,
    /// Exposure time, s, above 0.
    pub exposure_s: f64,
    /// Conversion gain, electrons per digital number, above 0.
    pub gain_e_per_dn: f64,
    /// Cadence of the wall mode, Hz, above 0.
    pub frame_rate_hz: f64,
    /// Number that the next frame will have.
    pub next_frame: u32,
    /// Frame packets sent in this exchange, modulo 2^32: a client that lost some bases its next `Credit` on this.
    pub packets_sent: u32,
    /// Counts since the emulator started.
    pub counters: Counters,
}

/// A command was carried out. [`Header::time`] is that of the packet it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ack {
    /// APID of the packet that it answers.
    pub apid: u16,
    /// Sequence count of the packet that it answers.
    pub sequence_count: u16,
}

/// A packet was refused. [`Header::time`] is the emulator's present time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nack<'a> {
    /// APID of the packet that it answers, as its octets state it.
    pub apid: u16,
    /// Sequence count of the packet that it answers, as its octets state it.
    pub sequence_count: u16,
    /// Why.
    pub reason: Reason,
    /// What and where, for people: UTF-8, at most [`MAX_DETAIL`] octets.
    pub detail: &'a str,
}

impl FrameHeader {
    /// Pixels of the frame.
    pub const fn pixels(&self) -> u32 {
        self.width as u32 * self.height as u32
    }

    /// Refuses fields that contradict each other. Every decoded header has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        geometry(self.width, self.height, self.bits, self.packing)?;
        let blocks = pixels::blocks_in_frame(self.pixels(), self.packing);
        rule(
            self.blocks == blocks,
            "FrameHeader.blocks",
            "must be as many full blocks as hold width * height pixels",
        )?;
        let parts = pixels::label_parts(self.label_bytes);
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

    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        Ok(Self {
            frame: reader.u32()?,
            attitude_sequence: reader.u32()?,
            width: reader.u16()?,
            height: reader.u16()?,
            bits: reader.u8()?,
            packing: packing(reader)?,
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

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u32(self.frame)?;
        writer.u32(self.attitude_sequence)?;
        writer.u16(self.width)?;
        writer.u16(self.height)?;
        writer.u8(self.bits)?;
        writer.u8(self.packing.code())?;
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
    /// Its pixels, DN.
    pub fn pixels(&self) -> Pixels<'a> {
        Pixels::new(self.data, self.packing, usize::from(self.count))
    }

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
        match self.packing {
            Packing::Bits12 => pixels::unpack12(self.data, pixels),
            Packing::Bits16 => pixels::unpack16(self.data, pixels),
        };
        true
    }

    fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
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

    /// Everything before the pixels.
    pub(crate) fn write_fields(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
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
        writer.u8(self.packing.code())
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if self.data.len() != packed_length(self.packing, usize::from(self.count)) {
            return Err(EncodeError::Inconsistent {
                what: "PixelBlock.count and length of its data",
            });
        }
        self.write_fields(writer)?;
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

    fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
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

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
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

impl Status {
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let mode = Mode::from_code(reader.u8()?);
        let mode = mode.ok_or(DecodeError::BadValue {
            field: "Status.mode",
            rule: "must be 0 or 1",
        })?;
        let mut status = Self {
            mode,
            width: reader.u16()?,
            height: reader.u16()?,
            bits: reader.u8()?,
            packing: packing(reader)?,
            exposure_s: reader.f64()?,
            gain_e_per_dn: reader.f64()?,
            frame_rate_hz: reader.f64()?,
            next_frame: reader.u32()?,
            packets_sent: reader.u32()?,
            counters: Counters::default(),
        };
        geometry(status.width, status.height, status.bits, status.packing)?;
        positive("Status.exposure_s", status.exposure_s)?;
        positive("Status.gain_e_per_dn", status.gain_e_per_dn)?;
        positive("Status.frame_rate_hz", status.frame_rate_hz)?;
        for counter in status.counters.iter_mut() {
            *counter = reader.u32()?;
        }
        Ok(status)
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.mode.code())?;
        writer.u16(self.width)?;
        writer.u16(self.height)?;
        writer.u8(self.bits)?;
        writer.u8(self.packing.code())?;
        writer.f64s(&[self.exposure_s, self.gain_e_per_dn, self.frame_rate_hz])?;
        writer.u32(self.next_frame)?;
        writer.u32(self.packets_sent)?;
        self.counters
            .iter()
            .try_for_each(|(_, value)| writer.u32(value))
    }
}

impl Ack {
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let (apid, sequence_count) = answered(reader)?;
        Ok(Self {
            apid,
            sequence_count,
        })
    }
}

impl<'a> Nack<'a> {
    /// A refusal; `detail` is cut to [`MAX_DETAIL`] octets at a character's end.
    pub fn new(apid: u16, sequence_count: u16, reason: Reason, detail: &'a str) -> Self {
        let detail = (0..=MAX_DETAIL)
            .rev()
            .find_map(|end| detail.get(..end))
            .unwrap_or_default();
        Self {
            apid,
            sequence_count,
            reason,
            detail,
        }
    }

    fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let (apid, sequence_count) = answered(reader)?;
        let reason = Reason::from_code(reader.u8()?);
        let reason = reason.ok_or(DecodeError::BadValue {
            field: "Nack.reason",
            rule: "must be a code of the ICD's table",
        })?;
        let text = reader.rest();
        rule(
            text.len() <= MAX_DETAIL,
            "Nack.detail",
            "must be 200 octets or fewer",
        )?;
        let detail = core::str::from_utf8(text);
        let detail = detail.map_err(|_| DecodeError::BadValue {
            field: "Nack.detail",
            rule: "must be UTF-8",
        })?;
        Ok(Self {
            apid,
            sequence_count,
            reason,
            detail,
        })
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        let (found, limit) = (self.detail.len(), MAX_DETAIL);
        if found > limit {
            return Err(EncodeError::TooLong {
                what: "Nack.detail",
                found,
                limit,
            });
        }
        write_answered(self.apid, self.sequence_count, writer)?;
        writer.u8(self.reason.code())?;
        writer.bytes(self.detail.as_bytes())
    }
}

/// APID and sequence count of the packet that is answered: 11 and 14 bits.
fn answered(reader: &mut Reader<'_>) -> Result<(u16, u16), DecodeError> {
    let (apid, count) = (reader.u16()?, reader.u16()?);
    rule(apid <= 0x7FF, "Ack/Nack.apid", "must be 0x7ff or below")?;
    rule(
        count < SEQUENCE_MODULUS,
        "Ack/Nack.sequence_count",
        "must be below 16384",
    )?;
    Ok((apid, count))
}

fn write_answered(
    apid: u16,
    sequence_count: u16,
    writer: &mut Writer<'_>,
) -> Result<(), EncodeError> {
    writer.u16(apid & 0x7FF)?;
    writer.u16(sequence_count % SEQUENCE_MODULUS)
}

fn packing(reader: &mut Reader<'_>) -> Result<Packing, DecodeError> {
    Packing::from_code(reader.u8()?).ok_or(DecodeError::BadValue {
        field: "packing",
        rule: "must be 12 or 16",
    })
}

fn geometry(width: u16, height: u16, bits: u8, packing: Packing) -> Result<(), DecodeError> {
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

fn rule(holds: bool, field: &'static str, rule: &'static str) -> Result<(), DecodeError> {
    if holds {
        Ok(())
    } else {
        Err(DecodeError::BadValue { field, rule })
    }
}

/// Everything that the emulator can say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply<'a> {
    /// Opens a frame.
    FrameHeader(FrameHeader),
    /// A run of pixels.
    PixelBlock(PixelBlock<'a>),
    /// A part of the label text.
    Labels(LabelPart<'a>),
    /// Settings and counters.
    Status(Status),
    /// A command was carried out.
    Ack(Ack),
    /// A packet was refused.
    Nack(Nack<'a>),
}

impl<'a> Reply<'a> {
    /// The APID of its packet.
    pub const fn apid(&self) -> u16 {
        match self {
            Self::FrameHeader(_) => apid::FRAME_HEADER,
            Self::PixelBlock(_) => apid::PIXEL_BLOCK,
            Self::Labels(_) => apid::LABELS,
            Self::Status(_) => apid::STATUS,
            Self::Ack(_) => apid::ACK,
            Self::Nack(_) => apid::NACK,
        }
    }

    /// Whether its packets take credit: those of a frame do, answers do not.
    pub const fn takes_credit(&self) -> bool {
        matches!(
            self,
            Self::FrameHeader(_) | Self::PixelBlock(_) | Self::Labels(_)
        )
    }

    /// Reads exactly one packet.
    ///
    /// # Errors
    /// Whatever is wrong first: length, CRC, version, type, then the fields in their order.
    pub fn decode(bytes: &'a [u8]) -> Result<(Header, Self), DecodeError> {
        let (header, mut reader) = packet::open(bytes)?;
        let reply = match header.apid {
            apid::FRAME_HEADER => Self::FrameHeader(FrameHeader::read(&mut reader)?),
            apid::PIXEL_BLOCK => Self::PixelBlock(PixelBlock::read(&mut reader)?),
            apid::LABELS => Self::Labels(LabelPart::read(&mut reader)?),
            apid::STATUS => Self::Status(Status::read(&mut reader)?),
            apid::ACK => Self::Ack(Ack::read(&mut reader)?),
            apid::NACK => Self::Nack(Nack::read(&mut reader)?),
            apid => return Err(DecodeError::UnknownApid { apid }),
        };
        reader.finish()?;
        if let Self::FrameHeader(frame) = &reply {
            frame.check()?;
        }
        Ok((header, reply))
    }

    /// Writes the packet into `buf` and returns its length; `header_seq_count` is taken modulo 2^14.
    ///
    /// # Errors
    /// A buffer too small, a text or pixels too long, or lengths that contradict each other. Other values are not
    /// judged here.
    pub fn encode(
        &self,
        header_seq_count: u16,
        time: WireTime,
        buf: &mut [u8],
    ) -> Result<usize, EncodeError> {
        packet::write(
            self.apid(),
            header_seq_count,
            time,
            buf,
            |writer| match self {
                Self::FrameHeader(frame) => frame.write(writer),
                Self::PixelBlock(block) => block.write(writer),
                Self::Labels(label) => label.write(writer),
                Self::Status(status) => status.write(writer),
                Self::Ack(ack) => write_answered(ack.apid, ack.sequence_count, writer),
                Self::Nack(nack) => nack.write(writer),
            },
        )
    }
}
