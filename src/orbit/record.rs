//! One element set as its file gives it, with what a scene has no use for and another format needs.

use crate::elements::Elements;
use crate::{Rejected, Theory};

/// An element set and what its source says beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Line of the source that it starts in, counted from 1.
    pub line: usize,
    /// Name of the object; empty: none.
    pub name: String,
    /// International designator in the long form, `1998-067A`, where it can be told; empty: none.
    pub designator: String,
    /// Classification, mostly `U`.
    pub classification: char,
    /// Ephemeris type: 0 for all that are published.
    pub ephemeris_type: u8,
    /// The theory that the source names.
    pub theory: Theory,
    /// Number of the element set.
    pub element_set: u32,
    /// Revolution number at the epoch.
    pub revolution: u32,
    /// Half the first derivative of the mean motion, rev/day^2: what both TLE and OMM of the publishers have.
    pub mean_motion_dot: f64,
    /// A sixth of the second derivative of the mean motion, rev/day^3.
    pub mean_motion_ddot: f64,
    /// The mean elements.
    pub elements: Elements,
}

impl Record {
    /// What the object is called by: `NORAD 44322`. Number 0 stands for any object that has none yet, so that its name joins it.
    pub fn object_id(&self) -> String {
        match (self.elements.norad, self.name.as_str()) {
            (0, name) if !name.is_empty() => format!("NORAD 0 {name}"),
            (number, _) => format!("NORAD {number}"),
        }
    }
}

/// A reason with its line.
pub(crate) type At<T> = Result<T, (usize, String)>;

/// What a reader has found so far.
pub(crate) struct Found<'a> {
    pub source: &'a str,
    pub records: Vec<Record>,
    pub rejected: Vec<Rejected>,
    /// Records that were given by [`Found::take`].
    taken: usize,
}

impl<'a> Found<'a> {
    pub fn new(source: &'a str) -> Self {
        Found {
            source,
            records: Vec::new(),
            rejected: Vec::new(),
            taken: 0,
        }
    }

    /// The next record of the file. What is wrong is told with its number, since a file may have one line for all.
    pub fn take(&mut self, record: At<Record>) {
        self.taken += 1;
        match record {
            Ok(record) => self.records.push(record),
            Err((line, reason)) => self.reject(line, format!("record {}: {reason}", self.taken)),
        }
    }

    pub fn reject(&mut self, line: usize, reason: String) {
        let rejected = Rejected::new(self.source, line, &reason);
        self.rejected.push(rejected);
    }
}

/// The international designator of a TLE's columns, `98067A`, in the long form, `1998-067A`; any other text as it is.
pub(crate) fn long_designator(short: &str) -> String {
    let short = short.trim();
    let parts = short.get(..2).zip(short.get(2..5)).zip(short.get(5..));
    match parts {
        Some(((year, launch), piece)) if is_number(year) && is_number(launch) => {
            let century = if year < "57" { "20" } else { "19" };
            format!("{century}{year}-{launch}{piece}")
        }
        _ => short.to_owned(),
    }
}

/// The eight columns that a designator has in a TLE; nothing where they cannot hold it.
pub(crate) fn short_designator(long: &str) -> Option<String> {
    let parts = long.get(..4).zip(long.get(4..5)).zip(long.get(5..));
    let short = match parts {
        Some(((year, "-"), rest)) if is_number(year) => {
            let years = "1957".."2057";
            years
                .contains(&year)
                .then(|| format!("{}{rest}", &year[2..]))?
        }
        _ => long.to_owned(),
    };
    (short.is_ascii() && short.len() <= 8).then_some(short)
}

fn is_number(text: &str) -> bool {
    text.bytes().all(|b| b.is_ascii_digit())
}

/// The first characters of what a message quotes.
pub(crate) fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn designators_go_there_and_back() {
        for (short, long) in [
            ("98067A", "1998-067A"),
            ("58002B", "1958-002B"),
            ("19029BC", "2019-029BC"),
            ("56001A", "2056-001A"),
            ("57001A", "1957-001A"),
            ("", ""),
            ("UNKNOWN", "UNKNOWN"),
        ] {
            assert_eq!(long_designator(short), long);
            assert_eq!(short_designator(long).as_deref(), Some(short));
        }
        for unfit in [
            "2057-001A",
            "1956-001A",
            "1998-067ABCD",
            "TO BE ASSIGNED",
            "1998-067é",
        ] {
            assert_eq!(short_designator(unfit), None, "{unfit}");
        }
        let _ = (long_designator("é8067A"), long_designator("9"));
    }
}
