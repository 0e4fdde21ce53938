//! The methods of orbit propagation.

use super::value::{Setting, Value};

/// How the orbits of objects are computed. The frames are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Orbits {
    /// From frame to frame who may be in the field is told from positions between knots, within
    /// centimetres; who is, by SGP4.
    #[default]
    Tracked,
    /// Everybody by SGP4, in lanes.
    Exact,
    /// Everybody by the scalar SGP4, one after another.
    Scalar,
}

impl Orbits {
    /// The names of the methods.
    pub const WORDS: &[&str] = &["tracked", "exact", "scalar"];
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
