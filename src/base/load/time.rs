//! Times in files.

use super::check::Check;
use super::error::ConfigError;
use super::limits::END;
use hifitime::Epoch;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use skyloop_orbit::time::parse_utc;
use std::borrow::Cow;
use std::fmt;

/// First digits of valid years: the series for Earth and Sun hold from 1900 to 2100
/// (`sky::bodies`).
const CENTURIES: [&str; 2] = ["19", "20"];

/// A time: a string, or a date and time of TOML.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a UTC time such as 2019-06-15T23:35:50.500Z"
)]
pub enum RawTime {
    /// As text.
    Text(String),
    /// As a TOML date and time.
    Date(toml::value::Datetime),
}

impl JsonSchema for RawTime {
    fn schema_name() -> Cow<'static, str> {
        "UTC".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let years = format!("({})[0-9]{{2}}", CENTURIES.join("|"));
        let date = format!("{years}-((0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])|[0-3][0-9]{{2}})");
        let clock = r"([01][0-9]|2[0-3]):[0-5][0-9]:([0-5][0-9]|60)(\.[0-9]*)?";
        json_schema!({
            "type": "string",
            "pattern": format!(r"^\s*{date}T{clock}Z?\s*{END}"),
            "description": "A UTC time such as 2019-06-15T23:35:50.500Z, in quotes or not",
        })
    }
}

impl fmt::Display for RawTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RawTime::Text(text) => f.write_str(text),
            RawTime::Date(date) => date.fmt(f),
        }
    }
}

impl RawTime {
    /// The instant, of a year from 1900 to 2099.
    pub fn utc(&self, check: &Check, key: &str) -> Result<Epoch, ConfigError> {
        let text = self.to_string();
        let epoch = parse_utc(&text).map_err(|why| check.explain(key, why))?;
        if !CENTURIES.iter().any(|years| text.trim().starts_with(years)) {
            return Err(check.refuse(key, text, "a time of the years 1900 to 2099"));
        }
        Ok(epoch)
    }
}
