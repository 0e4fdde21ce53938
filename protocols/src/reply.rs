//! Packets of the emulator: frames, status, acknowledgements.

use crate::credit::CREDITED_APIDS;
use crate::error::{DecodeError, EncodeError, Reason};
use crate::frame::fits_packing;
pub use crate::frame::{
    AttitudeSource, FrameEnd, FrameHeader, LabelPart, Overrun, Packing, PixelBlock, SyncState,
    Timing,
};
pub use crate::generated::answers::{Ack, Challenge, Nack, Reply, Status};
pub use crate::generated::codes::{Mode, Withheld};
use crate::packet::{self, Header};
pub use crate::parts::{
    CompressedBlock, ID_LENGTH, ObjectPart, ObjectRecord, Window, WindowBlock, window_length,
};
use crate::time::WireTime;

/// Longest detail text of a `Nack`, bytes.
pub const MAX_DETAIL: usize = 200;

impl Default for Withheld {
    /// Nothing is withheld.
    fn default() -> Self {
        Self::None
    }
}

impl Status {
    /// Refuses fields that contradict each other. Every decoded status has passed this.
    pub fn check(&self) -> Result<(), DecodeError> {
        self.check_fields()?;
        fits_packing(self.bits, self.packing)
    }
}

impl<'a> Nack<'a> {
    /// A refusal; `detail` is cut to [`MAX_DETAIL`] bytes at a character's end.
    pub fn new(apid: u16, sequence_count: u16, reason: Reason, detail: &'a str) -> Self {
        let detail = (0..=MAX_DETAIL)
            .rev()
            .find_map(|end| detail.get(..end))
            .unwrap_or_default();
        Self {
            apid,
            sequence_count,
            reason,
            detail,
        }
    }

    pub(crate) fn check_layout(&self) -> Result<(), EncodeError> {
        let (what, found, limit) = ("Nack.detail", self.detail.len(), MAX_DETAIL);
        if found <= limit {
            Ok(())
        } else {
            Err(EncodeError::TooLong { what, found, limit })
        }
    }
}

impl<'a> Reply<'a> {
    /// Whether its packets use credit: those of a frame do, answers do not.
    pub fn takes_credit(&self) -> bool {
        CREDITED_APIDS.contains(&self.apid())
    }

    /// Reads exactly one packet.
    ///
    /// # Errors
    /// The first error in this order: length, CRC, version, type, then the fields.
    pub fn decode(bytes: &'a [u8]) -> Result<(Header, Self), DecodeError> {
        let (header, mut reader) = packet::open(bytes)?;
        let reply = Self::read(header.apid, &mut reader)?;
        reader.finish()?;
        reply.check()?;
        Ok((header, reply))
    }

    /// Writes the packet into `buf` and returns its length. `header_seq_count` is modulo 2^14.
    ///
    /// # Errors
    /// A buffer too small, a text or pixels too long, or lengths that contradict each other. Other
    /// values are not checked.
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
