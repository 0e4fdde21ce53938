//! The value of one error tolerance, as in configurations, tables and labels.

use serde::{Serialize, Serializer};
use std::fmt;

/// Permitted values of a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Allowed {
    /// Minimum and maximum.
    Numbers([f64; 2]),
    /// One of several methods, the fastest first.
    Words(&'static [&'static str]),
}

/// The value of a tolerance.
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

/// The type of a field of `Fidelity`.
pub trait Setting: Copy {
    /// As a value.
    fn value(self) -> Value;
    /// From a value; none if it is of another kind.
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
