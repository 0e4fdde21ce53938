//! Injected faults, for the log.

use skyloop_protocols::{Direction, FaultKind};
use std::time::Duration;

/// A damaged item, or a rule that begins or ends.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Injection {
    /// Time since the engine's zero.
    pub at: Duration,
    pub direction: Direction,
    pub kind: FaultKind,
    pub event: Event,
}

/// Event of an injection.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Event {
    /// The rule begins, with this value.
    Begins(f64),
    Ends,
    /// An item was affected.
    Item {
        /// Number of the item in its direction, from 0.
        number: u64,
        /// Original length in bytes.
        length: usize,
        /// Its description: members of a JSON object.
        members: String,
        damage: Damage,
    },
}

/// Damage to an item.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Damage {
    /// As its kind states: lost, duplicated or reordered.
    ByKind,
    /// Indices of the inverted bits; 0 is the most significant bit of the first byte.
    Bits(Vec<usize>),
    /// Remaining number of bytes.
    CutTo(usize),
    /// Delay.
    Later(Duration),
}
