//! The methods of orbit propagation.

use super::value::{Setting, Value};

/// Method of orbit propagation. All give the same images, within 1e-6 px.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Orbits {
    /// Candidates for the field of view by interpolation between stored positions, within
    /// centimetres; objects in the field by SGP4.
    #[default]
    Tracked,
    /// All objects by the vectorised SGP4.
    Exact,
    /// All objects by the scalar SGP4.
    Scalar,
}

impl Orbits {
    /// The names of the methods.
    pub(crate) const WORDS: &[&str] = &["tracked", "exact", "scalar"];
    const ALL: [Orbits; 3] = [Orbits::Tracked, Orbits::Exact, Orbits::Scalar];
}

impl Setting for Orbits {
    fn value(self) -> Value {
        let named = Orbits::ALL.iter().zip(Orbits::WORDS);
        let mut named = named.filter(|(orbits, _)| **orbits == self);
        Value::Word(named.next().map_or("", |(_, word)| word))
    }

    fn of(value: Value) -> Option<Orbits> {
        let mut named = Orbits::ALL.iter().zip(Orbits::WORDS);
        let of = named.find(|(_, word)| Value::Word(word) == value);
        of.map(|(orbits, _)| *orbits)
    }
}
