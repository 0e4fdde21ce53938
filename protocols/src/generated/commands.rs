// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! What a client sends.

use super::codes::{Direction, FaultKind, LabelLevel, Opcode, PixelLevel, apid};
use crate::error::{DecodeError, EncodeError};
use crate::rules::{finite, positive, rule};
use crate::time::WireTime;
use crate::wire::{Reader, Writer};

/// Attitude of the body at the time in the header; in stepped mode that is the middle of the exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// The client's number of this attitude; keys the noise of its frame and returns in FrameHeader.
    pub sequence: u32,
    /// Attitude x, y, z, w, ICRF to body (section 1); the emulator normalises it.
    pub q_icrf_to_body: [f64; 4],
    /// Body rates. Unit: rad/s.
    pub rates_rad_s: [f64; 3],
    /// Geocentric position and velocity in GCRF; without it the observer is at the Earth's centre.
    pub state: Option<OrbitState>,
}

/// Geocentric position and velocity in GCRF; without it the observer is at the Earth's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitState {
    /// GCRF position, with flags 1 only. Unit: m.
    pub position_m: [f64; 3],
    /// GCRF velocity, with flags 1 only. Unit: m/s.
    pub velocity_m_s: [f64; 3],
}

impl Attitude {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let sequence = reader.u32()?;
        let flags = reader.flags(1, "Attitude.flags", "must be 0 or 1")?;
        let q_icrf_to_body = reader.f64s()?;
        let rates_rad_s = reader.f64s()?;
        let state = match flags {
            1 => Some(OrbitState {
                position_m: reader.f64s()?,
                velocity_m_s: reader.f64s()?,
            }),
            _ => None,
        };
        Ok(Self {
            sequence,
            q_icrf_to_body,
            rates_rad_s,
            state,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u32(self.sequence)?;
        writer.u8(self.state.is_some().into())?;
        writer.f64s(&self.q_icrf_to_body)?;
        writer.f64s(&self.rates_rad_s)?;
        if let Some(state) = &self.state {
            writer.f64s(&state.position_m)?;
            writer.f64s(&state.velocity_m_s)?;
        }
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        finite("Attitude.q_icrf_to_body", &self.q_icrf_to_body)?;
        finite("Attitude.rates_rad_s", &self.rates_rad_s)?;
        if let Some(state) = &self.state {
            finite("Attitude.position_m", &state.position_m)?;
        }
        if let Some(state) = &self.state {
            finite("Attitude.velocity_m_s", &state.velocity_m_s)?;
        }
        Ok(())
    }
}

/// What each frame from now on brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// Which pixels.
    pub pixels: PixelLevel,
    /// Which labels.
    pub labels: LabelLevel,
    /// Columns and rows of a window. Unit: px.
    pub window_size: u8,
    /// Windows around so many of the brightest stars.
    pub windows: u8,
    /// Records of so many of the brightest objects.
    pub objects: u16,
}

impl Output {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let pixels = reader.code(PixelLevel::from_code, "Output.pixels", "must be 0 to 3")?;
        let labels = reader.code(LabelLevel::from_code, "Output.labels", "must be 0 to 2")?;
        let window_size = reader.u8()?;
        let windows = reader.u8()?;
        let objects = reader.u16()?;
        Ok(Self {
            pixels,
            labels,
            window_size,
            windows,
            objects,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.pixels.code())?;
        writer.u8(self.labels.code())?;
        writer.u8(self.window_size)?;
        writer.u8(self.windows)?;
        writer.u16(self.objects)?;
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule((1..=25).contains(&self.window_size), "Output.window_size", "must be 1 to 25")?;
        Ok(())
    }
}

/// Centres of the windows, instead of the brightest stars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Positions {
    /// Number of positions; 0: around the brightest again.
    pub(crate) count: u8,
    /// Centres of the windows: column, row. Unit: px.
    pub(crate) at: [[u16; 2]; 64],
}

impl Positions {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let count = reader.u8()?;
        let mut at = [[0; 2]; 64];
        let listed = at.get_mut(..usize::from(count));
        let rule = "must be 64 or fewer";
        let field = "Positions.count";
        for number in listed.ok_or(DecodeError::BadValue { field, rule })?.iter_mut().flatten() {
            *number = reader.u16()?;
        }
        Ok(Self {
            count,
            at,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.count)?;
        for number in self.at.iter().take(self.count.into()).flatten() {
            writer.u16(*number)?;
        }
        Ok(())
    }

    /// Refuses values that the fields do not allow. What was decoded has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule((..=64).contains(&self.count), "Positions.count", "must be 0 to 64")?;
        Ok(())
    }
}

/// One fault of one direction, from now on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// What goes wrong.
    pub kind: FaultKind,
    /// Which way.
    pub direction: Direction,
    /// How much, as the kind says: a probability, a time, 1 or 0; 0 ends the fault.
    pub value: f64,
    /// For how long; 0: until it is changed. Unit: s.
    pub seconds: f64,
}

impl Fault {
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let kind = reader.code(FaultKind::from_code, "Fault.kind", "must be 1 to 11")?;
        let direction = reader.code(Direction::from_code, "Fault.direction", "must be 0 or 1")?;
        let value = reader.f64()?;
        let seconds = reader.f64()?;
        Ok(Self {
            kind,
            direction,
            value,
            seconds,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.kind.code())?;
        writer.u8(self.direction.code())?;
        writer.f64(self.value)?;
        writer.f64(self.seconds)?;
        Ok(())
    }

    /// What the fields allow, each by itself.
    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {
        rule((0.0..=1000000.0).contains(&self.seconds), "Fault.seconds", "must be 0 to 1000000")?;
        Ok(())
    }
}

/// Everything that a flight computer can say. The header's time of all but `Attitude` is the time of sending.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Attitude of the body at the time in the header; in stepped mode that is the middle of the exposure.
    Attitude(Attitude),
    /// Exposure time of the attitudes that follow (stepped), of the next frames (wall).
    Exposure {
        /// Exposure time.
        seconds: f64,
    },
    /// Conversion gain, likewise.
    Gain {
        /// Electrons per digital number.
        e_per_dn: f64,
    },
    /// By the wall and the external clock: cadence from now on; lets frames run again after SingleShot.
    FrameRate {
        /// Frames a second.
        hz: f64,
    },
    /// By the wall and the external clock: one frame with the latest attitude, then the cadence rests until FrameRate.
    SingleShot,
    /// Configured settings, frames under way abandoned, exchange as new (section 5).
    Reset,
    /// Answered by Ack, then Status.
    Ping,
    /// Pacing, section 5.3.
    Credit {
        /// How many frame packets the client can take since the exchange opened or was Reset: cumulative, modulo 2^32.
        packets: u32,
    },
    /// What each frame from now on brings.
    Output(Output),
    /// Where the windows are from now on.
    Positions(Positions),
    /// Packets of one of the last frames once more, as they were; they take no credit.
    Resend {
        /// Which frame.
        frame: u32,
        /// Number of the first packet in its frame: 0 is the FrameHeader.
        first: u32,
        /// How many packets.
        count: u32,
    },
    /// Something goes wrong on this link, on purpose.
    Fault(Fault),
    /// One exposure at a time that the client chooses; answered by its frame.
    Trigger {
        /// The client's number of this trigger; returns in FrameEnd.
        number: u32,
        /// First instant of the exposure.
        start: WireTime,
    },
    /// No exposure ends and the scene's time stands still until Resume; section 5.10.
    Pause,
    /// Exposures and the scene's time go on after Pause.
    Resume,
}

impl Command {
    /// The APID of its packet.
    pub const fn apid(&self) -> u16 {
        match self {
            Self::Attitude(_) => apid::ATTITUDE,
            _ => apid::COMMAND,
        }
    }

    /// The opcode of its packet; an attitude has none.
    pub const fn opcode(&self) -> Option<Opcode> {
        match self {
            Self::Attitude(_) => None,
            Self::Exposure { .. } => Some(Opcode::Exposure),
            Self::Gain { .. } => Some(Opcode::Gain),
            Self::FrameRate { .. } => Some(Opcode::FrameRate),
            Self::SingleShot => Some(Opcode::SingleShot),
            Self::Reset => Some(Opcode::Reset),
            Self::Ping => Some(Opcode::Ping),
            Self::Credit { .. } => Some(Opcode::Credit),
            Self::Output(_) => Some(Opcode::Output),
            Self::Positions(_) => Some(Opcode::Positions),
            Self::Resend { .. } => Some(Opcode::Resend),
            Self::Fault(_) => Some(Opcode::Fault),
            Self::Trigger { .. } => Some(Opcode::Trigger),
            Self::Pause => Some(Opcode::Pause),
            Self::Resume => Some(Opcode::Resume),
        }
    }

    /// Refuses values that the fields do not allow. Every decoded command has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        match self {
            Self::Attitude(inner) => inner.check()?,
            Self::Exposure { seconds } => positive("Exposure.seconds", *seconds, "must be 1e-9 to 1e4 s")?,
            Self::Gain { e_per_dn } => positive("Gain.e_per_dn", *e_per_dn, "must be 1e-4 to 1e6 e-/DN")?,
            Self::FrameRate { hz } => positive("FrameRate.hz", *hz, "must be 1e-4 to 1e4 Hz")?,
            Self::Output(inner) => inner.check()?,
            Self::Positions(inner) => inner.check()?,
            Self::Fault(inner) => inner.check()?,
            Self::Trigger { number, .. } => rule((1..).contains(number), "Trigger.number", "must be 1 to 4294967295")?,
            _ => {}
        }
        Ok(())
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let opcode = reader.u8()?;
        let known = Opcode::from_code(opcode).ok_or(DecodeError::UnknownOpcode { opcode })?;
        Ok(match known {
            Opcode::Exposure => Self::Exposure {
                seconds: reader.f64()?,
            },
            Opcode::Gain => Self::Gain {
                e_per_dn: reader.f64()?,
            },
            Opcode::FrameRate => Self::FrameRate {
                hz: reader.f64()?,
            },
            Opcode::SingleShot => Self::SingleShot,
            Opcode::Reset => Self::Reset,
            Opcode::Ping => Self::Ping,
            Opcode::Credit => Self::Credit {
                packets: reader.u32()?,
            },
            Opcode::Output => Self::Output(Output::read(reader)?),
            Opcode::Positions => Self::Positions(Positions::read(reader)?),
            Opcode::Resend => Self::Resend {
                frame: reader.u32()?,
                first: reader.u32()?,
                count: reader.u32()?,
            },
            Opcode::Fault => Self::Fault(Fault::read(reader)?),
            Opcode::Trigger => Self::Trigger {
                number: reader.u32()?,
                start: reader.time()?,
            },
            Opcode::Pause => Self::Pause,
            Opcode::Resume => Self::Resume,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if let Some(opcode) = self.opcode() {
            writer.u8(opcode.code())?;
        }
        match self {
            Self::Attitude(inner) => inner.write(writer)?,
            Self::Exposure { seconds } => {
                writer.f64(*seconds)?;
            }
            Self::Gain { e_per_dn } => {
                writer.f64(*e_per_dn)?;
            }
            Self::FrameRate { hz } => {
                writer.f64(*hz)?;
            }
            Self::SingleShot => {}
            Self::Reset => {}
            Self::Ping => {}
            Self::Credit { packets } => {
                writer.u32(*packets)?;
            }
            Self::Output(inner) => inner.write(writer)?,
            Self::Positions(inner) => inner.write(writer)?,
            Self::Resend { frame, first, count } => {
                writer.u32(*frame)?;
                writer.u32(*first)?;
                writer.u32(*count)?;
            }
            Self::Fault(inner) => inner.write(writer)?,
            Self::Trigger { number, start } => {
                writer.u32(*number)?;
                writer.u64(start.0)?;
            }
            Self::Pause => {}
            Self::Resume => {}
        }
        Ok(())
    }
}
