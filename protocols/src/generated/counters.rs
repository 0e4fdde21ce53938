// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! The counters of `Status`, in the order of the wire.

use super::codes::Reason;
use crate::table::counters;

counters! {
    /// Attitudes accepted.
    attitudes,
    /// Commands accepted, Credit included.
    commands,
    /// Frames rendered.
    frames_rendered,
    /// Frames whose last packet was handed to the link.
    frames_delivered,
    /// Frames given up before their last packet.
    frames_abandoned,
    /// Packets with a wrong CRC-16, serial frames with a wrong CRC-32.
    bad_crc,
    /// Packets of another version.
    bad_version,
    /// Packets of a wrong length.
    bad_length,
    /// Packets with an unknown APID, opcode, type bit or header flag.
    unknown_type,
    /// Serial frames with a bad escape, lines of a CAN adapter that are none, CAN frames on our identifiers that cannot be right (section 4.4).
    bad_framing,
    /// Attitudes whose quaternion is not of unit length or that hold a NaN or an infinity.
    bad_attitude,
    /// Attitudes earlier than the last one accepted: refused, or used where the emulator is configured so.
    time_backwards,
    /// Packets from others than the client of the exchange.
    foreign_packets,
    /// Packets, on a CAN bus frames, thrown away because the receiver was full.
    overflows,
    /// Packets with a value out of range.
    bad_value,
    /// Valid packets refused as Busy or NotSupported.
    refused,
    /// Packets missing in the client's sequence counts when a later one came; one that comes late counts, too.
    sequence_gaps,
    /// Records of orbit files refused at the start.
    rejected_records,
    /// Times that an object could not be shown in a frame: its orbit had no state there.
    objects_without_state,
    /// Packets that never left: their client had gone or read nothing, or the system refused to send.
    lost_outbound,
    /// By the wall and the external clock: exposures that gave no frame, because the one before was not rendered or taken in time, or there was nothing to show (section 5.5).
    exposures_missed,
    /// Packets and serial frames shorter than any packet can be.
    runts,
    /// Packets and serial frames longer than any packet can be.
    oversize,
    /// Packets of a frame sent again because the client asked.
    resent_blocks,
    /// Times that a line was lost and came back.
    reconnects,
    /// Messages of several CAN frames that were never completed.
    incomplete,
    /// CAN error frames.
    bus_errors,
    /// Times that the CAN controller left the bus.
    bus_off,
    /// Frames that had not left whole by their deadline.
    deadlines_missed,
    /// Frames rendered by coarser tolerances, so as to be in time.
    frames_coarsened,
    /// Frames that a slow client did not get, since a newer one was there.
    frames_dropped,
    /// Frames whose attitude was older than the limit.
    attitudes_stale,
    /// Frames whose only attitude was of the future.
    attitudes_future,
    /// Triggers accepted.
    triggers,
    /// Triggers accepted that gave no frame: no attitude, the client's clock was set, too late, or a Reset, another client or the end came first.
    triggers_missed,
}

impl Counters {
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
