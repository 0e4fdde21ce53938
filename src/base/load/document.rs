//! Keys of a TOML document, such as `heads[1].dead_px[3][0]`: their values, spans, and replacement.

use std::borrow::Cow;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// `heads[1].dead_px` of `heads[1].dead_px[3][0]`.
pub(super) fn without_indices(key: &str) -> &str {
    let mut key = key;
    while let Some((list, _)) = as_entry(key) {
        key = list;
    }
    key
}

/// Whether `key` is `table` or lies within it.
pub(super) fn within(key: &str, table: &str) -> bool {
    let rest = key.strip_prefix(table);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The key of the table or list around a key.
pub(super) fn parent(key: &str) -> &str {
    key.rfind(['.', '[']).map_or("", |at| &key[..at])
}

/// The list and the index of a key that is an entry of a list.
pub(super) fn as_entry(key: &str) -> Option<(&str, usize)> {
    let (list, index) = key.strip_suffix(']')?.rsplit_once('[')?;
    Some((list, index.parse().ok()?))
}

/// The names (`Ok`) and indices (`Err`) in a key.
pub(super) fn steps(key: &str) -> impl Iterator<Item = Result<&str, usize>> {
    let parts = key.split(['.', '[']).filter(|part| !part.is_empty());
    parts.map(|part| match part.strip_suffix(']').map(str::parse) {
        Some(Ok(index)) => Err(index),
        _ => Ok(part),
    })
}

/// The value of a key; `first` takes the first entry of every list instead of the index.
pub(super) fn value_at<'t, 'i>(
    table: &'t DeTable<'i>,
    key: &str,
    first: bool,
) -> Option<&'t Spanned<DeValue<'i>>> {
    let mut steps = steps(key);
    let mut value = table.get(steps.next()?.ok()?)?;
    for step in steps {
        value = match (step, value.get_ref()) {
            (Ok(name), DeValue::Table(table)) => table.get(name)?,
            (Err(_), DeValue::Array(values)) if first => values.first()?,
            (Err(index), DeValue::Array(values)) => values.get(index)?,
            _ => return None,
        };
    }
    Some(value)
}

fn value_mut<'t, 'i>(table: &'t mut DeTable<'i>, key: &str) -> Option<&'t mut DeValue<'i>> {
    let mut steps = steps(key);
    let mut value = table.get_mut(steps.next()?.ok()?)?.get_mut();
    for step in steps {
        value = match (step, value) {
            (Ok(name), DeValue::Table(table)) => table.get_mut(name)?.get_mut(),
            (Err(index), DeValue::Array(values)) => values.get_mut(index)?.get_mut(),
            _ => return None,
        };
    }
    Some(value)
}

/// The table with a named key, and the key's name in it.
fn table_around<'t, 'i, 'k>(
    table: &'t mut DeTable<'i>,
    key: &'k str,
) -> Option<(&'t mut DeTable<'i>, &'k str)> {
    let Some((around, name)) = key.rsplit_once('.') else {
        return Some((table, key));
    };
    match value_mut(table, around)? {
        DeValue::Table(table) => Some((table, name)),
        _ => None,
    }
}

/// Sets the value of a key; without a value removes the key or the list entry. False for a key
/// whose table or list is missing.
pub(super) fn set<'i>(document: &mut DeTable<'i>, key: &str, value: Option<DeValue<'i>>) -> bool {
    let Some((list, index)) = as_entry(key) else {
        let Some((table, name)) = table_around(document, key) else {
            return false;
        };
        let old = table.remove(name).map_or(0..0, |old| old.span());
        if let Some(value) = value {
            let name = Cow::Owned(name.to_string());
            table.insert(Spanned::new(old.clone(), name), Spanned::new(old, value));
        }
        return true;
    };
    let Some(DeValue::Array(values)) = value_mut(document, list) else {
        return false;
    };
    match (value, values.get_mut(index)) {
        (Some(value), Some(old)) => *old.get_mut() = value,
        (None, Some(_)) => {
            let old = std::mem::replace(values, DeArray::new()).into_iter();
            let others = old.enumerate().filter(|(i, _)| *i != index);
            *values = others.map(|(_, value)| value).collect();
        }
        _ => return false,
    }
    true
}

/// Removes the key at a span of the text: a quoted key may have dots and brackets, so its path is
/// ambiguous. False if no key is there.
pub(super) fn remove_at(table: &mut DeTable<'_>, span: &Range<usize>) -> bool {
    fn of_value(value: &mut DeValue<'_>, span: &Range<usize>) -> bool {
        match value {
            DeValue::Table(table) => remove_at(table, span),
            DeValue::Array(values) => values.iter_mut().any(|it| of_value(it.get_mut(), span)),
            _ => false,
        }
    }
    let name = table.keys().find(|key| key.span() == *span);
    match name.map(|name| name.get_ref().clone()) {
        Some(name) => table.remove(&*name).is_some(),
        None => table
            .iter_mut()
            .any(|(_, value)| of_value(value.get_mut(), span)),
    }
}

/// Renames a misspelt key to `meant`, unless the table already has that key.
pub(super) fn rename(document: &mut DeTable<'_>, key: &str, meant: &str) -> bool {
    let entry = table_around(document, key).and_then(|(table, name)| {
        let is_free = !table.contains_key(meant);
        let (old, value) = is_free.then(|| table.remove_entry(name))??;
        let name = Cow::Owned(meant.to_string());
        table.insert(Spanned::new(old.span(), name), value);
        Some(())
    });
    entry.is_some()
}

/// A value without spans, so that they are not taken for positions in another text.
pub(super) fn without_spans<'i>(value: &DeValue<'i>) -> DeValue<'i> {
    let spanned = |value: &Spanned<DeValue<'i>>| Spanned::new(0..0, without_spans(value.get_ref()));
    match value {
        DeValue::Array(values) => DeValue::Array(values.iter().map(spanned).collect()),
        DeValue::Table(table) => {
            let key = |key: &Spanned<Cow<'i, str>>| Spanned::new(0..0, key.get_ref().clone());
            let keys = table.iter();
            DeValue::Table(
                keys.map(|(name, value)| (key(name), spanned(value)))
                    .collect(),
            )
        }
        other => other.clone(),
    }
}

/// The key in `original` of a key in `document`, from which list entries were removed. Entries are
/// identified by their spans.
pub(super) fn key_in(original: &DeTable<'_>, document: &DeTable<'_>, key: &str) -> String {
    let Some(at) = key.rfind('[') else {
        return key.to_string();
    };
    let (list, rest) = key.split_at(at);
    let original_list = key_in(original, document, list);
    let entry = rest.find(']').and_then(|end| {
        let (entry, rest) = key.split_at(at + end + 1);
        let span = value_at(document, entry, false)?.span();
        let DeValue::Array(values) = value_at(original, &original_list, false)?.get_ref() else {
            return None;
        };
        let index = values.iter().position(|value| value.span() == span)?;
        Some(format!("[{index}]{rest}"))
    });
    original_list + entry.as_deref().unwrap_or(rest)
}

/// The span of a key's value, or of the innermost existing table around it.
pub(super) fn span_of(table: &DeTable<'_>, key: &str) -> Range<usize> {
    let mut key = key;
    while !key.is_empty() {
        if let Some(value) = value_at(table, key, false) {
            return value.span();
        }
        key = parent(key);
    }
    0..0
}

/// Calls `each` with every value within `value` (at `key`) that is neither a table nor a list.
pub(super) fn each_leaf(
    key: &str,
    value: &Spanned<DeValue<'_>>,
    each: &mut impl FnMut(&str, &Spanned<DeValue<'_>>),
) {
    match value.get_ref() {
        DeValue::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                each_leaf(&format!("{key}[{index}]"), value, each);
            }
        }
        DeValue::Table(table) => {
            for (name, value) in table {
                each_leaf(&format!("{key}.{}", name.get_ref()), value, each);
            }
        }
        _ => each(key, value),
    }
}

/// The tables that match a pattern, with their keys.
pub(super) fn tables_at<'t, 'i>(
    document: &'t DeTable<'i>,
    pattern: &str,
) -> Vec<(String, &'t DeTable<'i>)> {
    let pattern = pattern.replace('[', ".[");
    let mut steps = pattern.split('.');
    let first = steps.next().unwrap_or_default();
    let root = document.get(first).map(|value| value.get_ref());
    let mut found = Vec::from_iter(root.map(|value| (first.to_string(), value)));
    for step in steps {
        let members = found
            .iter()
            .flat_map(|(key, value)| members(key, value, step));
        found = members.collect();
    }
    let tables = found.into_iter();
    tables
        .filter_map(|(key, value)| Some((key, value.as_table()?)))
        .collect()
}

/// The members of a table or a list that match a step of a pattern.
fn members<'t, 'i>(
    key: &str,
    value: &'t DeValue<'i>,
    step: &str,
) -> Vec<(String, &'t DeValue<'i>)> {
    match value {
        DeValue::Array(list) if step == "[]" => {
            let entries = list.iter().enumerate();
            let entries = entries.map(|(i, entry)| (format!("{key}[{i}]"), entry.get_ref()));
            entries.collect()
        }
        DeValue::Table(table) => {
            let named = table
                .iter()
                .filter(|(name, _)| step == "*" || name.get_ref() == step);
            let named = named.map(|(name, value)| (format!("{key}.{}", name.get_ref()), value));
            named.map(|(key, value)| (key, value.get_ref())).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether `key` matches `pattern`.
pub(super) fn matches(pattern: &str, key: &str) -> bool {
    let wild = [pattern.find("[]"), pattern.find('*')];
    let Some(at) = wild.into_iter().flatten().min() else {
        return pattern == key;
    };
    let (head, rest) = pattern.split_at(at);
    let Some(key) = key.strip_prefix(head) else {
        return false;
    };
    if let Some(rest) = rest.strip_prefix('*') {
        // A name may have dots.
        let mut ends = key.char_indices().map(|(end, _)| end);
        return ends.any(|end| matches(rest, &key[end..]));
    }
    let index = key.strip_prefix('[').and_then(|key| key.split_once(']'));
    index.is_some_and(|(index, key)| index.parse::<usize>().is_ok() && matches(&rest[2..], key))
}
