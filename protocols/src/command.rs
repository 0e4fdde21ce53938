//! Packets of a flight computer: attitudes and commands.
//!
//! Encoders check only the layout. Values are checked by the receiver: ranges of fields by the
//! decoder, limits of the camera by the emulator.

use crate::error::{DecodeError, EncodeError};
pub use crate::generated::codes::Opcode;
pub use crate::generated::commands::{Attitude, Command, OrbitState};
use crate::packet::{self, Header, apid};
use crate::time::WireTime;

/// Largest accepted deviation of a quaternion's norm from 1 (the emulator then normalises it).
pub const UNIT_TOLERANCE: f64 = 1e-3;

impl Attitude {
    /// Refuses non-finite numbers, and quaternions whose norm differs from 1 by more than
    /// [`UNIT_TOLERANCE`].
    ///
    /// Every decoded attitude has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        // | |q| - 1 | <= t  is  (1 - t)^2 <= |q|^2 <= (1 + t)^2; no square root in `core`.
        let norm_squared: f64 = self.q_icrf_to_body.iter().map(|c| c * c).sum();
        let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
        if (low * low..=high * high).contains(&norm_squared) {
            Ok(())
        } else {
            Err(DecodeError::QuaternionNotUnit { norm_squared })
        }
    }
}

impl Command {
    /// Reads exactly one packet.
    ///
    /// # Errors
    /// The first error in this order: length, CRC, version, type, then the fields.
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

    /// Writes the packet into `buf` and returns its length. `header_seq_count` is modulo 2^14.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`]. Values are not checked.
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
}
