//! Arrays with a fixed length: a pixel, a quaternion, a point of a table.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// Exactly `N` values. Serde's own arrays stop reading after `N` and ignore the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fixed<T, const N: usize>(pub [T; N]);

impl<T, const N: usize> Fixed<T, N> {
    /// Unwraps a list.
    pub fn all(list: Vec<Self>) -> Vec<[T; N]> {
        list.into_iter().map(|Fixed(values)| values).collect()
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Fixed<T, N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_seq(Values(PhantomData))
    }
}

impl<T: JsonSchema, const N: usize> JsonSchema for Fixed<T, N> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("{}_{N}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let items = generator.subschema_for::<T>();
        json_schema!({ "type": "array", "items": items, "minItems": N, "maxItems": N })
    }
}

struct Values<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for Values<T, N> {
    type Value = Fixed<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {N} values")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut given: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = given.next_element()? {
            values.push(value);
        }
        let count = values.len();
        let values = values.try_into();
        values
            .map(Fixed)
            .map_err(|_| A::Error::custom(format!("must have {N} values, not {count}")))
    }
}
