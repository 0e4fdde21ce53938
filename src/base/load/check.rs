//! Checks values of a file.

use super::error::ConfigError;
use super::limits::{self, Limit};
use super::units::{range_text, short, unit_of};
use std::cell::RefCell;
use std::fmt;
use std::ops::RangeInclusive;

/// Checks of one file.
pub struct Check<'a> {
    /// The file's name in messages.
    pub file: &'a str,
    pub(super) notices: RefCell<Vec<String>>,
}

impl<'a> Check<'a> {
    pub(super) fn of(file: &'a str) -> Check<'a> {
        Check {
            file,
            notices: RefCell::default(),
        }
    }

    /// Adds a notice for an allowed but improbable value; reported if the file is valid.
    pub fn notice(&self, text: fmt::Arguments) {
        let notice = format!("{}: {text}", self.file);
        self.notices.borrow_mut().push(notice);
    }

    /// `value` if it lies within the limit of `key` in the table; NaN does not.
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

    /// `value` if it lies in `range`; NaN does not.
    pub fn range(
        &self,
        key: &str,
        value: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        if range.contains(&value) {
            // Avoids a negative zero.
            return Ok(value + 0.0);
        }
        let mut allowed = range_text(key, &range);
        if unit_of(key).is_empty() && *range.end() <= 1.0 && (*range.end()..=100.0).contains(&value)
        {
            allowed += &format!(", a share: {value} % is {}", value / 100.0);
        }
        Err(self.refuse(key, short(value), allowed))
    }

    /// The error of `key` with a reason.
    pub fn explain(&self, key: &str, reason: impl fmt::Display) -> ConfigError {
        ConfigError::Key {
            file: self.file.to_string(),
            key: key.to_string(),
            reason: reason.to_string(),
        }
    }

    /// The error of a file that is the value of `key`. If the file cannot be read, the error names
    /// `key`; errors in the file name their own keys.
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
