//! Splits a text into parts with messages of one kind: files are often joined from others.

use crate::lines::{self, Part};
use crate::{omm, tle, xml};
use memchr::{memchr, memchr3, memmem};

/// Kind of a part.
#[derive(Clone, Copy, PartialEq)]
enum Kind<'a> {
    /// Lines before the first message, or no message.
    Start,
    /// A CCSDS message, by its first keyword.
    Message(&'a str),
    /// Two-line element sets.
    Lines,
    Xml,
    Json,
    Table,
}

/// Cuts a text where messages of another kind begin: at `CCSDS_..._VERS`, at lines that begin XML,
/// JSON or a CSV table, and at two-line element sets after any of these, with their name.
pub(crate) fn parts(text: &str) -> Vec<Part<'_>> {
    let mut cuts = vec![(0, 0)];
    let mut kind = Kind::Start;
    // A fast search first: most catalogues have no message.
    let bytes = text.as_bytes();
    let has_message = memmem::find(bytes, b"CCSDS_").is_some()
        || memchr3(b'<', b'{', b'[', bytes).is_some()
        || memchr(b',', bytes).is_some();
    // The last line that is no comment, with its number.
    let mut before: Option<(usize, &str)> = None;
    let lines = lines::numbered(if has_message { text } else { "" });
    let mut lines = lines.peekable();
    while let Some((number, whole)) = lines.next() {
        let line = whole.trim_start();
        if lines::is_comment(line) {
            continue;
        }
        let offset = |line: &str| line.as_ptr().addr() - text.as_ptr().addr();
        let starts = starts(line, text.get(offset(line)..).unwrap_or_default()).or_else(|| {
            let next = lines.peek().map_or("", |(_, next)| next.trim_start());
            let is_set = tle::is_set(line, next);
            (is_set && kind != Kind::Start).then_some(Kind::Lines)
        });
        if let Some(new) = starts.filter(|new| *new != kind) {
            if let Some(before) = before {
                let is_named = new == Kind::Lines && is_name(before.1, kind);
                let (first, line) = if is_named { before } else { (number, whole) };
                cuts.push((offset(line), first - 1));
            }
            kind = new;
        }
        before = Some((number, whole));
    }
    let ends = cuts.iter().skip(1).map(|(offset, _)| *offset);
    let parts = cuts.iter().zip(ends.chain([text.len()]));
    let part = |(&(start, lines_before), end)| Part {
        text: text.get(start..end).unwrap_or_default(),
        lines_before,
    };
    parts.map(part).collect()
}

/// The kind of message that a line starts; `rest` is the text from this line on.
fn starts<'a>(line: &'a str, rest: &str) -> Option<Kind<'a>> {
    match line.as_bytes().first() {
        Some(b'<') => return xml::begins(line).then_some(Kind::Xml),
        Some(b'[' | b'{') => return omm::json::begins_object(rest).then_some(Kind::Json),
        _ if !line.contains('=') && omm::csv::begins(line) => return Some(Kind::Table),
        _ => {}
    }
    let (keyword, rest) = line.split_once("_VERS")?;
    let is_start = keyword.starts_with("CCSDS_") && rest.trim_start().starts_with('=');
    is_start.then_some(Kind::Message(keyword))
}

/// Whether a line between a message and an element set is the name of the set, and not part of the
/// message.
fn is_name(line: &str, kind: Kind) -> bool {
    let line = line.trim_start();
    match kind {
        Kind::Xml => return !line.contains('<'),
        Kind::Json => return !line.starts_with(['{', '[', '}', ']', '"']),
        Kind::Table => return !line.contains(','),
        Kind::Start | Kind::Message(_) | Kind::Lines => {}
    }
    let is_epoch = line.as_bytes().get(4) == Some(&b'-') && line.contains('T');
    !line.contains('=') && !line.ends_with("_STOP") && !is_epoch
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::SET;

    #[test]
    fn a_text_is_cut_where_another_kind_begins() {
        let oem = "CCSDS_OEM_VERS = 2.0\nMETA_STOP\n2000-06-27T00:00:00 7000 0 0 0 7.5 0\n";
        let omm = "CCSDS_OMM_VERS = 2.0\nBSTAR = 0\n";
        let xml = "<?xml version=\"1.0\"?>\n<omm/>\n";
        let json = "[\n{\"EPOCH\":1}\n]\n";
        for (texts, wanted) in [
            (vec![oem], vec![0]),
            (vec![oem, oem], vec![0]),
            (vec!["\n# a\n", oem, omm], vec![0, 5]),
            (vec![omm, oem, omm], vec![0, 2, 5]),
            (vec![SET, oem, SET], vec![0, 2, 5]),
            (vec![SET, "A NAME\n", SET], vec![0]),
            (vec![oem, "A NAME\n", SET, omm], vec![0, 3, 6]),
            (vec![oem, "A NAME\n\n", SET], vec![0, 3]),
            (vec![omm, SET, SET], vec![0, 2]),
            (vec![SET, xml, SET], vec![0, 2, 4]),
            (vec![SET, json, "A NAME\n", SET], vec![0, 2, 5]),
            (vec![SET, "NORAD_CAT_ID,EPOCH\n1,2\n", SET], vec![0, 2, 4]),
            (vec!["[A] NAME, 1\n", SET, "<B>\n", SET], vec![0]),
            (vec!["<B>\n", SET, "{C\n", SET], vec![0]),
            (vec![omm, "\u{feff}", oem], vec![0, 2]),
            (vec![""], vec![0]),
        ] {
            let text = texts.concat();
            let parts = parts(&text);
            let lines: Vec<usize> = parts.iter().map(|part| part.lines_before).collect();
            assert_eq!(lines, wanted, "{text}");
            let joined: Vec<&str> = parts.iter().map(|part| part.text).collect();
            assert_eq!(joined.concat(), text);
        }
    }
}
