//! A table with the keywords of the OMM as its header. A record takes several lines where a quoted
//! value has line breaks (RFC 4180).

use super::{Fields, Key};
use crate::Contents;
use crate::lines::Part;
use csv_core::{ReadRecordResult, Reader};
use std::borrow::Cow;

/// Largest number of lines in a record.
const MAX_LINES: usize = 16;

/// Whether a text with this first line is such a table.
pub(crate) fn begins(line: &str) -> bool {
    let mut names = line.split(',').map(|name| name.trim().trim_matches('"'));
    line.contains(',') && names.any(|name| Key::of(name).is_some())
}

pub(crate) fn read(part: &Part, found: &mut Contents) {
    let mut splitter = Splitter::new();
    let mut lines = part.lines();
    let Some((number, header)) = lines.find(|(_, line)| {
        let line = line.trim_start();
        !line.is_empty() && !line.starts_with('#')
    }) else {
        return;
    };
    splitter.split(header);
    let columns: Vec<_> = splitter.values().map(|name| Key::of(name.trim())).collect();
    for key in [Key::Epoch, Key::MeanMotion] {
        if !columns.contains(&Some(key)) {
            let reason = format!("the header has no column {}", key.keyword());
            return found.reject(number, reason);
        }
    }
    while let Some((number, line)) = lines.next() {
        if line.trim_start().is_empty() {
            continue;
        }
        let split = record(part.text, line, &mut lines, columns.len(), &mut splitter);
        found.take(split.map_err(|reason| (number, reason)).and_then(|()| {
            let mut fields = Fields::new(number, false);
            for (column, value) in columns.iter().zip(splitter.values()) {
                if let Some(key) = column {
                    fields.set(*key, Cow::Borrowed(value), number);
                }
            }
            fields.record()
        }));
    }
}

/// Splits the record that begins with `line`. After an open quotation mark the next lines are added
/// until there is a value for every column. If there never is, only the first line is rejected.
fn record<'a>(
    text: &str,
    line: &str,
    lines: &mut (impl Iterator<Item = (usize, &'a str)> + Clone),
    columns: usize,
    splitter: &mut Splitter,
) -> Result<(), String> {
    if is_closed(line) {
        splitter.split(line);
        return match splitter.count {
            count if count == columns => Ok(()),
            count => Err(format!(
                "{count} values in a line, the header has {columns} columns"
            )),
        };
    }
    let offset = |line: &str| line.as_ptr().addr() - text.as_ptr().addr();
    let mut ahead = lines.clone();
    for _ in 1..MAX_LINES {
        let Some((_, last)) = ahead.next() else { break };
        let record = text.get(offset(line)..offset(last) + last.len());
        if let Some(record) = record.filter(|record| is_closed(record)) {
            if splitter.split(record) && splitter.count == columns {
                *lines = ahead;
                return Ok(());
            }
            break;
        }
    }
    Err("a quotation mark without the other that closes it".to_owned())
}

/// Whether the number of quotation marks is even.
fn is_closed(record: &str) -> bool {
    record.bytes().filter(|b| *b == b'"').count() % 2 == 0
}

/// Splits records into values, with reused buffers.
struct Splitter {
    reader: Reader,
    text: Vec<u8>,
    ends: Vec<usize>,
    /// Count of values in the record.
    count: usize,
}

impl Splitter {
    fn new() -> Self {
        Splitter {
            // `Reader::default()` cannot read.
            reader: Reader::new(),
            text: Vec::new(),
            ends: Vec::new(),
            count: 0,
        }
    }

    /// Whether the whole text is one record.
    fn split(&mut self, line: &str) -> bool {
        self.reader.reset();
        // Upper bounds: no value is longer than its line, and each but the last has a comma.
        self.text.resize(line.len() + 1, 0);
        let commas = line.bytes().filter(|b| *b == b',').count();
        self.ends.resize(commas + 2, 0);
        let mut input = line.as_bytes();
        let mut written = 0;
        self.count = 0;
        loop {
            let output = self.text.get_mut(written..).unwrap_or_default();
            let ends = self.ends.get_mut(self.count..).unwrap_or_default();
            let (result, read, wrote, ended) = self.reader.read_record(input, output, ends);
            input = input.get(read..).unwrap_or_default();
            written += wrote;
            self.count += ended;
            // An empty input marks the end of the line.
            if result != ReadRecordResult::InputEmpty {
                return input.is_empty();
            }
        }
    }

    fn values(&self) -> impl Iterator<Item = &str> {
        let ends = self.ends.iter().take(self.count);
        ends.scan(0, |start, end| {
            let value = self.text.get(*start..*end).unwrap_or_default();
            *start = *end;
            // Text cut at commas and quotation marks stays valid UTF-8.
            Some(std::str::from_utf8(value).unwrap_or_default())
        })
    }
}
