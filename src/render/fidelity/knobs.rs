//! The shape of a knob: one error tolerance by name, as configurations, tables and labels see it.

use super::Fidelity;
use serde::{Serialize, Serializer};
use std::fmt;

/// One tolerance: what a configuration may set.
#[derive(Debug)]
pub struct Knob {
    /// Its key.
    pub name: &'static str,
    /// The unit of its value.
    pub unit: &'static str,
    /// What it bounds.
    pub bounds: &'static str,
    /// The greatest error by a value, in that unit or as `bounds` has it; 0 of methods that change nothing.
    pub bound: fn(f64) -> f64,
    /// What it may be.
    pub allowed: Allowed,
    /// Whether frames depend on it.
    pub is_seen: bool,
    /// Its value.
    pub get: fn(&Fidelity) -> Value,
    /// Turns it; a value of another kind does nothing.
    pub set: fn(&mut Fidelity, Value),
}

/// What a knob may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Allowed {
    /// From the least to the greatest.
    Numbers([f64; 2]),
    /// One of several methods, the fastest first.
    Words(&'static [&'static str]),
}

/// What a knob is set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A tolerance.
    Number(f64),
    /// A method.
    Word(&'static str),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Number(number) if *number != 0.0 && number.abs() < 1e-3 => {
                write!(f, "{number:e}")
            }
            Value::Number(number) => write!(f, "{number}"),
            Value::Word(word) => f.write_str(word),
        }
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Value::Number(number) => to.serialize_f64(*number),
            Value::Word(word) => to.serialize_str(word),
        }
    }
}

/// What a field of [`Fidelity`] is made of.
pub trait Setting: Copy {
    /// As a value.
    fn value(self) -> Value;
    /// From one; none of another kind.
    fn of(value: Value) -> Option<Self>;
}

impl Setting for f64 {
    fn value(self) -> Value {
        Value::Number(self)
    }

    fn of(value: Value) -> Option<f64> {
        match value {
            Value::Number(number) => Some(number),
            Value::Word(_) => None,
        }
    }
}

impl Knob {
    /// The knob called `name`.
    pub fn named(name: &str) -> Option<&'static Knob> {
        super::KNOBS.iter().find(|knob| knob.name == name)
    }

    /// Whether a frame by the one value is coarser or faster than by the other: a greater tolerance, or a method that stands before.
    pub fn is_coarser(&self, one: Value, other: Value) -> bool {
        match (one, other, self.allowed) {
            (Value::Number(one), Value::Number(other), _) => one > other,
            (Value::Word(one), Value::Word(other), Allowed::Words(words)) => {
                let place = |word| words.iter().position(|other| *other == word);
                place(one) < place(other)
            }
            _ => false,
        }
    }

    /// Whether two settings have it in common.
    pub fn is_same(&self, a: &Fidelity, b: &Fidelity) -> bool {
        (self.get)(a) == (self.get)(b)
    }
}
