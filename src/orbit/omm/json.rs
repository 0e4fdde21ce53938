//! JSON objects with the keywords of the OMM: one, an array, or a sequence. Values are numbers or
//! text.

use super::{Fields, KEYWORDS, Key};
use crate::lines::{self, LineFinder, Part};
use crate::record::{At, Record, shorten};
use crate::two_line::Checksum;
use crate::{Contents, bounded_name};
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::fmt;

/// Largest object, bytes; a longer one counts as not closed.
const LONGEST: usize = 1 << 16;

/// Whether a text that begins with a bracket is JSON with objects, or empty. A TOML table has a
/// word after its bracket.
pub(crate) fn begins(text: &str) -> bool {
    let text = text.get(lines::start(text)..).unwrap_or_default();
    let inside = text.trim_start_matches(|c: char| c == '[' || c.is_whitespace());
    inside.is_empty() || inside.starts_with(['{', ']'])
}

/// Whether a line in another format begins a JSON object: a key follows its first brace. No
/// satellite's name begins like that.
pub(crate) fn begins_object(text: &str) -> bool {
    let inside = text.trim_start_matches(|c: char| c == '[' || c.is_whitespace());
    let inside = inside.strip_prefix('{').map(str::trim_start);
    inside.is_some_and(|inside| inside.starts_with(['"', '}']))
}

/// Reads every object. Objects are flat: one ends at the first closing brace. It counts as not
/// closed where another opens before that.
pub(crate) fn read(part: &Part, found: &mut Contents) {
    let (text, mut finder) = (part.text, part.finder());
    let first = lines::start(text);
    let mut at = first;
    // Text after an unclosed object belongs to it.
    let mut torn = false;
    while let Some(gap) = text.get(at..).and_then(|rest| rest.split('{').next()) {
        let start = at + gap.len();
        if !torn {
            reject_between(gap, at, &mut finder, found);
        }
        if start == text.len() {
            break;
        }
        let line = finder.line(start);
        let end = closed(text.as_bytes(), start);
        torn = end.is_none();
        at = end.unwrap_or(start + 1);
        found.take(match end {
            Some(end) => {
                let object = text.get(start..end).unwrap_or_default();
                record(object, start, &mut finder).map(|record| Record { line, ..record })
            }
            None => {
                let reason = "a JSON object that is not closed, or has others inside; restore its \
                              quotation marks and braces";
                Err((line, reason.to_owned()))
            }
        });
    }
    let is_array = text.get(first..).is_some_and(|text| text.starts_with('['));
    let is_closed = text.get(at..).is_some_and(|rest| rest.contains(']'));
    if is_array && !is_closed && !torn {
        let line = finder.line(text.trim_end().len());
        found.reject(line, "the array is not closed: the file is cut off");
    }
}

/// Rejects text between objects, such as an object without its opening brace.
fn reject_between(gap: &str, at: usize, finder: &mut LineFinder, found: &mut Contents) {
    let foreign = |c: char| !c.is_whitespace() && !matches!(c, ',' | '[' | ']' | '\u{feff}');
    if let Some(offset) = gap.find(foreign) {
        let text = shorten(gap.get(offset..).unwrap_or_default());
        let line = finder.line(at + offset);
        let reason = format!(
            "'{text}' is outside of every JSON object: restore the object, or split the file at \
             line {line}"
        );
        found.reject(line, reason);
    }
}

/// The end of the object that opens at `start`, or none where it is not closed.
fn closed(text: &[u8], start: usize) -> Option<usize> {
    let (mut quoted, mut escaped) = (false, false);
    for (i, byte) in text.iter().enumerate().skip(start + 1).take(LONGEST) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = quoted,
            b'"' => quoted = !quoted,
            b'{' if !quoted => return None,
            b'}' if !quoted => return Some(i + 1),
            b'\n' | b'\r' if quoted => return None,
            _ => {}
        }
    }
    None
}

/// Keys of the two lines of an element set, and of its name; case is ignored.
const FIRST_LINE: [&str; 3] = ["line1", "tle_line1", "tle1"];
const SECOND_LINE: [&str; 3] = ["line2", "tle_line2", "tle2"];
const NAMES: [&str; 4] = ["object_name", "name", "tle_line0", "satname"];

fn is_one_of(key: &str, keys: &[&str]) -> bool {
    keys.iter().any(|known| key.eq_ignore_ascii_case(known))
}

/// Whether a key is that of a line of an element set.
pub(crate) fn is_element_line(key: &str) -> bool {
    is_one_of(key, &FIRST_LINE) || is_one_of(key, &SECOND_LINE)
}

/// The record of an object with the two lines of an element set in place of keywords.
fn of_lines(object: &str) -> Option<Result<Record, String>> {
    let pairs: Map<String, Value> = serde_json::from_str(object).ok()?;
    let text = |keys: &[&str]| {
        let (_, value) = pairs.iter().find(|(key, _)| is_one_of(key, keys))?;
        value.as_str()
    };
    let record = Record::from_lines(text(&FIRST_LINE)?, text(&SECOND_LINE)?, Checksum::Required);
    let name = text(&NAMES).unwrap_or_default();
    let name = bounded_name(name.strip_prefix("0 ").unwrap_or(name));
    let record = record.map(|record| Record { name, ..record });
    Some(record.map_err(|error| error.to_string()))
}

/// The record of an object that starts at this offset of the text.
fn record(object: &str, start: usize, finder: &mut LineFinder) -> At<Record> {
    let mut reader = serde_json::Deserializer::from_str(object);
    let values = reader.deserialize_map(Keywords).map_err(|error| {
        let line = finder.line(start) + error.line().saturating_sub(1);
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        (line, format!("not JSON: {reason}"))
    })?;
    let mut fields = Fields::new(start, false);
    for (key, raw) in values {
        let offset = start + raw.get().as_ptr().addr() - object.as_ptr().addr();
        match raw.get() {
            "null" => {}
            text if text.starts_with('"') => {
                let value = serde_json::from_str::<Text>(text).map(|text| text.0);
                fields.set(key, value.unwrap_or_default(), offset);
            }
            number => fields.set(key, Cow::Borrowed(number), offset),
        }
    }
    let of_lines = if fields.has_any_element() {
        None
    } else {
        of_lines(object).map(|record| record.map_err(|reason| (start, reason)))
    };
    let record = of_lines.unwrap_or_else(|| fields.record());
    record.map_err(|(offset, reason)| (finder.line(offset), reason))
}

/// A text, borrowed where it has no escapes.
#[derive(serde::Deserialize)]
struct Text<'a>(#[serde(borrow)] Cow<'a, str>);

struct Keywords;

impl<'de> Visitor<'de> for Keywords {
    type Value = Vec<(Key, &'de RawValue)>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::with_capacity(KEYWORDS.len());
        while let Some(Text(keyword)) = map.next_key()? {
            match Key::of(&keyword) {
                Some(key) => values.push((key, map.next_value()?)),
                None => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(values)
    }
}
