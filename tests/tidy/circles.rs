//! No circular uses of files, directly or through other files.

use super::{code, files, is_rust, root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Files by module path (`scene::area::blur`), with the modules that they use.
type Uses = BTreeMap<String, BTreeSet<String>>;

/// Crates: the folder of their sources.
const CRATES: [&str; 11] = [
    "src",
    "src/base",
    "src/config",
    "src/link",
    "src/live",
    "src/measure",
    "src/orbit",
    "src/render",
    "protocols/src",
    "protocols/schema/src",
    "firmware-sim/src",
];

#[test]
fn no_files_use_each_other_in_circles() {
    let circles: Vec<String> = CRATES.iter().flat_map(|folder| circles(folder)).collect();
    assert!(
        circles.is_empty(),
        "circles of files: move their common items to a new file\n{}",
        circles.join("\n")
    );
}

/// Module path of a file below `folder`.
fn module(folder: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(folder).unwrap().with_extension("");
    let mut parts: Vec<&str> = inside.iter().map(|part| part.to_str().unwrap()).collect();
    if ["mod", "lib", "main"].contains(parts.last().unwrap()) {
        parts.pop();
    }
    parts.join("::")
}

fn circles(folder: &str) -> Vec<String> {
    let base = root().join(folder);
    let inner = |path: &Path| {
        let nested = |other: &&&str| other.len() > folder.len() && other.starts_with(folder);
        let mut nested = CRATES.iter().filter(nested);
        nested.any(|other| path.starts_with(root().join(other)))
    };
    let is_own = |path: &Path| is_rust(path) && !inner(path) && !path.ends_with("tests.rs");
    let mut sources = BTreeMap::new();
    for path in files(&base).into_iter().filter(|path| is_own(path)) {
        if !path.starts_with(base.join("tests")) {
            sources.insert(module(&base, &path), code(&path));
        }
    }
    let modules: BTreeSet<String> = sources.keys().cloned().collect();
    let uses: Uses = sources
        .iter()
        .map(|(name, code)| (name.clone(), used(name, code, &modules)))
        .collect();
    let reached: Uses = uses
        .keys()
        .map(|name| (name.clone(), reach(name, &uses)))
        .collect();
    let in_circle = |name: &&String| reached[*name].contains(*name);
    let line = |name: &String| {
        let others = uses[name]
            .iter()
            .filter(|other| reached[*other].contains(name));
        let others: Vec<&str> = others.map(String::as_str).collect();
        format!("{folder}: {name:?} uses {others:?}, which lead back to it")
    };
    reached.keys().filter(in_circle).map(line).collect()
}

/// All modules that `name` uses, directly or not.
fn reach(name: &str, uses: &Uses) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    let mut open = vec![name];
    while let Some(next) = open.pop() {
        for other in &uses[next] {
            if reached.insert(other.clone()) {
                open.push(other);
            }
        }
    }
    reached
}

/// The modules whose items the code of module `name` uses.
fn used(name: &str, code: &str, modules: &BTreeSet<String>) -> BTreeSet<String> {
    let flat = code.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut paths = Vec::new();
    for (at, _) in flat.match_indices("use ") {
        if !flat[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            let tree = flat[at + 4..].split(';').next().unwrap();
            expand("", tree, &mut paths);
        }
    }
    for root in ["crate::", "super::", "self::"] {
        for (at, _) in flat.match_indices(root) {
            let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            let end = flat[at..].find(|c| !is_path(c)).unwrap_or(flat.len() - at);
            let is_tree = flat[at..at + end].ends_with("::");
            if !is_tree && !flat[..at].ends_with(is_path) {
                paths.push(flat[at..at + end].to_string());
            }
        }
    }
    let found = paths.iter().filter_map(|path| target(name, path, modules));
    found.filter(|other| other != name).collect()
}

/// The paths of a tree of imports: `a::{b, c::D}` gives `a::b` and `a::c::D`.
fn expand(prefix: &str, tree: &str, paths: &mut Vec<String>) {
    let Some((head, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap().trim();
        paths.push(format!("{prefix}{path}"));
        return;
    };
    let inside = rest.rfind('}').map_or(rest, |end| &rest[..end]);
    let prefix = format!("{prefix}{}", head.trim());
    let (mut depth, mut from) = (0, 0);
    for (at, c) in inside.char_indices().chain([(inside.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !inside[from..at].trim().is_empty() {
                    expand(&prefix, inside[from..at].trim(), paths);
                }
                from = at + 1;
            }
            _ => {}
        }
    }
}

/// The module of a path: its longest prefix that is a module. A path through a parent module does
/// not use the parent.
fn target(name: &str, path: &str, modules: &BTreeSet<String>) -> Option<String> {
    let mut here: Vec<&str> = name.split("::").filter(|part| !part.is_empty()).collect();
    let mut parts = path.split("::").peekable();
    match parts.peek() {
        Some(&"crate") => {
            here.clear();
            parts.next();
        }
        Some(&"self") => {
            parts.next();
        }
        Some(&"super") => {
            while parts.next_if_eq(&"super").is_some() {
                here.pop();
            }
        }
        // A child of this module, or another crate.
        Some(first) => {
            let child = here.iter().chain([first]).copied().collect::<Vec<_>>();
            modules.get(&child.join("::"))?;
        }
        None => return None,
    }
    let whole: Vec<&str> = here.into_iter().chain(parts).collect();
    (0..=whole.len())
        .rev()
        .find_map(|length| modules.get(&whole[..length].join("::")).cloned())
}
