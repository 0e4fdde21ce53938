//! Element sets as text, in every format that holds them.

mod omm;
mod two_line;

use crate::format::Format;
use crate::record::Record;
use hifitime::Epoch;

/// A text of element sets, and what of them it does not hold.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// The text.
    pub text: String,
    /// Records that the format cannot hold, each with the reason.
    pub left_out: Vec<String>,
}

/// Writes records in a format; messages of notations that say when they were made give `created`.
///
/// Elements that were read from a file come back to the last bit from an OMM, others within one
/// unit in the last place; two lines have fewer digits. None for formats of ephemerides.
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
