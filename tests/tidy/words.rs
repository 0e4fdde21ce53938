//! Comments and identifiers use plain words, and comments fit in 100 columns.

use super::{files, is_rust, name, root};
use vocabulary::avoided;

#[path = "../support/words.rs"]
mod vocabulary;

/// Columns of a line that is a comment; links and tables may be longer.
const MAX_COLUMNS: usize = 100;

/// Files, and the words that are right in them.
const ALLOWED: &[(&str, &[&str])] = &[
    // They list the words.
    ("tests/support/words.rs", &[""]),
    ("tests/documents/prose.rs", &[""]),
    // The ICD counts octets, as CCSDS does.
    ("protocols/", &["octet", "octets"]),
    ("tests/tidy/words.rs", &["octet", "octets"]),
    // A type of `nix`.
    ("src/live/host.rs", &["who"]),
];

/// Identifiers that other programs read: fields of labels, reports and packets.
const OUTPUT_NAMES: &[&str] = &[
    "first_octet",
    "first_octet_ms",
    "first_octet_s",
    "last_octet",
    "last_octet_s",
];

/// The comment and the code of each line of a source, the code without its strings.
fn lines(text: &str) -> Vec<(String, String)> {
    let mut all = vec![(String::new(), String::new())];
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let hashes = rest
            .strip_prefix('r')
            .map_or(0, |rest| rest.len() - rest.trim_start_matches('#').len());
        let raw = format!("r{}\"", "#".repeat(hashes));
        let length = if rest.starts_with("//") {
            let comment = rest.lines().next().unwrap();
            all.last_mut().unwrap().0 += comment;
            comment.len()
        } else if rest.starts_with(&raw) && !ends_in_name(all.last()) {
            let end = raw[1..].chars().rev().collect::<String>();
            raw.len() + rest[raw.len()..].find(&end).unwrap() + end.len()
        } else if c == '"' {
            1 + string_length(&rest[1..])
        } else if rest.starts_with("'\"'") {
            3
        } else {
            all.last_mut().unwrap().1.push(c);
            c.len_utf8()
        };
        let breaks = rest[..length].matches('\n').count();
        all.extend((0..breaks).map(|_| (String::new(), String::new())));
        rest = &rest[length..];
    }
    all
}

/// Whether the code of the last line ends within an identifier, so that an `r` belongs to it.
fn ends_in_name(line: Option<&(String, String)>) -> bool {
    line.is_some_and(|(_, code)| code.ends_with(|c: char| c.is_alphanumeric() || c == '_'))
}

/// The length of a string behind its first quote, with the last.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    let end = text.find(|c| {
        let ends = c == '"' && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        ends
    });
    end.map_or(text.len(), |end| end + 1)
}

/// The identifiers of a line of code with their parts apart: `PixelDn` is `Pixel Dn`.
fn parts(code: &str) -> String {
    let names = code.split(|c: char| !c.is_alphanumeric() && c != '_');
    let mut text = String::new();
    for name in names.filter(|name| !OUTPUT_NAMES.contains(name)) {
        let mut was_lower = false;
        for c in name.chars() {
            if c.is_uppercase() && was_lower {
                text.push(' ');
            }
            was_lower = c.is_lowercase();
            text.push(c);
        }
        text.push(' ');
    }
    text
}

/// The Rust files that people write, by name, with their text.
fn sources() -> impl Iterator<Item = (String, String)> {
    let paths = files(root()).into_iter().filter(|path| is_rust(path));
    let paths = paths.filter(|path| !path.iter().any(|part| part == "generated"));
    paths.map(|path| (name(&path), std::fs::read_to_string(path).unwrap()))
}

#[test]
fn comments_and_names_use_plain_words() {
    let mut found = Vec::new();
    for (path, text) in sources() {
        let allowed = ALLOWED.iter().filter(|(place, _)| path.starts_with(place));
        let allowed: Vec<&str> = allowed.flat_map(|(_, words)| *words).copied().collect();
        if allowed.contains(&"") {
            continue;
        }
        for (number, (comment, code)) in (1..).zip(lines(&text)) {
            for (word, plain) in avoided(&format!("{comment} {}", parts(&code))) {
                if !allowed.contains(&word) {
                    found.push(format!("{path}:{number}: {word}: {plain}"));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}: {:#?}", found.len(), found);
}

#[test]
fn comments_fit_in_100_columns() {
    let mut wide = Vec::new();
    for (path, text) in sources() {
        for (number, line) in (1..).zip(text.lines()) {
            let Some(comment) = line.trim_start().strip_prefix("//") else {
                continue;
            };
            let is_table = comment.trim_start_matches(['/', '!', ' ']).starts_with('|');
            if line.chars().count() > MAX_COLUMNS && !comment.contains("://") && !is_table {
                wide.push(format!("{path}:{number}"));
            }
        }
    }
    assert!(wide.is_empty(), "{}: {wide:#?}", wide.len());
}

#[test]
fn comments_code_and_strings_are_separated() {
    let text = "let a = \"one\n\\\" two\"; // three\nlet PixelDn = r#\"\"four\"#;\n";
    let read: Vec<String> = lines(text)
        .into_iter()
        .map(|(comment, code)| format!("{comment}|{}", parts(&code)))
        .collect();
    let expected = ["|let a    ", "// three|  ", "|let Pixel Dn    ", "|"];
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(
        read.iter().map(|line| squeezed(line)).collect::<Vec<_>>(),
        expected.map(squeezed)
    );
}
