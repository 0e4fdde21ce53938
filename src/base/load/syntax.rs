//! Faults of TOML and of raw keys. Each is one line: file, line, column, key, and expected value.

use super::document::{as_entry, value_at};
use super::error::ConfigError;
use super::words::{missing_key, no_toml, plain};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

/// A text that is not TOML.
pub(super) fn not_toml(file: &str, text: &str, error: &Error) -> ConfigError {
    let span = error.span().unwrap_or_default();
    let (line, column) = position(text, span.start);
    let code = text.lines().nth(line - 1).unwrap_or_default();
    let begin = text.get(..span.start).and_then(|before| before.rfind('\n'));
    let offset = span.start - begin.map_or(0, |feed| feed + 1);
    ConfigError::Syntax {
        place: format!("{file}:{line}:{column}"),
        reason: format!("not TOML: {}", no_toml(error.message(), code, offset)),
    }
}

/// The key of the parser's error, its span, and the error in the terms of the files. `known` gives
/// the name of a key in the file and its allowed values.
pub(super) fn locate(
    file: &str,
    text: &str,
    table: &Spanned<DeTable<'_>>,
    error: &Error,
    known: impl Fn(&str) -> (String, Option<String>),
) -> (String, Range<usize>, ConfigError) {
    let span = error.span().unwrap_or_default();
    let (line, column) = position(text, span.start);
    // A key that is missing in the whole file has no entry around it.
    let inside = (table.span() != span).then(|| in_table(table.get_ref(), &span));
    let key = inside.flatten().unwrap_or_default();
    let key = key.trim_start_matches('.');
    // A list of one table with its own header has the span of that header.
    let is_list =
        |key| value_at(table.get_ref(), key, false).is_some_and(|it| it.get_ref().is_array());
    let key = match as_entry(key) {
        Some((list, _))
            if error.message().starts_with("invalid type: sequence") && !is_list(key) =>
        {
            list
        }
        _ => key,
    };
    let (name, allowed) = known(key);
    let given = text.get(span.clone()).unwrap_or_default();
    let reason = plain(error.message(), given, allowed.as_deref());
    let reason = match &*name {
        "" => reason,
        name => format!("{name}: {reason}"),
    };
    let missing = missing_key(error.message());
    let key = match (key, missing) {
        (key, None) => key.to_string(),
        ("", Some(missing)) => missing.to_string(),
        (key, Some(missing)) => format!("{key}.{missing}"),
    };
    let location = format!("{file}:{line}:{column}");
    (
        key,
        span,
        ConfigError::Syntax {
            place: location,
            reason,
        },
    )
}

/// Line and column, from 1, of the byte at `at`.
pub(super) fn position(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let line = before.rsplit('\n').next().unwrap_or_default();
    (before.matches('\n').count() + 1, line.chars().count() + 1)
}

/// `.key` of the innermost entry around `span`.
fn in_table(table: &DeTable<'_>, span: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let at_key = || holds(&key.span(), span).then(String::new);
        let rest = in_value(value, span).or_else(at_key)?;
        Some(format!(".{}{rest}", key.get_ref()))
    })
}

/// The rest of the key after a value around `span`: `[1].key`, or empty.
fn in_value(value: &Spanned<DeValue<'_>>, span: &Range<usize>) -> Option<String> {
    let inside = match value.get_ref() {
        // A table without its own header has the span of its name, within the header of the inner
        // table.
        DeValue::Table(_) if value.span() == *span => None,
        DeValue::Table(table) => in_table(table, span),
        DeValue::Array(values) => (0..)
            .zip(values.iter())
            .find_map(|(i, value): (usize, _)| Some(format!("[{i}]{}", in_value(value, span)?))),
        _ => None,
    };
    inside.or_else(|| holds(&value.span(), span).then(String::new))
}

fn holds(outer: &Range<usize>, inner: &Range<usize>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end
}

#[cfg(test)]
mod tests {
    use crate::load::{Fixed, read};
    use schemars::JsonSchema;
    use serde::Deserialize;

    #[derive(Deserialize, JsonSchema, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Raw {
        seed: u64,
        #[serde(default)]
        points: Vec<Fixed<f64, 2>>,
        table: Option<Table>,
    }

    #[derive(Deserialize, JsonSchema, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Table {
        rows: Vec<Row>,
        inner: Option<Inner>,
    }

    #[derive(Deserialize, JsonSchema, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        size: f64,
    }

    #[derive(Deserialize, JsonSchema, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Row {
        q: Fixed<f64, 4>,
    }

    #[test]
    fn errors_are_one_line_with_location_and_key() {
        // Lines of a file, each after a `;` behind the seed, and the error.
        let table = r#"
            ;points = [[0, 1], [2, 3, 4]]    | f:2:19: points[1]: must have 2 values, not 3
            ;points = [[0]]                  | f:2:11: points[0]: must have 2 values, not 1
            ;points = 5                      | f:2:10: points: must be a list in brackets, not 5
            ;points = [7]                    | f:2:11: points[0]: must be a list of 2 values, not 7
            ;[table];rows = [{ q = [1] }]    | f:3:15: table.rows[0].q: must have 4 values, not 1
            ;[[table.rows]];q = [0, "ä", 1]  | f:3:9: table.rows[0].q[1]: must be a number, not "ä"
            ;[table];sead = 3;rows = []      | f:3:1: table.sead: unknown key `sead`, known: rows, inner
            ;[table]                         | f:2:1: table: the key `rows` is missing
            ;[table.inner];size = 1.0        | f:2:2: table: the key `rows` is missing
            ;table.inner.size = 1.0          | f:2:1: table: the key `rows` is missing
            ;[table];rows = [];[table.inner] | f:4:1: table.inner: the key `size` is missing
            ;[[table.rows]]                  | f:2:1: table.rows[0]: the key `q` is missing
            ;tabel.rows = []                 | f:2:1: tabel: unknown key `tabel`: did you mean `table`?
            ;table = 3                       | f:2:9: table: must be a table of keys, not 3
            ;öl = one                        | f:2:1: not TOML: öl = one: texts stand in quotes, öl = "one"
            ;x = one                         | f:2:5: not TOML: x = one: texts stand in quotes, x = "one"
            points = []                      | f:1:1: the key `seed` is missing
                                             | f:1:1: the key `seed` is missing
            seed = -1  | f:1:8: seed: must be a whole number, 0 to 18446744073709551615, not -1
            seed = 1.5 | f:1:8: seed: must be a whole number, 0 to 18446744073709551615, not 1.5
            seed = [1] | f:1:8: seed: must be a whole number, 0 to 18446744073709551615, not a list
            seed =     | f:1:7: not TOML: seed has no value: write seed = value"#;
        for (text, message) in table.lines().filter_map(|row| row.split_once("| ")) {
            let text = match text.trim() {
                text if text.starts_with(';') => format!("seed = 1{text}").replace(';', "\n"),
                text => text.to_string(),
            };
            let error = read("f", &text, "", &[], |raw: Raw, _| Ok(raw)).unwrap_err();
            assert_eq!(error.to_string(), message, "{text}");
        }
        let text = "seed = 1\npoints = [[0, 1], [2, 3.5]]";
        let raw: Raw = read("f", text, "", &[], |raw, _| Ok(raw)).unwrap();
        assert_eq!(Fixed::all(raw.points), [[0.0, 1.0], [2.0, 3.5]]);
    }
}
