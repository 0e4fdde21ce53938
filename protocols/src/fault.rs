//! Faults that a test injects into the line, live by [`Command::Fault`](crate::Command::Fault).

use crate::error::DecodeError;
pub use crate::generated::codes::{Direction, FaultKind};
pub use crate::generated::commands::Fault;
use crate::rules::rule;

impl Fault {
    /// Refuses values that the kind does not allow.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        let most = match self.kind {
            FaultKind::Delay | FaultKind::Jitter => 60.0,
            _ => 1.0,
        };
        rule(
            (0.0..=most).contains(&self.value),
            "Fault.value",
            "must be a probability from 0 to 1, or 0 to 60 s of Delay and Jitter",
        )
    }
}
