//! What the emulator answers: the packets of a frame, status, acknowledgements.

use crate::command::positive;
use crate::counters::Counters;
use crate::error::{DecodeError, EncodeError, Reason};
pub use crate::frame::{FrameHeader, LabelPart, Packing, PixelBlock};
use crate::frame::{geometry, packing, rule};
use crate::output::Output;
use crate::packet::{self, Header, SEQUENCE_MODULUS, apid};
pub use crate::parts::{
    CompressedBlock, ID_LENGTH, ObjectPart, ObjectRecord, Window, WindowBlock, window_length,
};
use crate::time::WireTime;
use crate::wire::{Reader, Writer, wire_enum};

/// Longest detail text of a `Nack`, octets.
pub const MAX_DETAIL: usize = 200;

wire_enum! {
    /// What makes the emulator take a frame.
    pub enum Mode: u8 {
        /// One frame for every attitude.
        Stepped = 0,
        /// The camera's cadence by the wall clock, with the latest attitude.
        Wall = 1,
    }
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
    /// How its pixels are packed.
    pub packing: Packing,
    /// What each frame brings.
    pub output: Output,
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
            output: Output::read(reader)?,
            exposure_s: reader.f64()?,
            gain_e_per_dn: reader.f64()?,
            frame_rate_hz: reader.f64()?,
            next_frame: reader.u32()?,
            packets_sent: reader.u32()?,
            counters: Counters::default(),
        };
        geometry(status.width, status.height, status.bits, status.packing)?;
        status.output.check()?;
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
        self.output.write(writer)?;
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
    /// Windows cut out of the frame.
    Windows(WindowBlock<'a>),
    /// The frame's brightest objects.
    Objects(ObjectPart<'a>),
    /// A run of pixels, compressed.
    Compressed(CompressedBlock<'a>),
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
            Self::Windows(_) => apid::WINDOWS,
            Self::Objects(_) => apid::OBJECTS,
            Self::Compressed(_) => apid::COMPRESSED,
        }
    }

    /// Whether its packets take credit: those of a frame do, answers do not.
    pub const fn takes_credit(&self) -> bool {
        !matches!(self, Self::Status(_) | Self::Ack(_) | Self::Nack(_))
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
            apid::WINDOWS => Self::Windows(WindowBlock::read(&mut reader)?),
            apid::OBJECTS => Self::Objects(ObjectPart::read(&mut reader)?),
            apid::COMPRESSED => Self::Compressed(CompressedBlock::read(&mut reader)?),
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
                Self::Windows(windows) => windows.write(writer),
                Self::Objects(objects) => objects.write(writer),
                Self::Compressed(block) => block.write(writer),
            },
        )
    }
}
