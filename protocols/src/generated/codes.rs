// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! Numbers with a name: versions, limits, kinds of packets, codes of fields.

use crate::table::wire_enum;

/// Version of these formats, in the secondary header.
pub const VERSION: u8 = 3;
/// Longest packet in octets, headers and CRC included: fits a UDP datagram on Ethernet unfragmented.
pub const MAX_PACKET: usize = 1400;

wire_enum! {
    /// What makes the emulator take a frame.
    pub enum Mode: u8 {
        /// One frame for every attitude.
        Stepped = 0,
        /// The camera's cadence by the wall clock, with the latest attitude.
        Wall = 1,
        /// Exposures by the client's time.
        External = 2,
    }
}

wire_enum! {
    /// Which pixels of a frame are sent.
    pub enum PixelLevel: u8 {
        /// No pixels: the header, and what labels there are.
        None = 0,
        /// Square windows around the brightest stars or around listed positions.
        Windows = 1,
        /// Every pixel.
        Frame = 2,
        /// Every pixel, losslessly compressed.
        Compressed = 3,
    }
}

wire_enum! {
    /// Which labels of a frame are sent.
    pub enum LabelLevel: u8 {
        /// No labels.
        None = 0,
        /// A record of fixed size for each of the brightest objects in the frame.
        Objects = 1,
        /// All of them: the frame's line of `labels.jsonl`, without `files`.
        Text = 2,
    }
}

wire_enum! {
    /// How pixels are laid out; the code is the number of bits that a pixel takes.
    pub enum Packing: u8 {
        /// Two pixels in three octets, first bit first.
        Bits12 = 12,
        /// Two octets a pixel, big-endian.
        Bits16 = 16,
    }
}

wire_enum! {
    /// What the attitude that a frame shows was made of.
    pub enum AttitudeSource: u8 {
        /// An attitude whose own time is the middle of the exposure.
        Exact = 0,
        /// Two attitudes, between them.
        Interpolated = 1,
        /// One attitude, carried on by its rates.
        Extrapolated = 2,
        /// A stale one: carried on to the limit of its age, and held there.
        Held = 3,
        /// One older than the limit, carried on all the same.
        Stale = 4,
        /// A stale one, and marked so: what is shown means nothing.
        Invalid = 5,
        /// One whose time lies after the exposure, carried back.
        Future = 6,
    }
}

wire_enum! {
    /// What was done about a frame that would be late.
    pub enum Overrun: u8 {
        /// Nothing: it was not expected to be.
        None = 0,
        /// It is late, foreseen or not.
        Late = 1,
        /// The first frame after exposures that were left out.
        Drop = 2,
        /// It was rendered by coarser tolerances.
        Coarsen = 3,
    }
}

wire_enum! {
    /// What the emulator goes by for the client's time.
    pub enum SyncState: u8 {
        /// Nothing: it keeps its own time.
        Free = 0,
        /// Nothing heard of the client's time yet.
        Waiting = 1,
        /// Follows the client's time.
        Locked = 2,
        /// Nothing heard for a while: runs on by its own.
        Holdover = 3,
        /// Nothing: Pause has stopped the scene's time.
        Paused = 4,
    }
}

wire_enum! {
    /// Why the client has not received the whole last frame.
    pub enum Withheld: u8 {
        /// It has, or there was no frame.
        None = 0,
        /// The frame has more packets than Credit grants: send `packets = received + window` after every few frame packets.
        NoCredit = 1,
        /// The link has had no room for 2 s: the client does not read.
        NotRead = 2,
        /// A frame takes longer on the link than there is time: ask for less with Output, or use a faster link.
        SlowLink = 3,
        /// UDP: the client has not returned the Challenge: send it back as it came.
        NoProof = 4,
        /// Packets got lost on the way: the client grants less than was sent, or asks for packets again. Enlarge its receive buffer (SO_RCVBUF), grant less, or limit the link (`rate_mbit`).
        Lost = 5,
        /// The frame cannot be encoded, such as a label text longer than 65,535 packets: ask for other labels.
        TooLong = 6,
        /// The attitude or Trigger was refused, or could not be decoded: a Nack says why.
        Refused = 7,
        /// No valid packet has come on this link, or its client has gone.
        NoClient = 8,
        /// Attitudes come and no Trigger, and `run.trigger` is `packet`: send Triggers, or set `run.trigger` to `own`.
        NoTrigger = 9,
    }
}

wire_enum! {
    /// What goes wrong on the link.
    pub enum FaultKind: u8 {
        /// Bits are flipped; value: probability of each bit.
        BitFlips = 1,
        /// Packets are lost; value: probability of each.
        Drop = 2,
        /// Packets come twice; value: probability of each.
        Duplicate = 3,
        /// A packet comes after the next one; value: probability of each.
        Reorder = 4,
        /// Packets are cut short; value: probability of each.
        Truncate = 5,
        /// Everything comes later; value: s.
        Delay = 6,
        /// Everything comes later by a random time; value: the longest, s.
        Jitter = 7,
        /// Nothing passes and no error is reported; value: 1 on, 0 off.
        Stuck = 8,
        /// The link is down; value: 1 on, 0 off.
        Down = 9,
        /// The receiver throws packets away; value: probability of each.
        Overrun = 10,
        /// CAN: the controller leaves the bus; value: 1 on, 0 off.
        BusOff = 11,
    }
}

wire_enum! {
    /// Which way packets go.
    pub enum Direction: u8 {
        /// From the client to the emulator.
        In = 0,
        /// From the emulator to the client.
        Out = 1,
    }
}

wire_enum! {
    /// Why the emulator refuses a packet: the reason octet of a `Nack`.
    pub enum Reason: u8 {
        /// The CRC does not fit the octets before it.
        BadCrc = 1,
        /// Packet version number not 0, or format version not 3.
        BadVersion = 2,
        /// Octets, data length and layout do not agree.
        BadLength = 3,
        /// Unknown APID, opcode or header flag, or the type bit of the other direction.
        UnknownType = 4,
        /// The norm is more than 0.001 off 1.
        QuaternionNotUnit = 5,
        /// A NaN or an infinity in an attitude.
        NotFinite = 6,
        /// Earlier than the last attitude accepted.
        TimeBackwards = 7,
        /// Outside what the field, the camera or the observer allows.
        ValueOutOfRange = 8,
        /// Cannot be taken now; send it again later.
        Busy = 9,
        /// This emulator or its present mode does not have it.
        NotSupported = 10,
    }
}

wire_enum! {
    /// First payload octet of a `Command` packet.
    pub enum Opcode: u8 {
        /// Exposure time of the attitudes that follow (stepped), of the next frames (wall).
        Exposure = 1,
        /// Conversion gain, likewise.
        Gain = 2,
        /// By the wall and the external clock: cadence from now on; lets frames run again after SingleShot.
        FrameRate = 3,
        /// By the wall and the external clock: one frame with the latest attitude, then the cadence rests until FrameRate.
        SingleShot = 4,
        /// Configured settings, frames under way abandoned, exchange as new (section 5).
        Reset = 5,
        /// Answered by Ack, then Status.
        Ping = 6,
        /// Pacing, section 5.3.
        Credit = 7,
        /// What each frame from now on brings.
        Output = 8,
        /// Where the windows are from now on.
        Positions = 9,
        /// Packets of one of the last frames once more, as they were; they take no credit.
        Resend = 10,
        /// Something goes wrong on this link, on purpose.
        Fault = 11,
        /// One exposure at a time that the client chooses; answered by its frame.
        Trigger = 12,
        /// No exposure ends and the scene's time stands still until Resume; section 5.10.
        Pause = 13,
        /// Exposures and the scene's time go on after Pause.
        Resume = 14,
    }
}

/// Application process identifiers: one a message kind.
pub mod apid {
    /// Towards the emulator: attitude of the body at the time in the header; in stepped mode that is the middle of the exposure.
    pub const ATTITUDE: u16 = 0x101;
    /// Towards the emulator: everything else that a client says, by opcode.
    pub const COMMAND: u16 = 0x102;
    /// From the emulator: opens a frame.
    pub const FRAME_HEADER: u16 = 0x201;
    /// From the emulator: a run of pixels.
    pub const PIXEL_BLOCK: u16 = 0x202;
    /// From the emulator: a part of a frame's label text: JSON, byte for byte the frame's line of `labels.jsonl`, without its last member `files` and without a newline.
    pub const LABELS: u16 = 0x203;
    /// From the emulator: settings and counters, sent after the Ack of a Ping.
    pub const STATUS: u16 = 0x204;
    /// From the emulator: a command was carried out.
    pub const ACK: u16 = 0x205;
    /// From the emulator: a packet was refused.
    pub const NACK: u16 = 0x206;
    /// From the emulator: square windows cut out of a frame.
    pub const WINDOWS: u16 = 0x207;
    /// From the emulator: records of the brightest objects in a frame, brightest first.
    pub const OBJECTS: u16 = 0x208;
    /// From the emulator: a run of pixels, losslessly compressed.
    pub const COMPRESSED: u16 = 0x209;
    /// From the emulator: closes a frame: what is known only when all of it has been rendered and sent.
    pub const FRAME_END: u16 = 0x20a;
    /// From the emulator: UDP: asks the client to prove its address by sending this packet back as it came (section 5.1).
    pub const CHALLENGE: u16 = 0x20b;

    /// All of them with their names in the ICD.
    pub const ALL: [(u16, &str); 13] = [
        (ATTITUDE, "Attitude"),
        (COMMAND, "Command"),
        (FRAME_HEADER, "FrameHeader"),
        (PIXEL_BLOCK, "PixelBlock"),
        (LABELS, "Labels"),
        (STATUS, "Status"),
        (ACK, "Ack"),
        (NACK, "Nack"),
        (WINDOWS, "Windows"),
        (OBJECTS, "Objects"),
        (COMPRESSED, "Compressed"),
        (FRAME_END, "FrameEnd"),
        (CHALLENGE, "Challenge"),
    ];

    /// Whether packets with this APID go towards the emulator (type bit 1).
    pub const fn is_telecommand(apid: u16) -> bool {
        matches!(apid, ATTITUDE | COMMAND)
    }

    /// The row of [`ALL`] that holds this APID.
    pub fn index(apid: u16) -> Option<usize> {
        ALL.iter().position(|(known, _)| *known == apid)
    }
}
