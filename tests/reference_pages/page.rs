//! Generated parts of the pages in `docs/reference/`: compared with the texts of the program, or
//! renewed with `SKYLOOP_WRITE_DOCS=1`.

use std::fmt::Display;
use std::path::Path;

/// Checks a part of a page, between the comments `begin PART` and `end PART`. `test` is the test
/// binary that generates it.
pub fn check(page: &str, part: &str, text: &str, test: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.ancestors().map(|root| root.join("docs/reference"));
    let path = folder
        .map(|folder| folder.join(page))
        .find(|path| path.is_file())
        .unwrap();
    let found = std::fs::read_to_string(&path).unwrap();
    let [begin, end] = ["begin", "end"].map(|word| format!("<!-- {word} {part} -->\n"));
    let (before, rest) = found.split_once(&begin).unwrap();
    let (old, after) = rest.split_once(&end).unwrap();
    let text = format!("\n{}\n\n", text.trim());
    if std::env::var("SKYLOOP_WRITE_DOCS").is_ok_and(|value| value == "1") {
        return std::fs::write(&path, [before, &begin, &text, &end, after].concat()).unwrap();
    }
    let first = old.lines().zip(text.lines()).find(|(old, new)| old != new);
    assert!(
        old == text,
        "docs/reference/{page} is stale, first here (old, new): {first:?}\n\
         renew it: SKYLOOP_WRITE_DOCS=1 cargo test --test {test}"
    );
}

/// Text in lines of at most 100 columns, all but the first with this indent.
pub fn wrapped(text: &str, indent: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().unwrap();
        if line.is_empty() {
            *line = word.to_string();
        } else if line.chars().count() + 1 + word.chars().count() <= 100 {
            *line += &format!(" {word}");
        } else {
            lines.push(format!("{indent}{word}"));
        }
    }
    lines.join("\n")
}

/// A row of a table.
pub fn row<S: Display>(cells: &[S]) -> String {
    let cells: String = cells.iter().map(|cell| format!(" {cell} |")).collect();
    format!("|{}\n", cells.replace("|  |", "| |"))
}

/// The head of a table.
pub fn head<S: Display>(cells: &[S]) -> String {
    row(cells) + &format!("|{}\n", "---|".repeat(cells.len()))
}

/// Text in a cell of a table, with the special characters of Markdown escaped.
pub fn prose(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let text = words.join(" ");
    let plain = |text: &str| text.replace('<', "\\<").replace('*', "\\*");
    let parts = text.split('`').enumerate().map(|(at, part)| match at % 2 {
        0 => plain(part),
        _ => format!("`{part}`"),
    });
    parts.collect::<String>().replace('|', "\\|")
}

/// A word of the program in a cell of a table.
pub fn code(text: &str) -> String {
    format!("`{}`", text.replace('|', "\\|"))
}
