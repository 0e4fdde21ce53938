//! Tables of the keys of files and of labels, from their JSON Schemas.

use super::page::{code, head, prose, row, wrapped};
use serde_json::Value;

/// A schema, and options of its tables.
pub struct Keys {
    pub schema: Value,
    /// Default values that the schema lacks.
    pub defaults: toml::Table,
    /// Whether the program writes the values: then keys have no default.
    pub is_output: bool,
}

impl Keys {
    /// A section for each table. `title` is the heading of the root table.
    pub fn sections(&self, title: &str) -> String {
        let mut text = String::new();
        let mut open = vec![(String::new(), &self.schema)];
        while let Some((place, table)) = open.pop() {
            let mut inner = Vec::new();
            text += &format!("### {}\n\n", self.heading(&place, table, title));
            text += &self.section(&place, table, &mut inner);
            open.extend(inner.into_iter().rev());
        }
        text
    }

    fn heading(&self, place: &str, table: &Value, title: &str) -> String {
        let kinds = listed(&table["properties"]["kind"]["enum"]);
        match place {
            "" => title.to_string(),
            _ if self.is_output && !kinds.is_empty() => {
                format!("`{place}` of kind {}", either(kinds))
            }
            _ => code(place),
        }
    }

    /// The section of one table; adds its nested tables to `inner`.
    fn section<'t>(&'t self, place: &str, table: &'t Value, inner: &mut Tables<'t>) -> String {
        let mut text = String::new();
        if let Some(about) = table["description"].as_str().filter(|_| !place.is_empty()) {
            text += &format!("{}\n\n", wrapped(&meaning(about), ""));
        }
        let third = if self.is_output { "Present" } else { "Default" };
        text += &head(&["Key", "Value", third, "Meaning"]);
        for (key, value) in table["properties"].as_object().into_iter().flatten() {
            let path = format!("{place}.{key}").trim_start_matches('.').to_string();
            let is_required = has(&table["required"], key);
            let allowed = self.allowed(value, &Value::Null, &path, inner);
            let third = match (self.is_output, is_required) {
                (true, true) => "always".to_string(),
                (false, true) => "required".to_string(),
                (true, false) => "where it applies".to_string(),
                (false, false) => self.default(&path, value).unwrap_or_default(),
            };
            let about = meaning(value["description"].as_str().unwrap_or_default());
            text += &row(&[&code(key), &allowed, &third, &about]);
        }
        let rules: Vec<String> = rules(table)
            .iter()
            .map(|rule| format!("{}\n", wrapped(&format!("- {rule}"), "  ")))
            .collect();
        let between = if rules.is_empty() { "" } else { "\n" };
        format!("{text}{between}{}\n", rules.concat())
    }

    /// The default value of a key.
    fn default(&self, path: &str, value: &Value) -> Option<String> {
        if let Some(default) = value.get("default").filter(|default| !default.is_null()) {
            return Some(code(&default.to_string()));
        }
        let (first, rest) = path.split_once('.').unwrap_or((path, ""));
        let mut found = self.defaults.get(first)?;
        for step in rest.split('.').filter(|step| !step.is_empty()) {
            found = found.get(step)?;
        }
        (!found.is_table()).then(|| code(&found.to_string()))
    }

    /// The allowed values. `around` is the schema that refers to this one and may limit it.
    fn allowed<'t>(
        &'t self,
        node: &'t Value,
        around: &Value,
        path: &str,
        inner: &mut Tables<'t>,
    ) -> String {
        if let Some(reference) = node["$ref"].as_str() {
            let target = self.schema.pointer(&reference[1..]).unwrap();
            return if reference.ends_with("/UTC") {
                "UTC time".to_string()
            } else {
                self.allowed(target, node, path, inner)
            };
        }
        if let Some(choices) = [&node["anyOf"], &node["oneOf"]]
            .iter()
            .find_map(|all| all.as_array())
            && !node["properties"].is_object()
        {
            let choices = choices.iter().filter(|one| one["type"] != "null");
            return either(
                choices
                    .map(|one| self.allowed(one, around, path, inner))
                    .collect(),
            );
        }
        if node["properties"].is_object() {
            inner.push((path.to_string(), node));
            return "table".to_string();
        }
        if let Some(word) = node["const"].as_str() {
            return code(&format!("{word:?}"));
        }
        if node["enum"].is_array() {
            return either(
                words(&node["enum"])
                    .map(|word| code(&format!("{word:?}")))
                    .collect(),
            );
        }
        let kinds = &node["type"];
        let text = match kinds.as_array().map_or(kinds, |kinds| &kinds[0]).as_str() {
            Some("array") => self.list(node, path, inner),
            Some("object") if node["additionalProperties"].is_object() => {
                let path = format!("{path}.NAME");
                let value = self.allowed(&node["additionalProperties"], node, &path, inner);
                format!("{value}, by name")
            }
            kind => self.scalar(node, around, kind.unwrap_or_default()),
        };
        let is_null = self.is_output && has(kinds, "null");
        text + if is_null { " or null" } else { "" }
    }

    /// The allowed values of a simple type. Values that the program writes have no limits.
    fn scalar(&self, node: &Value, around: &Value, kind: &str) -> String {
        let limit = |name: &str| {
            let limit = node.get(name).or(around.get(name)).and_then(Value::as_f64);
            limit.filter(|_| !self.is_output)
        };
        match kind {
            "object" => "table".to_string(),
            "boolean" => "`true` or `false`".to_string(),
            "string" => {
                let length = range(limit("minLength"), limit("maxLength"));
                let unit = if length.is_empty() { "" } else { " characters" };
                format!("text{length}{unit}")
            }
            kind => format!("{kind}{}", range(limit("minimum"), limit("maximum"))),
        }
    }

    /// The allowed items of a list.
    fn list<'t>(&'t self, node: &'t Value, path: &str, inner: &mut Tables<'t>) -> String {
        if let Some(places) = node["prefixItems"].as_array() {
            let places = places
                .iter()
                .map(|one| self.allowed(one, &Value::Null, path, inner));
            return format!("list: {}", places.collect::<Vec<_>>().join("; "));
        }
        let item = self.allowed(&node["items"], &Value::Null, &format!("{path}[]"), inner);
        let kinds = ["number", "integer", "text", "table", "list"];
        let items = match kinds
            .iter()
            .find_map(|kind| Some((kind, item.strip_prefix(kind)?)))
        {
            Some((kind, rest)) => format!("{kind}s{rest}"),
            None => item,
        };
        match (node["minItems"].as_u64(), node["maxItems"].as_u64()) {
            (Some(min), Some(max)) if min == max => format!("list of {min} {items}"),
            (Some(min), Some(max)) => format!("list of {min} to {max} {items}"),
            (Some(min), None) => format!("list of {min} or more {items}"),
            _ => format!("list of {items}"),
        }
    }
}

/// Pending tables with their paths, such as `optics.psf`.
type Tables<'t> = Vec<(String, &'t Value)>;

/// A description without rustdoc links.
fn meaning(text: &str) -> String {
    prose(&text.replace("[`", "`").replace("`]", "`"))
}

fn has(list: &Value, word: &str) -> bool {
    list.as_array()
        .is_some_and(|all| all.iter().any(|one| one == word))
}

fn words(list: &Value) -> impl Iterator<Item = &str> {
    let words = list.as_array().into_iter().flatten();
    words.filter_map(Value::as_str)
}

/// The words of a list as code.
fn listed(list: &Value) -> Vec<String> {
    words(list).map(code).collect()
}

fn either(mut choices: Vec<String>) -> String {
    choices.dedup();
    let has_commas = choices.iter().any(|one| one.contains(", "));
    let last = choices.pop().unwrap_or_default();
    if choices.is_empty() {
        last
    } else {
        let between = if has_commas { " or " } else { ", " };
        format!("{} or {last}", choices.join(between))
    }
}

/// A range of numbers; the maxima of 32 and 64 bits are no limits.
fn range(min: Option<f64>, max: Option<f64>) -> String {
    let number = |value: f64| match value.abs() {
        0.0 => "0".to_string(),
        1e-3..1e6 => value.to_string(),
        _ => format!("{value:e}"),
    };
    let max = max.filter(|max| ![u64::MAX as f64, f64::from(u32::MAX)].contains(max));
    match (min, max) {
        (Some(min), Some(max)) => format!(", {} to {}", number(min), number(max)),
        (Some(min), None) => format!(", {} or more", number(min)),
        _ => String::new(),
    }
}

/// The rules between keys of a table.
fn rules(table: &Value) -> Vec<String> {
    let mut rules = Vec::new();
    for (key, needed) in table["dependentRequired"].as_object().into_iter().flatten() {
        rules.push(format!("`{key}` needs {}.", listed(needed).join(", ")));
    }
    if let Some(choices) = table["oneOf"].as_array() {
        let keys = choices.iter().flat_map(|one| listed(&one["required"]));
        rules.push(format!(
            "Exactly one of {} is needed.",
            either(keys.collect())
        ));
    }
    rules.extend(table["allOf"].as_array().into_iter().flatten().map(rule));
    rules
}

fn rule(rule: &Value) -> String {
    let key_of = |node: &Value| node["required"][0].as_str().unwrap().to_string();
    let not = &rule["not"];
    if let Some([one, other]) = not["allOf"].as_array().map(Vec::as_slice) {
        let [key, other_key] = [one, other].map(key_of);
        return if other["properties"][&other_key]["allOf"].is_array() {
            format!("`{key}` excludes several `{other_key}`.")
        } else {
            format!("`{key}` and `{other_key}` exclude each other.")
        };
    }
    if not.is_object() {
        let list = key_of(not);
        let lacking = &not["properties"][&list]["allOf"][1]["contains"]["not"];
        return format!("Of several `{list}` each needs `{}`.", key_of(lacking));
    }
    let key = key_of(&rule["if"]);
    let kind = &rule["if"]["properties"][&key]["const"];
    let needs = listed(&rule["then"]["required"]);
    let others = rule["then"]["properties"].as_object().into_iter().flatten();
    let others: Vec<String> = others.map(|(key, _)| code(key)).collect();
    let needs = if needs.is_empty() {
        "no other key".to_string()
    } else {
        needs.join(", ")
    };
    if others.is_empty() {
        format!("`{key} = {kind}` needs {needs}.")
    } else {
        format!(
            "`{key} = {kind}` needs {needs}; it excludes {}.",
            others.join(", ")
        )
    }
}
