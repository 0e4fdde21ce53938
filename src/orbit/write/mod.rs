//! Writes element sets in every format that holds them.

mod omm;
mod two_line;

use crate::format::Format;
use crate::record::Record;
use hifitime::Epoch;

/// A text of element sets, and the records that it does not hold.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// The text.
    pub text: String,
    /// Records that the format cannot hold, with their reasons.
    pub left_out: Vec<String>,
}

/// Writes records in a format; `created` is the creation time in notations that have one.
///
/// An OMM restores elements from a file to the last bit, others within one unit in the last place.
/// Two lines have fewer digits. None for formats of ephemerides.
pub fn write(records: &[Record], format: Format, created: Epoch) -> Option<Written> {
    let text = match format {
        Format::Tle => return Some(two_line::write(records, false)),
        Format::ThreeLine => return Some(two_line::write(records, true)),
        Format::OmmKvn => omm::kvn(records, created),
        Format::OmmXml => omm::xml(records, created),
        Format::OmmJson => omm::json(records),
        Format::OmmCsv => omm::csv(records),
        Format::OemKvn | Format::OemXml => return None,
    };
    Some(Written {
        text,
        ..Written::default()
    })
}
