//! OEM in XML, alone or several in an NDM (CCSDS 505.0-B).

use super::{Data, Messages};
use crate::Contents;
use crate::lines::{LineFinder, Part};
use crate::meta::Meta;
use crate::record::{At, check_version, shorten};
use crate::segments::Message;
use crate::xml::{Element, read_elements, tags, unit, version};
use hifitime::Epoch;
use memchr::memmem;
use quick_xml::events::BytesStart;

/// Elements of a state in order: their tags and units.
const STATE: [(&str, &str); 9] = [
    ("X", "km"),
    ("Y", "km"),
    ("Z", "km"),
    ("X_DOT", "km/s"),
    ("Y_DOT", "km/s"),
    ("Z_DOT", "km/s"),
    ("X_DDOT", "km/s**2"),
    ("Y_DDOT", "km/s**2"),
    ("Z_DDOT", "km/s**2"),
];

/// Whether an XML text has an OEM.
pub(crate) fn looks_like(text: &str) -> bool {
    // A fast search first: most OMM catalogues do not have these letters.
    memmem::find(text.as_bytes(), b"oem").is_some() && tags(text, 0).any(|tag| tag.opens("oem"))
}

/// Reads every segment by itself, as [`super::read`] does.
pub(crate) fn read(part: &Part, contents: &mut Contents) {
    let (text, mut finder) = (part.text, part.finder());
    let mut read = Messages::new(contents);
    let is_part = |name: &str| matches!(name, "oem" | "segment" | "ndm");
    let mut parts = tags(text, 0).filter(|tag| is_part(tag.name)).peekable();
    let (mut in_oem, mut open) = (false, 0);
    while let Some(tag) = parts.next() {
        let is_empty = text
            .get(tag.start..tag.end)
            .is_some_and(|tag| tag.ends_with("/>"));
        if is_empty {
            continue;
        }
        if tag.name != "segment" {
            open += if tag.closing { -1 } else { 1 };
        }
        if tag.name == "oem" {
            in_oem = !tag.closing;
            let version = text.get(tag.start..tag.end).and_then(version);
            if let Some(version) = version.filter(|_| in_oem)
                && let Err(reason) = check_version("CCSDS_OEM_VERS", &version)
            {
                in_oem = false;
                read.refuse(finder.line(tag.start), reason);
            }
        }
        // Other messages of an NDM have segments too.
        if tag.name != "segment" || tag.closing || !in_oem {
            continue;
        }
        let line = finder.line(tag.start);
        let Some(end) = parts.next_if(|next| next.name == "segment" && next.closing) else {
            read.refuse(line, "<segment> without its </segment>");
            continue;
        };
        let segment = text.get(tag.start..end.end).unwrap_or_default();
        let first_start = &mut read.contents.first_start;
        let data = self::segment(segment, tag.start, &mut finder, first_start);
        if let Err((line, reason)) = data.and_then(|data| read.end(data, line)) {
            read.refuse(line, reason);
        }
    }
    if open > 0 {
        let line = finder.line(text.trim_end().len());
        read.refuse(line, "<oem> or <ndm> is not closed: the file is cut off");
    }
    read.finish();
}

fn segment(
    text: &str,
    start: usize,
    finder: &mut LineFinder,
    first_start: &mut Option<Epoch>,
) -> At<Data> {
    let line = finder.line(start);
    let mut segment = Reader {
        meta: Meta::new(line),
        first_start,
        data: None,
        in_metadata: false,
        state: None,
    };
    read_elements(text, start, finder, |element, finder| match element {
        Element::Start(tag, offset) => segment.start(&tag, finder.line(offset)),
        Element::End(name, value, offset) => segment.end(name, value, finder.line(offset)),
    })?;
    let missing = || (line, "the segment has no <metadata>".to_owned());
    segment.data.ok_or_else(missing)
}

/// State of the reader within a segment.
struct Reader<'a> {
    meta: Meta,
    /// START_TIME of the first segment of the file.
    first_start: &'a mut Option<Epoch>,
    data: Option<Data>,
    in_metadata: bool,
    state: Option<State>,
}

impl Reader<'_> {
    fn start(&mut self, tag: &BytesStart, line: usize) -> At<()> {
        match (tag.local_name().into_inner(), &self.state) {
            ("metadata", _) if self.data.is_some() => {
                let reason =
                    "a second <metadata> in the segment: give its states a <segment> of their own";
                return Err((line, reason.to_owned()));
            }
            ("metadata", _) => self.in_metadata = true,
            ("stateVector", _) => self.state = Some(State::new(line)),
            (name, Some(state)) => state.unit(name, tag).map_err(|reason| (line, reason))?,
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str, value: &str, line: usize) -> At<()> {
        match name {
            "metadata" => {
                self.in_metadata = false;
                self.data = Some(Data::new(&self.meta, self.first_start)?);
            }
            "stateVector" => {
                if let Some(state) = self.state.take() {
                    let missing = (state.line, "<stateVector> before <metadata>".to_owned());
                    state.add_to(self.data.as_mut().ok_or(missing)?)?;
                }
            }
            "COMMENT" if self.in_metadata => self.meta.comment(value, line),
            name if self.in_metadata => self.meta.set(name, value.trim(), line),
            name => {
                if let Some(state) = &mut self.state {
                    state.set(name, value).map_err(|reason| (line, reason))?;
                }
            }
        }
        Ok(())
    }
}

struct State {
    line: usize,
    epoch: Option<String>,
    values: [Option<f64>; STATE.len()],
}

impl State {
    fn new(line: usize) -> Self {
        let values = [None; STATE.len()];
        State {
            line,
            epoch: None,
            values,
        }
    }

    /// Refuses a unit other than the standard's.
    fn unit(&self, name: &str, tag: &BytesStart) -> Result<(), String> {
        let known = STATE.iter().find(|(tag, _)| *tag == name);
        match (known, unit(tag)) {
            (Some((_, wanted)), Some(given)) if !given.eq_ignore_ascii_case(wanted) => {
                let given = shorten(&given);
                Err(format!(
                    "<{name}> in '{given}': the unit is {wanted}, convert the values"
                ))
            }
            _ => Ok(()),
        }
    }

    fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let twice = || format!("<{name}> twice in a stateVector: keep one");
        if name == "EPOCH" {
            let epoch = value.trim().to_owned();
            return self.epoch.replace(epoch).map_or(Ok(()), |_| Err(twice()));
        }
        let mut values = STATE.iter().zip(&mut self.values);
        let Some((_, slot)) = values.find(|((tag, _), _)| *tag == name) else {
            return Ok(());
        };
        let number = value.trim().parse().ok();
        let number = number.filter(|x: &f64| x.is_finite());
        let number = number.ok_or_else(|| {
            let value = shorten(value);
            format!("a value that is not a number in <{name}> '{value}'")
        })?;
        slot.replace(number).map_or(Ok(()), |_| Err(twice()))
    }

    fn add_to(&self, data: &mut Data) -> At<()> {
        let numbers: Vec<f64> = self.values.iter().map_while(|value| *value).collect();
        let epoch = self.epoch.as_deref().unwrap_or_default();
        let bad = |fault: String| {
            let epoch = shorten(epoch);
            (
                self.line,
                format!("{fault} in the stateVector of '{epoch}'"),
            )
        };
        let time = data.clock.read(epoch).ok_or("no epoch".to_owned());
        time.and_then(|time| data.state(time, &numbers))
            .map_err(bad)
    }
}
