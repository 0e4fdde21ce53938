//! Faults of a configuration file.

use super::words::MEANT;
use thiserror::Error;

/// Largest number of faults that are listed.
pub(super) const MAX_FAULTS: usize = 30;

/// A fault of a configuration file.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{file}: {source}; {remedy}")]
    Read {
        /// As named by the user.
        file: String,
        /// The error of the system.
        source: std::io::Error,
        /// The remedy.
        remedy: String,
    },
    /// The text is not TOML, a key is missing or unknown, or a value has another type.
    #[error("{place}: {}", line(reason))]
    Syntax {
        /// File, line and column.
        place: String,
        /// Key and expected value.
        reason: String,
    },
    /// A value out of its range.
    #[error("{file}: {}", line(&format!("{key} = {value}: must be {allowed}")))]
    Value {
        /// As named by the user.
        file: String,
        /// Table and key.
        key: String,
        /// As given.
        value: String,
        /// Range or choices.
        allowed: String,
    },
    /// A key with another fault than its value.
    #[error("{file}: {}", line(&format!("{key}: {reason}")))]
    Key {
        /// As named by the user.
        file: String,
        /// Table and key.
        key: String,
        /// The fault and the remedy.
        reason: String,
    },
    /// A value that breaks a rule between keys.
    #[error("{error}")]
    Rule {
        /// The other keys that the rule compares it with.
        needs: Vec<String>,
        /// The fault.
        error: Box<ConfigError>,
    },
    /// An orbit file that cannot be used.
    #[error("{0}")]
    Orbit(String),
    /// A fault of another file that a key names.
    #[error("{error}")]
    Named {
        /// Table and key.
        key: String,
        /// The fault.
        error: Box<ConfigError>,
    },
    /// A file with more than one fault, in the order of its lines.
    #[error("{file}: {} faults{}:\n  {}", faults.len(), more(faults), lines(faults))]
    Several {
        /// As named by the user.
        file: String,
        /// The faults.
        faults: Vec<ConfigError>,
    },
}

/// A text in one line of at most 2,000 characters. A longer one loses its middle, so that key and
/// remedy stay.
fn line(text: &str) -> String {
    const ENDS: [usize; 2] = [1300, 600];
    let escaped = |c: char| {
        if c.is_control() {
            c.escape_default().to_string()
        } else {
            c.to_string()
        }
    };
    let count = text.chars().count();
    if count <= ENDS.iter().sum() {
        return text.chars().map(escaped).collect();
    }
    let first: String = text.chars().take(ENDS[0]).map(escaped).collect();
    let last: String = text.chars().skip(count - ENDS[1]).map(escaped).collect();
    format!("{first} ... {last}")
}

/// Text for more faults than are listed.
fn more(faults: &[ConfigError]) -> &'static str {
    if faults.len() < MAX_FAULTS {
        ""
    } else {
        " or more"
    }
}

/// One line for each fault.
fn lines(faults: &[ConfigError]) -> String {
    let lines: Vec<String> = faults.iter().map(ConfigError::to_string).collect();
    lines.join("\n").replace('\n', "\n  ")
}

impl ConfigError {
    /// The faulty key.
    pub(super) fn key(&self) -> Option<&str> {
        match self {
            ConfigError::Value { key, .. }
            | ConfigError::Key { key, .. }
            | ConfigError::Named { key, .. } => Some(key),
            ConfigError::Rule { error, .. } => error.key(),
            _ => None,
        }
    }

    /// Whether another value of the key would be valid.
    pub(super) fn is_of_value(&self) -> bool {
        match self {
            ConfigError::Value { .. } | ConfigError::Syntax { .. } => true,
            ConfigError::Rule { error, .. } => error.is_of_value(),
            _ => false,
        }
    }

    /// Adds the position of the key to an error of `of_file`; `given` converts keys to those of the
    /// file.
    pub(super) fn at(
        self,
        of_file: &str,
        place: &str,
        given: &impl Fn(&str) -> String,
    ) -> ConfigError {
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

    /// Makes this the error of a rule between its key and `keys`. If one of `keys` has a fault of
    /// its own, only that is reported.
    pub fn needs(self, keys: &[&str]) -> ConfigError {
        ConfigError::Rule {
            needs: keys.iter().map(|key| (*key).to_string()).collect(),
            error: Box::new(self),
        }
    }

    /// The text after `unknown key`.
    pub(super) fn unknown_key(&self) -> Option<&str> {
        let ConfigError::Syntax { reason, .. } = self else {
            return None;
        };
        Some(reason.split_once("unknown key ")?.1)
    }

    /// The key that an unknown one was meant to be.
    pub(super) fn meant(&self) -> Option<&str> {
        let (_, meant) = self.unknown_key()?.split_once(MEANT)?;
        meant.strip_suffix("`?")
    }
}
