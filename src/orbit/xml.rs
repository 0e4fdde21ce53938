//! XML of navigation data messages (CCSDS 505.0-B): tags of a whole file, and elements of a part.

use crate::lines::LineFinder;
use crate::record::{At, shorten};
use quick_xml::escape::resolve_xml_entity;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::borrow::Cow;

/// A tag, also an incomplete one.
pub(crate) struct Tag<'a> {
    pub start: usize,
    /// After its closing bracket.
    pub end: usize,
    /// Without prefix.
    pub name: &'a str,
    pub closing: bool,
}

impl Tag<'_> {
    /// Whether it begins an element of this name.
    pub fn opens(&self, name: &str) -> bool {
        self.name == name && !self.closing
    }
}

/// The value of the attribute `version` in the text of a start tag, with its brackets.
pub(crate) fn version(tag: &str) -> Option<String> {
    let inside = tag.strip_prefix('<')?.trim_end_matches(['>', '/']);
    let name = inside.find(char::is_whitespace)?;
    attribute(&BytesStart::from_content(inside, name), &["version"])
}

/// The tags from an offset on; comments and CDATA sections are skipped.
pub(crate) fn tags(text: &str, mut at: usize) -> impl Iterator<Item = Tag<'_>> {
    std::iter::from_fn(move || {
        loop {
            let start = at + text.get(at..)?.find('<')?;
            let rest = text.get(start..)?;
            let passed = [("<!--", "-->"), ("<![CDATA[", "]]>")];
            let passed = passed.iter().find(|(open, _)| rest.starts_with(open));
            if let Some((_, close)) = passed {
                at = start + rest.find(close)? + close.len();
                continue;
            }
            let inside = rest.get(1..)?;
            let bare = inside.strip_prefix('/').unwrap_or(inside);
            let ends = |c: char| c.is_whitespace() || matches!(c, '>' | '/' | '<');
            let name = bare.split(ends).next().unwrap_or_default();
            let close = closing_bracket(inside);
            at = start + 1 + close.unwrap_or(inside.len());
            let closed = close.is_some_and(|at| inside.as_bytes().get(at) == Some(&b'>'));
            return Some(Tag {
                start,
                end: at + usize::from(closed),
                name: name.rsplit(':').next().unwrap_or(name),
                closing: inside.starts_with('/'),
            });
        }
    })
}

/// Offset of the bracket that closes a tag: a quoted value may have `>`, but no `<` (XML 1.0, 2.4
/// and 3.1). For a tag or a quote that is not closed it is the first bracket.
fn closing_bracket(inside: &str) -> Option<usize> {
    let mut quote = None;
    for (at, byte) in inside.bytes().enumerate() {
        match (byte, quote) {
            (b'<', _) => break,
            (b'>', None) => return Some(at),
            (b'"' | b'\'', None) => quote = Some(byte),
            (byte, Some(open)) if byte == open => quote = None,
            _ => {}
        }
    }
    inside.find(['>', '<'])
}

/// Tags of navigation data messages, and of the NDM for several of them.
const ROOTS: [&str; 11] = [
    "ndm", "omm", "oem", "opm", "ocm", "cdm", "tdm", "rdm", "aem", "apm", "acm",
];

/// Whether a line of a text in another format begins XML of this kind.
pub(crate) fn begins(line: &str) -> bool {
    let mut tags = tags(line, 0);
    line.starts_with("<?xml")
        || line.starts_with("<!--")
        || tags.next().is_some_and(|tag| ROOTS.contains(&tag.name))
}

/// Text between messages or after the last one: offsets and contents.
pub(crate) fn between(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut tags = tags(text, 0).peekable();
    while let Some(tag) = tags.next() {
        if !tag.closing || !ROOTS.contains(&tag.name) {
            continue;
        }
        // Unknown tags are foreign too, such as those of a web page.
        let is_known = |tag: &Tag| ROOTS.contains(&tag.name) || tag.name.starts_with(['?', '!']);
        let next = tags.peek().filter(|next| is_known(next));
        let end = next.map_or(text.len(), |next| next.start);
        let rest = skip_comments(text.get(tag.end..end).unwrap_or_default());
        if !rest.is_empty() {
            found.push((end - rest.len(), rest));
        }
    }
    found
}

/// A text without leading blanks and comments.
fn skip_comments(mut text: &str) -> &str {
    loop {
        text = text.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
        let inside = text.strip_prefix("<!--");
        match inside.and_then(|inside| inside.split_once("-->")) {
            Some((_, after)) => text = after,
            None => return text,
        }
    }
}

/// The start of an element, or its name and text at its end; with the offset in the file after the
/// start tag.
pub(crate) enum Element<'a> {
    Start(BytesStart<'a>, usize),
    End(&'a str, &'a str, usize),
}

/// Reads the elements of a part of a file that starts at `start`. The finder gives the line numbers
/// of the handler's errors.
pub(crate) fn read_elements(
    text: &str,
    start: usize,
    finder: &mut LineFinder,
    mut handle: impl FnMut(Element, &mut LineFinder) -> At<()>,
) -> At<()> {
    let mut reader = Reader::from_str(text);
    let (mut value, mut begin) = (String::new(), start);
    loop {
        let event = reader.read_event().map_err(|error| {
            let offset = start + reader.error_position() as usize;
            (finder.line(offset), format!("not XML: {error}"))
        })?;
        let offset = start + reader.buffer_position() as usize;
        if decode(&event, &mut value).map_err(|reason| (finder.line(offset), reason))? {
            continue;
        }
        match event {
            Event::Start(tag) => {
                value.clear();
                begin = offset;
                handle(Element::Start(tag, offset), finder)?;
            }
            Event::End(tag) => {
                let name = tag.local_name().into_inner();
                handle(Element::End(name, &value, begin), finder)?;
                value.clear();
            }
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

/// The unit in a tag: `units` in the standard, `unit` in some files.
pub(crate) fn unit(tag: &BytesStart) -> Option<String> {
    attribute(tag, &["units", "unit"])
}

/// The value of the first attribute with one of these names, with references resolved (XML 1.0,
/// 3.3.3), or unchanged where a reference is unknown.
fn attribute(tag: &BytesStart, names: &[&str]) -> Option<String> {
    let mut attributes = tag.attributes().filter_map(Result::ok);
    let found = attributes.find(|attribute| {
        let name = attribute.key.into_inner();
        names.iter().any(|known| name.eq_ignore_ascii_case(known))
    })?;
    let value = found.normalized_value(XmlVersion::Implicit1_0);
    Some(value.unwrap_or(found.value).trim().to_owned())
}

/// Adds the text of an event to that of the open element; returns whether it was text.
fn decode(event: &Event, value: &mut String) -> Result<bool, String> {
    match event {
        Event::Text(text) => *value += &text.xml10_content(),
        Event::CData(text) => *value += &text.xml10_content(),
        Event::GeneralRef(entity) => {
            let known = resolve_xml_entity(entity).map(Cow::Borrowed);
            let letter = entity.resolve_char_ref().ok().flatten();
            let letter = letter.map(|letter| Cow::Owned(letter.to_string()));
            let unknown = || format!("not XML: unknown entity &{};", shorten(entity));
            *value += &known.or(letter).ok_or_else(unknown)?;
        }
        _ => return Ok(false),
    }
    Ok(true)
}
