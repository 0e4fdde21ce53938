//! Who is there already: objects by what they are called, in whatever form it is given.

use skyloop_orbit::{Designator, Object, Orbit, catalogue_number};
use std::borrow::Cow;
use std::collections::HashMap;

/// Objects and their places in a list. The same object is one of the same id; of an ephemeris the catalogue number counts however it is
/// written, and the international designator, which is all that agencies call it by. Element sets of one designator and two
/// numbers are two objects.
#[derive(Debug, Default)]
pub struct Register {
    ids: HashMap<String, usize>,
    /// With whether it is an ephemeris.
    designators: HashMap<(Designator, bool), usize>,
}

impl Register {
    /// Of a list.
    pub fn of(objects: &[Object]) -> Register {
        let mut register = Register::default();
        for (place, object) in objects.iter().enumerate() {
            register.insert(object, place);
        }
        register
    }

    /// Makes room for so many more.
    pub fn reserve(&mut self, more: usize) {
        self.ids.reserve(more);
        self.designators.reserve(more);
    }

    /// Adds an object, unless one of its names is taken.
    pub fn insert(&mut self, object: &Object, place: usize) {
        self.ids.entry(id(object).into_owned()).or_insert(place);
        if let Some(designator) = object.designator {
            let designated = self.designators.entry((designator, is_ephemeris(object)));
            designated.or_insert(place);
        }
    }

    /// The place of the object that this one is.
    pub fn place(&self, object: &Object) -> Option<usize> {
        let by_id = self.ids.get(id(object).as_ref());
        let kinds = match is_ephemeris(object) {
            true => &[true, false][..],
            false => &[true],
        };
        let by_designator = || {
            let designator = object.designator?;
            let known = |kind: &bool| self.designators.get(&(designator, *kind));
            kinds.iter().find_map(known)
        };
        by_id.or_else(by_designator).copied()
    }

    /// Whether none is there.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Whether this object is there.
    pub fn has(&self, object: &Object) -> bool {
        self.place(object).is_some()
    }
}

fn is_ephemeris(object: &Object) -> bool {
    matches!(object.orbit, Orbit::Ephemeris(_))
}

/// The object's id; an OEM may write the catalogue number in its own way.
fn id(object: &Object) -> Cow<'_, str> {
    let number = || catalogue_number(&object.id);
    match is_ephemeris(object).then(number).flatten() {
        Some(number) => format!("NORAD {number}").into(),
        None => object.id.as_str().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: String) -> Object {
        let mut loaded = skyloop_orbit::parse(&text, "here").unwrap();
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
        let calls = ["1958-002B", "58002B", "1958-2B", "1958-02b"];
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
    }
}
