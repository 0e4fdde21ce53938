//! What a flight computer sends: attitudes and commands.
//!
//! Encoders check only what cannot be laid out; values are judged where they are received, by the decoder (what the
//! field allows) and then by the emulator (what the camera allows).

use crate::error::{DecodeError, EncodeError};
use crate::fault::Fault;
use crate::output::{Output, Positions};
use crate::packet::{self, Header, apid};
use crate::time::WireTime;
use crate::wire::{Reader, Writer, wire_enum};

/// Largest difference of a quaternion's norm from 1 that is still accepted (the emulator then normalises it).
pub const UNIT_TOLERANCE: f64 = 1e-3;

const HAS_STATE: u8 = 1;

/// Attitude of the body at [`Header::time`]; in stepped mode that is the middle of the exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// The client's number of this attitude: it keys the frame's noise and comes back in the frame's header.
    pub sequence: u32,
    /// Unit quaternion, Hamilton, `[x, y, z, w]`, ICRF to body: `v_body = q v_icrf q^-1`.
    pub q_icrf_to_body: [f64; 4],
    /// Angular velocity of the body against ICRF in body axes, rad/s.
    pub rates_rad_s: [f64; 3],
    /// Position and velocity of the body; without it the observer is at the Earth's centre.
    pub state: Option<OrbitState>,
}

/// Geocentric position and velocity in GCRF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitState {
    /// Position, m.
    pub position_m: [f64; 3],
    /// Velocity, m/s.
    pub velocity_m_s: [f64; 3],
}

impl Attitude {
    /// Refuses numbers that are not finite and quaternions that are not of unit length within [`UNIT_TOLERANCE`].
    ///
    /// Every decoded attitude has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        finite("Attitude.q_icrf_to_body", &self.q_icrf_to_body)?;
        finite("Attitude.rates_rad_s", &self.rates_rad_s)?;
        if let Some(state) = &self.state {
            finite("Attitude.position_m", &state.position_m)?;
            finite("Attitude.velocity_m_s", &state.velocity_m_s)?;
        }
        // | |q| - 1 | <= t  is  (1 - t)^2 <= |q|^2 <= (1 + t)^2; no square root in `core`.
        let norm_squared: f64 = self.q_icrf_to_body.iter().map(|c| c * c).sum();
        let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
        if (low * low..=high * high).contains(&norm_squared) {
            Ok(())
        } else {
            Err(DecodeError::QuaternionNotUnit { norm_squared })
        }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let sequence = reader.u32()?;
        let has_state = match reader.u8()? {
            0 => false,
            HAS_STATE => true,
            _ => {
                return Err(DecodeError::BadValue {
                    field: "Attitude.flags",
                    rule: "must be 0 or 1",
                });
            }
        };
        Ok(Self {
            sequence,
            q_icrf_to_body: reader.f64s()?,
            rates_rad_s: reader.f64s()?,
            state: match has_state {
                true => Some(OrbitState {
                    position_m: reader.f64s()?,
                    velocity_m_s: reader.f64s()?,
                }),
                false => None,
            },
        })
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u32(self.sequence)?;
        writer.u8(if self.state.is_some() { HAS_STATE } else { 0 })?;
        writer.f64s(&self.q_icrf_to_body)?;
        writer.f64s(&self.rates_rad_s)?;
        if let Some(state) = &self.state {
            writer.f64s(&state.position_m)?;
            writer.f64s(&state.velocity_m_s)?;
        }
        Ok(())
    }
}

fn finite(field: &'static str, numbers: &[f64]) -> Result<(), DecodeError> {
    if numbers.iter().all(|number| number.is_finite()) {
        Ok(())
    } else {
        Err(DecodeError::NotFinite { field })
    }
}

wire_enum! {
    /// First payload octet of a `Command` packet.
    pub enum Opcode: u8 {
        /// [`Command::Exposure`].
        Exposure = 1,
        /// [`Command::Gain`].
        Gain = 2,
        /// [`Command::FrameRate`].
        FrameRate = 3,
        /// [`Command::SingleShot`].
        SingleShot = 4,
        /// [`Command::Reset`].
        Reset = 5,
        /// [`Command::Ping`].
        Ping = 6,
        /// [`Command::Credit`].
        Credit = 7,
        /// [`Command::Output`].
        Output = 8,
        /// [`Command::Positions`].
        Positions = 9,
        /// [`Command::Resend`].
        Resend = 10,
        /// [`Command::Fault`].
        Fault = 11,
    }
}

/// Everything that a flight computer can say. [`Header::time`] of all but `Attitude` is the time of sending.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Where the body points; in stepped mode each one accepted yields exactly one frame.
    Attitude(Attitude),
    /// Sets the exposure.
    Exposure {
        /// Exposure time, s, above 0.
        seconds: f64,
    },
    /// Sets the conversion gain.
    Gain {
        /// Electrons per digital number, above 0.
        e_per_dn: f64,
    },
    /// Wall mode: sets the cadence and lets frames run.
    FrameRate {
        /// Frames a second, above 0.
        hz: f64,
    },
    /// Wall mode: takes one frame with the latest attitude and stops the cadence.
    SingleShot,
    /// Back to the configured settings and an exchange as new; frames under way are abandoned.
    Reset,
    /// Asks for an `Ack` and a `Status`.
    Ping,
    /// Paces the frame packets (`FrameHeader`, `PixelBlock`, `Labels`): see [`credit`](crate::credit).
    Credit {
        /// How many frame packets the client can take since the exchange opened or was Reset: cumulative, modulo 2^32.
        packets: u32,
    },
    /// Sets what each frame from now on brings.
    Output(Output),
    /// Sets where windows lie.
    Positions(Positions),
    /// Asks for packets of a frame once more. They take no credit.
    Resend {
        /// The frame: the present one or one of the last few.
        frame: u32,
        /// First of the packets: 0 is the `FrameHeader`, then come its pixels, then its labels.
        first: u32,
        /// How many.
        count: u32,
    },
    /// Injects a fault into the line.
    Fault(Fault),
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
        }
    }

    /// Reads exactly one packet.
    ///
    /// # Errors
    /// Whatever is wrong first: length, CRC, version, type, then the fields in their order.
    pub fn decode(bytes: &[u8]) -> Result<(Header, Self), DecodeError> {
        let (header, mut reader) = packet::open(bytes)?;
        let command = match header.apid {
            apid::ATTITUDE => Self::Attitude(Attitude::read(&mut reader)?),
            apid::COMMAND => Self::read(&mut reader)?,
            apid => return Err(DecodeError::UnknownApid { apid }),
        };
        reader.finish()?;
        command.check()?;
        Ok((header, command))
    }

    /// Writes the packet into `buf` and returns its length; `header_seq_count` is taken modulo 2^14.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`]. Values are not judged here.
    pub fn encode(
        &self,
        header_seq_count: u16,
        time: WireTime,
        buf: &mut [u8],
    ) -> Result<usize, EncodeError> {
        packet::write(self.apid(), header_seq_count, time, buf, |writer| {
            self.write(writer)
        })
    }

    /// Refuses values that the fields do not allow. Every decoded command has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        match self {
            Self::Attitude(attitude) => attitude.check(),
            Self::Exposure { seconds } => positive("Exposure.seconds", *seconds),
            Self::Gain { e_per_dn } => positive("Gain.e_per_dn", *e_per_dn),
            Self::FrameRate { hz } => positive("FrameRate.hz", *hz),
            Self::Output(output) => output.check(),
            Self::Fault(fault) => fault.check(),
            Self::SingleShot
            | Self::Reset
            | Self::Ping
            | Self::Credit { .. }
            | Self::Positions(_)
            | Self::Resend { .. } => Ok(()),
        }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let opcode = reader.u8()?;
        Ok(
            match Opcode::from_code(opcode).ok_or(DecodeError::UnknownOpcode { opcode })? {
                Opcode::Exposure => Self::Exposure {
                    seconds: reader.f64()?,
                },
                Opcode::Gain => Self::Gain {
                    e_per_dn: reader.f64()?,
                },
                Opcode::FrameRate => Self::FrameRate { hz: reader.f64()? },
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
            },
        )
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        if let Some(opcode) = self.opcode() {
            writer.u8(opcode.code())?;
        }
        match self {
            Self::Attitude(attitude) => attitude.write(writer),
            Self::Exposure { seconds: value }
            | Self::Gain { e_per_dn: value }
            | Self::FrameRate { hz: value } => writer.f64(*value),
            Self::Credit { packets } => writer.u32(*packets),
            Self::Output(output) => output.write(writer),
            Self::Positions(positions) => positions.write(writer),
            Self::Resend {
                frame,
                first,
                count,
            } => {
                writer.u32(*frame)?;
                writer.u32(*first)?;
                writer.u32(*count)
            }
            Self::Fault(fault) => fault.write(writer),
            Self::SingleShot | Self::Reset | Self::Ping => Ok(()),
        }
    }
}

/// Refuses anything but finite numbers above zero.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<(), DecodeError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(DecodeError::BadValue {
            field,
            rule: "must be finite and above 0",
        })
    }
}
