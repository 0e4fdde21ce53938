//! OMM in keyword = value notation: messages one after the other.

use super::{Fields, Metadata, index_of, unit_of};
use crate::lines;
use crate::record::{Found, check_version, shorten};
use std::borrow::Cow;

/// The keyword that every message starts with.
const VERSION: &str = "CCSDS_OMM_VERS";

/// Whether a text whose first line is this one is an OMM. Some files leave the version out.
pub(crate) fn begins(line: &str) -> bool {
    let keyword = line.split_once('=').map(|(keyword, _)| keyword.trim());
    keyword.is_some_and(|keyword| {
        let header = [VERSION, "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID"];
        header.contains(&keyword) || index_of(keyword).is_some()
    })
}

/// Reads every message. One begins with its version or, where messages have none, with the keyword that the one before
/// began with, or with any that comes again behind a message that has all it needs.
pub(crate) fn read<'a>(text: &'a str, found: &mut Found) {
    let mut message: Option<Message<'a>> = None;
    for (number, line) in lines::numbered(text) {
        let line = line.trim_start();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if line.split_whitespace().next() == Some("COMMENT") {
            continue;
        }
        let pair = line.split_once('=').map(|(k, v)| (k.trim(), v.trim()));
        let index = pair.and_then(|(keyword, _)| index_of(keyword));
        let version = pair.is_some_and(|(keyword, _)| keyword == VERSION);
        let next = |message: &Message| index.is_some_and(|index| message.ends_before(index));
        if version || message.as_ref().is_some_and(next) {
            finish(message.take(), found);
        }
        let message = message.get_or_insert_with(|| Message {
            line: number,
            version,
            ..Message::default()
        });
        match (pair, index) {
            (Some((_, value)), _) if version => {
                if let Err(reason) = check_version(VERSION, value) {
                    message.fields.refuse(number, reason);
                }
            }
            (Some((_, value)), Some(index)) => {
                message.first.get_or_insert(index);
                // Text may end in brackets of its own.
                let (value, unit) = match unit_of(index) {
                    "" => (value, None),
                    _ => split(value),
                };
                if let Some(unit) = unit {
                    message.fields.unit(index, unit, number);
                }
                message.fields.set(index, Cow::Borrowed(value), number);
            }
            (Some(_), None) => {}
            (None, _) => {
                let reason = format!("'{}' is not KEYWORD = VALUE", shorten(line));
                message.fields.refuse(number, reason);
            }
        }
    }
    finish(message, found);
}

/// A message being read.
#[derive(Default)]
struct Message<'a> {
    line: usize,
    /// Whether it begins with its version, as the standard demands; what follows it then does too.
    version: bool,
    /// The keyword that it begins with, of those that are read.
    first: Option<usize>,
    fields: Fields<'a>,
}

impl Message<'_> {
    /// Whether the keyword with this index belongs to the next message. One that comes again is else there twice.
    fn ends_before(&self, index: usize) -> bool {
        let first = self.first == Some(index);
        let complete = self.fields.are_complete();
        self.fields.has(index)
            && match self.version {
                true => first && complete,
                false => first || complete,
            }
    }
}

fn finish(message: Option<Message>, found: &mut Found) {
    if let Some(message) = message {
        found.take(message.fields.record(message.line, Metadata::Required));
    }
}

/// A value and its unit in brackets behind it: `15.5 [rev/day]`.
fn split(value: &str) -> (&str, Option<&str>) {
    let inside = value.strip_suffix(']').and_then(|v| v.split_once('['));
    match inside {
        Some((number, unit)) => (number.trim_end(), Some(unit)),
        None => (value, None),
    }
}
