//! Compares the limits of JSON Schemas with those of the loader.

use super::*;
use toml::Value as Toml;

#[test]
fn patterns_match_indices_and_names() {
    for (pattern, key, is) in [
        ("a.b", "a.b", true),
        ("a.b", "a.bc", false),
        ("a[]", "a[12]", true),
        ("a[].b[]", "a[0].b[3]", true),
        ("a[]", "a", false),
        ("a[]", "a[x]", false),
        ("a[0]", "a[0]", true),
        ("a[0]", "a[1]", false),
        ("s.*.p[].d", "s.NAME.p[0].d", true),
        ("s.*.p[].d", "s.a.b c.p[0].d", true),
        ("s.*.p[].d", "s.NAME.p[0].e", false),
    ] {
        assert_eq!(matches(pattern, key), is, "{pattern} {key}");
    }
}

/// Asserts that schema and loader (which returns its error) refuse values just outside each limit
/// and accept those at it. Each key with a limit is in one of the `bases`, valid files; `*` in it
/// matches the name `NAME`.
pub fn agree(
    schema: &Schema,
    limits: &[&[Limit]],
    bases: &[&str],
    load: impl Fn(&str) -> Option<String>,
) {
    for base in bases {
        let json = serde_json::to_value(base.parse::<toml::Table>().unwrap()).unwrap();
        assert_eq!(flaw(schema, schema.as_value(), &json), None, "{base}");
    }
    let tried = |key: &str, value: Toml| {
        let with = |base: &&str| {
            let mut table = Toml::Table(base.parse().unwrap());
            *value_mut(&mut table, key)? = value.clone();
            Some(table)
        };
        let table = bases.iter().find_map(with);
        let table = table.unwrap_or_else(|| panic!("{key} is in no base"));
        let json = serde_json::to_value(&table).unwrap();
        let text = toml::to_string(&table).unwrap();
        (flaw(schema, schema.as_value(), &json), load(&text))
    };
    for (pattern, allowed) in limits.iter().copied().flatten() {
        let key = pattern.replace("[]", "[0]").replace('*', "NAME");
        let refused = |value: Toml, words: &str| {
            let (by_schema, by_loader) = tried(&key, value.clone());
            assert!(by_schema.is_some(), "{key} = {value}: not by the schema");
            let text = by_loader.unwrap_or_else(|| panic!("{key} = {value}: not by the loader"));
            assert!(text.contains(words), "{key} = {value}: {text}");
        };
        let accepted = |value: Toml, words: &str| {
            let (by_schema, by_loader) = tried(&key, value.clone());
            assert_eq!(by_schema, None, "{key} = {value}");
            // Another key may forbid it.
            let text = by_loader.unwrap_or_default();
            assert!(!text.contains(words), "{key} = {value}: {text}");
        };
        match allowed {
            Allowed::Number(range) => {
                let [min, max] = [*range.start(), *range.end()];
                let words = format!("must be {min} to {max}");
                for (at, beyond, step) in [(min, min.next_down(), -1.0), (max, max.next_up(), 1.0)]
                {
                    let is_whole = bases.iter().any(|base| {
                        let mut table = Toml::Table(base.parse().unwrap());
                        value_mut(&mut table, &key).is_some_and(|value| value.is_integer())
                    });
                    let number = |value: f64| {
                        if is_whole {
                            Toml::Integer(value as i64)
                        } else {
                            Toml::Float(value)
                        }
                    };
                    accepted(number(at), &words);
                    match is_whole {
                        true if at + step < 0.0 && *pattern != "run.cpus[]" => {}
                        true => refused(number(at + step), "must be"),
                        false => refused(number(beyond), "must be"),
                    }
                }
            }
            Allowed::Word(words) => {
                refused(Toml::String("nonsense".to_string()), "one of");
                for word in words() {
                    accepted(Toml::String(word.to_string()), "must be one of");
                }
            }
            Allowed::Count(range) => {
                let one = |count: usize| {
                    let mut table = Toml::Table(bases[0].parse().unwrap());
                    let found = bases.iter().find_map(|base| {
                        table = Toml::Table(base.parse().unwrap());
                        value_mut(&mut table, &format!("{key}[0]")).cloned()
                    });
                    Toml::Array(vec![found.unwrap(); count])
                };
                refused(one(range.start() - 1), "must be");
                if *range.end() < usize::MAX {
                    accepted(one(*range.end()), "must be");
                    refused(one(range.end() + 1), "must be");
                }
            }
            Allowed::Length(range) => {
                let text = |length| Toml::String("x".repeat(length));
                for length in [*range.start(), *range.end()] {
                    accepted(text(length), "must be");
                }
                for length in [range.start() - 1, range.end() + 1] {
                    refused(text(length), "must be");
                }
            }
            Allowed::Kind(kind, kinds) => {
                let key = format!("{key}.{kind}");
                for (name, ..) in *kinds {
                    let (_, by_loader) = tried(&key, Toml::String(name.to_string()));
                    let text = by_loader.unwrap_or_default();
                    assert!(!text.contains("must be one of"), "{key} = {name}: {text}");
                }
                let (by_schema, by_loader) = tried(&key, "nonsense".into());
                assert!(by_schema.is_some() && by_loader.is_some(), "{key}");
            }
            Allowed::Form(_) => refused(Toml::String("no form: \u{7}".to_string()), ""),
            // Each crate has its own cases.
            Allowed::OneOf(_)
            | Allowed::NotBoth(_)
            | Allowed::Needs(_)
            | Allowed::NotWithSeveral(_)
            | Allowed::EachOfSeveral(_) => {}
        }
    }
}

/// Asserts that both accept the file, or both refuse it.
pub fn both(schema: &Schema, text: &str, load: impl Fn(&str) -> Option<String>, is_valid: bool) {
    let json = serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap();
    let by_schema = flaw(schema, schema.as_value(), &json);
    assert_eq!(by_schema.is_none(), is_valid, "{by_schema:?}: {text}");
    let by_loader = load(text);
    assert_eq!(by_loader.is_none(), is_valid, "{by_loader:?}: {text}");
}

/// The value of an existing key.
fn value_mut<'a>(table: &'a mut Toml, key: &str) -> Option<&'a mut Toml> {
    let mut value = table;
    for step in key
        .replace('[', ".[")
        .split('.')
        .filter(|step| !step.is_empty())
    {
        let index = step
            .strip_prefix('[')
            .and_then(|step| step.strip_suffix(']'));
        value = match index {
            Some(index) => value
                .as_array_mut()?
                .get_mut(index.parse::<usize>().unwrap())?,
            None => value.as_table_mut()?.get_mut(step)?,
        };
    }
    Some(value)
}

/// The fault of a value by a schema. Supports the keywords of draft 2020-12 that occur.
fn flaw(root: &Schema, schema: &Value, value: &Value) -> Option<String> {
    let Some(keywords) = schema.as_object() else {
        return (schema == &json!(false)).then(|| format!("{value} is not allowed"));
    };
    let is_valid = |schema: &Value| flaw(root, schema, value).is_none();
    let count = |list: &Value| {
        list.as_array()
            .unwrap()
            .iter()
            .filter(|s| is_valid(s))
            .count()
    };
    let bound = |limit: &Value| value.as_f64().zip(limit.as_f64());
    let length = |limit: &Value| value.as_array().map(Vec::len).zip(limit.as_u64());
    let characters = |limit: &Value| {
        value
            .as_str()
            .map(|t| t.chars().count())
            .zip(limit.as_u64())
    };
    let members = |all: &Value, of: &str| all.get(of).and_then(Value::as_object).cloned();
    keywords.iter().find_map(|(keyword, rule)| {
        let holds = match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" | "then" => true,
            "$ref" => {
                return flaw(
                    root,
                    root.pointer(&rule.as_str().unwrap()[1..]).unwrap(),
                    value,
                );
            }
            "type" => rule
                .as_array()
                .unwrap_or(&vec![rule.clone()])
                .iter()
                .any(|one| match one.as_str().unwrap() {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "integer" => value.is_i64() || value.is_u64(),
                    "number" => value.is_number(),
                    "null" => value.is_null(),
                    other => panic!("type {other}"),
                }),
            "enum" => rule.as_array().unwrap().contains(value),
            "const" => rule == value,
            "minimum" => bound(rule).is_none_or(|(value, min)| value >= min),
            "maximum" => bound(rule).is_none_or(|(value, max)| value <= max),
            "minItems" => length(rule).is_none_or(|(length, min)| length as u64 >= min),
            "maxItems" => length(rule).is_none_or(|(length, max)| length as u64 <= max),
            "minLength" => characters(rule).is_none_or(|(n, min)| n as u64 >= min),
            "maxLength" => characters(rule).is_none_or(|(n, max)| n as u64 <= max),
            "pattern" => value.as_str().is_none_or(|text| {
                // This library has no look-ahead; its `$` matches only at the end.
                let pattern = rule.as_str().unwrap().replace(END, "$");
                let pattern = regex_lite::Regex::new(&pattern);
                pattern.unwrap().is_match(text)
            }),
            "contains" => value
                .as_array()
                .is_none_or(|list| list.iter().any(|entry| flaw(root, rule, entry).is_none())),
            "anyOf" => count(rule) > 0,
            "oneOf" => count(rule) == 1,
            "allOf" => count(rule) == rule.as_array().unwrap().len(),
            "not" => !is_valid(rule),
            "if" => !is_valid(rule) || is_valid(&schema["then"]),
            "required" => value.as_object().is_none_or(|object| {
                rule.as_array()
                    .unwrap()
                    .iter()
                    .all(|key| object.contains_key(key.as_str().unwrap()))
            }),
            "dependentRequired" => value.as_object().is_none_or(|object| {
                rule.as_object().unwrap().iter().all(|(key, needed)| {
                    let needed = needed.as_array().unwrap();
                    !object.contains_key(key)
                        || needed
                            .iter()
                            .all(|key| object.contains_key(key.as_str().unwrap()))
                })
            }),
            "properties" => {
                return rule.as_object().unwrap().iter().find_map(|(key, rule)| {
                    flaw(root, rule, value.get(key)?).map(|flaw| format!("{key}: {flaw}"))
                });
            }
            "additionalProperties" => {
                return value.as_object()?.iter().find_map(|(key, value)| {
                    let known =
                        members(schema, "properties").is_some_and(|all| all.contains_key(key));
                    if known {
                        None
                    } else {
                        flaw(root, rule, value).map(|flaw| format!("{key}: {flaw}"))
                    }
                });
            }
            "prefixItems" => {
                return value
                    .as_array()?
                    .iter()
                    .zip(rule.as_array().unwrap())
                    .find_map(|(value, rule)| flaw(root, rule, value));
            }
            "items" => {
                return value
                    .as_array()?
                    .iter()
                    .find_map(|value| flaw(root, rule, value));
            }
            other => panic!("keyword {other}"),
        };
        (!holds).then(|| format!("{value}: {keyword} {rule}"))
    })
}
