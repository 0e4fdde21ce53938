//! Links of the pages are valid; pages, lines and sentences are short and use plain words.

use super::words::avoided;
use super::{page, root};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Bytes of `README.md` and `ARCHITECTURE.md`, and of a page of `docs/`.
const MAX_ENTRANCE: usize = 12_288;
const MAX_PAGE: usize = 16_384;
/// Columns of a line of prose, and words of a sentence.
const MAX_COLUMNS: usize = 100;
const MAX_WORDS: usize = 35;

/// The Markdown files below a folder, by their paths from the root.
fn below(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::from(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if root().join(&path).is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "md") {
                found.push(path.to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}

/// Hand-written pages: the entrances, and `docs/` without the generated reference.
fn written() -> Vec<String> {
    let docs = below("docs").into_iter();
    let docs = docs.filter(|page| !page.starts_with("docs/reference/"));
    ["README.md", "ARCHITECTURE.md"]
        .map(str::to_string)
        .into_iter()
        .chain(docs)
        .collect()
}

/// A line of Markdown and whether it is code: in a fence, or indented after a blank line.
fn lines(text: &str) -> Vec<(&str, bool)> {
    let (mut fenced, mut after_blank, mut indented) = (false, true, false);
    let mark = |line| {
        let line: &str = line;
        let is_fence = line.trim_start().starts_with("```");
        fenced ^= is_fence;
        indented = line.starts_with("    ") && (after_blank || indented);
        after_blank = line.trim().is_empty();
        (line, fenced || is_fence || indented)
    };
    text.lines().map(mark).collect()
}

/// Whether a list's item begins on this line.
fn is_item(line: &str) -> bool {
    let line = line.trim_start();
    let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
    line.starts_with("- ") || (number.len() < line.len() && number.starts_with(". "))
}

/// The paragraphs and items of a page, each with the number of its first line, without code, tables
/// and headings.
fn paragraphs(text: &str) -> Vec<(usize, String)> {
    let mut all: Vec<(usize, String)> = Vec::new();
    let mut is_open = false;
    for (number, (line, is_code)) in lines(text).into_iter().enumerate() {
        if is_code || line.trim().is_empty() || line.starts_with(['|', '#', '<']) {
            is_open = false;
        } else if is_open && !is_item(line) {
            let (_, paragraph) = all.last_mut().unwrap();
            *paragraph += " ";
            *paragraph += line.trim();
        } else {
            all.push((number + 1, line.trim().to_string()));
            is_open = true;
        }
    }
    all
}

/// A paragraph with links replaced by their text and spans of code by one word.
fn spoken(paragraph: &str) -> String {
    let mut text = String::new();
    for (at, part) in paragraph.split('`').enumerate() {
        text += if at % 2 == 0 { part } else { "code" };
    }
    while let Some((before, rest)) = text.split_once("](") {
        let rest = rest.split_once(')').map_or("", |(_, rest)| rest);
        text = format!("{before}{rest}");
    }
    text
}

/// The sentences of a text: each ends with a punctuation mark before a blank.
fn sentences(text: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    for word in text.split_whitespace() {
        let last = all.last_mut().unwrap();
        *last += word;
        *last += " ";
        let bare = word.trim_end_matches(['"', '\'', ')', '*', '_', ']']);
        if bare.ends_with(['.', '!', '?']) {
            all.push(String::new());
        }
    }
    all
}

#[test]
fn the_entrances_and_pages_are_short() {
    for path in written() {
        let size = page(&path).len();
        let is_entrance = !path.starts_with("docs/");
        let max = if is_entrance { MAX_ENTRANCE } else { MAX_PAGE };
        assert!(size <= max, "{path}: {size} bytes, of at most {max}");
    }
}

#[test]
fn lines_of_prose_have_at_most_100_columns() {
    let mut long = Vec::new();
    for path in written() {
        for (number, (line, is_code)) in lines(&page(&path)).into_iter().enumerate() {
            let is_free = is_code || line.starts_with('|') || line.contains("](");
            let columns = line.chars().count();
            if !is_free && columns > MAX_COLUMNS {
                long.push(format!("{path}:{}: {columns} columns", number + 1));
            }
        }
    }
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn sentences_have_at_most_35_words() {
    let mut long = Vec::new();
    for path in written() {
        for (number, paragraph) in paragraphs(&page(&path)) {
            for sentence in sentences(&spoken(&paragraph)) {
                let words = sentence.split_whitespace().count();
                if words > MAX_WORDS {
                    long.push(format!("{path}:{number}: {words} words: {sentence}"));
                }
            }
        }
    }
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn pages_use_plain_words() {
    let mut found = Vec::new();
    // This page lists the words that are to be replaced.
    for path in written()
        .iter()
        .filter(|path| !path.ends_with("/names-to-change.md"))
    {
        for (number, (line, is_code)) in lines(&page(path)).into_iter().enumerate() {
            let text = if is_code {
                String::new()
            } else {
                spoken(line).to_lowercase()
            };
            for (word, plain) in avoided(&text) {
                found.push(format!("{path}:{}: {word}: {plain}", number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn sentences_and_code_are_distinguished() {
    let text = "# Head line.\n\nOne `a. b` [two\nthree](x.md). Four!\n\n    code. code\n\n- five\n";
    let read: Vec<String> = paragraphs(text)
        .iter()
        .flat_map(|(_, paragraph)| sentences(&spoken(paragraph)))
        .filter(|sentence| !sentence.is_empty())
        .collect();
    assert_eq!(read, ["One code [two three. ", "Four! ", "- five "]);
}

/// The anchor of a heading, as in GitHub and mdBook.
fn anchor(heading: &str) -> String {
    let text = heading.to_lowercase();
    let text = text
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    text.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The anchors of a page.
fn anchors(text: &str) -> Vec<String> {
    let headings = lines(text).into_iter().filter(|(_, is_code)| !is_code);
    let headings = headings.filter_map(|(line, _)| line.trim_start_matches('#').strip_prefix(' '));
    headings.map(anchor).collect()
}

/// The targets of a page's links.
fn targets(text: &str) -> Vec<String> {
    let prose: Vec<&str> = lines(text)
        .into_iter()
        .filter_map(|(line, is_code)| (!is_code).then_some(line))
        .collect();
    let prose = prose.join(" ");
    let ends = prose.split("](").skip(1);
    let targets = ends.filter_map(|rest| Some(rest.split_once(')')?.0.to_string()));
    targets.collect()
}

/// The fault of a link from a page, if any. `known` caches the anchors of files.
fn fault(path: &str, target: &str, known: &mut BTreeMap<PathBuf, Vec<String>>) -> Option<String> {
    let here = root().join(path);
    let (file, heading) = target.split_once('#').unwrap_or((target, ""));
    let file = if file.is_empty() {
        here
    } else {
        here.parent().unwrap().join(file)
    };
    if !file.exists() {
        return Some(format!("{path}: no file of the link {target}"));
    }
    let read = |file: &PathBuf| anchors(&std::fs::read_to_string(file).unwrap());
    let is_there = heading.is_empty() || {
        let anchors = known.entry(file).or_insert_with_key(read);
        anchors.iter().any(|anchor| anchor == heading)
    };
    (!is_there).then(|| format!("{path}: no heading of the link {target}"))
}

#[test]
fn links_lead_to_files_and_headings() {
    let mut pages = below("docs");
    pages.extend(["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(str::to_string));
    pages.extend(below("protocols/docs"));
    let mut known = BTreeMap::new();
    let (mut links, mut faults) = (0, Vec::new());
    for path in &pages {
        let targets = targets(&page(path)).into_iter();
        for target in targets.filter(|target| !target.contains("://")) {
            links += 1;
            faults.extend(fault(path, &target, &mut known));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(links > 200, "{links}");
}

#[test]
fn the_summary_lists_every_page_once() {
    let mut listed = targets(&page("docs/SUMMARY.md"));
    listed.sort();
    let pages = below("docs").into_iter();
    let pages = pages.filter_map(|path| Some(path.strip_prefix("docs/")?.to_string()));
    let pages: Vec<String> = pages.filter(|path| path != "SUMMARY.md").collect();
    assert_eq!(listed, pages);
}
