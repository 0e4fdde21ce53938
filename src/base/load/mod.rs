//! Loading text files: folders on disk or built in, checked TOML, errors that name file, key, value and
//! the allowed range. Unknown keys are refused.

mod document;
mod embedded;
mod fixed;
mod folder;
mod kinds;
mod limits;
pub mod orbits;
mod report;
mod syntax;
mod table;
mod words;

pub use embedded::EXAMPLE_CAMERA;
pub use embedded::{CAMERAS, DEFAULT_SCENE, DEFAULT_TOML};
pub use fixed::Fixed;
pub use folder::Folder;
pub use kinds::only_its_keys;
pub use limits::{Allowed, END, Kind, Limit};
use report::MAX_FAULTS;
pub use report::{Noticed, read, read_noticed};
pub use table::{
    TextOrList, named_tables, some_table, some_tables, some_word, table, tables, word,
};
pub use words::{MEANT, advice, nearest};

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt;
use std::ops::RangeInclusive;
use thiserror::Error;

/// What is wrong with a configuration file.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{file}: {source}; {remedy}")]
    Read {
        /// As named by the user.
        file: String,
        /// Why.
        source: std::io::Error,
        /// What to do.
        remedy: String,
    },
    /// The text is not TOML, lacks a key or has an unknown one, or a value is of another type.
    #[error("{place}: {}", line(reason))]
    Syntax {
        /// File, line and column.
        place: String,
        /// Key, and what is expected there.
        reason: String,
    },
    /// A value that the emulator cannot work with.
    #[error("{file}: {}", line(&format!("{key} = {value}: must be {allowed}")))]
    Value {
        /// As named by the user.
        file: String,
        /// Table and key.
        key: String,
        /// As given.
        value: String,
        /// Range or choice.
        allowed: String,
    },
    /// A key that cannot be used as it is.
    #[error("{file}: {}", line(&format!("{key}: {reason}")))]
    Key {
        /// As named by the user.
        file: String,
        /// Table and key.
        key: String,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// A value that breaks a rule between keys.
    #[error("{error}")]
    Rule {
        /// The other keys that the rule compares it with.
        needs: Vec<String>,
        /// What is wrong.
        error: Box<ConfigError>,
    },
    /// An orbit file that cannot be used.
    #[error("{0}")]
    Orbit(String),
    /// What is wrong with another file that a key names.
    #[error("{error}")]
    Named {
        /// Table and key.
        key: String,
        /// What is wrong.
        error: Box<ConfigError>,
    },
    /// A file with more than one fault, in the order of its lines.
    #[error("{file}: {} faults{}:\n  {}", faults.len(), more(faults), lines(faults))]
    Several {
        /// As named by the user.
        file: String,
        /// Its faults.
        faults: Vec<ConfigError>,
    },
}

/// A text in one line of at most 2,000 characters. Of a longer one the middle is left out: key and
/// remedy stay.
fn line(text: &str) -> String {
    const ENDS: [usize; 2] = [1300, 600];
    let escaped = |c: char| match c.is_control() {
        true => c.escape_default().to_string(),
        false => c.to_string(),
    };
    let count = text.chars().count();
    if count <= ENDS.iter().sum() {
        return text.chars().map(escaped).collect();
    }
    let first: String = text.chars().take(ENDS[0]).map(escaped).collect();
    let last: String = text.chars().skip(count - ENDS[1]).map(escaped).collect();
    format!("{first} ... {last}")
}

/// Whether there may be more than are listed.
fn more(faults: &[ConfigError]) -> &'static str {
    match faults.len() < MAX_FAULTS {
        true => "",
        false => " or more",
    }
}

/// One line for each fault.
fn lines(faults: &[ConfigError]) -> String {
    let lines: Vec<String> = faults.iter().map(ConfigError::to_string).collect();
    lines.join("\n").replace('\n', "\n  ")
}

impl ConfigError {
    /// The key that a check refused.
    fn key(&self) -> Option<&str> {
        match self {
            ConfigError::Value { key, .. }
            | ConfigError::Key { key, .. }
            | ConfigError::Named { key, .. } => Some(key),
            ConfigError::Rule { error, .. } => error.key(),
            _ => None,
        }
    }

    /// Whether another value of the key would do.
    fn is_of_value(&self) -> bool {
        match self {
            ConfigError::Value { .. } | ConfigError::Syntax { .. } => true,
            ConfigError::Rule { error, .. } => error.is_of_value(),
            _ => false,
        }
    }

    /// The same with the place of the key in the file, where the error is of this file; `given`: keys as the file has them.
    fn at(self, of_file: &str, place: &str, given: &impl Fn(&str) -> String) -> ConfigError {
        match self {
            ConfigError::Value {
                file,
                key,
                value,
                allowed,
            } if file == of_file => ConfigError::Value {
                file: place.to_string(),
                key: given(&key),
                value,
                allowed,
            },
            ConfigError::Key { file, key, reason } if file == of_file => ConfigError::Key {
                file: place.to_string(),
                key: given(&key),
                reason,
            },
            ConfigError::Rule { needs, error } => ConfigError::Rule {
                needs: needs.iter().map(|key| given(key)).collect(),
                error: Box::new(error.at(of_file, place, given)),
            },
            other => other,
        }
    }

    /// The same as the error of a rule between its key and `keys`: where one of these is faulty itself, only that is reported.
    pub fn needs(self, keys: &[&str]) -> ConfigError {
        ConfigError::Rule {
            needs: keys.iter().map(|key| (*key).to_string()).collect(),
            error: Box::new(self),
        }
    }

    /// What is said of an unknown key.
    fn unknown_key(&self) -> Option<&str> {
        let ConfigError::Syntax { reason, .. } = self else {
            return None;
        };
        Some(reason.split_once("unknown key ")?.1)
    }

    /// The key that is meant by an unknown one.
    fn meant(&self) -> Option<&str> {
        let (_, meant) = self.unknown_key()?.split_once(MEANT)?;
        meant.strip_suffix("`?")
    }
}

/// The JSON Schema (draft 2020-12) of a file that is read as `Raw`, with the limits of its values.
pub fn schema_of<Raw: JsonSchema>(title: &str, limits: &[&[Limit]]) -> Schema {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<Raw>();
    limits::bound_integers(schema.ensure_object().values_mut());
    for limits in limits {
        limits::apply(&mut schema, limits);
    }
    schema.insert("title".to_string(), title.into());
    schema
}

/// Checks values of one file, so that each check is one line.
pub struct Check<'a> {
    /// The file's name in messages.
    pub file: &'a str,
    notices: RefCell<Vec<String>>,
}

impl<'a> Check<'a> {
    fn of(file: &'a str) -> Check<'a> {
        Check {
            file,
            notices: RefCell::default(),
        }
    }

    /// Notes a value that is allowed, but hardly meant; reported if the file is valid.
    pub fn notice(&self, text: fmt::Arguments) {
        let notice = format!("{}: {text}", self.file);
        self.notices.borrow_mut().push(notice);
    }

    /// `value` if it lies within the limit of `key` in the table (NaN never does).
    pub fn limit(&self, limits: &[Limit], key: &str, value: f64) -> Result<f64, ConfigError> {
        let unknown = "has no limit in the tables of skyloop: please report it";
        match limits::range_of(limits, key) {
            Some(range) => self.range(key, value, range),
            None => Err(self.explain(key, unknown)),
        }
    }

    /// `values` if each lies within the limit of `key[]`; the error names the first that does not.
    pub fn each_limit<const N: usize>(
        &self,
        limits: &[Limit],
        key: &str,
        values: [f64; N],
    ) -> Result<[f64; N], ConfigError> {
        for (i, value) in values.into_iter().enumerate() {
            self.limit(limits, &format!("{key}[{i}]"), value)?;
        }
        Ok(values)
    }

    /// `value` if it lies in `range` (NaN never does).
    pub fn range(
        &self,
        key: &str,
        value: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        if range.contains(&value) {
            // No negative zero.
            return Ok(value + 0.0);
        }
        let mut allowed = range_text(key, &range);
        if unit_of(key).is_empty() && *range.end() <= 1.0 && (*range.end()..=100.0).contains(&value)
        {
            allowed += &format!(", a share: {value} % is {}", value / 100.0);
        }
        Err(self.refuse(key, short(value), allowed))
    }

    /// The error of `key` where another message says what is wrong.
    pub fn explain(&self, key: &str, reason: impl fmt::Display) -> ConfigError {
        ConfigError::Key {
            file: self.file.to_string(),
            key: key.to_string(),
            reason: reason.to_string(),
        }
    }

    /// The error of a file that `key` names: a file that cannot be read is reported with the key, faults in the file without.
    pub fn named(&self, key: &str, error: ConfigError) -> ConfigError {
        match error {
            ConfigError::Read { .. } => self.explain(key, error),
            other => ConfigError::Named {
                key: key.to_string(),
                error: Box::new(other),
            },
        }
    }

    /// The error for `key = value`.
    pub fn refuse(
        &self,
        key: &str,
        value: impl fmt::Display,
        allowed: impl Into<String>,
    ) -> ConfigError {
        ConfigError::Value {
            file: self.file.to_string(),
            key: key.to_string(),
            value: value.to_string(),
            allowed: allowed.into(),
        }
    }
}

/// The choice between words.
pub fn one_of(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    match quoted.as_slice() {
        [only] => only.clone(),
        all => format!("one of {}", all.join(", ")),
    }
}

/// A number as it was written, one of many digits by its power of ten.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-5..1e16 => value.to_string(),
        _ => format!("{value:e}"),
    }
}

/// The allowed range of a key, with its unit.
fn range_text(key: &str, range: &RangeInclusive<f64>) -> String {
    let text = match *range.start() {
        f64::MIN_POSITIVE => format!("above 0, at most {}", range.end()),
        least => format!("{least} to {}", range.end()),
    };
    match unit_of(key) {
        "" => text,
        unit => format!("{text} {unit}"),
    }
}

/// Units of keys whose names do not have them.
const UNITS_OF_KEYS: &[(&str, &str)] = &[
    ("optics.band[]", "nm"),
    ("optics.psf.width_by_field[][0]", "deg"),
    ("optics.stray.pst[][0]", "deg"),
    ("optics.vignetting.table[][0]", "deg"),
    ("sequence.look_at[]", "deg"),
    ("sequence.radec[]", "deg"),
];

/// Ends of keys and the units that they name; of two that fit the first.
const UNITS: &[(&str, &str)] = &[
    ("_e_per_dn", "e-/DN"),
    ("_cm2_s", "1/cm^2/s"),
    ("_deg_s", "deg/s"),
    ("_e_s", "e-/s"),
    ("_arcsec", "arcsec"),
    ("_deg", "deg"),
    ("_m2", "m^2"),
    ("_bits", "bits"),
    ("_mev", "MeV"),
    ("_mm", "mm"),
    ("_um", "um"),
    ("_us", "us"),
    ("_px", "px"),
    ("_hz", "Hz"),
    ("_dn", "DN"),
    ("_e", "e-"),
    ("_c", "deg C"),
    ("_k", "K"),
    ("_m", "m"),
    ("_s", "s"),
];

/// The unit that a key names; none where it names none.
fn unit_of(key: &str) -> &'static str {
    let mut own = UNITS_OF_KEYS.iter();
    if let Some((_, unit)) = own.find(|(pattern, _)| limits::matches(pattern, key)) {
        return unit;
    }
    let name = match key.rfind('[') {
        Some(at) if key.ends_with(']') => &key[..at],
        _ => key,
    };
    let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
    unit.map_or("", |(_, unit)| *unit)
}

/// What the years of times begin with: the series of the Earth's and the Sun's positions hold from 1900 to 2100 (`sky::bodies`).
pub const CENTURIES: [&str; 2] = ["19", "20"];

/// A time: a string, or TOML's own date and time.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a UTC time such as 2019-06-15T23:35:50.500Z"
)]
pub enum RawTime {
    /// As text.
    Text(String),
    /// As TOML writes it.
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

/// Compares schemas with loaders, for tests of the crates that read files.
#[cfg(any(test, feature = "test-support"))]
pub use limits::tests::{agree, both};
