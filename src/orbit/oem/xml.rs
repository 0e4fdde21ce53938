//! OEM in XML, alone or several in an NDM (CCSDS 505.0-B).

use super::{Data, Segments};
use crate::lines::LineFinder;
use crate::load::Loaded;
use crate::meta::Meta;
use crate::omm::xml::{decode, tags};
use crate::record::{At, shorten};
use memchr::memmem;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

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

/// Whether an XML text has a message of this kind.
pub(crate) fn looks_like(text: &str) -> bool {
    // Catalogues of OMM are long: most have not even the letters.
    memmem::find(text.as_bytes(), b"oem").is_some() && tags(text, 0).any(|tag| tag.opens("oem"))
}

/// Reads every segment by itself, as [`super::parse`] does.
pub(crate) fn parse(text: &str, source: &str) -> Loaded {
    let mut finder = LineFinder::new(text);
    let mut read = Segments::new(source);
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
        }
        // Other messages of an NDM have segments too.
        if tag.name != "segment" || tag.closing || !in_oem {
            continue;
        }
        let line = finder.line(tag.start);
        let Some(end) = parts.next_if(|next| next.name == "segment" && next.closing) else {
            read.reject(line, "<segment> without its </segment>");
            continue;
        };
        let segment = text.get(tag.start..end.end).unwrap_or_default();
        match self::segment(segment, tag.start, &mut finder) {
            Ok(data) => read.finish(data),
            Err((line, reason)) => read.reject(line, &reason),
        }
    }
    if open > 0 {
        let line = finder.line(text.trim_end().len());
        read.reject(line, "<oem> or <ndm> is not closed: the file is cut off");
    }
    read.loaded
}

/// A segment that starts at an offset of the text.
fn segment(text: &str, start: usize, finder: &mut LineFinder) -> At<Data> {
    let mut reader = Reader::from_str(text);
    let line = finder.line(start);
    let (mut meta, mut data) = (Meta::new(line), None);
    let (mut in_metadata, mut in_state) = (false, false);
    let mut state = State::new(line);
    let mut value = String::new();
    loop {
        let event = reader.read_event().map_err(|error| {
            let offset = start + reader.error_position() as usize;
            (finder.line(offset), format!("not XML: {error}"))
        })?;
        let line = finder.line(start + reader.buffer_position() as usize);
        if decode(&event, &mut value).map_err(|reason| (line, reason))? {
            continue;
        }
        match event {
            Event::Start(tag) => {
                value.clear();
                match tag.local_name().into_inner() {
                    "metadata" => in_metadata = true,
                    "stateVector" => {
                        (in_state, state) = (true, State::new(line));
                    }
                    name if in_state => state.unit(name, &tag).map_err(|reason| (line, reason))?,
                    _ => {}
                }
            }
            Event::End(tag) => match tag.local_name().into_inner() {
                "metadata" => {
                    in_metadata = false;
                    data = Some(Data::new(&meta)?);
                }
                "stateVector" => {
                    in_state = false;
                    let data = data.as_mut();
                    let data =
                        data.ok_or((state.line, "<stateVector> before <metadata>".to_owned()))?;
                    state.add_to(data)?;
                }
                "COMMENT" if in_metadata => meta.comment(&value, line),
                name if in_metadata => meta.set(name, value.trim(), line),
                name if in_state => state.set(name, &value).map_err(|reason| (line, reason))?,
                _ => {}
            },
            Event::Eof => break,
            _ => {}
        }
    }
    data.ok_or((line, "the segment has no <metadata>".to_owned()))
}

/// A `<stateVector>`, which begins in a line.
struct State {
    line: usize,
    epoch: String,
    values: [Option<f64>; STATE.len()],
}

impl State {
    fn new(line: usize) -> Self {
        let values = [None; STATE.len()];
        let epoch = String::new();
        State {
            line,
            epoch,
            values,
        }
    }

    /// Refuses a unit that is not the standard's.
    fn unit(&self, name: &str, tag: &BytesStart) -> Result<(), String> {
        let known = STATE.iter().find(|(tag, _)| *tag == name);
        let given = tag.try_get_attribute("units").ok().flatten();
        match (known, given) {
            (Some((_, unit)), Some(given)) if !given.value.eq_ignore_ascii_case(unit) => {
                Err(format!(
                    "<{name}> in '{}': the unit is {unit}",
                    shorten(&given.value)
                ))
            }
            _ => Ok(()),
        }
    }

    fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        if name == "EPOCH" {
            self.epoch = value.trim().to_owned();
        }
        let values = STATE.iter().zip(&mut self.values);
        for ((_, _), place) in values.filter(|((tag, _), _)| *tag == name) {
            let number = value.trim().parse().ok();
            let number = number.filter(|x: &f64| x.is_finite());
            *place = Some(number.ok_or_else(|| {
                format!(
                    "a value that is not a number in <{name}> '{}'",
                    shorten(value)
                )
            })?);
        }
        Ok(())
    }

    fn add_to(&self, data: &mut Data) -> At<()> {
        let numbers: Vec<f64> = self.values.iter().map_while(|value| *value).collect();
        let bad = |what: String| {
            let epoch = shorten(&self.epoch);
            (self.line, format!("{what} in the stateVector of '{epoch}'"))
        };
        data.state(&self.epoch, &numbers).map_err(bad)
    }
}
