//! Limits of the values of a file, for the checks and for the JSON Schema.

use super::document::{matches, steps};
use super::units::range_text;
use super::words::one_of;
use schemars::Schema;
use serde_json::{Map, Value, json};
use std::ops::RangeInclusive;

/// A key and its allowed values. In the key `[]` matches any index, `*` any name.
pub type Limit = (&'static str, Allowed);

/// The end of a text in an [`Allowed::Form`]: in Python `$` also matches before a last line feed.
pub const END: &str = r"(?![\s\S])";

/// Allowed values of a key.
#[derive(Clone)]
pub enum Allowed {
    /// A number.
    Number(RangeInclusive<f64>),
    /// One of these texts.
    Word(fn() -> Vec<&'static str>),
    /// The length of a list.
    Count(RangeInclusive<usize>),
    /// The length of a text, in characters.
    Length(RangeInclusive<usize>),
    /// A text of this form: a regular expression of ECMA-262, Python and Rust.
    Form(fn() -> String),
    /// A table with exactly one of these keys, each with its form in messages. False and empty
    /// lists count as absent.
    OneOf(&'static [(&'static str, &'static str)]),
    /// A table that has at most one of these keys; errors name the first. False, empty lists and
    /// zeros count as absent.
    NotBoth([&'static str; 2]),
    /// A table that must have the second key if it has the first.
    Needs([&'static str; 2]),
    /// A table that must not have the first key if the list of the second key has several entries.
    /// Zeros count as absent.
    NotWithSeveral([&'static str; 2]),
    /// A table with a list of the first key: where it has several entries, each has the second key.
    EachOfSeveral([&'static str; 2]),
    /// A table whose kind is the value of this key; each kind has required and optional keys.
    Kind(&'static str, &'static [Kind]),
}

/// A kind of table, its required keys, and its optional ones.
pub type Kind = (
    &'static str,
    &'static [&'static str],
    &'static [&'static str],
);

/// The range of a number, if the table has one for the key.
pub(crate) fn range_of(limits: &[Limit], key: &str) -> Option<RangeInclusive<f64>> {
    limits.iter().find_map(|(pattern, allowed)| match allowed {
        Allowed::Number(range) if matches(pattern, key) => Some(range.clone()),
        _ => None,
    })
}

/// The allowed values of a key in words, if its schema has a range, a length or a choice of words.
pub(crate) fn text_of(schema: &Schema, key: &str) -> Option<String> {
    let forms = forms_of(schema, key);
    let mut words = Vec::new();
    let mut texts = Vec::new();
    for (form, around) in &forms {
        let own = |name: &str| form.get(name).or(around.get(name));
        // The maximum of a 64-bit integer is not reported as a limit.
        let number = |name: &str| {
            let end = own(name).filter(|end| end.as_u64() != Some(u64::MAX));
            end.and_then(Value::as_f64)
        };
        let listed = own("enum").and_then(Value::as_array);
        let listed = listed.into_iter().flatten().chain(form.get("const"));
        let listed: Vec<&str> = listed.filter_map(Value::as_str).collect();
        if !listed.is_empty() {
            words.extend(listed);
        } else if let (Some(min), Some(max)) = (number("minimum"), number("maximum")) {
            texts.push(range_text(key, &(min..=max)));
        } else if let (Some(min), Some(max)) = (number("minLength"), number("maxLength")) {
            texts.push(format!("a text of {min} to {max} characters in quotes"));
        } else if form.get("properties").is_some() && forms.len() > 1 {
            texts.push("a table of keys".to_string());
        } else {
            return None;
        }
    }
    if !words.is_empty() {
        texts.insert(0, one_of(&words));
    }
    (!texts.is_empty()).then(|| texts.join(" or "))
}

/// Whether the value of a key is a number by the schema.
pub(crate) fn is_number(schema: &Schema, key: &str) -> bool {
    let is_number = |(form, _): &(&Value, &Value)| {
        let kind = form.get("type").and_then(Value::as_str);
        kind.is_some_and(|kind| ["number", "integer"].contains(&kind))
    };
    forms_of(schema, key).iter().any(is_number)
}

/// The schemas of a key's value, one for each of its forms, each with the schema around it, which
/// may also have limits.
fn forms_of<'s>(schema: &'s Schema, key: &str) -> Vec<(&'s Value, &'s Value)> {
    let root = schema.as_value();
    let mut found = vec![(root, root)];
    for step in steps(key) {
        let inner = found.into_iter().filter_map(|(form, _)| match step {
            Ok(name) => {
                let named = form.get("properties").and_then(|own| own.get(name));
                named.or(form.get("additionalProperties"))
            }
            Err(index) => {
                let placed = form.get("prefixItems").and_then(|own| own.get(index));
                placed.or(form.get("items"))
            }
        });
        let forms = inner.flat_map(|around| {
            let forms = forms(schema, around).into_iter();
            forms.map(move |form| (form, around))
        });
        found = forms.collect();
    }
    found
}

/// Resolves a reference or a choice of schemas; null, for an optional key, is left out.
fn forms<'s>(schema: &'s Schema, node: &'s Value) -> Vec<&'s Value> {
    if let Some(reference) = node.get("$ref").and_then(Value::as_str) {
        let pointer = reference.strip_prefix('#').unwrap_or_default();
        let node = schema.pointer(pointer);
        return node.map_or(Vec::new(), |node| forms(schema, node));
    }
    let one_of = node.get("oneOf").filter(|_| node.get("type").is_none());
    let choices = node.get("anyOf").or(one_of);
    match choices.and_then(Value::as_array) {
        Some(choices) => choices.iter().flat_map(|one| forms(schema, one)).collect(),
        None if node.get("type") == Some(&json!("null")) => Vec::new(),
        None => vec![node],
    }
}

/// Adds the maxima of integer types: schemars omits those of 32 and 64 bits. Limits of keys
/// replace them.
pub(crate) fn bound_integers<'s>(nodes: impl Iterator<Item = &'s mut Value>) {
    for node in nodes {
        match node {
            Value::Array(list) => bound_integers(list.iter_mut()),
            Value::Object(map) => {
                let max = match map.get("format").and_then(Value::as_str) {
                    Some("uint32") => Some(u64::from(u32::MAX)),
                    Some("uint64") => Some(u64::MAX),
                    _ => None,
                };
                if let Some(max) = max {
                    map.entry("maximum").or_insert_with(|| json!(max));
                }
                bound_integers(map.values_mut());
            }
            _ => {}
        }
    }
}

/// Writes the limits into the schema of a file.
pub(crate) fn apply(schema: &mut Schema, limits: &[Limit]) {
    for (pattern, allowed) in limits {
        // A rule between keys belongs to the schema of the table that has the keys.
        let found = pointer(schema, pattern).and_then(|pointer| match allowed {
            Allowed::Number(_)
            | Allowed::Word(_)
            | Allowed::Count(_)
            | Allowed::Length(_)
            | Allowed::Form(_) => Some(pointer),
            _ => resolved(schema, pointer, "properties"),
        });
        if let Some(pointer) = found
            && let Some(Value::Object(node)) = schema.pointer_mut(&pointer)
        {
            allowed.write(node);
        }
    }
}

impl Allowed {
    fn write(&self, node: &mut Map<String, Value>) {
        let mut set = |key: &str, value: Value| drop(node.insert(key.into(), value));
        match self {
            Allowed::Number(range) => {
                set("minimum", json!(range.start()));
                set("maximum", json!(range.end()));
            }
            Allowed::Word(words) => set("enum", json!(words())),
            Allowed::Count(range) => {
                set("minItems", json!(range.start()));
                if *range.end() < usize::MAX {
                    set("maxItems", json!(range.end()));
                }
            }
            Allowed::Length(range) => {
                set("minLength", json!(range.start()));
                set("maxLength", json!(range.end()));
            }
            Allowed::Form(pattern) => set("pattern", json!(pattern())),
            Allowed::OneOf(keys) => {
                let keys: Vec<Value> = keys.iter().map(|(key, _)| is_given(key, &[])).collect();
                set("oneOf", json!(keys));
            }
            Allowed::NotBoth(keys) => {
                let keys = keys.map(|key| is_given(key, &zeros()));
                add_rules(node, vec![json!({ "not": { "allOf": keys } })]);
            }
            Allowed::Needs([key, needed]) => {
                let needs = node.entry("dependentRequired").or_insert_with(|| json!({}));
                if let Value::Object(needs) = needs {
                    needs.insert((*key).into(), json!([needed]));
                }
            }
            Allowed::NotWithSeveral([key, list]) => {
                let both = [is_given(key, &zeros()), several(list, &json!({}))];
                add_rules(node, vec![json!({ "not": { "allOf": both } })]);
            }
            Allowed::EachOfSeveral([list, key]) => {
                let lacks = json!({ "contains": { "not": { "required": [key] } } });
                add_rules(node, vec![json!({ "not": several(list, &lacks) })]);
            }
            Allowed::Kind(key, kinds) => {
                let all: Vec<&str> = kinds.iter().flat_map(own_keys).collect();
                let rules = kinds.iter().map(|kind| rule(key, kind, &all));
                add_rules(node, rules.collect());
                let names: Vec<&str> = kinds.iter().map(|(name, ..)| *name).collect();
                let properties = node.get_mut("properties");
                if let Some(Value::Object(own)) = properties.and_then(|all| all.get_mut(key)) {
                    own.insert("enum".into(), json!(names));
                }
            }
        }
    }
}

fn own_keys((_, needed, others): &Kind) -> impl Iterator<Item = &'static str> {
    needed.iter().chain(others.iter()).copied()
}

/// The rule of a kind: its required keys, and none of `all` keys of other kinds.
fn rule(key: &str, kind: &Kind, all: &[&str]) -> Value {
    let (name, needed, _) = kind;
    let foreign = all
        .iter()
        .filter(|key| !own_keys(kind).any(|own| own == **key));
    let without: Map<String, Value> = foreign
        .map(|key| ((*key).to_string(), json!(false)))
        .collect();
    json!({
        "if": { "properties": { key: { "const": name } }, "required": [key] },
        "then": { "required": needed, "properties": without },
    })
}

/// Adds rules that must all hold.
fn add_rules(node: &mut Map<String, Value>, rules: Vec<Value>) {
    let all = node.entry("allOf").or_insert_with(|| json!([]));
    if let Value::Array(all) = all {
        all.extend(rules);
    }
}

/// The schema of a key that is present, and neither false nor an empty list nor one of `defaults`.
fn is_given(key: &str, defaults: &[Value]) -> Value {
    let none = [json!(false), json!([])];
    let none: Vec<&Value> = none.iter().chain(defaults).collect();
    let counts = json!({ "not": { "enum": none } });
    json!({ "required": [key], "properties": { key: counts } })
}

/// Numbers that count as missing.
fn zeros() -> [Value; 2] {
    [json!(0.0), json!([0.0, 0.0, 0.0])]
}

/// The schema of a list with at least two entries that also matches `more`.
fn several(list: &str, more: &Value) -> Value {
    let count = json!({ "minItems": 2 });
    json!({ "required": [list], "properties": { list: { "allOf": [count, more] } } })
}

/// The JSON pointer to the schema of the values that match a pattern.
fn pointer(schema: &mut Schema, pattern: &str) -> Option<String> {
    let mut pointer = String::new();
    let pattern = pattern.replace('[', ".[");
    let steps: Vec<&str> = pattern.split('.').filter(|step| !step.is_empty()).collect();
    for step in &steps {
        let index = step
            .strip_prefix('[')
            .and_then(|step| step.strip_suffix(']'));
        let member = match index {
            Some("") => "items",
            Some(_) => {
                split_items(schema, &resolved(schema, pointer.clone(), "items")?);
                "prefixItems"
            }
            None if *step == "*" => "additionalProperties",
            None => "properties",
        };
        pointer = resolved(schema, pointer, member)?;
        pointer += &match member {
            "properties" => format!("/properties/{step}"),
            "prefixItems" => format!("/prefixItems/{}", index.unwrap_or_default()),
            member => format!("/{member}"),
        };
        schema.pointer(&pointer)?;
    }
    Some(pointer)
}

/// The pointer to the schema with `member`, through references and choices.
fn resolved(schema: &Schema, mut pointer: String, member: &str) -> Option<String> {
    loop {
        let node = schema.pointer(&pointer)?;
        if node.get(member).is_some() {
            return Some(pointer);
        }
        pointer = match (node.get("$ref"), node.get("anyOf")) {
            (Some(reference), _) => reference.as_str()?.strip_prefix('#')?.to_string(),
            (None, Some(choices)) => {
                let has =
                    |choice: &Value| choice.get(member).is_some() || choice.get("$ref").is_some();
                let index = choices.as_array()?.iter().position(has)?;
                format!("{pointer}/anyOf/{index}")
            }
            (None, None) => return None,
        };
    }
}

/// Gives each index of a list of fixed length its own schema.
fn split_items(schema: &mut Schema, pointer: &str) {
    let Some(Value::Object(list)) = schema.pointer_mut(pointer) else {
        return;
    };
    let length = list.get("maxItems").and_then(Value::as_u64).unwrap_or(0);
    let items = list.get("items").cloned().unwrap_or_default();
    let schemas = || (0..length).map(|_| items.clone()).collect::<Vec<_>>();
    list.entry("prefixItems")
        .or_insert_with(|| schemas().into());
}

#[cfg(any(test, feature = "test-support"))]
pub mod tests;
