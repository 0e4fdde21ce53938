//! OMM in XML, alone or many of them in an NDM (CCSDS 505.0-B).

use super::{Fields, Metadata, index_of};
use crate::lines::LineFinder;
use crate::record::{At, Found, Record, check_version};
use crate::xml::{Element, read_elements, tags, unit, version};
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
                let version = text.get(tag.start..tag.end).and_then(version);
                if let Some(version) = version
                    && let Err(reason) = check_version("CCSDS_OMM_VERS", &version)
                {
                    found.take(Err((line, reason)));
                    continue;
                }
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

/// The record of a message that starts at an offset of the text.
fn record(message: &str, start: usize, finder: &mut LineFinder) -> At<Record> {
    let mut fields = Fields::default();
    read_elements(message, start, finder, |event, _| {
        match event {
            Element::Start(tag, offset) => {
                if let Some(index) = index_of(tag.local_name().into_inner())
                    && let Some(unit) = unit(&tag)
                {
                    fields.unit(index, &unit, offset);
                }
            }
            Element::End(name, value, offset) => {
                if let Some(index) = index_of(name) {
                    fields.set(index, Cow::Owned(value.to_owned()), offset);
                }
            }
        }
        Ok(())
    })?;
    let record = fields.record(start, Metadata::Required);
    record.map_err(|(offset, reason)| (finder.line(offset), reason))
}
