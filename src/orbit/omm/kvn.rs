//! OMM in keyword = value notation: a sequence of messages.

use super::{Fields, Key};
use crate::lines::Part;
use crate::record::{check_version, shorten};
use crate::{Contents, lines};
use std::borrow::Cow;

const VERSION: &str = "CCSDS_OMM_VERS";

/// Whether a text with this first line is an OMM. Some files lack the version.
pub(crate) fn begins(line: &str) -> bool {
    let header = [VERSION, "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID"];
    let keyword = line.split_once('=').map(|(keyword, _)| keyword.trim());
    keyword.is_some_and(|keyword| header.contains(&keyword) || Key::of(keyword).is_some())
}

/// Reads every message. A message begins with its version. Where versions are missing, it begins
/// with the first key of the message before, or with any repeated key after a complete message.
pub(crate) fn read(part: &Part, found: &mut Contents) {
    let mut message: Option<Message> = None;
    for (number, line) in part.lines() {
        let line = line.trim_start();
        if lines::is_comment(line) {
            continue;
        }
        let pair = line.split_once('=').map(|(k, v)| (k.trim(), v.trim()));
        let key = pair.and_then(|(keyword, _)| Key::of(keyword));
        let version = pair.filter(|(keyword, _)| *keyword == VERSION);
        let next = |message: &Message| key.is_some_and(|key| message.ends_before(key));
        if version.is_some() || message.as_ref().is_some_and(next) {
            finish(message.take(), found);
        }
        let message = message.get_or_insert_with(|| Message {
            has_version: version.is_some(),
            first: None,
            fields: Fields::new(number, true),
        });
        match (version, pair, key) {
            (Some((_, value)), ..) => {
                if let Err(reason) = check_version(VERSION, value) {
                    message.fields.refuse(number, reason);
                }
            }
            (_, Some((_, value)), Some(key)) => message.set(key, value, number),
            (_, Some(_), None) => {}
            (_, None, _) => {
                let reason = format!("'{}' is not KEYWORD = VALUE", shorten(line));
                message.fields.refuse(number, reason);
            }
        }
    }
    finish(message, found);
}

struct Message<'a> {
    /// Whether it begins with its version, as the standard requires; the next one then does too.
    has_version: bool,
    /// First key of the message.
    first: Option<Key>,
    fields: Fields<'a>,
}

impl<'a> Message<'a> {
    /// Whether a key belongs to the next message. A repeated key within a message is an error.
    fn ends_before(&self, key: Key) -> bool {
        let is_first = self.first == Some(key);
        let is_complete = self.fields.are_complete();
        self.fields.has(key)
            && if self.has_version {
                is_first && is_complete
            } else {
                is_first || is_complete
            }
    }

    /// Sets a value, and checks a unit in brackets after it: `15.5 [rev/day]`.
    fn set(&mut self, key: Key, value: &'a str, line: usize) {
        self.first.get_or_insert(key);
        // Text values may end in brackets.
        let bracketed = value.strip_suffix(']').filter(|_| !key.unit().is_empty());
        let value = match bracketed.and_then(|value| value.split_once('[')) {
            Some((number, unit)) => {
                self.fields.check_unit(key, unit, line);
                number.trim_end()
            }
            None => value,
        };
        self.fields.set(key, Cow::Borrowed(value), line);
    }
}

fn finish(message: Option<Message>, found: &mut Contents) {
    if let Some(message) = message {
        found.take(message.fields.record());
    }
}
