//! What is wrong with a configuration file.

use super::words::MEANT;
use thiserror::Error;

/// Largest number of faults that are listed.
pub(super) const MAX_FAULTS: usize = 30;

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
    pub(super) fn key(&self) -> Option<&str> {
        match self {
            ConfigError::Value { key, .. }
            | ConfigError::Key { key, .. }
            | ConfigError::Named { key, .. } => Some(key),
            ConfigError::Rule { error, .. } => error.key(),
            _ => None,
        }
    }

    /// Whether another value of the key would do.
    pub(super) fn is_of_value(&self) -> bool {
        match self {
            ConfigError::Value { .. } | ConfigError::Syntax { .. } => true,
            ConfigError::Rule { error, .. } => error.is_of_value(),
            _ => false,
        }
    }

    /// The same with the place of the key in the file, where the error is of this file; `given`: keys as the file has them.
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

    /// The same as the error of a rule between its key and `keys`: where one of these is faulty itself, only that is reported.
    pub fn needs(self, keys: &[&str]) -> ConfigError {
        ConfigError::Rule {
            needs: keys.iter().map(|key| (*key).to_string()).collect(),
            error: Box::new(self),
        }
    }

    /// What is said of an unknown key.
    pub(super) fn unknown_key(&self) -> Option<&str> {
        let ConfigError::Syntax { reason, .. } = self else {
            return None;
        };
        Some(reason.split_once("unknown key ")?.1)
    }

    /// The key that is meant by an unknown one.
    pub(super) fn meant(&self) -> Option<&str> {
        let (_, meant) = self.unknown_key()?.split_once(MEANT)?;
        meant.strip_suffix("`?")
    }
}
