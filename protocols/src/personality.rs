//! The wire formats of the emulator: each is a row of functions around the same `Command` and
//! `Reply`.

use crate::command::Command;
use crate::error::{DecodeError, EncodeError};
use crate::packet::Header;
use crate::reply::Reply;
use crate::time::WireTime;

/// Reads a flight computer's packet.
pub type DecodeCommand = fn(&[u8]) -> Result<(Header, Command), DecodeError>;
/// Writes a flight computer's packet: message, sequence count, time, buffer.
pub type EncodeCommand = fn(&Command, u16, WireTime, &mut [u8]) -> Result<usize, EncodeError>;
/// Reads an emulator's packet.
pub type DecodeReply = for<'a> fn(&'a [u8]) -> Result<(Header, Reply<'a>), DecodeError>;
/// Writes an emulator's packet: message, sequence count, time, buffer.
pub type EncodeReply =
    for<'a> fn(&Reply<'a>, u16, WireTime, &mut [u8]) -> Result<usize, EncodeError>;

/// One wire format.
#[derive(Debug, Clone, Copy)]
pub struct Personality {
    /// Its name in configurations.
    pub name: &'static str,
    /// One line of description.
    pub summary: &'static str,
    /// Decoder of the emulator.
    pub decode_command: DecodeCommand,
    /// Encoder of the emulator.
    pub encode_reply: EncodeReply,
    /// Encoder of the flight computer.
    pub encode_command: EncodeCommand,
    /// Decoder of the flight computer.
    pub decode_reply: DecodeReply,
}

/// The native formats of `docs/icd.md`.
pub const NATIVE: Personality = Personality {
    name: "native",
    summary: "CCSDS space packets with time code, version and CRC",
    decode_command: |bytes| Command::decode(bytes),
    encode_reply: |reply, count, time, buffer| reply.encode(count, time, buffer),
    encode_command: |command, count, time, buffer| command.encode(count, time, buffer),
    decode_reply: |bytes| Reply::decode(bytes),
};

/// All formats: a new one is one file and one row.
pub const PERSONALITIES: &[Personality] = &[NATIVE];
