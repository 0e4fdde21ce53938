//! The two ends of the bus, and error counters of one end.

/// Which end of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Receives commands and attitudes.
    Emulator,
    /// The flight computer.
    Client,
}

/// Errors since the start, modulo 2^32.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Received ISO-TP messages dropped because of a wrong sequence number.
    pub sequence_errors: u32,
    /// Messages of either direction, and attitudes, dropped because the other end was silent.
    pub timeouts: u32,
    /// Attitudes and ISO-TP messages that were received in part, for any reason.
    pub incomplete: u32,
    /// Packets that were not sent: the other end was silent, waited too long or had no room.
    pub unsent: u32,
    /// Messages refused because their announced length exceeds any packet.
    pub oversize: u32,
    /// Invalid frames with identifiers of this end: remote frames, wrong lengths, data that is no
    /// protocol data unit.
    pub malformed: u32,
    /// Frames with other identifiers, and late or repeated frames.
    pub ignored: u32,
}

pub(crate) fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
