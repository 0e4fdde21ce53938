//! Refused packets of the golden vectors.

use serde::Deserialize;
use toml::Table;

/// A refused packet: a good packet with errors.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mistake {
    pub name: String,
    /// The receiving end: `emulator` or `client`.
    pub receiver: String,
    /// Name of the error.
    pub error: String,
    pub(crate) like: String,
    #[serde(default)]
    pub(crate) fields: Table,
    /// Omitted fields.
    #[serde(default)]
    pub(crate) without: Vec<String>,
    /// Whole payload in hexadecimal digits, in place of the fields.
    pub(crate) payload: Option<String>,
    /// Number of bytes removed from the end of the payload.
    #[serde(default)]
    pub(crate) cut: usize,
    /// Bytes added after the payload.
    pub(crate) append: Option<String>,
    /// Wrong format version.
    pub version: Option<u8>,
    /// Bits of the first byte to flip.
    #[serde(default)]
    pub octet0: u8,
    /// Wrong sequence flags.
    pub flags: Option<u16>,
    /// Added to the data length.
    #[serde(default)]
    pub extra: i16,
    pub apid: Option<u16>,
    /// Bits of the CRC to flip.
    #[serde(default)]
    pub crc: u16,
    /// Length of the truncated packet in bytes.
    pub(crate) keep: Option<usize>,
    #[serde(skip)]
    pub bytes: Vec<u8>,
}
