//! Files of two-line element sets, with or without name lines.

use crate::lines::Part;
use crate::record::{At, Record, shorten};
use crate::two_line::Checksum;
use crate::{Contents, bounded_name, lines};
use rayon::prelude::*;

/// Longest name line: 24 characters after `0 `. Element lines have 69, or 68 without a checksum.
const LONGEST_NAME: usize = 26;
/// Columns of a line without its checksum.
const LINE_WITHOUT_CHECKSUM: usize = 68;

/// Position of the name lines in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Names {
    /// Before their sets, as in a 3LE.
    Before,
    /// After their sets.
    After,
}

/// Reads every set of a text.
///
/// A record is lines 1 and 2 with an optional name line (with or without a leading `0 `). The name
/// is before them. In files that begin with line 1 and end with a name it is after them. Blank
/// lines and lines that begin with `#` are skipped.
pub(crate) fn read(part: &Part, found: &mut Contents) {
    let mut reader = Reader {
        names: order(part.text),
        name: None,
        first: None,
        is_unnamed: false,
        steps: Vec::new(),
    };
    for (number, line) in significant(part.text) {
        let number = number + part.lines_before;
        match element_line(line) {
            Some(1) => reader.first_line(number, line),
            Some(_) => reader.second_line(number, line),
            None => reader.name_line(number, line),
        }
    }
    // In parallel, since this takes most of the time.
    let steps = reader.close().into_par_iter();
    let read: Vec<At<Record>> = steps.map(Step::read).collect();
    for (line, reason) in read.iter().filter_map(|one| one.as_ref().err()) {
        found.reject(*line, reason);
    }
    // Collected in place to save memory for large catalogues.
    let records: Vec<Record> = read.into_iter().filter_map(Result::ok).collect();
    if found.records.is_empty() {
        found.records = records;
    } else {
        found.records.extend(records);
    }
}

/// A set or a refused line.
enum Step<'a> {
    /// Lines 1 and 2 with their numbers, and the name.
    Set {
        first: (usize, &'a str),
        second: (usize, &'a str),
        name: Option<&'a str>,
    },
    /// The number of a refused line, and the reason.
    Refused(usize, String),
}

impl Step<'_> {
    fn read(self) -> At<Record> {
        let (first, second, name) = match self {
            Step::Set {
                first,
                second,
                name,
            } => (first, second, name),
            Step::Refused(line, reason) => return Err((line, reason)),
        };
        let is_bare =
            first.1.len() == LINE_WITHOUT_CHECKSUM && second.1.len() == LINE_WITHOUT_CHECKSUM;
        let checksum = if is_bare {
            Checksum::Ignored
        } else {
            Checksum::Required
        };
        let record = Record::from_lines(first.1, second.1, checksum).map_err(|error| {
            let line = if error.line == 1 { first.0 } else { second.0 };
            let name = name.map(|name| format!(" ({})", shorten(name)));
            (line, format!("{error}{}", name.unwrap_or_default()))
        })?;
        Ok(Record {
            line: first.0,
            name: name.map(bounded_name).unwrap_or_default(),
            ..record
        })
    }
}

struct Reader<'a> {
    names: Names,
    /// A name before its set.
    name: Option<(usize, &'a str)>,
    /// A line 1 before its line 2.
    first: Option<(usize, &'a str)>,
    /// Whether a name at this line belongs to the set, or the refused lines, before it.
    is_unnamed: bool,
    steps: Vec<Step<'a>>,
}

impl<'a> Reader<'a> {
    fn first_line(&mut self, number: usize, line: &'a str) {
        self.abandon();
        self.first = Some((number, line));
        self.is_unnamed = false;
    }

    fn second_line(&mut self, number: usize, line: &'a str) {
        let name = self.name.take().map(|(_, name)| name);
        match self.first.take() {
            Some(first) => self.steps.push(Step::Set {
                first,
                second: (number, line),
                name,
            }),
            None => self.refuse(number, "line 2 of a set without its line 1".to_owned()),
        }
        self.is_unnamed = true;
    }

    fn name_line(&mut self, number: usize, line: &'a str) {
        self.abandon();
        // The name line of an object without a name is `0`.
        let line = if line == "0" { "0 " } else { line };
        let text = line.strip_prefix("0 ").unwrap_or(line).trim();
        let is_unnamed = std::mem::take(&mut self.is_unnamed);
        match self.names {
            Names::Before => {
                if let Some(old) = self.name.replace((number, text)) {
                    self.unused(old);
                }
            }
            Names::After if is_unnamed => {
                if let Some(Step::Set { name, .. }) = self.steps.last_mut() {
                    *name = Some(text);
                }
            }
            Names::After => self.unused((number, text)),
        }
    }

    /// Refuses a line 1 without its line 2, and drops its name.
    fn abandon(&mut self) {
        if let Some((at, _)) = self.first.take() {
            self.refuse(at, "line 1 of a set without its line 2".to_owned());
            self.name = None;
            self.is_unnamed = true;
        }
    }

    fn unused(&mut self, (at, name): (usize, &str)) {
        self.refuse(at, format!("'{}' names no element set", shorten(name)));
    }

    fn refuse(&mut self, line: usize, reason: String) {
        self.steps.push(Step::Refused(line, reason));
    }

    fn close(mut self) -> Vec<Step<'a>> {
        self.abandon();
        if let Some(name) = self.name.take() {
            self.unused(name);
        }
        self.steps
    }
}

/// Whether the sets of a text have names; none for a text without an element line.
pub(crate) fn has_names(text: &str) -> Option<bool> {
    let mut lines = significant(text).map(|(_, line)| element_line(line));
    if lines.clone().all(|line| line.is_none()) {
        return None;
    }
    Some(lines.any(|line| line.is_none()))
}

/// The position of names. They are after their sets in a file that begins with a set, has a name
/// next, and ends with a name. (A 3LE begins with a name; one without its first line ends with a
/// set.) Names marked as line 0 must be as many as the sets.
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
    let last = lines.last().or(third);
    let after = start == [Some(1), Some(2)]
        && name(third)
        && name(last)
        && last.is_some_and(|last| last.len() <= LONGEST_NAME)
        && (!marked || count(None) == count(Some(1)));
    if after { Names::After } else { Names::Before }
}

/// The lines that are neither blank nor comments, with their numbers.
fn significant(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    lines::numbered(text)
        .map(|(number, line)| (number, line.trim_start()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Whether two lines have the form of a set.
pub(crate) fn is_set(first: &str, second: &str) -> bool {
    element_line(first) == Some(1) && element_line(second) == Some(2)
}

/// The number, 1 or 2, of a line of a set. A name may begin with these digits, but has more letters
/// than digits.
fn element_line(line: &str) -> Option<u8> {
    let number = match line.get(..2)? {
        "1 " => 1,
        "2 " => 2,
        _ => return None,
    };
    let count = |is_one: fn(&u8) -> bool| line.bytes().filter(is_one).count();
    let has_columns = || count(u8::is_ascii_digit) > count(u8::is_ascii_alphabetic);
    (line.len() > LONGEST_NAME && has_columns()).then_some(number)
}
