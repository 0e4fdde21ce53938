//! Reads a TOML file and reports all its faults at once, one line each.
//!
//! Parser and checks stop at the first fault. The faulty key is then replaced by that of an example
//! file, or removed, and the file is read again until it is valid. Faults that follow from a
//! replaced key are not reported. At last all values are compared with their limits, since a check
//! may have been skipped after another fault.

use super::check::Check;
use super::document::{
    as_entry, each_leaf, key_in, matches, parent, placeless, remove_at, rename, set, span_of,
    value_at, within, without_indices,
};
use super::error::{ConfigError, MAX_FAULTS};
use super::limits::{self, Allowed, Limit};
use super::rules;
use super::schema::schema_of;
use super::syntax::{locate, not_toml, position};
use super::words::one_of;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::cell::LazyCell;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue, Deserializer, ValueDeserializer};

/// Largest number of times that a file is read.
const MAX_READS: usize = 100;

/// A value and the notices of its checks, one line each.
pub type Noticed<T> = (T, Vec<String>);

/// Parses `text`, the contents of `file`, checks it with `validate`, and logs notices of a valid
/// file. `example` is a valid file with all required keys, and in its table `spare` values of
/// others.
pub fn read<Raw: DeserializeOwned + JsonSchema, T>(
    file: &str,
    text: &str,
    example: &'static str,
    limits: &[&[Limit]],
    validate: impl FnMut(Raw, &Check) -> Result<T, ConfigError>,
) -> Result<T, ConfigError> {
    let (value, notices) = read_noticed(file, text, example, limits, validate)?;
    for notice in notices {
        tracing::warn!("{notice}");
    }
    Ok(value)
}

/// The same; notices are returned instead of logged.
pub fn read_noticed<Raw: DeserializeOwned + JsonSchema, T>(
    file: &str,
    text: &str,
    example: &'static str,
    limits: &[&[Limit]],
    mut validate: impl FnMut(Raw, &Check) -> Result<T, ConfigError>,
) -> Result<Noticed<T>, ConfigError> {
    let original = DeTable::parse(text).map_err(|error| not_toml(file, text, &error))?;
    let example = DeTable::parse(example).map_err(|error| not_toml("example", example, &error))?;
    let schema = LazyCell::new(|| schema_of::<Raw>("", limits));
    let mut report = Report {
        file,
        text,
        original: &original,
        document: original.clone(),
        faults: Vec::new(),
        repaired: Vec::new(),
        meant_keys: Vec::new(),
        misread: Vec::new(),
    };
    for _ in 0..MAX_READS {
        let check = Check::of(file);
        let raw = Raw::deserialize(Deserializer::from(report.document.clone()));
        let outcome = match raw {
            Ok(raw) => {
                let document = report.document.get_ref();
                // Keys by themselves before rules between them, whose repair would hide other faults.
                rules::keys_of_kinds(document, limits, &check)
                    .and_then(|()| validate(raw, &check))
                    .and_then(|value| rules::between_keys(document, limits, &check).map(|()| value))
                    .map_err(|error| report.of_check(error))
            }
            Err(error) => Err(report.of_parser(&error, &schema)),
        };
        match outcome {
            Ok(value) if report.faults.is_empty() => {
                return Ok((value, check.notices.into_inner()));
            }
            Ok(_) => break,
            Err(fault) => {
                if !report.take(fault, example.get_ref(), &schema) {
                    break;
                }
            }
        }
    }
    report.compare_with(limits);
    Err(report.into_error())
}

/// A fault of a key.
struct Fault {
    /// The key in the file.
    key: String,
    /// The key in the repaired document.
    place: String,
    span: Range<usize>,
    error: ConfigError,
}

/// The faults of a file so far.
struct Report<'a> {
    file: &'a str,
    text: &'a str,
    original: &'a Spanned<DeTable<'a>>,
    /// The same without its faults.
    document: Spanned<DeTable<'a>>,
    faults: Vec<Fault>,
    /// The keys that were replaced or removed.
    repaired: Vec<String>,
    /// Names that misspelt keys got: the file does not have them.
    meant_keys: Vec<String>,
    /// Tables with keys that are unknown: keys that they lack may be meant.
    misread: Vec<String>,
}

impl Report<'_> {
    /// A key of the repaired document as the file has it.
    fn given(&self, place: &str) -> String {
        key_in(self.original.get_ref(), self.document.get_ref(), place)
    }

    /// A fault that a check found.
    fn of_check(&self, error: ConfigError) -> Fault {
        let place = error.key().unwrap_or_default().to_string();
        let span = span_of(self.document.get_ref(), &place);
        let shown = shown(self.file, self.text, &span);
        Fault {
            key: self.given(&place),
            error: error.at(self.file, &shown, &|key| self.given(key)),
            place,
            span,
        }
    }

    /// A fault that the parser found.
    fn of_parser(&self, error: &toml::de::Error, schema: &Schema) -> Fault {
        let (place, span, error) = locate(self.file, self.text, &self.document, error, |key| {
            (self.given(key), limits::text_of(schema, key))
        });
        Fault {
            key: self.given(&place),
            place,
            span,
            error,
        }
    }

    /// Reports a fault, unless it follows from an earlier one, and repairs the document; false if nothing more can be found.
    fn take(&mut self, fault: Fault, example: &DeTable<'static>, schema: &Schema) -> bool {
        let Fault {
            key,
            place,
            span,
            error,
        } = &fault;
        // No value is right for a key that does not belong here.
        let is_value = error.is_of_value();
        let unknown = error.unknown_key().map(|_| (key.clone(), span.clone()));
        let mut meant_keys = self.meant_keys.iter();
        let is_guess = !is_value && meant_keys.any(|meant| meant == without_indices(key));
        let place = place.clone();
        if !is_guess && !self.follows(key, error) {
            let renamed = error.meant().is_some_and(|meant| {
                let (table, _) = place.rsplit_once('.').unwrap_or_default();
                let new = format!("{table}.{meant}");
                self.meant_keys
                    .push(new.trim_start_matches('.').to_string());
                // The value of a misspelt key is checked as well.
                rename(self.document.get_mut(), &place, meant)
            });
            if !renamed && unknown.is_some() {
                self.misread.push(parent(key).to_string());
            }
            self.faults.push(fault);
            if self.faults.len() == MAX_FAULTS {
                return false;
            }
            if renamed {
                return true;
            }
        }
        if let Some((key, span)) = unknown
            && remove_at(self.document.get_mut(), &span)
        {
            self.repaired.push(key);
            return true;
        }
        self.repair(place, is_value, example, schema)
    }

    /// Whether a fault of `key` follows from a repair, is of a table with an unknown key, which may
    /// be the one that it lacks, or of a rule that needs a key that such a table lacks.
    fn follows(&self, key: &str, error: &ConfigError) -> bool {
        let is_misread = |need: &String| {
            let is_missing = value_at(self.original.get_ref(), need, false).is_none();
            is_missing && self.misread.iter().any(|table| table == parent(need))
        };
        let needs = match error {
            ConfigError::Rule { needs, .. } => needs.as_slice(),
            _ => &[],
        };
        let is_of_misread = !key.is_empty() && self.misread.iter().any(|table| table == key);
        let lacks_more = is_of_misread && !error.is_of_value();
        // The file has no value of a key that was only guessed.
        let message = error.to_string();
        let speaks_of_guess = |meant: &String| {
            meant.contains('.') && !within(key, meant) && message.contains(meant.as_str())
        };
        lacks_more
            || self.meant_keys.iter().any(speaks_of_guess)
            || needs.iter().any(is_misread)
            || (self.repaired.iter()).any(|done| follows_from(key, error, done))
    }

    /// Replaces the key, or the first table or list around it that has not been replaced before; false if there is none.
    fn repair(
        &mut self,
        place: String,
        is_value: bool,
        example: &DeTable<'static>,
        schema: &Schema,
    ) -> bool {
        // Of a replacement that is no good itself all is replaced.
        let key = self.given(&place);
        let around = |done: &&String| *done != &key && within(&key, done);
        let around = self.repaired.iter().find(around);
        let mut place = around.cloned().unwrap_or(place);
        let value = loop {
            let value = self.replacement(&place, is_value, example, schema);
            let is_missing = value_at(self.document.get_ref(), &place, false).is_none();
            let is_lost = is_missing && as_entry(&place).is_some();
            // A key that was removed may be needed.
            let is_needed = is_missing && value.is_some();
            if !is_lost && (is_needed || !self.repaired.contains(&self.given(&place))) {
                break value;
            }
            place = parent(&place).to_string();
        };
        if place.is_empty() {
            return false;
        }
        let key = self.given(&place);
        self.repaired.push(key);
        set(self.document.get_mut(), &place, value)
    }

    /// The replacement of a faulty key: 0 for a number in a list, which may need its length; for a
    /// key, or the only entry of a list, the value in the example, or in its table `spare` where
    /// the value is wrong (`is_value`) or missing. Anything else is removed.
    fn replacement(
        &self,
        place: &str,
        is_value: bool,
        example: &DeTable<'static>,
        schema: &Schema,
    ) -> Option<DeValue<'static>> {
        let document = self.document.get_ref();
        if let Some((list, _)) = as_entry(place) {
            if limits::is_number(schema, place) {
                return Some(DeValue::Integer(DeInteger::default()));
            }
            let list = value_at(document, list, false)?.get_ref().as_array()?;
            if list.len() > 1 {
                return None;
            }
        }
        let is_missing = value_at(document, place, false).is_none();
        let spare = || {
            let spare = value_at(example, &format!("spare.{place}"), true);
            spare.filter(|_| is_value || is_missing)
        };
        let value = value_at(example, place, true).or_else(spare)?;
        Some(placeless(value.get_ref()))
    }

    /// Adds unreported values that are out of their limits.
    fn compare_with(&mut self, limits: &[&[Limit]]) {
        let check = Check::of(self.file);
        let mut found = Vec::new();
        let mut compare = |key: &str, value: &Spanned<DeValue<'_>>| {
            let reported = self.faults.iter().any(|fault| {
                let same_key = without_indices(&fault.key) == without_indices(key);
                same_key && (within(key, &fault.key) || within(&fault.key, key))
            });
            let error = limits
                .iter()
                .find_map(|limits| beyond(limits, key, value, &check));
            if let Some(error) = error.filter(|_| !reported) {
                let (key, span) = (key.to_string(), value.span());
                let shown = shown(self.file, self.text, &span);
                found.push(Fault {
                    place: key.clone(),
                    key,
                    error: error.at(self.file, &shown, &str::to_string),
                    span,
                });
            }
        };
        for (name, value) in self.original.get_ref() {
            each_leaf(name.get_ref(), value, &mut compare);
        }
        self.faults.extend(found);
        self.faults.truncate(MAX_FAULTS);
    }

    fn into_error(self) -> ConfigError {
        let mut faults = self.faults;
        faults.sort_by_key(|fault| fault.span.start);
        let mut faults: Vec<ConfigError> = faults.into_iter().map(|fault| fault.error).collect();
        match faults.len() {
            1 => faults.remove(0),
            _ => ConfigError::Several {
                file: self.file.to_string(),
                faults,
            },
        }
    }
}

/// The error of a number or a word beyond the limit of its key.
fn beyond(
    limits: &[Limit],
    key: &str,
    value: &Spanned<DeValue<'_>>,
    check: &Check,
) -> Option<ConfigError> {
    if let Some(range) = limits::range_of(limits, key) {
        let number = f64::deserialize(ValueDeserializer::from(value.clone())).ok()?;
        return check.range(key, number, range).err();
    }
    let word = value.get_ref().as_str()?;
    limits.iter().find_map(|(pattern, allowed)| match allowed {
        Allowed::Word(words) if matches(pattern, key) => {
            let words = words();
            let refused = || check.refuse(key, format!("{word:?}"), one_of(&words));
            (!words.contains(&word)).then(refused)
        }
        _ => None,
    })
}

/// Whether a fault of `key` follows from the replacement of `done`: it lies within, is of the list
/// that holds it, or of a rule that needs it or whose message names it.
fn follows_from(key: &str, error: &ConfigError, done: &str) -> bool {
    let is_of = |need: &String| within(need, done) || within(done, need);
    if let ConfigError::Rule { needs, .. } = error
        && needs.iter().any(is_of)
    {
        return true;
    }
    let message = match error {
        ConfigError::Syntax { .. } => String::new(),
        other => other.to_string(),
    };
    // Behind the place, which may have any words.
    let message = message.split_once(": ").map_or("", |(_, message)| message);
    let speaks_of = |name: &str| {
        let mut words = message.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.any(|word| word == name)
    };
    let is_of_list = (done.strip_prefix(key)).is_some_and(|rest| rest.starts_with('['));
    let around = done.rsplit_once('.');
    let misses =
        around.is_some_and(|(table, name)| table == key && speaks_of(without_indices(name)));
    within(key, done) || is_of_list || misses || (done.contains('.') && message.contains(done))
}

/// File, line and column of a span.
fn shown(file: &str, text: &str, span: &Range<usize>) -> String {
    if span.end == 0 {
        return file.to_string();
    }
    let (line, column) = position(text, span.start);
    format!("{file}:{line}:{column}")
}
