//! Who is there already: objects by what they are called, in whatever form it is given.

use skyloop_orbit::{Designator, Object, Orbit};
use std::collections::HashMap;

/// Objects and their places in a list. The same object is one of the same id; a bare catalogue number is an id too; and an ephemeris
/// is joined with element sets by the international designator, which is all that agencies call it by.
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

    /// Adds an object, unless one of its names is taken.
    pub fn insert(&mut self, object: &Object, place: usize) {
        self.ids.entry(id(object)).or_insert(place);
        if let Some(designator) = object.designator {
            let designated = self.designators.entry((designator, is_ephemeris(object)));
            designated.or_insert(place);
        }
    }

    /// The place of the object that this one is.
    pub fn place(&self, object: &Object) -> Option<usize> {
        let by_id = self.ids.get(&id(object));
        let of_other_kind = |designator| (designator, !is_ephemeris(object));
        let by_designator = || self.designators.get(&of_other_kind(object.designator?));
        by_id.or_else(by_designator).copied()
    }

    /// Whether this object is there.
    pub fn has(&self, object: &Object) -> bool {
        self.place(object).is_some()
    }
}

fn is_ephemeris(object: &Object) -> bool {
    matches!(object.orbit, Orbit::Ephemeris(_))
}

/// The object's id; an OEM may have the catalogue number alone.
fn id(object: &Object) -> String {
    match object.id.parse::<u32>() {
        Ok(number) if is_ephemeris(object) => format!("NORAD {number}"),
        _ => object.id.clone(),
    }
}
