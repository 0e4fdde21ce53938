//! Files of two-line element sets, with or without name lines.

use crate::bounded_name;
use crate::format::Format;
use crate::lines;
use crate::record::{Found, Record, shorten};
use crate::two_line::{Checksum, ElementsError};
use rayon::prelude::*;

/// Name lines have at most 24 characters behind a `0 `; element lines have 69, or 68 without a checksum.
const LONGEST_NAME: usize = 26;
/// Columns of a line without its checksum.
const UNSEALED: usize = 68;

/// Where the name lines of a file stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Names {
    /// Before their sets, as in every 3LE.
    Before,
    /// Behind their sets.
    Behind,
}

/// Reads every set in `text`.
///
/// A record is lines 1 and 2, with an optional name line (with or without a leading `0 `) before or, in files
/// that begin with line 1 and end with a name, behind them. Blank lines and lines that begin with `#` are passed over.
pub(crate) fn read(text: &str, found: &mut Found) {
    let sets = sets(text);
    found.records.reserve(sets.len());
    let mut reader = Reader {
        names: order(text),
        sets: sets.into_iter(),
        name: None,
        first: None,
        unnamed: Unnamed::Nothing,
        found,
    };
    for (number, line) in significant(text) {
        match element_line(line) {
            Some(1) => reader.first_line(number),
            Some(_) => reader.second_line(number),
            None => reader.name_line(number, line),
        }
    }
    reader.close();
}

/// Every line 1 with a line 2 right behind it, in the order of the text, read side by side: that takes most of the time.
fn sets(text: &str) -> Vec<Result<Record, ElementsError>> {
    let lines = significant(text).map(|(_, line)| (element_line(line), line));
    let mut first = None;
    let pairs: Vec<(&str, &str)> = lines
        .filter_map(|(kind, line)| {
            let before = std::mem::replace(&mut first, (kind == Some(1)).then_some(line));
            before.filter(|_| kind == Some(2)).map(|one| (one, line))
        })
        .collect();
    let read = |(one, two): (&str, &str)| {
        let unsealed = one.len() == UNSEALED && two.len() == UNSEALED;
        let checksum = match unsealed {
            true => Checksum::Ignored,
            false => Checksum::Required,
        };
        Record::from_lines(one, two, checksum)
    };
    pairs.into_par_iter().map(read).collect()
}

struct Reader<'a, 'b, 'c> {
    names: Names,
    /// What is in the sets that are still to come.
    sets: std::vec::IntoIter<Result<Record, ElementsError>>,
    /// A name whose set has not come yet.
    name: Option<(usize, &'a str)>,
    /// The number of a line 1 whose line 2 has not come yet.
    first: Option<usize>,
    /// What a name behind it would name.
    unnamed: Unnamed,
    found: &'b mut Found<'c>,
}

/// The set that a name line behind it belongs to.
#[derive(PartialEq)]
enum Unnamed {
    Nothing,
    /// The last record.
    Record,
    /// One that was rejected.
    Rejected,
}

impl<'a> Reader<'a, '_, '_> {
    fn first_line(&mut self, number: usize) {
        self.abandon();
        self.first = Some(number);
        self.unnamed = Unnamed::Nothing;
    }

    fn second_line(&mut self, number: usize) {
        let name = self.name.take().map(|(_, name)| name);
        let first = self.first.take();
        let Some((at, set)) = first.and_then(|at| Some((at, self.sets.next()?))) else {
            let reason = "line 2 of a set without its line 1".to_owned();
            self.found.reject(number, reason);
            self.unnamed = Unnamed::Rejected;
            return;
        };
        match set {
            Ok(record) => {
                self.found.take(Ok(Record {
                    line: at,
                    name: name.map(bounded_name).unwrap_or_default(),
                    ..record
                }));
                self.unnamed = Unnamed::Record;
            }
            Err(error) => {
                let line = if error.line() == 1 { at } else { number };
                let who = name.map(|n| format!(" ({})", shorten(n)));
                let reason = format!("{error}{}", who.unwrap_or_default());
                self.found.reject(line, reason);
                self.unnamed = Unnamed::Rejected;
            }
        }
    }

    fn name_line(&mut self, number: usize, line: &'a str) {
        self.abandon();
        // An object without a name has `0` alone.
        let line = if line == "0" { "0 " } else { line };
        let text = line.strip_prefix("0 ").unwrap_or(line).trim();
        match (
            self.names,
            std::mem::replace(&mut self.unnamed, Unnamed::Nothing),
        ) {
            (Names::Before, _) => {
                if let Some(old) = self.name.replace((number, text)) {
                    self.unused(old);
                }
            }
            (Names::Behind, Unnamed::Record) => {
                if let Some(record) = self.found.records.last_mut() {
                    record.name = bounded_name(text);
                }
            }
            (Names::Behind, Unnamed::Rejected) => {}
            (Names::Behind, Unnamed::Nothing) => self.unused((number, text)),
        }
    }

    /// Gives up a line 1 that is left alone, and its name.
    fn abandon(&mut self) {
        if let Some(at) = self.first.take() {
            let reason = "line 1 of a set without its line 2".to_owned();
            self.found.reject(at, reason);
            self.name = None;
            self.unnamed = Unnamed::Rejected;
        }
    }

    fn unused(&mut self, (at, name): (usize, &str)) {
        let reason = format!("'{}' names no element set", shorten(name));
        self.found.reject(at, reason);
    }

    fn close(mut self) {
        self.abandon();
        if let Some(name) = self.name.take() {
            self.unused(name);
        }
    }
}

/// The format of a text that holds anything like an element line.
pub(crate) fn looks_like(text: &str) -> Option<Format> {
    let mut lines = significant(text).map(|(_, line)| element_line(line));
    if lines.clone().all(|line| line.is_none()) {
        return None;
    }
    Some(match lines.all(|line| line.is_some()) {
        true => Format::Tle,
        false => Format::ThreeLine,
    })
}

/// Names stand behind their sets in a file that begins with a set, has a name right after it and ends with a name. A 3LE
/// begins with a name; one that lost it ends with a set. Names that are marked as a 3LE's line 0 must be as many as the sets.
fn order(text: &str) -> Names {
    let all = significant(text).map(|(_, line)| line);
    let mut lines = all.clone();
    let start = [lines.next(), lines.next()].map(|line| line.and_then(element_line));
    let name = |line: Option<&str>| line.is_some_and(|line| element_line(line).is_none());
    let third = lines.next();
    let marked = third.is_some_and(|line| line.starts_with("0 ") || line == "0");
    let count = |kind| {
        all.clone()
            .filter(|line| element_line(line) == kind)
            .count()
    };
    let behind = start == [Some(1), Some(2)]
        && name(third)
        && name(lines.last().or(third))
        && (!marked || count(None) == count(Some(1)));
    if behind { Names::Behind } else { Names::Before }
}

/// The lines that are neither blank nor comments, with their numbers.
fn significant(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    lines::numbered(text)
        .map(|(number, line)| (number, line.trim_start()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// 1 or 2 when the line is that line of a set.
fn element_line(line: &str) -> Option<u8> {
    if line.len() <= LONGEST_NAME {
        return None;
    }
    match line.get(..2)? {
        "1 " => Some(1),
        "2 " => Some(2),
        _ => None,
    }
}
