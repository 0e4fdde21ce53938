//! Rules between the keys of a table, from the limits that are also in the JSON Schema.

use super::check::Check;
use super::document::tables_at;
use super::error::ConfigError;
use super::limits::{Allowed, Kind, Limit};
use super::words::one_of;
use toml::de::{DeArray, DeTable, DeValue};

/// Refuses the first table of a document without the keys of its kind.
pub(super) fn keys_of_kinds(
    document: &DeTable<'_>,
    limits: &[&[Limit]],
    check: &Check,
) -> Result<(), ConfigError> {
    let is_kind = |rule: &Allowed| matches!(rule, Allowed::Kind(..));
    each_table(document, limits, check, is_kind)
}

/// Refuses the first table of a document that breaks another rule.
pub(super) fn between_keys(
    document: &DeTable<'_>,
    limits: &[&[Limit]],
    check: &Check,
) -> Result<(), ConfigError> {
    let is_other = |rule: &Allowed| !matches!(rule, Allowed::Kind(..));
    each_table(document, limits, check, is_other)
}

fn each_table(
    document: &DeTable<'_>,
    limits: &[&[Limit]],
    check: &Check,
    is_checked: impl Fn(&Allowed) -> bool,
) -> Result<(), ConfigError> {
    let rules = limits.iter().copied().flatten();
    for (pattern, rule) in rules.filter(|(_, rule)| is_checked(rule)) {
        for (key, values) in tables_at(document, pattern) {
            let table = Table { key, values, check };
            table.check(rule)?;
        }
    }
    Ok(())
}

/// A table with its key in the file.
struct Table<'a, 'i> {
    key: String,
    values: &'a DeTable<'i>,
    check: &'a Check<'a>,
}

impl Table<'_, '_> {
    fn check(&self, rule: &Allowed) -> Result<(), ConfigError> {
        match rule {
            Allowed::OneOf(keys) => self.has_one_of(keys),
            Allowed::NotBoth([key, other]) if self.is_set(key) && self.is_set(other) => {
                Err(self.both_given(key, other))
            }
            Allowed::Needs([key, needed])
                if self.values.contains_key(*key) && !self.values.contains_key(*needed) =>
            {
                let needed = self.key_of(needed);
                let reason = format!("goes with {needed}: add that, or leave it out");
                Err(self.error(key, reason, &[&needed]))
            }
            Allowed::NotWithSeveral([key, list])
                if self.is_set(key) && self.several(list).is_some() =>
            {
                let reason = format!("given with several {list}: leave it out");
                Err(self.error(key, reason, &[&self.key_of(list)]))
            }
            Allowed::EachOfSeveral([list, key]) => self.each_has(list, key),
            Allowed::Kind(key, kinds) => self.has_keys_of_kind(key, kinds),
            _ => Ok(()),
        }
    }

    fn key_of(&self, name: &str) -> String {
        format!("{}.{name}", self.key)
    }

    /// The error of a rule between a key of the table and others.
    fn error(&self, name: &str, reason: String, needs: &[&str]) -> ConfigError {
        let error = self.check.explain(&self.key_of(name), reason);
        error.needs(needs)
    }

    fn both_given(&self, name: &str, other: &str) -> ConfigError {
        let other = self.key_of(other);
        let reason = format!("given with {other}: leave one of them out");
        self.check.explain(&self.key_of(name), reason)
    }

    fn value(&self, name: &str) -> Option<&DeValue<'_>> {
        self.values.get(name).map(|value| value.get_ref())
    }

    /// Whether a key is present, and neither false nor an empty list.
    fn is_given(&self, name: &str) -> bool {
        self.value(name).is_some_and(|value| match value {
            DeValue::Boolean(flag) => *flag,
            DeValue::Array(list) => !list.is_empty(),
            _ => true,
        })
    }

    /// Whether a key is given and not zero.
    fn is_set(&self, name: &str) -> bool {
        let is_zeros = match self.value(name) {
            Some(DeValue::Array(list)) => list.iter().all(|one| is_zero(one.get_ref())),
            Some(value) => is_zero(value),
            None => true,
        };
        self.is_given(name) && !is_zeros
    }

    /// A list with at least two entries.
    fn several(&self, list: &str) -> Option<&DeArray<'_>> {
        let list = self.value(list)?.as_array()?;
        (list.len() > 1).then_some(list)
    }

    /// Checks that exactly one of the keys is given; errors have their forms.
    fn has_one_of(&self, keys: &[(&str, &str)]) -> Result<(), ConfigError> {
        let mut given = keys.iter().filter(|(name, _)| self.is_given(name));
        match (given.next(), given.next_back()) {
            (Some(_), None) => Ok(()),
            // The error is of the last key, since the table is checked again without that key.
            (Some((first, _)), Some((last, _))) => Err(self.both_given(last, first)),
            (None, _) => {
                let forms: Vec<&str> = keys.iter().map(|(_, form)| *form).collect();
                let reason = format!("give one of {}", forms.join(", "));
                let names: Vec<String> = keys.iter().map(|(name, _)| self.key_of(name)).collect();
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                Err(self.check.explain(&self.key, reason).needs(&names))
            }
        }
    }

    fn each_has(&self, list: &str, key: &str) -> Result<(), ConfigError> {
        let lacks = |value: &DeValue| value.as_table().is_some_and(|it| !it.contains_key(key));
        let mut entries = self.several(list).into_iter().flatten();
        match entries.position(|entry| lacks(entry.get_ref())) {
            None => Ok(()),
            Some(at) => {
                let key_of = self.key_of(list);
                let reason = format!("no {key}; each of several {list} needs one");
                Err(self.check.explain(&format!("{key_of}[{at}]"), reason))
            }
        }
    }

    /// Refuses an unknown kind, keys of other kinds, and missing required keys.
    fn has_keys_of_kind(&self, key: &str, kinds: &[Kind]) -> Result<(), ConfigError> {
        let Some(kind) = self.value(key).and_then(DeValue::as_str) else {
            return Ok(());
        };
        let named = self.key_of(key);
        let Some((_, needed, others)) = kinds.iter().find(|(known, ..)| *known == kind) else {
            let known: Vec<&str> = kinds.iter().map(|(known, ..)| *known).collect();
            return Err((self.check).refuse(&named, format!("{kind:?}"), one_of(&known)));
        };
        let takes = [*needed, *others].concat();
        let all = kinds
            .iter()
            .flat_map(|(_, needed, others)| [*needed, *others].concat());
        let mut foreign = all.filter(|name| !takes.contains(name));
        if let Some(name) = foreign.find(|name| self.values.contains_key(*name)) {
            let takes = if takes.is_empty() {
                "no other key".to_string()
            } else {
                takes.join(", ")
            };
            let reason = format!("means nothing to {key} {kind:?}, which takes {takes}");
            return Err(self.error(name, reason, &[&named]));
        }
        let Some(name) = needed.iter().find(|name| !self.values.contains_key(**name)) else {
            return Ok(());
        };
        let needed = needed.join(", ");
        let reason = format!("the key `{name}` is missing: {key} {kind:?} needs {needed}");
        Err(self.error(name, reason, &[&named]))
    }
}

fn is_zero(value: &DeValue<'_>) -> bool {
    match value {
        DeValue::Integer(number) => number.as_str().trim_start_matches(['+', '-']) == "0",
        DeValue::Float(number) => number.as_str().parse() == Ok(0.0),
        _ => false,
    }
}
