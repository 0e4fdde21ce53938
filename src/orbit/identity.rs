//! What tells an object from all others: catalogue number, international designator, or else what it is called.

use crate::two_line::alpha_5;
use crate::{Designator, Object, Orbit};
use std::collections::HashMap;
use std::num::NonZeroU32;

/// Values that stand for none, without blanks and marks. `UNKNOWN` is that of the standard (CCSDS 502.0-B-3, OBJECT_ID and
/// OBJECT_NAME); `TBA - TO BE ASSIGNED` is a name of Space-Track's.
const PLACEHOLDERS: [&str; 22] = [
    "UNKNOWN",
    "UNK",
    "TBD",
    "TBA",
    "TBC",
    "NA",
    "NONE",
    "NULL",
    "NIL",
    "NAN",
    "UNDEFINED",
    "UNASSIGNED",
    "UNSPECIFIED",
    "UNIDENTIFIED",
    "UNNAMED",
    "ANALYST",
    "NOTAVAILABLE",
    "NOTASSIGNED",
    "TOBEANNOUNCED",
    "TOBEASSIGNED",
    "TOBEDETERMINED",
    "TBATOBEASSIGNED",
];

/// Words that say nothing beside one of [`PLACEHOLDERS`], as in `UNKNOWN OBJECT 2`.
const FILLERS: [&str; 4] = ["OBJECT", "OBJ", "SAT", "SATELLITE"];

/// Whether a text stands for no value: a word such as `UNKNOWN`, no letter or digit at all, or a number such as 0 or 99999.
pub fn is_placeholder(text: &str) -> bool {
    if let Some(number) = catalogue_number(text) {
        return assigned(number).is_none();
    }
    let letters = text.chars().filter(|c| c.is_alphanumeric());
    let letters: String = letters.map(|c| c.to_ascii_uppercase()).collect();
    let text = text.to_ascii_uppercase();
    let words = text.split(|c: char| !c.is_alphanumeric());
    let mut words = words.filter(|word| {
        let is_number = word.bytes().all(|byte| byte.is_ascii_digit());
        !is_number && !FILLERS.contains(word)
    });
    let (first, second) = (words.next(), words.next());
    let is_one_word = second.is_none() && first.is_some_and(|word| PLACEHOLDERS.contains(&word));
    letters.is_empty() || is_one_word || PLACEHOLDERS.contains(&letters.as_str())
}

/// The catalogue number, unless it stands for none: 0, or five or more nines.
pub(crate) fn assigned(number: u32) -> Option<NonZeroU32> {
    let nines = [99_999, 999_999, 9_999_999, 99_999_999, 999_999_999];
    NonZeroU32::new(number).filter(|_| !nines.contains(&number))
}

/// The catalogue number that an id or a selector gives: `NORAD 5`, `norad5`, `00005` or, in Alpha-5, `A0005`.
pub fn catalogue_number(text: &str) -> Option<u32> {
    let text = text.trim();
    let named = text
        .split_at_checked(5)
        .filter(|(word, _)| word.eq_ignore_ascii_case("NORAD"));
    let digits = named.map_or(text, |(_, rest)| rest.trim_start_matches([' ', '_', '-']));
    alpha_5(&digits.to_ascii_uppercase())
}

/// What tells an object from all others. Where two objects both have a number, or else both a designator, that decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    number: Option<NonZeroU32>,
    /// The international designator of its element sets; of an OEM the OBJECT_ID, where that is one.
    pub designator: Option<Designator>,
    word: Word,
}

/// What tells an object that has neither number nor designator from others of that kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Word {
    /// The id: an OEM's OBJECT_ID may be any text.
    Id,
    /// The name, where the id is a placeholder.
    Name,
    /// The orbit alone, where the name is one too.
    #[default]
    Orbit,
}

impl Identity {
    /// Of an element set.
    pub(crate) fn of_set(number: u32, designator: &str, name: &str) -> Self {
        let number = assigned(number);
        Identity {
            number,
            designator: Designator::parse(designator),
            // Catalogues are long: what a number tells apart needs no name.
            word: if number.is_some() {
                Word::Name
            } else {
                Word::of_name(name)
            },
        }
    }

    /// Of an ephemeris, by the OBJECT_ID and OBJECT_NAME of an OEM.
    pub(crate) fn of_ephemeris(id: &str, name: &str) -> Self {
        Identity {
            number: catalogue_number(id).and_then(assigned),
            designator: Designator::parse(id),
            word: if is_placeholder(id) {
                Word::of_name(name)
            } else {
                Word::Id
            },
        }
    }

    /// The catalogue number, unless it is a placeholder.
    pub fn number(&self) -> Option<u32> {
        self.number.map(NonZeroU32::get)
    }

    /// Takes what `other`, the identity of the same object, has beyond it.
    pub(crate) fn join(&mut self, other: Identity) {
        self.number = self.number.or(other.number);
        self.designator = self.designator.or(other.designator);
    }
}

impl Word {
    fn of_name(name: &str) -> Self {
        if is_placeholder(name) {
            Word::Orbit
        } else {
            Word::Name
        }
    }
}

/// What an object is called by that has no number: `UNKNOWN`, or `NORAD 0` with its name behind it.
pub(crate) fn unnumbered_id(placeholder: &str, name: &str) -> String {
    if is_placeholder(name) {
        placeholder.to_owned()
    } else {
        format!("{placeholder} {name}")
    }
}

impl Object {
    /// The catalogue number as it is written, a placeholder or not.
    pub(crate) fn written_number(&self) -> Option<u32> {
        match &self.orbit {
            Orbit::Elements(set, _) => Some(set.norad),
            Orbit::Ephemeris(_) => catalogue_number(&self.id),
        }
    }

    /// What tells it from others without number and designator; nothing where it has one of these.
    fn word(&self) -> Option<String> {
        if self.identity.number.is_some() || self.identity.designator.is_some() {
            return None;
        }
        let name = self.names.first().map_or("", String::as_str);
        Some(match (self.identity.word, &self.orbit) {
            (Word::Id, _) => format!("id {}", self.id.to_uppercase()),
            (Word::Name, _) => format!("name {}", name.to_uppercase()),
            (Word::Orbit, Orbit::Elements(set, _)) => format!("orbit {set:?}"),
            (Word::Orbit, Orbit::Ephemeris(ephemeris)) => {
                let segments = ephemeris.segments.iter();
                let ends = segments.map(|one| (one.nodes.first(), one.nodes.last()));
                format!("orbit {:?}", ends.collect::<Vec<_>>())
            }
        })
    }
}

/// Objects and their places in a list, found by what tells them apart: the same catalogue number, however it is written; where one of
/// the two has none, the same international designator, which is all that agencies call an object by; where both have
/// neither, the same OBJECT_ID or, where that is a placeholder, the same name. Objects without any of these are the same only with the
/// same orbit.
#[derive(Debug, Default)]
pub struct Register {
    numbers: HashMap<u32, usize>,
    /// With whether the object has a number too.
    designators: HashMap<(Designator, bool), usize>,
    words: HashMap<String, usize>,
    /// How often the ids of objects without a number were wanted.
    ids: HashMap<String, usize>,
}

impl Register {
    /// Of a list.
    pub fn of(objects: &[Object]) -> Register {
        let mut register = Register::default();
        for (place, object) in objects.iter().enumerate() {
            register.note(object, place);
        }
        register
    }

    /// Makes room for so many more.
    pub fn reserve(&mut self, more: usize) {
        self.numbers.reserve(more);
        self.designators.reserve(more);
    }

    /// Adds a new object. Where its id is that of another object it gets a number behind it: `UNKNOWN #2`.
    pub fn insert(&mut self, object: &mut Object, place: usize) {
        if object.identity.number.is_none() && self.ids.contains_key(&object.id) {
            let base = match object.id.rsplit_once(" #") {
                Some((base, count)) if count.bytes().all(|b| b.is_ascii_digit()) => base,
                _ => &object.id,
            };
            let base = base.to_owned();
            while self.ids.contains_key(&object.id) {
                let count = self.ids.entry(base.clone()).or_insert(1);
                *count += 1;
                object.id = format!("{base} #{count}");
            }
        }
        self.note(object, place);
    }

    /// Adds what is known of an object: one that is there may have got a number or a designator since.
    pub fn note(&mut self, object: &Object, place: usize) {
        let Identity {
            number, designator, ..
        } = object.identity;
        match number {
            Some(number) => _ = self.numbers.entry(number.get()).or_insert(place),
            None if !self.ids.contains_key(&object.id) => {
                self.ids.insert(object.id.clone(), 1);
            }
            None => {}
        }
        if let Some(designator) = designator {
            let known = self.designators.entry((designator, number.is_some()));
            known.or_insert(place);
        }
        if let Some(word) = object.word() {
            self.words.entry(word).or_insert(place);
        }
    }

    /// The place of the object that this one is.
    pub fn place(&self, object: &Object) -> Option<usize> {
        let Identity {
            number, designator, ..
        } = object.identity;
        // Two objects with numbers of their own are two, whatever their designators.
        let kinds = match number {
            Some(_) => &[false][..],
            None => &[false, true],
        };
        let by_number = number.and_then(|number| self.numbers.get(&number.get()));
        let by_designator = || {
            let designator = designator?;
            let known = |kind: &bool| self.designators.get(&(designator, *kind));
            kinds.iter().find_map(known)
        };
        let by_word = || self.words.get(&object.word()?);
        by_number.or_else(by_designator).or_else(by_word).copied()
    }

    /// Whether none is there.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty() && self.designators.is_empty() && self.words.is_empty()
    }

    /// Whether this object is there.
    pub fn has(&self, object: &Object) -> bool {
        self.place(object).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: String) -> Object {
        let mut loaded = crate::parse(&text, "here").unwrap();
        loaded.objects.swap_remove(0)
    }

    fn ephemeris(id: &str) -> Object {
        read(format!(
            "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = A\nOBJECT_ID = {id}\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
             TIME_SYSTEM = UTC\nSTART_TIME = 2000-06-27T00:00:00\nSTOP_TIME = 2000-06-27T00:00:10\nMETA_STOP\n\
             2000-06-27T00:00:00 7000 0 0 0 7.5 0\n2000-06-27T00:00:10 7000 75 0 0 7.5 0\n"
        ))
    }

    fn set(number: u32, designator: &str) -> Object {
        read(format!(
            "OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
             {designator},2026-07-12T03:04:05,15.2,.001,97.5,120,90,270,{number},0\n"
        ))
    }

    #[test]
    fn an_ephemeris_is_known_however_it_is_called() {
        let alike = |one: &Object, other: &Object| {
            let [there, back] = [(one, other), (other, one)]
                .map(|(known, new)| Register::of(std::slice::from_ref(known)).has(new));
            assert_eq!(there, back, "{} {}", one.id, other.id);
            there
        };
        let vanguard = set(5, "1958-002B");
        let calls = ["1958-002B", "58002B", "1958-2B", "1958-02b", "1958-002-B"];
        let numbers = ["5", "00005", "NORAD 5", "NORAD5", "norad 5", "Norad_00005"];
        for id in calls.iter().chain(&numbers) {
            assert!(alike(&vanguard, &ephemeris(id)), "{id}");
        }
        for same in [&calls[..], &numbers] {
            for other in same {
                assert!(alike(&ephemeris(same[0]), &ephemeris(other)), "{other}");
            }
        }
        for other in ["1958-002A", "1958-20B", "6", "NORAD 55", "NORADIA 5", "A"] {
            assert!(!alike(&vanguard, &ephemeris(other)), "{other}");
            assert!(
                !alike(&ephemeris("1958-002B"), &ephemeris(other)),
                "{other}"
            );
        }
        assert!(!alike(&vanguard, &set(6, "1958-002B")));
        // X-Val: space-track.org, Alpha-5: T0001 is 270001.
        for id in ["T0001", "t0001", "270001", "NORAD 270001", "NORAD T0001"] {
            assert!(alike(&set(270_001, ""), &ephemeris(id)), "{id}");
        }
        // Of a set without a number the designator decides.
        assert!(alike(&vanguard, &set(99_999, "1958-002B")));
        assert!(!alike(&set(0, "1958-002A"), &set(99_999, "1958-002B")));
    }

    #[test]
    fn placeholders_tell_nothing_apart() {
        for text in [
            "UNKNOWN",
            "unknown",
            "TBD",
            "tba",
            "",
            "  ",
            "-",
            "N/A",
            "n.a.",
            "NONE",
            "None",
            "0",
            "00000",
            "99999",
            "999999999",
            "NORAD 0",
            "NORAD 99999",
            "TBA - TO BE ASSIGNED",
            "To be announced",
            "UNKNOWN 1",
            "Unknown Object",
            "UNK OBJ",
            "UNIDENTIFIED",
            "ANALYST SAT",
        ] {
            assert!(is_placeholder(text), "{text}");
        }
        for text in [
            "5",
            "9999",
            "99998",
            "A0005",
            "1998-067A",
            "OBJECT 1",
            "OBJECT A",
            "UNKNOWN PLEASURES",
            "ISS",
            "É",
        ] {
            assert!(!is_placeholder(text), "{text}");
        }
    }
}
