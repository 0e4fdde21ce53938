//! Tables of keys that a list cannot stand for: serde takes the values of a list for the keys of a struct, in their order.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// For `#[serde(deserialize_with = ...)]`: a table, not a list.
///
/// # Errors
/// It is something else, or those of `T`.
pub(crate) fn table<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<T, D::Error> {
    from.deserialize_map(Keys(PhantomData))
}

/// The same for an optional table.
///
/// # Errors
/// As of [`table`].
pub(crate) fn some_table<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    table(from).map(Some)
}

/// The same for a list of tables.
///
/// # Errors
/// As of [`table`], of an entry.
pub(crate) fn tables<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    let entries = Vec::<Entry<T>>::deserialize(from)?;
    Ok(entries.into_iter().map(|Entry(entry)| entry).collect())
}

/// The same for an optional list of tables.
///
/// # Errors
/// As of [`tables`].
pub(crate) fn some_tables<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<T>>, D::Error> {
    tables(from).map(Some)
}

struct Entry<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Entry<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        table(from).map(Entry)
    }
}

struct Keys<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Keys<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map))
    }
}
