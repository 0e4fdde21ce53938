//! Reads a TOML file and reports all its faults at once, one line each.
//!
//! Parser and checks stop at the first fault. The faulty key is then replaced by that of an example
//! file, or removed, and the file is read again until it is valid. Faults that follow from a
//! replaced key are not reported. At the end all values are compared with their limits, since a
//! fault may have prevented a check.

use super::check::Check;
use super::document::{
    as_entry, each_leaf, key_in, matches, parent, remove_at, rename, set, span_of, value_at,
    within, without_indices, without_spans,
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

/// Largest number of passes over a file.
const MAX_READS: usize = 100;

/// A value and the notices of its checks, one line each.
pub type Noticed<T> = (T, Vec<String>);

/// Parses `text`, the contents of `file`, checks it with `validate`, and logs the notices of a
/// valid file. `example` is a valid file with all required keys; its table `spare` has values of
/// other keys.
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

/// [`read`], but notices are returned instead of logged.
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
        tables_with_unknown_keys: Vec::new(),
    };
    for _ in 0..MAX_READS {
        let check = Check::of(file);
        let raw = Raw::deserialize(Deserializer::from(report.document.clone()));
        let outcome = match raw {
            Ok(raw) => {
                let document = report.document.get_ref();
                // Single keys before rules between them, whose repair would hide other faults.
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
    repaired_key: String,
    span: Range<usize>,
    error: ConfigError,
}

/// The faults of a file so far.
struct Report<'a> {
    file: &'a str,
    text: &'a str,
    original: &'a Spanned<DeTable<'a>>,
    /// The document with its faults repaired.
    document: Spanned<DeTable<'a>>,
    faults: Vec<Fault>,
    /// The keys that were replaced or removed.
    repaired: Vec<String>,
    /// Corrected names of misspelt keys, which the file does not have.
    meant_keys: Vec<String>,
    /// Tables with unknown keys, which may be misspelt forms of missing keys.
    tables_with_unknown_keys: Vec<String>,
}

impl Report<'_> {
    /// The key in the file of a key in the repaired document.
    fn given(&self, key: &str) -> String {
        key_in(self.original.get_ref(), self.document.get_ref(), key)
    }

    /// A fault from a check.
    fn of_check(&self, error: ConfigError) -> Fault {
        let repaired_key = error.key().unwrap_or_default().to_string();
        let span = span_of(self.document.get_ref(), &repaired_key);
        let location = location(self.file, self.text, &span);
        Fault {
            key: self.given(&repaired_key),
            error: error.at(self.file, &location, &|key| self.given(key)),
            repaired_key,
            span,
        }
    }

    /// A fault from the parser.
    fn of_parser(&self, error: &toml::de::Error, schema: &Schema) -> Fault {
        let (repaired_key, span, error) =
            locate(self.file, self.text, &self.document, error, |key| {
                (self.given(key), limits::text_of(schema, key))
            });
        Fault {
            key: self.given(&repaired_key),
            repaired_key,
            span,
            error,
        }
    }

    /// Reports a fault, unless it follows from an earlier one, and repairs the document. False if
    /// no more faults can be found.
    fn take(&mut self, fault: Fault, example: &DeTable<'static>, schema: &Schema) -> bool {
        let Fault {
            key,
            repaired_key,
            span,
            error,
        } = &fault;
        // No value is valid for an unknown key.
        let is_value = error.is_of_value();
        let unknown = error.unknown_key().map(|_| (key.clone(), span.clone()));
        let mut meant_keys = self.meant_keys.iter();
        let is_guess = !is_value && meant_keys.any(|meant| meant == without_indices(key));
        let repaired_key = repaired_key.clone();
        if !is_guess && !self.follows(key, error) {
            let renamed = error.meant().is_some_and(|meant| {
                let (table, _) = repaired_key.rsplit_once('.').unwrap_or_default();
                let new = format!("{table}.{meant}");
                self.meant_keys
                    .push(new.trim_start_matches('.').to_string());
                // The value of a misspelt key is checked as well.
                rename(self.document.get_mut(), &repaired_key, meant)
            });
            if !renamed && unknown.is_some() {
                self.tables_with_unknown_keys.push(parent(key).to_string());
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
        self.repair(repaired_key, is_value, example, schema)
    }

    /// Whether a fault of `key` follows from a repair or from an unknown key. An unknown key may be
    /// a misspelt form of a key that its table lacks or that a rule needs.
    fn follows(&self, key: &str, error: &ConfigError) -> bool {
        let is_misread = |need: &String| {
            let is_missing = value_at(self.original.get_ref(), need, false).is_none();
            is_missing
                && self
                    .tables_with_unknown_keys
                    .iter()
                    .any(|table| table == parent(need))
        };
        let needs = match error {
            ConfigError::Rule { needs, .. } => needs.as_slice(),
            _ => &[],
        };
        let is_of_misread = !key.is_empty()
            && self
                .tables_with_unknown_keys
                .iter()
                .any(|table| table == key);
        let lacks_more = is_of_misread && !error.is_of_value();
        // A fault that names a guessed key follows from the guess: the file lacks that key.
        let message = error.to_string();
        let names_a_guess = |meant: &String| {
            meant.contains('.') && !within(key, meant) && message.contains(meant.as_str())
        };
        lacks_more
            || self.meant_keys.iter().any(names_a_guess)
            || needs.iter().any(is_misread)
            || (self.repaired.iter()).any(|done| follows_from(key, error, done))
    }

    /// Replaces the key, or the innermost table or list around it that has not been replaced. False
    /// if there is none.
    fn repair(
        &mut self,
        key: String,
        is_value: bool,
        example: &DeTable<'static>,
        schema: &Schema,
    ) -> bool {
        // A replacement that is itself faulty is replaced as a whole.
        let given = self.given(&key);
        let around = |done: &&String| *done != &given && within(&given, done);
        let around = self.repaired.iter().find(around);
        let mut key = around.cloned().unwrap_or(key);
        let value = loop {
            let value = self.replacement(&key, is_value, example, schema);
            let is_missing = value_at(self.document.get_ref(), &key, false).is_none();
            let is_lost = is_missing && as_entry(&key).is_some();
            // A removed key may be required.
            let is_needed = is_missing && value.is_some();
            if !is_lost && (is_needed || !self.repaired.contains(&self.given(&key))) {
                break value;
            }
            key = parent(&key).to_string();
        };
        if key.is_empty() {
            return false;
        }
        let given = self.given(&key);
        self.repaired.push(given);
        set(self.document.get_mut(), &key, value)
    }

    /// The replacement of a faulty key. A number in a list becomes 0, as the list may have a fixed
    /// length. A key, or the only entry of a list, gets the value in the example. If the value is
    /// faulty (`is_value`) or missing, it may come from the table `spare`. The rest is removed.
    fn replacement(
        &self,
        key: &str,
        is_value: bool,
        example: &DeTable<'static>,
        schema: &Schema,
    ) -> Option<DeValue<'static>> {
        let document = self.document.get_ref();
        if let Some((list, _)) = as_entry(key) {
            if limits::is_number(schema, key) {
                return Some(DeValue::Integer(DeInteger::default()));
            }
            let list = value_at(document, list, false)?.get_ref().as_array()?;
            if list.len() > 1 {
                return None;
            }
        }
        let is_missing = value_at(document, key, false).is_none();
        let spare = || {
            let spare = value_at(example, &format!("spare.{key}"), true);
            spare.filter(|_| is_value || is_missing)
        };
        let value = value_at(example, key, true).or_else(spare)?;
        Some(without_spans(value.get_ref()))
    }

    /// Adds unreported values beyond their limits.
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
                let location = location(self.file, self.text, &span);
                found.push(Fault {
                    repaired_key: key.clone(),
                    key,
                    error: error.at(self.file, &location, &str::to_string),
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

/// The error of a number or a word that is not allowed for its key.
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

/// Whether a fault of `key` follows from the replacement of `done`. Then `key` lies within `done`
/// or is the list around it, or a rule needs `done`, or the message names `done`.
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
    // Without the location, since a file name may have any words.
    let message = message.split_once(": ").map_or("", |(_, message)| message);
    let names = |name: &str| {
        let mut words = message.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.any(|word| word == name)
    };
    let is_of_list = (done.strip_prefix(key)).is_some_and(|rest| rest.starts_with('['));
    let around = done.rsplit_once('.');
    let misses = around.is_some_and(|(table, name)| table == key && names(without_indices(name)));
    within(key, done) || is_of_list || misses || (done.contains('.') && message.contains(done))
}

/// File, line and column of a span.
fn location(file: &str, text: &str, span: &Range<usize>) -> String {
    if span.end == 0 {
        return file.to_string();
    }
    let (line, column) = position(text, span.start);
    format!("{file}:{line}:{column}")
}
