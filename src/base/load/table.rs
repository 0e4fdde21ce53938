//! Tables of keys that must not be lists: serde also accepts a list of values for a struct, in the
//! order of its keys. Use the functions with `#[serde(deserialize_with = ...)]`.

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{
    Deserialize, Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Unexpected, Visitor,
};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// A table, not a list.
pub fn table<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_map(Keys(PhantomData))
}

/// An optional table.
pub fn some_table<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    table(from).map(Some)
}

/// A list of tables.
pub fn tables<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<Vec<T>, D::Error> {
    let entries = Vec::<Entry<T>>::deserialize(from)?;
    Ok(entries.into_iter().map(|Entry(entry)| entry).collect())
}

/// An optional list of tables.
pub fn some_tables<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<T>>, D::Error> {
    tables(from).map(Some)
}

/// Tables by name.
pub fn named_tables<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<BTreeMap<String, T>, D::Error> {
    let entries = BTreeMap::<String, Entry<T>>::deserialize(from)?;
    let entries = entries.into_iter();
    Ok(entries.map(|(name, Entry(entry))| (name, entry)).collect())
}

/// A value that is a text or a list, or a whole number where `number` accepts one. Serde's untagged
/// enums report an error for the whole list; this type reports it for the entry.
pub struct TextOrList<T, L> {
    /// Name of the expected value in errors.
    pub expected: &'static str,
    /// Converts a text.
    pub text: fn(String) -> T,
    /// Converts a number.
    pub number: Option<fn(u32) -> T>,
    /// Converts a list.
    pub list: fn(L) -> T,
}

impl<'de, T, L: Deserialize<'de>> Visitor<'de> for TextOrList<T, L> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        Ok((self.text)(text.to_string()))
    }

    fn visit_i64<E: Error>(self, given: i64) -> Result<T, E> {
        let number = self.number.zip(u32::try_from(given).ok());
        let refused = || E::invalid_type(Unexpected::Signed(given), &self);
        number.map(|(of, number)| of(number)).ok_or_else(refused)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T, A::Error> {
        L::deserialize(SeqAccessDeserializer::new(list)).map(self.list)
    }
}

/// A choice of words, not a table, which serde also accepts.
pub fn word<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    T::deserialize(String::deserialize(from)?.into_deserializer())
}

/// An optional word.
pub fn some_word<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    word(from).map(Some)
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
