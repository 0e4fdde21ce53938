// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! What closes a frame.

use super::codes::{AttitudeSource, Overrun, SyncState};
use crate::error::{DecodeError, EncodeError};
use crate::rules::rule;
use crate::wire::{Reader, Writer};

/// Closes a frame: what is known only when all of it has been rendered and sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameEnd {
    /// The frame that it belongs to.
    pub frame: u32,
    /// CRC-32 of all pixels of the frame in order, each as u16, whatever is sent of them.
    pub pixels_crc32: u32,
    /// Number of the Trigger that requested the frame; 0: none.
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
        let sync = reader.code(SyncState::from_code, "FrameEnd.sync", "must be 0 to 4")?;
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
    /// Time left until the deadline when FrameEnd was handed to the link, less what waits before it on a line of known pace; below 0: late by so much. Unit: s.
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
