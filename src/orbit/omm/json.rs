//! Objects with the keywords of the OMM: one, an array of them, or one after the other. Values are numbers or text.

use super::{Fields, Metadata, index_of};
use crate::bounded_name;
use crate::lines::{self, LineFinder};
use crate::record::{At, Found, Record, shorten};
use crate::two_line::Checksum;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::fmt;

/// Bytes that an object may have; one that is longer is taken as not closed.
const LONGEST: usize = 1 << 16;

/// Whether a text that begins with a bracket is JSON: objects stand in it, or nothing. A table of TOML has a word there.
pub(crate) fn begins(text: &str) -> bool {
    let text = text.get(lines::start(text)..).unwrap_or_default();
    let inside = text.trim_start_matches(|c: char| c == '[' || c.is_whitespace());
    inside.is_empty() || inside.starts_with(['{', ']'])
}

/// Whether a line of a text in another format begins JSON: a key follows the first brace, which no name has.
pub(crate) fn begins_object(text: &str) -> bool {
    let inside = text.trim_start_matches(|c: char| c == '[' || c.is_whitespace());
    let inside = inside.strip_prefix('{').map(str::trim_start);
    inside.is_some_and(|inside| inside.starts_with(['"', '}']))
}

/// Reads every object. These are flat: one ends at the first closing brace, and where another opens before, it is not closed.
pub(crate) fn read(text: &str, found: &mut Found) {
    let mut finder = LineFinder::new(text);
    let first = lines::start(text);
    let mut at = first;
    // The text behind an object that is not closed belongs to it.
    let mut torn = false;
    while let Some(start) = text.get(at..).and_then(|rest| rest.find('{')) {
        let start = at + start;
        if !torn {
            between(
                text.get(at..start).unwrap_or_default(),
                at,
                &mut finder,
                found,
            );
        }
        let line = finder.line(start);
        let end = closed(text.as_bytes(), start);
        torn = end.is_none();
        at = end.unwrap_or(start + 1);
        if torn {
            let reason = "a JSON object that is not closed, or has others inside; restore its quotation marks and braces";
            found.take(Err((line, reason.to_owned())));
        } else {
            let object = text.get(start..at).unwrap_or_default();
            found.take(record(object, start, &mut finder).map(|r| Record { line, ..r }));
        }
    }
    let rest = text.get(at..).unwrap_or_default();
    if !torn {
        between(rest, at, &mut finder, found);
        let array = text.get(first..).is_some_and(|text| text.starts_with('['));
        if array && !rest.contains(']') {
            let line = finder.line(text.trim_end().len());
            found.reject(
                line,
                "the array is not closed: the file is cut off".to_owned(),
            );
        }
    }
}

/// Rejects text between objects, such as an object without its opening brace.
fn between(gap: &str, at: usize, finder: &mut LineFinder, found: &mut Found) {
    let foreign = |c: char| !c.is_whitespace() && !matches!(c, ',' | '[' | ']' | '\u{feff}');
    if let Some(offset) = gap.find(foreign) {
        let text = shorten(gap.get(offset..).unwrap_or_default());
        let line = finder.line(at + offset);
        let reason = format!(
            "'{text}' is outside of every JSON object: restore the object, or split the file at line {line}"
        );
        found.reject(line, reason);
    }
}

/// The end of the object that opens at `start`; nothing if it has none of its own.
fn closed(text: &[u8], start: usize) -> Option<usize> {
    let mut quoted = false;
    let mut escaped = false;
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

/// Keys of the lines of an element set, and of its name, in any case of letters.
const LINES: [[&str; 3]; 2] = [
    ["line1", "tle_line1", "tle1"],
    ["line2", "tle_line2", "tle2"],
];
const NAMES: [&str; 4] = ["object_name", "name", "tle_line0", "satname"];

/// Whether an object's key is that of a line of an element set.
pub(crate) fn is_element_line(key: &str) -> bool {
    LINES
        .as_flattened()
        .iter()
        .any(|known| key.eq_ignore_ascii_case(known))
}

/// The record of an object without elements in keywords, but with the two lines of an element set.
fn of_lines(object: &str) -> Option<Result<Record, String>> {
    let pairs: Map<String, Value> = serde_json::from_str(object).ok()?;
    let text = |keys: &[&str]| {
        let mut pairs = pairs.iter();
        let is_key = |key: &str| keys.iter().any(|known| key.eq_ignore_ascii_case(known));
        pairs
            .find(|(key, _)| is_key(key))
            .and_then(|(_, value)| value.as_str())
    };
    let [first, second] = LINES.map(|keys| text(&keys));
    let (first, second) = (first?, second?);
    let record = Record::from_lines(first, second, Checksum::Required);
    let name = text(&NAMES).unwrap_or_default();
    let name = bounded_name(name.strip_prefix("0 ").unwrap_or(name));
    Some(
        record
            .map(|record| Record { name, ..record })
            .map_err(|error| error.to_string()),
    )
}

/// The record of an object that starts at an offset of the text.
fn record(object: &str, start: usize, finder: &mut LineFinder) -> At<Record> {
    let values: Values = serde_json::from_str(object).map_err(|error| {
        let line = finder.line(start) + error.line().saturating_sub(1);
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        (line, format!("not JSON: {reason}"))
    })?;
    let mut fields = Fields::default();
    for (index, raw) in values.0 {
        let offset = raw.get().as_ptr().addr() - object.as_ptr().addr();
        match raw.get() {
            "null" => {}
            text if text.starts_with('"') => {
                let value = serde_json::from_str::<Text>(text).map(|text| text.0);
                fields.set(index, value.unwrap_or_default(), start + offset);
            }
            number => fields.set(index, Cow::Borrowed(number), start + offset),
        }
    }
    if !fields.has_elements()
        && let Some(record) = of_lines(object)
    {
        return record.map_err(|reason| (finder.line(start), reason));
    }
    let record = fields.record(start, Metadata::Understood);
    record.map_err(|(offset, reason)| (finder.line(offset), reason))
}

/// The values of the keywords that are read, by index.
struct Values<'a>(Vec<(usize, &'a RawValue)>);

/// A text, borrowed where it has no escapes.
#[derive(serde::Deserialize)]
struct Text<'a>(#[serde(borrow)] Cow<'a, str>);

impl<'de> Deserialize<'de> for Values<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Keywords)
    }
}

struct Keywords;

impl<'de> Visitor<'de> for Keywords {
    type Value = Values<'de>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::with_capacity(super::KEYWORDS.len());
        while let Some(Text(key)) = map.next_key()? {
            match index_of(&key) {
                Some(index) => values.push((index, map.next_value()?)),
                None => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(Values(values))
    }
}
