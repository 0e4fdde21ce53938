//! What was injected, for the log.

use skyloop_protocols::{Direction, FaultKind};
use std::time::Duration;

/// A harmed item, or a rule that begins or ends.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Injection {
    /// When, since the engine's zero.
    pub at: Duration,
    pub direction: Direction,
    pub kind: FaultKind,
    pub what: What,
}

/// What was done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum What {
    /// The rule begins, with this value.
    Begins(f64),
    /// The rule ends.
    Ends,
    /// An item was harmed.
    Item {
        /// Number of the item in its direction, from 0.
        number: u64,
        /// How many bytes it had.
        length: usize,
        /// Its description: members of a JSON object.
        members: String,
        how: How,
    },
}

/// How an item was harmed.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum How {
    /// As its kind says: it is lost, comes twice or changes places.
    Plainly,
    /// These bits were inverted, counted from the first byte's most significant one.
    Bits(Vec<usize>),
    /// This many bytes were left.
    CutTo(usize),
    /// This much later.
    Later(Duration),
}
