//! OMM in keyword = value notation: messages one after the other.

use super::{Fields, Key, Metadata, index_of};
use crate::lines;
use crate::record::{Found, shorten};
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

/// Reads every message. One begins with its version, or where a keyword comes again.
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
        let again = |message: &Message| index.is_some_and(|index| message.fields.has(index));
        let starts = pair.is_some_and(|(keyword, _)| keyword == VERSION);
        if starts || message.as_ref().is_some_and(again) {
            finish(message.take(), found);
        }
        let message = message.get_or_insert_with(|| Message::new(number));
        match (pair, index) {
            (Some((_, value)), Some(index)) => {
                // Names may end in brackets of their own.
                let text = index == Key::Name as usize || index == Key::Designator as usize;
                let value = if text { value } else { bare(value) };
                message.fields.set(index, Cow::Borrowed(value), number);
            }
            (Some(_), None) => {}
            (None, _) => {
                let reason = format!("'{}' is not KEYWORD = VALUE", shorten(line));
                message.broken.get_or_insert((number, reason));
            }
        }
    }
    finish(message, found);
}

/// A message being read.
struct Message<'a> {
    line: usize,
    fields: Fields<'a>,
    /// The first line that cannot be read.
    broken: Option<(usize, String)>,
}

impl Message<'_> {
    fn new(line: usize) -> Self {
        Message {
            line,
            fields: Fields::default(),
            broken: None,
        }
    }
}

fn finish(message: Option<Message>, found: &mut Found) {
    let record = message.map(|message| match message.broken {
        Some(broken) => Err(broken),
        None => message.fields.record(message.line, Metadata::Required),
    });
    if let Some(record) = record {
        found.take(record);
    }
}

/// A value without its unit, which stands in brackets: `15.5 [rev/day]`.
fn bare(value: &str) -> &str {
    match value.strip_suffix(']').and_then(|v| v.rfind('[')) {
        Some(at) => value[..at].trim_end(),
        _ => value,
    }
}
