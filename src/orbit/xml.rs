//! XML of navigation data messages (CCSDS 505.0-B): tags of a whole file, and the elements of a part of it.

use crate::lines::LineFinder;
use crate::record::{At, shorten};
use quick_xml::escape::resolve_xml_entity;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::borrow::Cow;

/// A tag, or what of it there is.
pub(crate) struct Tag<'a> {
    pub start: usize,
    /// Behind its closing bracket.
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

/// The value of the attribute `version` in the text of a start tag, brackets included.
pub(crate) fn version(tag: &str) -> Option<String> {
    let inside = tag.strip_prefix('<')?.trim_end_matches(['>', '/']);
    let name = inside.find(char::is_whitespace)?;
    attribute(&BytesStart::from_content(inside, name), &["version"])
}

/// The tags from an offset on; comments and quoted sections are passed over.
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

/// Place of the bracket that closes a tag: a quoted value may have `>`, but no `<` (XML 1.0, 2.4
/// and 3.1). Of a tag that is not closed, or whose quotes are not, the first bracket.
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

/// Messages of navigation data, and what holds several of them.
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

/// Text between messages or behind the last, which belongs to none: offsets, and what stands there.
pub(crate) fn between(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut tags = tags(text, 0).peekable();
    while let Some(tag) = tags.next() {
        if !tag.closing || !ROOTS.contains(&tag.name) {
            continue;
        }
        // Tags of no message are foreign too, such as those of a page.
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

/// A text without the blanks and comments that it begins with.
fn skip_comments(mut text: &str) -> &str {
    loop {
        text = text.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
        let inside = text.strip_prefix("<!--");
        match inside.and_then(|inside| inside.split_once("-->")) {
            Some((_, behind)) => text = behind,
            None => return text,
        }
    }
}

/// The start of an element, or its end with its text, and the offset in the file behind the start tag.
pub(crate) enum Element<'a> {
    Start(BytesStart<'a>, usize),
    End(&'a str, &'a str, usize),
}

/// Reads the elements of a part of a file that starts at `start`. The handler's errors have a line, which the finder gives.
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

/// The unit that a tag gives its element: `units` in the standard, `unit` in some files.
pub(crate) fn unit(tag: &BytesStart) -> Option<String> {
    attribute(tag, &["units", "unit"])
}

/// The value of the first attribute with one of these names, without its references (XML 1.0, 3.3.3); as it stands where one is unknown.
fn attribute(tag: &BytesStart, names: &[&str]) -> Option<String> {
    let mut attributes = tag.attributes().filter_map(Result::ok);
    let found = attributes.find(|attribute| {
        let name = attribute.key.into_inner();
        names.iter().any(|known| name.eq_ignore_ascii_case(known))
    })?;
    let value = found.normalized_value(XmlVersion::Implicit1_0);
    Some(value.unwrap_or(found.value).trim().to_owned())
}

/// Adds what an event says to the text of the element that is open. Whether it is text.
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
