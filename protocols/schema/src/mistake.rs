//! Packets that a receiver refuses.

use serde::Deserialize;
use toml::Table;

/// A refused packet: a good packet and what is wrong with it.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mistake {
    pub name: String,
    /// The end that receives them: `emulator` or `client`.
    pub receiver: String,
    /// Name of the error.
    pub error: String,
    pub(crate) like: String,
    #[serde(default)]
    pub(crate) fields: Table,
    /// Fields to leave out.
    #[serde(default)]
    pub(crate) without: Vec<String>,
    /// All of the payload.
    pub(crate) payload: Option<String>,
    /// Octets that the payload lacks at its end.
    #[serde(default)]
    pub(crate) cut: usize,
    /// Octets after the payload.
    pub(crate) append: Option<String>,
    /// Another format version.
    pub version: Option<u8>,
    /// Bits of the first octet to flip.
    #[serde(default)]
    pub octet0: u8,
    /// Other sequence flags.
    pub flags: Option<u16>,
    /// Added to the data length.
    #[serde(default)]
    pub extra: i16,
    pub apid: Option<u16>,
    /// Bits of the CRC to flip.
    #[serde(default)]
    pub crc: u16,
    /// Only so many octets of the packet.
    pub(crate) keep: Option<usize>,
    #[serde(skip)]
    pub octets: Vec<u8>,
}
