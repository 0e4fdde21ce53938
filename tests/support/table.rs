//! Tables of cases as text, a line for each case.
#![allow(dead_code, reason = "each test program uses its own part of this")]

/// The rows of a table: an input, then its texts, separated by ` | `. A line that starts with `|`
/// continues the row above it; a line that starts with `//` is a comment.
pub fn rows(table: &str) -> Vec<(&str, Vec<&str>)> {
    let mut rows: Vec<(&str, Vec<&str>)> = Vec::new();
    let lines = table.lines().map(str::trim);
    for line in lines.filter(|line| !line.is_empty() && !line.starts_with("//")) {
        let mut parts = line.split(" | ").map(str::trim);
        match line.strip_prefix("| ") {
            Some(more) => rows.last_mut().unwrap().1.extend(more.split(" | ")),
            None => rows.push((parts.next().unwrap(), parts.collect())),
        }
    }
    rows
}

/// Calls `refusal` with the input of each row (`\n` is a line break) and asserts that the message
/// has the row's texts.
pub fn check_refusals(table: &str, refusal: impl Fn(&str) -> String) {
    for (input, words) in rows(table) {
        let message = refusal(&input.replace("\\n", "\n"));
        for word in words {
            assert!(
                message.contains(word),
                "{input}\n{message}\nhas no {word:?}"
            );
        }
    }
}
