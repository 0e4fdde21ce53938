//! OMM in XML, alone or many of them in an NDM (CCSDS 505.0-B).

use super::{Fields, Metadata, index_of};
use crate::lines::LineFinder;
use crate::record::{At, Found, Record, shorten};
use quick_xml::Reader;
use quick_xml::escape::resolve_xml_entity;
use quick_xml::events::Event;
use std::borrow::Cow;

/// Whether an XML text has a message of this kind.
pub(crate) fn looks_like(text: &str) -> bool {
    tags(text, 0).any(|tag| tag.opens("omm"))
}

/// Reads every message by itself, so that one which is damaged does not take the others with it.
pub(crate) fn read(text: &str, found: &mut Found) {
    let mut finder = LineFinder::new(text);
    let mut messages = tags(text, 0).filter(|tag| tag.name == "omm").peekable();
    while let Some(tag) = messages.next() {
        let line = finder.line(tag.start);
        if tag.closing {
            found.reject(line, "</omm> without its <omm>".to_owned());
            continue;
        }
        match messages.next_if(|next| next.closing) {
            Some(end) => {
                let message = text.get(tag.start..end.end).unwrap_or_default();
                let record = record(message, tag.start, &mut finder);
                found.take(record.map(|record| Record { line, ..record }));
            }
            None => found.take(Err((line, "<omm> without its </omm>".to_owned()))),
        }
    }
    let whole = tags(text, 0).filter(|tag| tag.name == "ndm");
    let open = whole.fold(0, |open, tag| open + if tag.closing { -1 } else { 1 });
    if open > 0 {
        let line = finder.line(text.trim_end().len());
        found.reject(
            line,
            "<ndm> without its </ndm>: the file is cut off".to_owned(),
        );
    }
}

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
            let close = inside.find(['>', '<']);
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

/// The record of a message that starts at an offset of the text.
fn record(message: &str, start: usize, finder: &mut LineFinder) -> At<Record> {
    let mut reader = Reader::from_str(message);
    let mut fields = Fields::default();
    // The keyword that is open, where its value starts, and what of it is read.
    let mut open: Option<(usize, usize)> = None;
    let mut value = String::new();
    loop {
        let event = reader.read_event().map_err(|error| {
            let offset = start + reader.error_position() as usize;
            (finder.line(offset), format!("not XML: {error}"))
        })?;
        let is_text = decode(&event, &mut value).map_err(|reason| {
            let offset = start + reader.buffer_position() as usize;
            (finder.line(offset), reason)
        })?;
        if is_text {
            continue;
        }
        match event {
            Event::Start(tag) => {
                let keyword = index_of(tag.local_name().into_inner());
                open = keyword.map(|index| (index, reader.buffer_position() as usize));
                value.clear();
                let unit = tag.try_get_attribute("units").ok().flatten();
                if let (Some((index, offset)), Some(unit)) = (open, unit) {
                    fields.unit(index, &unit.value, start + offset);
                }
            }
            Event::End(_) => {
                if let Some((index, offset)) = open.take() {
                    let value = Cow::Owned(std::mem::take(&mut value));
                    fields.set(index, value, start + offset);
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    let record = fields.record(start, Metadata::Required);
    record.map_err(|(offset, reason)| (finder.line(offset), reason))
}

/// Adds what an event says to the text of the element that is open. Whether it is text.
pub(crate) fn decode(event: &Event, value: &mut String) -> Result<bool, String> {
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
