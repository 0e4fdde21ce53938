//! Reads a TOML file and reports everything that is wrong with it at once, a line for each fault.
//!
//! Parser and checks stop at the first fault. Here each faulty key is then replaced by that of an example file, or removed where the example
//! has none, and the file is read again until it is valid. Faults that only follow from a replaced key are not reported.

use super::syntax::{locate, not_toml, position};
use super::{Check, ConfigError, Limit};
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

/// Faults that are listed at most.
pub(super) const MAX_FAULTS: usize = 30;
/// Times that a file is read at most.
const MAX_READS: usize = 100;

/// A value and what was noticed while it was checked, a line each.
pub(crate) type Noticed<T> = (T, Vec<String>);

/// Parses `text`, the contents of `file`, and checks it with `validate`. `example`: a valid file with all required keys; `limits`: of its
/// keys. What is noticed of a valid file is logged.
pub(crate) fn read<Raw: DeserializeOwned, T>(
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

/// The same; what is noticed is returned instead of logged.
pub(crate) fn read_noticed<Raw: DeserializeOwned, T>(
    file: &str,
    text: &str,
    example: &'static str,
    limits: &[&[Limit]],
    mut validate: impl FnMut(Raw, &Check) -> Result<T, ConfigError>,
) -> Result<Noticed<T>, ConfigError> {
    let original = DeTable::parse(text).map_err(|error| not_toml(file, text, &error))?;
    let example = DeTable::parse(example).map_err(|error| not_toml("example", example, &error))?;
    let mut document = original.clone();
    let mut faults: Vec<(Range<usize>, ConfigError)> = Vec::new();
    let mut repaired: Vec<String> = Vec::new();
    // Names that misspelt keys got here: the file does not have them.
    let mut meant_keys: Vec<String> = Vec::new();
    for _ in 0..MAX_READS {
        let check = Check::of(file);
        let raw = Raw::deserialize(Deserializer::from(document.clone()));
        let outcome = match raw {
            Ok(raw) => validate(raw, &check).map_err(|error| {
                let key = error.key().unwrap_or_default().to_string();
                let span = span_of(document.get_ref(), &key);
                let place = shown(file, text, &span);
                (key, span, error.at(file, &place))
            }),
            Err(error) => Err(locate(file, text, &original, &error, limits)),
        };
        let (key, span, error) = match outcome {
            Ok(value) if faults.is_empty() => return Ok((value, check.notices.into_inner())),
            Ok(_) => break,
            Err(fault) => fault,
        };
        // Of a key that does not belong here no value is right.
        let is_value = error.is_of_value();
        let key = without_indices(&key).to_string();
        let is_guess = !is_value && meant_keys.contains(&key);
        if !is_guess && !repaired.iter().any(|done| follows(&key, &error, done)) {
            let renamed = error.meant().is_some_and(|meant| {
                let (table, _) = key.rsplit_once('.').unwrap_or_default();
                let new = format!("{table}.{meant}");
                meant_keys.push(new.trim_start_matches('.').to_string());
                // The value of a misspelt key is checked as well.
                rename(document.get_mut(), &key, meant)
            });
            faults.push((span, error));
            if faults.len() == MAX_FAULTS {
                break;
            }
            if renamed {
                continue;
            }
        }
        if !repair(document.get_mut(), &example, key, is_value, &mut repaired) {
            break;
        }
    }
    faults.sort_by_key(|(span, _)| span.start);
    let mut faults: Vec<ConfigError> = faults.into_iter().map(|(_, error)| error).collect();
    Err(match faults.len() {
        1 => faults.remove(0),
        _ => ConfigError::Several {
            file: file.to_string(),
            faults,
        },
    })
}

/// Replaces the key, or the first table around it that has not been replaced before; false if there is none. A key that the example lacks is removed,
/// or where its value is wrong (`is_value`) or missing replaced by the one in the example's table `spare`.
fn repair(
    document: &mut DeTable<'_>,
    example: &Spanned<DeTable<'static>>,
    key: String,
    is_value: bool,
    repaired: &mut Vec<String>,
) -> bool {
    let mut key = key;
    while repaired.contains(&key) {
        let parent = key.rsplit_once('.').map_or("", |(parent, _)| parent);
        key = without_indices(parent).to_string();
    }
    if key.is_empty() {
        return false;
    }
    let is_missing = value_at(document, &key, false).is_none();
    let spare = || {
        let spare = value_at(example.get_ref(), &format!("spare.{key}"), true);
        spare.filter(|_| is_value || is_missing)
    };
    let value = value_at(example.get_ref(), &key, true)
        .or_else(spare)
        .cloned();
    let done = match table_around(document, &key) {
        Some((table, name)) => {
            table.remove(name);
            if let Some(value) = value {
                table.insert(
                    Spanned::new(value.span(), Cow::Owned(name.to_string())),
                    value,
                );
            }
            true
        }
        None => false,
    };
    repaired.push(key);
    done
}

/// Whether a fault of `key` follows from the replacement of `done`: it lies within, or is of a rule that needs it or whose message speaks of it,
/// as that of a table does where a key of its own is missing.
fn follows(key: &str, error: &ConfigError, done: &str) -> bool {
    let within = |key: &str, table: &str| {
        let rest = key.strip_prefix(table);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    if let ConfigError::Rule { needs, .. } = error
        && needs
            .iter()
            .any(|need| within(need, done) || within(done, need))
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
    let misses = done
        .rsplit_once('.')
        .is_some_and(|(table, name)| without_indices(table) == key && speaks_of(name));
    within(key, done) || misses || (done.contains('.') && message.contains(done))
}

/// Gives the entry of a misspelt key the name that is meant, unless that is there.
fn rename(document: &mut DeTable<'_>, key: &str, meant: &str) -> bool {
    let Some((table, name)) = table_around(document, key) else {
        return false;
    };
    if table.contains_key(meant) {
        return false;
    }
    let Some((old, value)) = table.remove_entry(name) else {
        return false;
    };
    table.insert(
        Spanned::new(old.span(), Cow::Owned(meant.to_string())),
        value,
    );
    true
}

/// `heads[1].dead_px` of `heads[1].dead_px[3][0]`.
fn without_indices(key: &str) -> &str {
    let mut key = key;
    while let Some(at) = key.rfind('[').filter(|_| key.ends_with(']')) {
        key = &key[..at];
    }
    key
}

/// The names and places in lists that a key is made of: `heads`, `[1]`, `dead_px`.
fn steps(key: &str) -> impl Iterator<Item = Result<&str, usize>> {
    let parts = key.split(['.', '[']).filter(|part| !part.is_empty());
    parts.map(|part| match part.strip_suffix(']').map(str::parse) {
        Some(Ok(index)) => Err(index),
        _ => Ok(part),
    })
}

/// The value of a key; `first`: of the first entry of every list, whatever the key's place in it.
fn value_at<'t, 'i>(
    table: &'t DeTable<'i>,
    key: &str,
    first: bool,
) -> Option<&'t Spanned<DeValue<'i>>> {
    let mut steps = steps(key);
    let mut value = table.get(steps.next()?.ok()?)?;
    for step in steps {
        value = match (step, value.get_ref()) {
            (Ok(name), DeValue::Table(table)) => table.get(name)?,
            (Err(_), DeValue::Array(values)) if first => values.iter().next()?,
            (Err(index), DeValue::Array(values)) => values.get(index)?,
            _ => return None,
        };
    }
    Some(value)
}

/// The table that holds a key, and the key's name in it.
fn table_around<'t, 'i, 'k>(
    table: &'t mut DeTable<'i>,
    key: &'k str,
) -> Option<(&'t mut DeTable<'i>, &'k str)> {
    let steps: Vec<_> = steps(key).collect();
    let (last, around) = steps.split_last()?;
    let mut table = table;
    let mut places = around.iter().peekable();
    while let Some(step) = places.next() {
        let mut value = table.get_mut((*step).ok()?)?.get_mut();
        while let Some(Err(index)) = places.peek() {
            let DeValue::Array(values) = value else {
                return None;
            };
            value = values.get_mut(*index)?.get_mut();
            places.next();
        }
        let DeValue::Table(inner) = value else {
            return None;
        };
        table = inner;
    }
    Some((table, (*last).ok()?))
}

/// Where a key's value stands, or the innermost of the tables around it that is there.
fn span_of(table: &DeTable<'_>, key: &str) -> Range<usize> {
    let mut key = key;
    while !key.is_empty() {
        if let Some(value) = value_at(table, key, false) {
            return value.span();
        }
        let cut = key.rfind(['.', '[']).unwrap_or(0);
        key = &key[..cut];
    }
    0..0
}

/// File, line and column of a span.
fn shown(file: &str, text: &str, span: &Range<usize>) -> String {
    if span.end == 0 {
        return file.to_string();
    }
    let (line, column) = position(text, span.start);
    format!("{file}:{line}:{column}")
}
