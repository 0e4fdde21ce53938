//! Columns of CSV, fields of JSON, keys of configurations, and the generated wire files.

use super::{assert_unchanged, output_of, repository};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Paths of all fields below a value: `objects[].snr`.
fn fields(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (key, member) in members {
                fields(member, &format!("{path}.{key}"), found);
            }
        }
        Value::Array(items) => {
            let path = format!("{path}[]");
            items.iter().for_each(|item| fields(item, &path, found));
        }
        _ => {
            found.insert(path.trim_start_matches('.').to_string());
        }
    }
}

#[test]
fn csv_columns_and_json_fields_are_unchanged() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let scene = |name: &str| repository(&format!("configs/scenes/{name}"));
    let (rcm, body) = (scene("rcm-2019-06-15"), scene("tumbling-rocket-body"));
    let (rcm, body) = (rcm.display(), body.display());
    let mut columns = String::new();
    let mut add = |name: &str, text: &str| {
        writeln!(columns, "{name}: {}", text.lines().next().unwrap()).unwrap();
    };
    add(
        "passes",
        &output_of(at, &format!("passes --scene {rcm} --csv")),
    );
    let cost = output_of(
        at,
        &format!("cost --scene {rcm} --frames 1 --rounds 5 --json --out cost"),
    );
    add(
        "cost",
        &std::fs::read_to_string(at.join("cost/cost.csv")).unwrap(),
    );
    let object = "--object 99002 --out curve";
    output_of(at, &format!("lightcurve --scene {body} {object}"));
    add(
        "lightcurve",
        &std::fs::read_to_string(at.join("curve/lightcurve.csv")).unwrap(),
    );
    assert_unchanged("csv_columns", &columns);

    let orbits = repository("configs/scenes/leo-570.tle");
    let orbits = orbits.display();
    let outputs = [
        ("cost", cost),
        (
            "passes",
            output_of(at, &format!("passes --scene {rcm} --json")),
        ),
        ("plan", output_of(at, &format!("plan --scene {rcm} --json"))),
        (
            "plan --measure",
            output_of(at, &format!("plan --scene {rcm} --measure --json")),
        ),
        (
            "catalog check",
            output_of(at, &format!("catalog check {orbits} --json")),
        ),
        (
            "catalog info",
            output_of(at, &format!("catalog info {orbits} --json")),
        ),
    ];
    let mut all = String::new();
    for (name, json) in outputs {
        let mut found = BTreeSet::new();
        fields(&serde_json::from_str(&json).unwrap(), "", &mut found);
        found
            .iter()
            .for_each(|field| writeln!(all, "{name}: {field}").unwrap());
    }
    assert_unchanged("json_fields", &all);
}

/// Paths of all keys of a JSON Schema, with their types, choices and ranges; references are
/// followed.
fn keys(schema: &Value, root: &Value, path: &str, depth: u32, found: &mut BTreeSet<String>) {
    assert!(depth < 40, "{path}: a circle of references");
    if let Some(reference) = schema["$ref"].as_str() {
        let target = root.pointer(reference.trim_start_matches('#')).unwrap();
        keys(target, root, path, depth + 1, found);
    }
    let mut rules = Vec::new();
    for rule in [
        "type",
        "enum",
        "const",
        "minimum",
        "maximum",
        "exclusiveMinimum",
        "exclusiveMaximum",
        "minItems",
        "maxItems",
        "required",
    ] {
        if let Some(value) = schema.get(rule) {
            rules.push(format!("{rule} {value}"));
        }
    }
    if !rules.is_empty() {
        found.insert(format!("{path}: {}", rules.join(", ")));
    }
    for (key, member) in schema["properties"].as_object().into_iter().flatten() {
        keys(member, root, &format!("{path}.{key}"), depth + 1, found);
    }
    for several in ["anyOf", "oneOf", "allOf", "prefixItems"] {
        for one in schema[several].as_array().into_iter().flatten() {
            keys(one, root, path, depth + 1, found);
        }
    }
    for (key, of) in [("items", "[]"), ("additionalProperties", ".*")] {
        if schema[key].is_object() {
            keys(&schema[key], root, &format!("{path}{of}"), depth + 1, found);
        }
    }
}

#[test]
fn keys_of_configurations_and_labels_are_unchanged() {
    let here = tempfile::tempdir().unwrap();
    let mut all = String::new();
    for kind in ["camera", "scene", "run", "population", "labels"] {
        let schema = output_of(here.path(), &format!("schema {kind}"));
        let schema: Value = serde_json::from_str(&schema).unwrap();
        let mut found = BTreeSet::new();
        keys(&schema, &schema, kind, 0, &mut found);
        found.iter().for_each(|key| writeln!(all, "{key}").unwrap());
    }
    assert_unchanged("keys", &all);
}

/// A text without the parts from mark `begin` to mark `end`.
fn without(text: &str, begin: &str, end: &str) -> String {
    let mut parts = text.split(begin);
    let mut rest = parts.next().unwrap().to_string();
    for part in parts {
        rest += part.split_once(end).unwrap().1;
    }
    rest
}

/// The generated files without comments and descriptions, which are prose.
#[test]
fn generated_wire_files_are_unchanged() {
    let read =
        |file: &str| std::fs::read_to_string(repository(&format!("protocols/{file}"))).unwrap();
    let c = without(&read("include/skyloop.h"), "/*", "*/");
    let xtce = without(&read("docs/skyloop.xtce.xml"), "<!--", "-->");
    let xtce = without(&xtce, " shortDescription=\"", "\"");
    let dbc = read("docs/skyloop.dbc");
    let dbc = dbc
        .lines()
        .filter(|line| !line.starts_with("VERSION") && !line.starts_with("CM_"));
    // Of the ICD only the rows of its tables, without the description in the last column.
    let icd = read("docs/icd.md");
    let rows = icd.lines().filter(|line| line.starts_with('|'));
    let rows = rows.map(|row| row.rsplitn(3, '|').last().unwrap());
    let files = [
        ("skyloop.h", c),
        ("skyloop.xtce.xml", xtce),
        ("skyloop.dbc", dbc.collect::<Vec<_>>().join("\n")),
        ("icd.md", rows.collect::<Vec<_>>().join("\n")),
        ("golden.h", without(&read("vectors/golden.h"), "/*", "*/")),
        (
            "golden.txt",
            without(&read("vectors/golden.txt"), "#", "\n"),
        ),
    ];
    let mut sums = String::new();
    for (name, text) in files {
        let words: Vec<&str> = text.split_whitespace().collect();
        let crc = crc32fast::hash(words.join(" ").as_bytes());
        writeln!(sums, "{name} {} words, crc {crc:08x}", words.len()).unwrap();
    }
    assert_unchanged("wire_files", &sums);
}
