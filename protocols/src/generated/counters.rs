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
    /// Frames abandoned before their last packet.
    frames_abandoned,
    /// Packets with a wrong CRC-16, serial frames with a wrong CRC-32.
    bad_crc,
    /// Packets of another version.
    bad_version,
    /// Packets of a wrong length.
    bad_length,
    /// Packets with an unknown APID, opcode, type bit or header flag.
    unknown_type,
    /// Serial frames with a bad escape, invalid lines of a CAN adapter, invalid CAN frames with skyloop's identifiers (section 4.4).
    bad_framing,
    /// Attitudes whose quaternion is not of unit length or that hold a NaN or an infinity.
    bad_attitude,
    /// Attitudes earlier than the last one accepted: refused, or used where the emulator is configured so.
    time_backwards,
    /// Packets from others than the client of the exchange.
    foreign_packets,
    /// Packets (on a CAN bus: frames) dropped because the receive queue was full.
    overflows,
    /// Packets with a value out of range.
    bad_value,
    /// Valid packets refused as Busy or NotSupported.
    refused,
    /// Packets missing in the client's sequence counts when a later one arrived; packets that arrive late count, too.
    sequence_gaps,
    /// Records of orbit files refused at the start.
    rejected_records,
    /// Objects left out of a frame because their orbit had no state at its time.
    objects_without_state,
    /// Packets not sent: the client had left or did not read, or the system refused to send.
    lost_outbound,
    /// By the wall and the external clock: exposures without a frame, because the previous one was not rendered or sent in time, or without an attitude (section 5.5).
    exposures_missed,
    /// Packets and serial frames shorter than any packet can be.
    runts,
    /// Packets and serial frames longer than any packet can be.
    oversize,
    /// Packets of a frame retransmitted at the client's request.
    resent_blocks,
    /// Number of times that a link was lost and reopened.
    reconnects,
    /// Messages of several CAN frames that were not completed.
    incomplete,
    /// CAN error frames.
    bus_errors,
    /// Number of times that the CAN controller was off the bus.
    bus_off,
    /// Frames not sent completely by their deadline.
    deadlines_missed,
    /// Frames rendered with larger tolerances to be in time.
    frames_coarsened,
    /// Frames not sent to a slow client because a newer frame was ready.
    frames_dropped,
    /// Frames whose attitude was older than the limit.
    attitudes_stale,
    /// Frames whose only attitude was in the future.
    attitudes_future,
    /// Triggers accepted.
    triggers,
    /// Accepted Triggers without a frame: no attitude, the client's clock was set, too late, or a Reset, another client or the end of the run came first.
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
