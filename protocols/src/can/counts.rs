//! The two ends of the bus, and what goes wrong at one of them.

/// Which end of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Takes commands and attitudes.
    Emulator,
    /// The flight computer.
    Client,
}

/// What went wrong since the start, modulo 2^32.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Received ISO-TP messages given up because of a wrong sequence number.
    pub sequence_errors: u32,
    /// Messages given up because the other end fell silent: either direction, and attitudes.
    pub timeouts: u32,
    /// Attitudes and ISO-TP messages that began to arrive and were never whole, for any reason.
    pub incomplete: u32,
    /// Packets that did not reach the other end: it fell silent, waits too long or has no room.
    pub unsent: u32,
    /// Messages announced as longer than any packet, refused.
    pub oversize: u32,
    /// Frames on our identifiers that are wrong by themselves: remote frames, other lengths than the
    /// form's, data that is no protocol data unit.
    pub malformed: u32,
    /// Frames that mean nothing here: those of others, and late or repeated parts.
    pub ignored: u32,
}

/// One more.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
