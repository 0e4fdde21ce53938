//! Faults that a test injects into the line by [`Command::Fault`](crate::Command::Fault).

use crate::error::DecodeError;
pub use crate::generated::codes::{Direction, FaultKind};
pub use crate::generated::commands::Fault;
use crate::rules::rule;

impl FaultKind {
    /// Every kind and its name in files and on command lines.
    pub const NAMES: [(&'static str, FaultKind); 11] = [
        ("bit_flips", FaultKind::BitFlips),
        ("drop", FaultKind::Drop),
        ("duplicate", FaultKind::Duplicate),
        ("reorder", FaultKind::Reorder),
        ("truncate", FaultKind::Truncate),
        ("delay", FaultKind::Delay),
        ("jitter", FaultKind::Jitter),
        ("stuck", FaultKind::Stuck),
        ("down", FaultKind::Down),
        ("overrun", FaultKind::Overrun),
        ("bus_off", FaultKind::BusOff),
    ];

    /// Whether its value switches the fault on or off. While it is on, no packet passes.
    pub fn is_switch(self) -> bool {
        matches!(self, FaultKind::Stuck | FaultKind::Down | FaultKind::BusOff)
    }
}

impl Fault {
    /// Refuses values that the kind does not allow.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        let max = match self.kind {
            FaultKind::Delay | FaultKind::Jitter => 60.0,
            _ => 1.0,
        };
        let fits = (0.0..=max).contains(&self.value);
        rule(
            fits && (!self.kind.is_switch() || self.value == 0.0 || self.value == 1.0),
            "Fault.value",
            "must be a probability from 0 to 1, 0 to 60 s of Delay and Jitter, or 0 or 1 of Stuck, Down and BusOff",
        )
    }
}
