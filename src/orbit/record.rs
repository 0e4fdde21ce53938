//! An element set as its file gives it, with values that SGP4 does not use but other formats store.

use crate::catalogue_number::assigned;
use crate::elements::Elements;
use crate::identity::{agency_id, unnumbered_id};
use crate::is_placeholder;
use crate::{Designator, Theory};

/// An element set and its metadata.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// First line in the source, counted from 1.
    pub line: usize,
    /// Name of the object, or empty.
    pub name: String,
    /// International designator in the long form, `1998-067A`, or empty.
    pub designator: String,
    /// Classification, usually `U`.
    pub classification: char,
    /// Ephemeris type: 0 for all published sets.
    pub ephemeris_type: u8,
    /// The theory of the elements, as the source gives it.
    pub theory: Theory,
    /// Number of the element set.
    pub element_set: u32,
    /// Revolution number at the epoch.
    pub revolution: u32,
    /// Half the first derivative of the mean motion, rev/day^2, as in published TLEs and OMMs.
    pub mean_motion_dot: f64,
    /// A sixth of the second derivative of the mean motion, rev/day^3.
    pub mean_motion_ddot: f64,
    /// The mean elements.
    pub elements: Elements,
}

impl Record {
    /// The id of the object: `NORAD 44322`. Without a number an agency's own id, or a placeholder
    /// such as `NORAD 0` followed by the name.
    pub(crate) fn object_id(&self) -> String {
        let id = format!("NORAD {}", self.elements.norad);
        if assigned(self.elements.norad).is_some() {
            return id;
        }
        let own = agency_id(&self.designator);
        own.map_or_else(|| unnumbered_id(&id, &self.name), str::to_owned)
    }
}

/// A result whose error has a line number and a reason.
pub(crate) type At<T> = Result<T, (usize, String)>;

/// An international designator in the long form, `1998-067A`; other text is returned as it is.
pub(crate) fn long_designator(text: &str) -> String {
    match Designator::parse(text) {
        Some(designator) => designator.to_string(),
        None => text.trim().to_owned(),
    }
}

/// An international designator in the columns of a TLE, blank for a placeholder. None for a year
/// that does not fit, and for any other id.
pub(crate) fn short_designator(text: &str) -> Option<String> {
    match Designator::parse(text) {
        Some(designator) => designator.short(),
        None => is_placeholder(text).then(String::new),
    }
}

/// The first characters of a text, for messages.
pub(crate) fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Supported versions by keyword: CCSDS 502.0-B-1 to B-3, 504.0-B-1 and B-2.
const VERSIONS: [(&str, &[&str]); 3] = [
    ("CCSDS_OEM_VERS", &["1.0", "2.0", "3.0"]),
    ("CCSDS_OMM_VERS", &["2.0", "3.0"]),
    ("CCSDS_AEM_VERS", &["1.0", "2.0"]),
];

/// Refuses an unknown version, where keywords and columns may have other meanings.
pub(crate) fn check_version(key: &str, text: &str) -> Result<(), String> {
    let text = text.trim();
    let known = VERSIONS.iter().find(|(known, _)| *known == key);
    let known = known.map_or(&[][..], |(_, known)| known);
    let version = text.parse::<f64>().ok();
    let is_same = |known: &&str| version.is_some() && known.parse().ok() == version;
    if known.iter().any(is_same) {
        return Ok(());
    }
    let (text, known) = (shorten(text), known.join(", "));
    Err(format!(
        "{key} '{text}'; expected {known}: export the message in one of these"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn designators_are_converted_between_both_forms() {
        for (text, short, long) in [
            ("98067A", Some("98067A"), "1998-067A"),
            ("1998-067-a", Some("98067A"), "1998-067A"),
            ("2057-001A", None, "2057-001A"),
            ("", Some(""), ""),
            ("UNKNOWN", Some(""), "UNKNOWN"),
            // Other ids are no designators, even if they fit the columns.
            ("98067", None, "98067"),
            ("NORAD-5", None, "NORAD-5"),
            ("X-37B", None, "X-37B"),
            ("1998-067ABCD", None, "1998-067ABCD"),
            ("1998-067é", None, "1998-067é"),
            ("é8067A", None, "é8067A"),
        ] {
            assert_eq!(long_designator(text), long);
            assert_eq!(short_designator(text).as_deref(), short);
        }
    }
}
