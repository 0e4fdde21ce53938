//! OMM in XML, alone or many of them in an NDM (CCSDS 505.0-B).

use super::{Fields, Key};
use crate::Contents;
use crate::lines::{LineFinder, Part};
use crate::record::{At, Record, check_version};
use crate::xml::{Element, read_elements, tags, unit, version};
use std::borrow::Cow;

/// Whether an XML text has an OMM.
pub(crate) fn looks_like(text: &str) -> bool {
    tags(text, 0).any(|tag| tag.opens("omm"))
}

/// Reads every message by itself: a damaged one does not affect the others.
pub(crate) fn read(part: &Part, found: &mut Contents) {
    let (text, mut finder) = (part.text, part.finder());
    let mut messages = tags(text, 0).filter(|tag| tag.name == "omm").peekable();
    while let Some(tag) = messages.next() {
        let line = finder.line(tag.start);
        if tag.closing {
            found.reject(line, "</omm> without its <omm>");
            continue;
        }
        let Some(end) = messages.next_if(|next| next.closing) else {
            found.take(Err((line, "<omm> without its </omm>".to_owned())));
            continue;
        };
        let version = text.get(tag.start..tag.end).and_then(version);
        let checked = version.map_or(Ok(()), |version| check_version("CCSDS_OMM_VERS", &version));
        let message = text.get(tag.start..end.end).unwrap_or_default();
        found.take(match checked {
            Ok(()) => record(message, tag.start, &mut finder).map(|r| Record { line, ..r }),
            Err(reason) => Err((line, reason)),
        });
    }
    let whole = tags(text, 0).filter(|tag| tag.name == "ndm");
    let open = whole.fold(0, |open, tag| open + if tag.closing { -1 } else { 1 });
    if open > 0 {
        let line = finder.line(text.trim_end().len());
        found.reject(line, "<ndm> without its </ndm>: the file is cut off");
    }
}

/// The record of a message that starts at this offset of the text.
fn record(message: &str, start: usize, finder: &mut LineFinder) -> At<Record> {
    let mut fields = Fields::new(start, true);
    read_elements(message, start, finder, |event, _| {
        match event {
            Element::Start(tag, offset) => {
                let key = Key::of(tag.local_name().into_inner());
                if let Some((key, unit)) = key.zip(unit(&tag)) {
                    fields.check_unit(key, &unit, offset);
                }
            }
            Element::End(name, value, offset) => {
                if let Some(key) = Key::of(name) {
                    fields.set(key, Cow::Owned(value.to_owned()), offset);
                }
            }
        }
        Ok(())
    })?;
    fields
        .record()
        .map_err(|(offset, reason)| (finder.line(offset), reason))
}
