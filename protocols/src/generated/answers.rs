// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! The answers of the emulator, and all of its packets.

use super::codes::{Mode, Packing, Reason, SyncState, Withheld, apid};
use super::commands::Output;
use super::counters::Counters;
use super::ends::{FrameEnd, Timing};
use super::frames::{FrameHeader, PixelBlock, LabelPart, WindowBlock, ObjectPart, CompressedBlock};
use crate::error::{DecodeError, EncodeError};
use crate::rules::{positive, rule};
use crate::time::WireTime;
use crate::wire::{Reader, Writer};

/// Settings and counters, sent after the Ack of a Ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Status {
    /// What makes the emulator take a frame.
    pub mode: Mode,
    /// Columns of the camera. Unit: px.
    pub width: u16,
    /// Rows of the camera. Unit: px.
    pub height: u16,
    /// Bits of a digital number. Unit: bit.
    pub bits: u8,
    /// Bits that a pixel takes in PixelBlock and Windows. Unit: bit.
    pub packing: Packing,
    /// What each frame brings.
    pub output: Output,
    /// Exposure time. Unit: s.
    pub exposure_s: f64,
    /// Conversion gain. Unit: e-/DN.
    pub gain_e_per_dn: f64,
    /// Cadence by the wall and the external clock. Unit: Hz.
    pub frame_rate_hz: f64,
    /// Number that the next frame will have.
    pub next_frame: u32,
    /// Frame packets sent in this exchange, modulo 2^32. Unit: packets.
    pub packets_sent: u32,
    /// What it goes by for the client's time.
    pub sync: SyncState,
    /// As in FrameEnd, at present. Unit: s.
    pub clock_offset_s: f64,
    /// First instant of the exposure of the last frame that left; 0 before.
    pub exposure_start: WireTime,
    /// Its last instant; its middle lies halfway.
    pub exposure_end: WireTime,
    /// Of that frame, on this link; all 0 before.
    pub timing: Timing,
    /// From the trigger until a frame's last octet left, half of the run's frames in this time; 0 before the first. Unit: s.
    pub latency_p50_s: f32,
    /// The same for 99 of 100 frames. Unit: s.
    pub latency_p99_s: f32,
    /// The same for all. Unit: s.
    pub latency_max_s: f32,
    /// Why the client has not received the whole last frame.
    pub withheld: Withheld,
    /// Counts since the emulator started.
    pub counters: Counters,
}

impl Status {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let mode = reader.code(Mode::from_code, "Status.mode", "must be 0 to 2")?;
        let width = reader.u16()?;
        let height = reader.u16()?;
        let bits = reader.u8()?;
        let packing = reader.code(Packing::from_code, "Status.packing", "must be 12 or 16")?;
        let output = Output::read(reader)?;
        let exposure_s = reader.f64()?;
        let gain_e_per_dn = reader.f64()?;
        let frame_rate_hz = reader.f64()?;
        let next_frame = reader.u32()?;
        let packets_sent = reader.u32()?;
        let sync = reader.code(SyncState::from_code, "Status.sync", "must be 0 to 4")?;
        let clock_offset_s = reader.f64()?;
        let exposure_start = reader.time()?;
        let exposure_end = reader.time()?;
        let timing = Timing::read(reader)?;
        let latency_p50_s = reader.f32()?;
        let latency_p99_s = reader.f32()?;
        let latency_max_s = reader.f32()?;
        let withheld = reader.code(Withheld::from_code, "Status.withheld", "must be 0 to 9")?;
        let mut counters = Counters::default();
        for counter in counters.iter_mut() {
            *counter = reader.u32()?;
        }
        Ok(Self {
            mode,
            width,
            height,
            bits,
            packing,
            output,
            exposure_s,
            gain_e_per_dn,
            frame_rate_hz,
            next_frame,
            packets_sent,
            sync,
            clock_offset_s,
            exposure_start,
            exposure_end,
            timing,
            latency_p50_s,
            latency_p99_s,
            latency_max_s,
            withheld,
            counters,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.mode.code())?;
        writer.u16(self.width)?;
        writer.u16(self.height)?;
        writer.u8(self.bits)?;
        writer.u8(self.packing.code())?;
        self.output.write(writer)?;
        writer.f64(self.exposure_s)?;
        writer.f64(self.gain_e_per_dn)?;
        writer.f64(self.frame_rate_hz)?;
        writer.u32(self.next_frame)?;
        writer.u32(self.packets_sent)?;
        writer.u8(self.sync.code())?;
        writer.f64(self.clock_offset_s)?;
        writer.u64(self.exposure_start.0)?;
        writer.u64(self.exposure_end.0)?;
        self.timing.write(writer)?;
        writer.f32(self.latency_p50_s)?;
        writer.f32(self.latency_p99_s)?;
        writer.f32(self.latency_max_s)?;
        writer.u8(self.withheld.code())?;
        for (_, value) in self.counters.iter() {
            writer.u32(value)?;
        }
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((1..).contains(&self.width), "Status.width", "must be 1 to 65535")?;
        rule((1..).contains(&self.height), "Status.height", "must be 1 to 65535")?;
        rule((1..=16).contains(&self.bits), "Status.bits", "must be 1 to 16")?;
        self.output.check()?;
        positive("Status.exposure_s", self.exposure_s, "must be finite and above 0 s")?;
        positive("Status.gain_e_per_dn", self.gain_e_per_dn, "must be finite and above 0 e-/DN")?;
        positive("Status.frame_rate_hz", self.frame_rate_hz, "must be finite and above 0 Hz")?;
        rule(self.clock_offset_s.is_finite(), "Status.clock_offset_s", "must be finite")?;
        self.timing.check()?;
        rule(self.latency_p50_s.is_finite(), "Status.latency_p50_s", "must be finite")?;
        rule(self.latency_p99_s.is_finite(), "Status.latency_p99_s", "must be finite")?;
        rule(self.latency_max_s.is_finite(), "Status.latency_max_s", "must be finite")?;
        Ok(())
    }
}

/// A command was carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ack {
    /// APID of the packet that it answers.
    pub apid: u16,
    /// Sequence count of that packet.
    pub sequence_count: u16,
}

impl Ack {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let apid = reader.u16()?;
        let sequence_count = reader.u16()?;
        Ok(Self {
            apid,
            sequence_count,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u16(self.apid)?;
        writer.u16(self.sequence_count)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule((..=2047).contains(&self.apid), "Ack.apid", "must be 0 to 2047")?;
        rule((..=16383).contains(&self.sequence_count), "Ack.sequence_count", "must be 0 to 16383")?;
        Ok(())
    }
}

/// A packet was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nack<'a> {
    /// APID of the refused packet, as its octets state it.
    pub apid: u16,
    /// Sequence count of that packet, as its octets state it.
    pub sequence_count: u16,
    /// Why.
    pub reason: Reason,
    /// What and where, for people; UTF-8.
    pub detail: &'a str,
}

impl<'a> Nack<'a> {
    pub(crate) fn read(reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        let apid = reader.u16()?;
        let sequence_count = reader.u16()?;
        let reason = reader.code(Reason::from_code, "Nack.reason", "must be 1 to 10")?;
        let detail = reader.text(200, "Nack.detail", "must be 200 octets or fewer")?;
        Ok(Self {
            apid,
            sequence_count,
            reason,
            detail,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        self.check_layout()?;
        writer.u16(self.apid)?;
        writer.u16(self.sequence_count)?;
        writer.u8(self.reason.code())?;
        writer.bytes(self.detail.as_bytes())?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule((..=2047).contains(&self.apid), "Nack.apid", "must be 0 to 2047")?;
        rule((..=16383).contains(&self.sequence_count), "Nack.sequence_count", "must be 0 to 16383")?;
        Ok(())
    }
}

/// UDP: asks the client to prove its address by sending this packet back as it came (section 5.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Challenge {
    /// A secret of this address and time.
    pub token: u64,
}

impl Challenge {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let token = reader.u64()?;
        Ok(Self {
            token,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u64(self.token)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        Ok(())
    }
}

/// Everything that the emulator can say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reply<'a> {
    /// Opens a frame.
    FrameHeader(FrameHeader),
    /// A run of pixels.
    PixelBlock(PixelBlock<'a>),
    /// A part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without its last member `files` and without a newline.
    Labels(LabelPart<'a>),
    /// Settings and counters, sent after the Ack of a Ping.
    Status(Status),
    /// A command was carried out.
    Ack(Ack),
    /// A packet was refused.
    Nack(Nack<'a>),
    /// Square windows cut out of a frame.
    Windows(WindowBlock<'a>),
    /// Records of the brightest objects in a frame, brightest first.
    Objects(ObjectPart<'a>),
    /// A run of pixels, losslessly compressed.
    Compressed(CompressedBlock<'a>),
    /// Closes a frame: what is known only when all of it has been rendered and sent.
    FrameEnd(FrameEnd),
    /// UDP: asks the client to prove its address by sending this packet back as it came (section 5.1).
    Challenge(Challenge),
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
            Self::FrameEnd(_) => apid::FRAME_END,
            Self::Challenge(_) => apid::CHALLENGE,
        }
    }

    /// Refuses values that the fields do not allow. Every decoded reply has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        match self {
            Self::FrameHeader(inner) => inner.check(),
            Self::PixelBlock(inner) => inner.check(),
            Self::Labels(inner) => inner.check(),
            Self::Status(inner) => inner.check(),
            Self::Ack(inner) => inner.check(),
            Self::Nack(inner) => inner.check(),
            Self::Windows(inner) => inner.check(),
            Self::Objects(inner) => inner.check(),
            Self::Compressed(inner) => inner.check(),
            Self::FrameEnd(inner) => inner.check(),
            Self::Challenge(inner) => inner.check(),
        }
    }

    pub(crate) fn read(apid: u16, reader: &mut Reader<'a>) -> Result<Self, DecodeError> {
        Ok(match apid {
            apid::FRAME_HEADER => Self::FrameHeader(FrameHeader::read(reader)?),
            apid::PIXEL_BLOCK => Self::PixelBlock(PixelBlock::read(reader)?),
            apid::LABELS => Self::Labels(LabelPart::read(reader)?),
            apid::STATUS => Self::Status(Status::read(reader)?),
            apid::ACK => Self::Ack(Ack::read(reader)?),
            apid::NACK => Self::Nack(Nack::read(reader)?),
            apid::WINDOWS => Self::Windows(WindowBlock::read(reader)?),
            apid::OBJECTS => Self::Objects(ObjectPart::read(reader)?),
            apid::COMPRESSED => Self::Compressed(CompressedBlock::read(reader)?),
            apid::FRAME_END => Self::FrameEnd(FrameEnd::read(reader)?),
            apid::CHALLENGE => Self::Challenge(Challenge::read(reader)?),
            apid => return Err(DecodeError::UnknownApid { apid }),
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        match self {
            Self::FrameHeader(inner) => inner.write(writer),
            Self::PixelBlock(inner) => inner.write(writer),
            Self::Labels(inner) => inner.write(writer),
            Self::Status(inner) => inner.write(writer),
            Self::Ack(inner) => inner.write(writer),
            Self::Nack(inner) => inner.write(writer),
            Self::Windows(inner) => inner.write(writer),
            Self::Objects(inner) => inner.write(writer),
            Self::Compressed(inner) => inner.write(writer),
            Self::FrameEnd(inner) => inner.write(writer),
            Self::Challenge(inner) => inner.write(writer),
        }
    }
}
