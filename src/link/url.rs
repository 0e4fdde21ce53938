//! Link URLs: `scheme://target?key=value&...`.

use super::{LinkError, examples};

/// A link URL in parts.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkUrl {
    /// As given.
    pub text: String,
    /// Before `://`.
    pub scheme: String,
    /// Between `://` and `?`.
    pub target: String,
    options: Vec<(String, String)>,
}

impl LinkUrl {
    /// Splits `text`.
    pub fn parse(text: &str) -> Result<LinkUrl, LinkError> {
        let Some((scheme, rest)) = text.split_once("://") else {
            return Err(LinkError::Url {
                url: text.to_string(),
                reason: "no scheme".to_string(),
                examples: examples(),
            });
        };
        let (target, query) = rest.split_once('?').unwrap_or((rest, ""));
        let options = query
            .split('&')
            .filter(|pair| !pair.is_empty())
            .map(|pair| pair.split_once('=').unwrap_or((pair, "")))
            .map(|(key, value)| (key.to_string(), value.to_string()))
            .collect();
        Ok(LinkUrl {
            text: text.to_string(),
            scheme: scheme.to_string(),
            target: target.to_string(),
            options,
        })
    }

    /// The value of option `key` as a number; `default` where it is not given.
    pub fn number(&self, key: &str, default: u32) -> Result<u32, LinkError> {
        match self.options.iter().find(|(k, _)| k == key) {
            None => Ok(default),
            Some((_, value)) => value
                .parse()
                .map_err(|_| self.refuse(format!("{key} = {value:?} must be a whole number"))),
        }
    }

    /// Refuses options that the link does not have.
    pub fn only(&self, known: &[&str]) -> Result<(), LinkError> {
        match self
            .options
            .iter()
            .find(|(key, _)| !known.contains(&key.as_str()))
        {
            None => Ok(()),
            Some((key, _)) => {
                let has = if known.is_empty() {
                    "none".to_string()
                } else {
                    known.join(", ")
                };
                Err(self.refuse(format!("unknown option {key:?}; {} has {has}", self.scheme)))
            }
        }
    }

    /// The error for this URL.
    pub fn refuse(&self, reason: String) -> LinkError {
        LinkError::Url {
            url: self.text.clone(),
            reason,
            examples: examples(),
        }
    }
}
