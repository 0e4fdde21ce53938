//! A table with the keywords of the OMM as its header, a record a line, or several lines where
//! a value in quotation marks has line breaks (RFC 4180).

use super::{Fields, Key, Metadata, index_of};
use crate::lines;
use crate::record::Found;
use csv_core::{ReadRecordResult, Reader};
use std::borrow::Cow;

/// Whether a text whose first line is this one is such a table.
pub(crate) fn begins(line: &str) -> bool {
    let mut names = line.split(',').map(|name| name.trim().trim_matches('"'));
    line.contains(',') && names.any(|name| index_of(name).is_some())
}

/// Lines that a record may have.
const MOST_LINES: usize = 16;

/// Reads every record below the header.
pub(crate) fn read(text: &str, found: &mut Found) {
    let mut splitter = Splitter::new();
    let mut columns: Option<Vec<Option<usize>>> = None;
    let mut lines = lines::numbered(text);
    while let Some((number, line)) = lines.next() {
        // A name below the header may begin as a comment does.
        let comment = columns.is_none() && line.starts_with('#');
        if line.trim_start().is_empty() || comment {
            continue;
        }
        let Some(columns) = &columns else {
            splitter.split(line);
            let header: Vec<_> = splitter
                .values()
                .map(|name| index_of(name.trim()))
                .collect();
            for key in [Key::Epoch, Key::MeanMotion] {
                if !header.contains(&Some(key as usize)) {
                    let keyword = super::KEYWORDS[key as usize];
                    found.reject(number, format!("the header has no column {keyword}"));
                    return;
                }
            }
            columns = Some(header);
            continue;
        };
        if let Err(reason) = record(text, line, &mut lines, columns.len(), &mut splitter) {
            found.take(Err((number, reason)));
            continue;
        }
        let mut fields = Fields::default();
        for (column, value) in columns.iter().zip(splitter.values()) {
            if let Some(index) = column {
                fields.set(*index, Cow::Borrowed(value), number);
            }
        }
        found.take(fields.record(number, Metadata::Understood));
    }
}

/// Splits the record that begins with `line`. A quotation mark that is open at its end takes further lines, but only those
/// that make a value for every column: one that is lost spoils its own line alone.
fn record<'a>(
    text: &str,
    line: &str,
    lines: &mut (impl Iterator<Item = (usize, &'a str)> + Clone),
    columns: usize,
    splitter: &mut Splitter,
) -> Result<(), String> {
    if is_closed(line) {
        splitter.split(line);
        return match splitter.count() {
            count if count == columns => Ok(()),
            count => Err(format!(
                "{count} values in a line, the header has {columns} columns"
            )),
        };
    }
    let place = |line: &str| line.as_ptr().addr() - text.as_ptr().addr();
    let mut ahead = lines.clone();
    for _ in 1..MOST_LINES {
        let Some((_, last)) = ahead.next() else { break };
        let record = text.get(place(line)..place(last) + last.len());
        let Some(record) = record.filter(|record| is_closed(record)) else {
            continue;
        };
        if splitter.split(record) && splitter.count() == columns {
            *lines = ahead;
            return Ok(());
        }
        break;
    }
    Err("a quotation mark without the other that closes it".to_owned())
}

/// Whether every quotation mark has its other.
fn is_closed(record: &str) -> bool {
    record.bytes().filter(|b| *b == b'"').count() % 2 == 0
}

/// Splits records into values; its memory is kept from one to the next.
struct Splitter {
    reader: Reader,
    text: Vec<u8>,
    ends: Vec<usize>,
    count: usize,
}

impl Splitter {
    fn new() -> Self {
        Splitter {
            // Its default is not ready to read.
            reader: Reader::new(),
            text: Vec::new(),
            ends: Vec::new(),
            count: 0,
        }
    }

    /// Whether the values of a text, whole, are those of one record.
    fn split(&mut self, line: &str) -> bool {
        self.reader.reset();
        // No value is longer than its line, none takes less than a comma.
        self.text.resize(line.len() + 1, 0);
        let commas = line.bytes().filter(|b| *b == b',').count();
        self.ends.resize(commas + 2, 0);
        let mut input = line.as_bytes();
        let (mut written, mut ends) = (0, 0);
        loop {
            let output = self.text.get_mut(written..).unwrap_or_default();
            let places = self.ends.get_mut(ends..).unwrap_or_default();
            let (result, read, wrote, ended) = self.reader.read_record(input, output, places);
            input = input.get(read..).unwrap_or_default();
            written += wrote;
            ends += ended;
            // An empty input tells the reader that the line is at its end.
            if result != ReadRecordResult::InputEmpty {
                break;
            }
        }
        self.count = ends;
        input.is_empty()
    }

    fn count(&self) -> usize {
        self.count
    }

    fn values(&self) -> impl Iterator<Item = &str> {
        let ends = self.ends.iter().take(self.count);
        ends.scan(0, |start, end| {
            let value = self.text.get(*start..*end).unwrap_or_default();
            *start = *end;
            // Pieces of a text that are cut at commas and quotation marks are text.
            Some(std::str::from_utf8(value).unwrap_or_default())
        })
    }
}
