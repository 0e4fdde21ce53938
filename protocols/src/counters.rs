//! The emulator's counters: each packet received, answered, refused or lost is counted once.

use crate::error::DecodeError;
pub use crate::generated::counters::Counters;
use crate::packet::{CRC_LENGTH, HEADER_LENGTH, MAX_PACKET};

impl Counters {
    /// Counts an undecodable packet by its error.
    pub fn refuse_undecodable(&mut self, error: &DecodeError) {
        let counter = match error {
            DecodeError::BadLength { found, .. } if *found < HEADER_LENGTH + CRC_LENGTH => {
                &mut self.runts
            }
            DecodeError::BadLength { found, .. } if *found > MAX_PACKET => &mut self.oversize,
            _ => return self.refuse(error.reason()),
        };
        *counter = counter.wrapping_add(1);
    }
}
