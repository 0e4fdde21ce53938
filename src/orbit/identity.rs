//! Identity of an object: catalogue number, international designator, an agency's own id, or its
//! orbit.

use crate::catalogue_number::{assigned, catalogue_number};
use crate::{Designator, Elements, Object, Orbit, is_placeholder};
use rayon::prelude::*;
use std::collections::HashMap;
use std::num::NonZeroU32;

/// Names, without their numbers, that many objects share.
const GENERIC: [&[&str]; 6] = [
    &["DEB"],
    &["DEBRIS"],
    &["R", "B"],
    &["ROCKET", "BODY"],
    &["OBJECT"],
    &["OBJ"],
];

/// Whether a name is one of [`GENERIC`], such as `0 DEB`, `R/B(1)`, `OBJECT 12` and `OBJECT AB`.
fn is_generic(name: &str) -> bool {
    let name = name.to_ascii_uppercase();
    let words = name.split(|c: char| !c.is_alphanumeric());
    let is_number = |word: &str| word.bytes().all(|byte| byte.is_ascii_digit());
    let words: Vec<&str> = words.filter(|word| !is_number(word)).collect();
    // Pieces have up to three letters, as in designators.
    let is_piece = |word: &str| word.len() <= 3 && word.bytes().all(|b| b.is_ascii_uppercase());
    let is_lettered = matches!(words[..], ["OBJECT" | "OBJ", piece] if is_piece(piece));
    is_lettered || GENERIC.contains(&words.as_slice())
}

/// Identity of an object: its number, else its designator, else a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    number: Option<NonZeroU32>,
    /// The international designator of its element sets, or the OBJECT_ID of an OEM.
    pub designator: Option<Designator>,
    word: Word,
}

/// Identity of an object without number and designator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Word {
    /// The id; an OBJECT_ID may be any text.
    Id,
    /// The name, where the id is a placeholder. Segments of one file with equal names are one
    /// object. Many satellites may share a name, so elsewhere the orbits must be equal too.
    Name,
    /// The orbit alone, where the name is a placeholder too.
    #[default]
    Orbit,
}

impl Identity {
    pub(crate) fn of_set(number: u32, designator: &str, name: &str) -> Self {
        let number = assigned(number);
        Identity {
            number,
            designator: Designator::parse(designator),
            word: match number {
                // No name is stored for a numbered object, to keep large catalogues small.
                Some(_) => Word::Name,
                None if agency_id(designator).is_some() => Word::Id,
                None => Word::of_name(name),
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

    /// Whether the name is the only identification.
    pub fn has_name_alone(&self) -> bool {
        self.number.is_none() && self.designator.is_none() && self.word == Word::Name
    }

    /// The catalogue number, unless it is a placeholder.
    pub fn number(&self) -> Option<u32> {
        self.number.map(NonZeroU32::get)
    }

    /// Adds the fields of `other`, the identity of the same object; the earlier designator counts.
    pub(crate) fn join(&mut self, other: Identity) {
        self.number = self.number.or(other.number);
        let designators = [self.designator, other.designator];
        self.designator = designators.into_iter().flatten().min();
    }

    pub(crate) fn set_number(&mut self, number: u32) {
        self.number = assigned(number);
    }
}

impl Word {
    fn of_name(name: &str) -> Self {
        if is_placeholder(name) || is_generic(name) {
            Word::Orbit
        } else {
            Word::Name
        }
    }
}

/// An agency's own OBJECT_ID: no number, no designator and no placeholder.
pub(crate) fn agency_id(text: &str) -> Option<&str> {
    let is_own = catalogue_number(text).is_none()
        && Designator::parse(text).is_none()
        && !is_placeholder(text);
    is_own.then_some(text)
}

/// The id of an object without a number: `UNKNOWN`, or `NORAD 0` followed by its name.
pub(crate) fn unnumbered_id(placeholder: &str, name: &str) -> String {
    if is_placeholder(name) {
        placeholder.to_owned()
    } else {
        format!("{placeholder} {name}")
    }
}

impl Object {
    /// The catalogue number as written, even a placeholder.
    pub(crate) fn written_number(&self) -> Option<u32> {
        match &self.orbit {
            Orbit::Elements(set, _) => Some(set.norad),
            Orbit::Ephemeris(_) => catalogue_number(&self.id),
        }
    }

    /// The first name in capital letters.
    pub fn capital_name(&self) -> String {
        let name = self.names.first();
        name.map_or_else(String::new, |name| name.to_uppercase())
    }

    /// Identifies an object without number and designator.
    fn word(&self) -> String {
        let name = match self.identity.word {
            Word::Id => return format!("id {}", self.id.to_uppercase()),
            Word::Name => self.capital_name(),
            Word::Orbit => String::new(),
        };
        match &self.orbit {
            // All placeholder numbers count as equal.
            Orbit::Elements(set, _) => format!("{name} orbit {:?}", Elements { norad: 0, ..*set }),
            Orbit::Ephemeris(ephemeris) => {
                let segments = ephemeris.segments.iter();
                let ends = segments.map(|one| (one.nodes.first(), one.nodes.last()));
                format!("{name} orbit {:?}", ends.collect::<Vec<_>>())
            }
        }
    }
}

/// Grouping key: objects with equal keys are one object.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Key {
    Number(u32),
    Designator(Designator),
    Word(String),
}

impl Key {
    /// Key of a segment within its file, where the name is enough.
    pub fn of_segment(object: &Object) -> Key {
        if object.identity.has_name_alone() {
            return Key::Word(format!("name {}", object.capital_name()));
        }
        Keys::default().key(object)
    }

    /// Key of an attitude ephemeris, from its OBJECT_ID and OBJECT_NAME.
    pub fn of_ephemeris(id: &str, name: &str) -> Key {
        let identity = Identity::of_ephemeris(id, name);
        match (identity.number, identity.designator, identity.word) {
            (Some(number), ..) => Key::Number(number.get()),
            (None, Some(designator), _) => Key::Designator(designator),
            (None, None, Word::Id) => Key::Word(format!("id {}", id.to_uppercase())),
            (None, None, Word::Name) => Key::Word(format!("name {}", name.to_uppercase())),
            (None, None, Word::Orbit) => Key::Word(String::new()),
        }
    }
}

/// Keys of a set of objects, independent of their order. A key is the catalogue number, or that of
/// another object with the same international designator; else the designator; else the OBJECT_ID
/// or, where that is a placeholder, name and orbit.
#[derive(Debug, Default)]
pub(crate) struct Keys {
    /// Designators of objects without a number, and the smallest number of any object with each.
    numbers: HashMap<Designator, Option<u32>>,
}

impl Keys {
    pub fn of<'a>(objects: impl Iterator<Item = &'a Object> + Clone) -> Self {
        let identities = objects.map(|object| &object.identity);
        let unnumbered = identities.clone().filter(|one| one.number.is_none());
        let designators = unnumbered.filter_map(|one| Some((one.designator?, None)));
        let mut numbers: HashMap<Designator, Option<u32>> = designators.collect();
        if numbers.is_empty() {
            return Keys { numbers };
        }
        for identity in identities {
            if let (Some(number), Some(designator)) = (identity.number(), identity.designator)
                && let Some(known) = numbers.get_mut(&designator)
            {
                *known = Some(known.map_or(number, |known| known.min(number)));
            }
        }
        Keys { numbers }
    }

    pub fn key(&self, object: &Object) -> Key {
        let Identity {
            number, designator, ..
        } = object.identity;
        match (number, designator) {
            (Some(number), _) => Key::Number(number.get()),
            (None, Some(designator)) => {
                let number = self.numbers.get(&designator).copied().flatten();
                number.map_or(Key::Designator(designator), Key::Number)
            }
            (None, None) => Key::Word(object.word()),
        }
    }
}

/// Whether two objects are the same.
pub fn is_same(one: &Object, other: &Object) -> bool {
    let keys = Keys::of([one, other].into_iter());
    keys.key(one) == keys.key(other)
}

/// The number of each entry's object, counted from 0 in the order of first appearance. Entries of
/// the same object have the same number.
pub fn places<'a>(objects: impl Iterator<Item = &'a Object> + Clone) -> Vec<usize> {
    // Fast path for large catalogues: no map where each object has its own number.
    let mut numbers: Vec<Option<u32>> = objects.clone().map(|o| o.identity.number()).collect();
    numbers.par_sort_unstable();
    if numbers.first() != Some(&None) && numbers.is_sorted_by(|a, b| a < b) {
        return (0..numbers.len()).collect();
    }
    let keys = Keys::of(objects.clone());
    let mut known: HashMap<Key, usize> = HashMap::new();
    let places = objects.map(|object| {
        let next = known.len();
        *known.entry(keys.key(object)).or_insert(next)
    });
    places.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::{OMM, oem, omm_json};

    fn read(text: &str) -> Object {
        crate::parse(text, "here").unwrap().objects.swap_remove(0)
    }

    fn ephemeris(id: &str) -> Object {
        let states = [
            "2019-06-15T00:00:00 7000 0 0 1 0 0",
            "2019-06-15T00:00:10 7010 0 0 1 0 0",
        ];
        read(&oem(&format!("OBJECT_ID = {id}\n"), &states))
    }

    fn set(number: u32, designator: &str) -> Object {
        let text = omm_json(OMM).replace("2026-101A", designator);
        read(&text.replace("100001", &number.to_string()))
    }

    /// NORAD_CAT_ID is optional in an OMM (CCSDS 502.0-B-3, Table 4-3).
    #[test]
    fn a_set_without_a_number_is_identified_by_its_id() {
        for (one, other, are_same) in [
            (set(0, "OWN-1"), set(0, "own-1"), true),
            (set(0, "OWN-1"), set(0, "OWN-2"), false),
            (set(0, "OWN-1"), ephemeris("OWN-1"), true),
            (set(0, "OWN-1"), set(5, "OWN-1"), false),
            (set(0, "NORAD 25544"), set(25_544, "1998-067A"), true),
            (set(99_999, "25544"), set(0, "25545"), false),
        ] {
            assert_eq!(is_same(&one, &other), are_same, "{} {}", one.id, other.id);
        }
        assert_eq!(set(0, "OWN-1").id, "OWN-1");
        assert_eq!(set(0, "25544").id, "NORAD 25544");
    }

    #[test]
    fn all_spellings_of_an_id_identify_an_ephemeris() {
        let alike = |one: &Object, other: &Object| {
            let [forward, backward] = [is_same(one, other), is_same(other, one)];
            assert_eq!(forward, backward, "{} {}", one.id, other.id);
            forward
        };
        let vanguard = set(5, "1958-002B");
        let spellings = "1958-002B,58002B,1958-2B,1958-02b,1958-002-B,1958/002B,COSPAR 1958-002B,\
                     COSPAR ID: 1958-002B,\"1958-002B\"";
        let numbers = "5,00005,NORAD 5,NORAD5,norad 5,Norad_00005,NORAD ID 5,NORAD_CAT_ID 5,#5,\
                       NORAD #5,NORAD-5,NORAD - 5,NORAD_-5,'5'";
        for (first, same) in [("1958-002B", spellings), ("5", numbers)] {
            for id in same.split(',') {
                assert!(alike(&vanguard, &ephemeris(id)), "{id}");
                assert!(alike(&ephemeris(first), &ephemeris(id)), "{id}");
            }
        }
        for other in "1958-002A,1958-20B,6,NORAD 55,NORADIA 5,NORAD -5,NORAD ID: -5,A".split(',') {
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
        // Without a number the designator decides.
        assert!(alike(&vanguard, &set(99_999, "1958-002B")));
        assert!(!alike(&set(0, "1958-002A"), &set(99_999, "1958-002B")));
    }
}
