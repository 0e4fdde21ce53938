//! The formats of orbit files, detected from their text.

use crate::{lines, oem, omm, tle};
use std::fmt;

/// A format of orbit files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// Two-line element sets.
    Tle,
    /// Two-line element sets with name lines.
    ThreeLine,
    /// CCSDS Orbit Mean-Elements Messages in keyword = value notation.
    OmmKvn,
    /// OMM in XML, alone or in an NDM.
    OmmXml,
    /// JSON objects with the keywords of the OMM.
    OmmJson,
    /// A table with the keywords of the OMM as its header.
    OmmCsv,
    /// A CCSDS Orbit Ephemeris Message in keyword = value notation.
    OemKvn,
    /// OEM in XML, alone or in an NDM.
    OemXml,
}

impl Format {
    /// All formats.
    pub const ALL: [Format; 8] = [
        Format::Tle,
        Format::ThreeLine,
        Format::OmmKvn,
        Format::OmmXml,
        Format::OmmJson,
        Format::OmmCsv,
        Format::OemKvn,
        Format::OemXml,
    ];

    /// Name in commands and reports, such as `omm-kvn`.
    pub fn name(self) -> &'static str {
        match self {
            Format::Tle => "tle",
            Format::ThreeLine => "3le",
            Format::OmmKvn => "omm-kvn",
            Format::OmmXml => "omm-xml",
            Format::OmmJson => "omm-json",
            Format::OmmCsv => "omm-csv",
            Format::OemKvn => "oem-kvn",
            Format::OemXml => "oem-xml",
        }
    }

    pub(crate) fn is_xml(self) -> bool {
        matches!(self, Format::OmmXml | Format::OemXml)
    }

    /// The format of a text, from its first line that is no comment; none where it is unknown.
    pub(crate) fn of(text: &str) -> Option<Format> {
        let mut lines = lines::numbered(text).map(|(_, line)| line.trim_start());
        let first = lines.find(|line| !lines::is_comment(line))?;
        match first.as_bytes().first()? {
            b'<' if omm::xml::looks_like(text) => Some(Format::OmmXml),
            b'<' => oem::xml::looks_like(text).then_some(Format::OemXml),
            b'[' | b'{' if omm::json::begins(text) => Some(Format::OmmJson),
            _ if oem::begins(first) => Some(Format::OemKvn),
            _ if omm::kvn::begins(first) => Some(Format::OmmKvn),
            _ if omm::csv::begins(first) => Some(Format::OmmCsv),
            _ if tle::has_names(text)? => Some(Format::ThreeLine),
            _ => Some(Format::Tle),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
