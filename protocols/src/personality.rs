//! The wire languages that the emulator can speak: each is one row of functions around the same `Command` and `Reply`.

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

/// One wire language.
#[derive(Debug, Clone, Copy)]
pub struct Personality {
    /// Its name in configurations.
    pub name: &'static str,
    /// What it is, in one line.
    pub summary: &'static str,
    /// The emulator's ear.
    pub decode_command: DecodeCommand,
    /// The emulator's mouth.
    pub encode_reply: EncodeReply,
    /// The flight computer's mouth.
    pub encode_command: EncodeCommand,
    /// The flight computer's ear.
    pub decode_reply: DecodeReply,
}

/// skyloop's own formats, described in `docs/icd.md`.
pub const NATIVE: Personality = Personality {
    name: "native",
    summary: "CCSDS space packets with time code, version and CRC",
    decode_command: |bytes| Command::decode(bytes),
    encode_reply: |reply, count, time, buffer| reply.encode(count, time, buffer),
    encode_command: |command, count, time, buffer| command.encode(count, time, buffer),
    decode_reply: |bytes| Reply::decode(bytes),
};

/// All of them: a new language is one file and one row here.
pub const PERSONALITIES: &[Personality] = &[NATIVE];
