//! The 14-bit sequence counts: one for each APID, so that the receiver detects missing packets.

use crate::packet::{SEQUENCE_MODULUS, apid};

const KINDS: usize = apid::ALL.len();

/// The sender's side: the next count of each APID.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SequenceCounts([u16; KINDS]);

impl SequenceCounts {
    /// All counts start at 0.
    pub const fn new() -> Self {
        Self([0; KINDS])
    }

    /// The count for the next packet with this APID; 0 for an unknown one.
    pub fn next(&mut self, apid: u16) -> u16 {
        let count = self.peek(apid);
        if let Some(slot) = apid::index(apid).and_then(|row| self.0.get_mut(row)) {
            *slot = (count + 1) % SEQUENCE_MODULUS;
        }
        count
    }

    /// The next count, without advancing it: for a packet that may not be sent.
    pub fn peek(&self, apid: u16) -> u16 {
        apid::index(apid)
            .and_then(|row| self.0.get(row))
            .copied()
            .unwrap_or(0)
    }
}

/// The receiver's side: how many packets are missing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GapDetector([Option<u16>; KINDS]);

impl GapDetector {
    /// Nothing received yet.
    pub const fn new() -> Self {
        Self([None; KINDS])
    }

    /// Number of packets with this APID that are missing just before this one.
    ///
    /// The first packet sets the start. A step back of up to half the range is a late or repeated
    /// packet and counts as 0. A jump ahead of half the range or more also counts as 0.
    pub fn missing(&mut self, apid: u16, sequence_count: u16) -> u16 {
        let Some(expected) = apid::index(apid).and_then(|row| self.0.get_mut(row)) else {
            return 0;
        };
        let ahead = match *expected {
            Some(expected) => sequence_count.wrapping_sub(expected) % SEQUENCE_MODULUS,
            None => 0,
        };
        if ahead >= SEQUENCE_MODULUS / 2 {
            return 0;
        }
        *expected = Some(sequence_count.wrapping_add(1) % SEQUENCE_MODULUS);
        ahead
    }
}
