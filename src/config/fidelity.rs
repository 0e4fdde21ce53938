//! The key `fidelity`: the name of a preset, or a table of a preset and the tolerances that differ
//! from it.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, Visitor};
use skyloop_base::load::{Check, ConfigError, END, advice};
use skyloop_render::fidelity::{Allowed, Coarser, Fidelity, PRESETS, TOLERANCES, Tolerance, Value};
use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

/// The value in the file.
pub(crate) struct RawFidelity {
    /// The key of the preset.
    key: &'static str,
    preset: String,
    tolerances: Vec<(&'static Tolerance, Raw)>,
}

/// The value of a tolerance.
#[derive(Deserialize)]
#[serde(untagged)]
enum Raw {
    Number(f64),
    Word(String),
    Flag(bool),
    Other(IgnoredAny),
}

enum Key {
    Preset,
    Tolerance(&'static Tolerance),
}

const PRESET: &str = "preset";

static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let tolerances = TOLERANCES.iter().map(|tolerance| tolerance.name);
    [PRESET].into_iter().chain(tolerances).collect()
});

impl JsonSchema for RawFidelity {
    fn schema_name() -> Cow<'static, str> {
        "Fidelity".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = PRESETS.iter().map(|(name, _)| *name).collect();
        let mut keys = json_schema!({ PRESET: { "enum": names } });
        for tolerance in TOLERANCES {
            let mut schema = match tolerance.allowed {
                Allowed::Numbers([min, max]) => {
                    json_schema!({ "type": "number", "minimum": min, "maximum": max })
                }
                Allowed::Words(words) => json_schema!({ "enum": words }),
            };
            let text = format!("{} ({})", tolerance.bounds, tolerance.unit);
            schema.insert("description".to_string(), text.into());
            keys.insert(tolerance.name.to_string(), schema.into());
        }
        json_schema!({
            "description": "Error tolerances of the renderer: a preset, or a table of a preset and the keys that differ from it",
            "anyOf": [
                { "enum": names },
                { "type": "object", "properties": keys, "additionalProperties": false },
            ],
        })
    }
}

impl Default for RawFidelity {
    fn default() -> Self {
        RawFidelity {
            key: "fidelity.preset",
            preset: "realtime".to_string(),
            tolerances: Vec::new(),
        }
    }
}

impl RawFidelity {
    /// The tolerances, checked against their ranges.
    pub fn validate(self, check: &Check) -> Result<Fidelity, ConfigError> {
        let mut fidelity = Fidelity::preset(&self.preset).ok_or_else(|| {
            let names: Vec<_> = PRESETS.iter().map(|(name, _)| *name).collect();
            let given = format!("{:?}", self.preset);
            check.refuse(self.key, given, format!("one of {}", names.join(", ")))
        })?;
        for (tolerance, raw) in self.tolerances {
            let key = format!("fidelity.{}", tolerance.name);
            (tolerance.set)(&mut fidelity, value(&key, tolerance, raw, check)?);
        }
        Ok(fidelity)
    }
}

/// The form of an entry of `run.coarsen`; only [`steps`] checks ranges.
pub(crate) fn step_form() -> String {
    let presets: Vec<&str> = PRESETS.iter().map(|(name, _)| *name).collect();
    let tolerances = TOLERANCES.iter().map(|tolerance| {
        let value = match tolerance.allowed {
            Allowed::Numbers(_) => r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?".to_string(),
            Allowed::Words(words) => format!("\"*({})\"*", words.join("|")),
        };
        format!(r"\s*{}\s*=\s*{value}\s*", tolerance.name)
    });
    let tolerances: Vec<String> = tolerances.collect();
    format!("^({}|{}){END}", presets.join("|"), tolerances.join("|"))
}

/// The steps of `run.coarsen`: presets and tolerances.
pub(crate) fn steps(texts: &[String], check: &Check) -> Result<Vec<Coarser>, ConfigError> {
    if texts.is_empty() {
        let allowed = "at least one preset or tolerance, such as [\"fast\"]";
        return Err(check.refuse("run.coarsen", "[]", allowed));
    }
    let step = |(i, text): (usize, &String)| {
        let key = format!("run.coarsen[{i}]");
        if let Some((name, preset)) = PRESETS.iter().find(|(name, _)| name == text) {
            return Ok(Coarser::Preset(name, *preset));
        }
        let Some((name, given)) = text.split_once('=') else {
            let names: Vec<_> = PRESETS.iter().map(|(name, _)| *name).collect();
            let allowed = format!(
                "one of {}, or a tolerance such as \"wing_e = 0.5\"",
                names.join(", ")
            );
            return Err(check.refuse(&key, format!("{text:?}"), allowed));
        };
        let (name, given) = (name.trim(), given.trim());
        let tolerance = Tolerance::named(name).ok_or_else(|| {
            let names: Vec<&str> = TOLERANCES.iter().map(|tolerance| tolerance.name).collect();
            let reason = format!("unknown tolerance `{name}`{}", advice(name, &names));
            check.explain(&key, reason)
        })?;
        let raw = match given.parse() {
            Ok(number) => Raw::Number(number),
            Err(_) => Raw::Word(given.trim_matches('"').to_string()),
        };
        let value = value(name, tolerance, raw, check).map_err(|error| match error {
            ConfigError::Value { value, allowed, .. } => {
                check.explain(&key, format!("{name} = {value}: must be {allowed}"))
            }
            other => other,
        });
        Ok(Coarser::Tolerance(tolerance, value?))
    };
    texts.iter().enumerate().map(step).collect()
}

/// The value of a tolerance, given by `key`.
fn value(key: &str, tolerance: &Tolerance, raw: Raw, check: &Check) -> Result<Value, ConfigError> {
    match (tolerance.allowed, raw) {
        (Allowed::Numbers([min, max]), Raw::Number(number)) => {
            let number = check.range(key, number, min..=max)?;
            Ok(Value::Number(number))
        }
        (allowed, raw) => {
            let given = match raw {
                Raw::Number(number) => number.to_string(),
                Raw::Word(word) => format!("{word:?}"),
                Raw::Flag(flag) => flag.to_string(),
                Raw::Other(_) => "a list or a table".to_string(),
            };
            let word = match allowed {
                Allowed::Words(words) => words.iter().find(|word| format!("{word:?}") == given),
                Allowed::Numbers(_) => None,
            };
            let refused = || {
                let allowed = match allowed {
                    Allowed::Numbers([min, max]) => match tolerance.unit {
                        "1" => format!("{min} to {max}"),
                        unit => format!("{min} to {max} {unit}"),
                    },
                    Allowed::Words(words) => format!("one of {}", words.join(", ")),
                };
                check.refuse(key, given, allowed)
            };
            word.map(|word| Value::Word(word)).ok_or_else(refused)
        }
    }
}

impl<'de> Deserialize<'de> for RawFidelity {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Forms;

        impl<'de> Visitor<'de> for Forms {
            type Value = RawFidelity;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a preset such as \"realtime\", or a table of keys")
            }

            fn visit_str<E: Error>(self, preset: &str) -> Result<RawFidelity, E> {
                Ok(RawFidelity {
                    key: "fidelity",
                    preset: preset.to_string(),
                    tolerances: Vec::new(),
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RawFidelity, A::Error> {
                let mut raw = RawFidelity::default();
                while let Some(key) = map.next_key::<Key>()? {
                    match key {
                        Key::Preset => raw.preset = map.next_value()?,
                        Key::Tolerance(tolerance) => {
                            raw.tolerances.push((tolerance, map.next_value()?));
                        }
                    }
                }
                Ok(raw)
            }
        }

        from.deserialize_any(Forms)
    }
}

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        if name == PRESET {
            return Ok(Key::Preset);
        }
        let tolerance = Tolerance::named(&name).map(Key::Tolerance);
        tolerance.ok_or_else(|| D::Error::unknown_field(&name, &KEYS))
    }
}
