//! The emulator's counters: everything that arrives, is answered, refused or lost is counted once.

use crate::error::{DecodeError, Reason};
use crate::packet::{CRC_LENGTH, HEADER_LENGTH, MAX_PACKET};

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident,)+) => {
        /// Counts since the emulator started, modulo 2^32; in this order on the wire.
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        pub struct Counters { $($(#[$doc])* pub $name: u32,)+ }

        impl Counters {
            /// The names, in the order of the fields.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// Names and values, in the order of the fields.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, u32)> + use<> {
                Self::NAMES.iter().copied().zip([$(self.$name),+])
            }

            pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut u32> {
                [$(&mut self.$name),+].into_iter()
            }
        }
    };
}

counters! {
    /// Attitudes accepted.
    attitudes,
    /// Commands accepted, `Credit` included.
    commands,
    /// Frames rendered.
    frames_rendered,
    /// Frames whose last packet was handed to the link.
    frames_delivered,
    /// Frames given up before their last packet: Reset, or a client that went away or takes nothing.
    frames_abandoned,
    /// Packets with a wrong CRC-16, and serial frames with a wrong CRC-32.
    bad_crc,
    /// Packets of another version.
    bad_version,
    /// Packets whose length is not that of their header or layout.
    bad_length,
    /// Packets with an unknown APID, opcode, type bit or header flags.
    unknown_type,
    /// Serial frames with a bad escape, and lines of a CAN adapter that are none.
    bad_framing,
    /// Attitudes with a quaternion that is not of unit length, or a number that is not finite.
    bad_attitude,
    /// Attitudes earlier than the last one accepted.
    time_backwards,
    /// Packets from somebody other than the client of the exchange.
    foreign_packets,
    /// Packets thrown away because the receiver or its queue was full.
    overflows,
    /// Commands with a value out of range.
    bad_value,
    /// Valid packets refused as `Busy` or `NotSupported`.
    refused,
    /// Packets missing in the client's sequence counts.
    sequence_gaps,
    /// Records of orbit files refused at the start.
    rejected_records,
    /// Times that an object could not be shown in a frame: its orbit had no state there.
    objects_without_state,
    /// Packets that never left: their client had gone or read nothing, or the system refused to send.
    lost_outbound,
    /// Exposures by the wall clock that gave no frame: the one before was not rendered or taken in time, or there was
    /// nothing to show.
    exposures_missed,
    /// Packets and serial frames shorter than any packet.
    runts,
    /// Packets and serial frames longer than any packet.
    oversize,
    /// Frame packets sent again because the client asked.
    resent_blocks,
    /// Times that a line was lost and came back.
    reconnects,
    /// Messages over several CAN frames that never came whole.
    incomplete,
    /// Error frames of a CAN bus.
    bus_errors,
    /// Times that the CAN controller went off the bus.
    bus_off,
}

impl Counters {
    /// Counts octets that are no packet.
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

    /// Counts one packet refused for this reason.
    pub fn refuse(&mut self, reason: Reason) {
        let counter = match reason {
            Reason::BadCrc => &mut self.bad_crc,
            Reason::BadVersion => &mut self.bad_version,
            Reason::BadLength => &mut self.bad_length,
            Reason::UnknownType => &mut self.unknown_type,
            Reason::QuaternionNotUnit | Reason::NotFinite => &mut self.bad_attitude,
            Reason::TimeBackwards => &mut self.time_backwards,
            Reason::ValueOutOfRange => &mut self.bad_value,
            Reason::Busy | Reason::NotSupported => &mut self.refused,
        };
        *counter = counter.wrapping_add(1);
    }
}
