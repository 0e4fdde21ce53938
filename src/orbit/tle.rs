//! Files of two-line element sets, with or without name lines.

use crate::elements::Elements;
use crate::load::{Loaded, Rejected};
use crate::two_line::Checksum;
use crate::{Object, Orbit, bounded_name};
use std::collections::HashMap;

/// Name lines have at most 24 characters behind a `0 `; element lines have 69.
const LONGEST_NAME: usize = 26;

/// Reads every set in `text`; `source` names the file in rejections. Sets of one catalogue number are one object.
///
/// A record is an optional name line (with or without a leading `0 `), then
/// lines 1 and 2. Blank lines and lines that begin with `#` are passed over.
pub(crate) fn parse(text: &str, source: &str) -> Loaded {
    let mut loaded = Loaded::default();
    let mut name: Option<(usize, &str)> = None;
    let mut first: Option<(usize, &str)> = None;
    let mut places = HashMap::new();

    let reject = |loaded: &mut Loaded, line: usize, reason: String| {
        loaded.rejected.push(Rejected {
            source: source.to_owned(),
            line,
            reason,
        });
    };
    let alone = || "line 1 of a set without its line 2".to_owned();
    let unused = |name: &str| format!("'{}' names no element set", shorten(name));

    for (index, line) in text.lines().enumerate() {
        let (number, line) = (index + 1, line.trim_end());
        if line.trim_start().is_empty() || line.starts_with('#') {
            continue;
        }
        match element_line(line) {
            Some(1) => {
                if let Some((at, _)) = first.replace((number, line)) {
                    reject(&mut loaded, at, alone());
                    name = None;
                }
            }
            Some(_) => {
                let named = name.take().map(|(_, name)| name);
                match first.take() {
                    Some((at, line1)) => match Elements::parse(line1, line, Checksum::Required) {
                        Ok(elements) => {
                            let place =
                                places.entry(elements.norad).or_insert(loaded.objects.len());
                            match loaded.objects.get_mut(*place) {
                                Some(known) => add_set(known, elements, named),
                                None => loaded.objects.push(object(elements, named)),
                            }
                        }
                        Err(error) => {
                            let line = if error.line() == 1 { at } else { number };
                            let who = named.map(|n| format!(" ({n})")).unwrap_or_default();
                            reject(&mut loaded, line, format!("{error}{who}"));
                        }
                    },
                    None => {
                        let reason = "line 2 of a set without its line 1".to_owned();
                        reject(&mut loaded, number, reason);
                    }
                }
            }
            None => {
                if let Some((at, _)) = first.take() {
                    reject(&mut loaded, at, alone());
                    name = None;
                }
                let text = line.strip_prefix("0 ").unwrap_or(line).trim();
                if let Some((at, old)) = name.replace((number, text)) {
                    reject(&mut loaded, at, unused(old));
                }
            }
        }
    }
    if let Some((at, _)) = first {
        reject(&mut loaded, at, alone());
    } else if let Some((at, old)) = name {
        reject(&mut loaded, at, unused(old));
    }
    loaded
}

/// Whether a text holds anything that looks like an element line.
pub(crate) fn looks_like(text: &str) -> bool {
    text.lines()
        .any(|line| element_line(line.trim_end()).is_some())
}

/// 1 or 2 when the line is that line of a set.
fn element_line(line: &str) -> Option<u8> {
    if line.len() <= LONGEST_NAME {
        return None;
    }
    match line.get(..2)? {
        "1 " => Some(1),
        "2 " => Some(2),
        _ => None,
    }
}

fn object(elements: Elements, name: Option<&str>) -> Object {
    Object {
        id: format!("NORAD {}", elements.norad),
        names: name
            .filter(|name| !name.is_empty())
            .map(bounded_name)
            .into_iter()
            .collect(),
        orbit: Orbit::Elements(elements, Vec::new()),
    }
}

/// Another set of an object that is known.
fn add_set(object: &mut Object, elements: Elements, name: Option<&str>) {
    if let Orbit::Elements(_, others) = &mut object.orbit {
        others.push(elements);
    }
    let name = name.filter(|name| !name.is_empty()).map(bounded_name);
    if let Some(name) = name.filter(|name| !object.names.contains(name)) {
        object.names.push(name);
    }
}

fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}
