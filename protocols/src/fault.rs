//! Faults that a test injects into the line, live by [`Command::Fault`](crate::Command::Fault).

use crate::EncodeError;
use crate::error::DecodeError;
use crate::frame::rule;
use crate::wire::{Reader, Writer, wire_enum};

wire_enum! {
    /// What happens to the packets of one direction.
    pub enum FaultKind: u8 {
        /// Bits are inverted; the value is the probability of each.
        BitFlips = 1,
        /// Packets vanish; the value is the probability of each.
        Drop = 2,
        /// Packets come twice; the value is the probability of each.
        Duplicate = 3,
        /// Packets change places with the next; the value is the probability of each.
        Reorder = 4,
        /// Packets lose their end; the value is the probability of each.
        Truncate = 5,
        /// All packets come later; the value is the time in s.
        Delay = 6,
        /// Packets come later by a random time; the value is the longest in s.
        Jitter = 7,
        /// The line is stuck: nothing passes, and neither end is told.
        Stuck = 8,
        /// The link is down, and the emulator's end is told.
        Down = 9,
        /// The receiver throws packets away as if its buffer had run over; the value is the probability of each.
        Overrun = 10,
        /// The CAN controller goes off the bus.
        BusOff = 11,
    }
}

wire_enum! {
    /// Which way packets go.
    pub enum Direction: u8 {
        /// Towards the emulator.
        In = 0,
        /// From the emulator.
        Out = 1,
    }
}

/// One fault of one direction, from now on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// What happens.
    pub kind: FaultKind,
    /// To which packets.
    pub direction: Direction,
    /// How much: a probability, or a time in s, as the kind says; 0 ends the fault. `Stuck`, `Down` and `BusOff`: 1 or 0.
    pub value: f64,
    /// How long, s; 0: until it is changed.
    pub seconds: f64,
}

impl Fault {
    /// Refuses values that the kind does not allow.
    pub fn check(&self) -> Result<(), DecodeError> {
        let most = match self.kind {
            FaultKind::Delay | FaultKind::Jitter => 60.0,
            _ => 1.0,
        };
        rule(
            (0.0..=most).contains(&self.value),
            "Fault.value",
            "must be a probability from 0 to 1, or 0 to 60 s of Delay and Jitter",
        )?;
        rule(
            (0.0..=1e6).contains(&self.seconds),
            "Fault.seconds",
            "must be 0 (until changed) to 1e6",
        )
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let unknown = |field, rule| DecodeError::BadValue { field, rule };
        Ok(Self {
            kind: FaultKind::from_code(reader.u8()?)
                .ok_or(unknown("Fault.kind", "must be 1 to 11"))?,
            direction: Direction::from_code(reader.u8()?)
                .ok_or(unknown("Fault.direction", "must be 0 or 1"))?,
            value: reader.f64()?,
            seconds: reader.f64()?,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.kind.code())?;
        writer.u8(self.direction.code())?;
        writer.f64(self.value)?;
        writer.f64(self.seconds)
    }
}
