//! Link URLs: `scheme://target?key=value&...`, and for `loopback`, which chooses the target, `scheme?key=value&...`.

use super::{LINKS, LinkError, Roles, by_scheme, examples};
use skyloop_firmware_sim::port::PortError;
use std::ops::RangeInclusive;

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
        LinkUrl::of(text, scheme, target, query)
    }

    /// Splits the `text` of `loopback --link`.
    pub fn parse_loopback(text: &str) -> Result<LinkUrl, LinkError> {
        let (scheme, query) = text.split_once('?').unwrap_or((text, ""));
        if LINKS.iter().all(|link| link.scheme != scheme) {
            let schemes: Vec<&str> = LINKS.iter().map(|link| link.scheme).collect();
            return Err(LinkError::Url {
                url: text.to_string(),
                reason: format!("no link is called {scheme:?}"),
                examples: format!("one of {}", schemes.join(", ")),
            });
        }
        LinkUrl::of(text, scheme, "", query)
    }

    fn of(text: &str, scheme: &str, target: &str, query: &str) -> Result<LinkUrl, LinkError> {
        let mut url = LinkUrl {
            text: text.to_string(),
            scheme: scheme.to_string(),
            target: target.to_string(),
            options: Vec::new(),
        };
        for pair in query.split('&').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            if url.value(key).is_some() {
                return Err(url.refuse(format!("option {key:?} is given twice")));
            }
            url.options.push((key.to_string(), value.to_string()));
        }
        Ok(url)
    }

    /// The value of option `key`, if it is given.
    pub fn value(&self, key: &str) -> Option<&str> {
        let mut options = self.options.iter();
        options.find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// The value of option `key` as a number within `range`; `default` where it is not given.
    pub fn number_in(
        &self,
        key: &str,
        default: u32,
        range: RangeInclusive<u32>,
    ) -> Result<u32, LinkError> {
        let Some(value) = self.value(key) else {
            return Ok(default);
        };
        let number: u32 = value
            .parse()
            .map_err(|_| self.refuse(format!("{key} = {value:?} must be a whole number")))?;
        if range.contains(&number) {
            return Ok(number);
        }
        let (least, most) = range.into_inner();
        Err(self.refuse(format!("{key} = {number} must be {least} to {most}")))
    }

    /// The value of option `key` as a decimal number within `range`; none where it is not given.
    pub fn decimal_in(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
    ) -> Result<Option<f64>, LinkError> {
        let Some(value) = self.value(key) else {
            return Ok(None);
        };
        match value.parse() {
            Ok(number) if range.contains(&number) => Ok(Some(number)),
            _ => {
                let (least, most) = range.into_inner();
                Err(self.refuse(format!(
                    "{key} = {value:?} must be a number from {least} to {most}"
                )))
            }
        }
    }

    /// What the link is for, by option `roles`; all where it is not given.
    pub fn roles(&self) -> Result<Roles, LinkError> {
        let roles = self.value("roles").map_or(Ok(Roles::ALL), Roles::parse);
        roles.map_err(|reason| self.refuse(reason))
    }

    /// Refuses options that the link does not have. Every link has `roles`.
    pub fn only(&self, known: &[&str]) -> Result<(), LinkError> {
        let mut keys = self.options.iter().map(|(key, _)| key.as_str());
        match keys.find(|key| *key != "roles" && !known.contains(key)) {
            None => Ok(()),
            Some(key) => {
                let has = [known, &["roles"]].concat().join(", ");
                Err(self.refuse(format!("unknown option {key:?}; {} has {has}", self.scheme)))
            }
        }
    }

    /// The error for this URL, with an example of its scheme (of a loopback: the scheme), or of all schemes.
    pub fn refuse(&self, reason: String) -> LinkError {
        let is_loopback = !self.text.contains("://");
        let examples = match by_scheme(&self.scheme) {
            Some(link) if is_loopback => link.scheme.to_string(),
            Some(link) => link.example.to_string(),
            None => examples(),
        };
        LinkError::Url {
            url: self.text.clone(),
            reason,
            examples,
        }
    }

    /// The error for a URL that lacks `roles`, with an example that has them.
    pub fn refuse_roles(&self, reason: &str, roles: &str) -> LinkError {
        let mut error = self.refuse(reason.to_string());
        if let LinkError::Url { examples, .. } = &mut error {
            let sign = if examples.contains('?') { '&' } else { '?' };
            examples.push_str(&format!("{sign}roles={roles}"));
        }
        error
    }

    /// The error for a loopback whose flight computer's end cannot be opened.
    pub fn no_client(&self, error: PortError) -> LinkError {
        let error = std::io::Error::other(error);
        self.failed("open the client's end", error, "try again")
    }

    /// The error for what the system refuses to do with this URL.
    pub fn failed(
        &self,
        action: &'static str,
        source: std::io::Error,
        remedy: &'static str,
    ) -> LinkError {
        LinkError::refused(self.text.clone(), action, source, remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused<T: std::fmt::Debug>(result: Result<T, LinkError>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn a_url_has_a_scheme_a_target_and_options() {
        let url = LinkUrl::parse("serial:///dev/ttyUSB0?baud=9600&roles=truth").unwrap();
        assert_eq!(
            (&url.scheme[..], &url.target[..]),
            ("serial", "/dev/ttyUSB0")
        );
        assert_eq!(url.number_in("baud", 1, 9600..=9600).unwrap(), 9600);
        assert_eq!(url.number_in("other", 7, 1..=2).unwrap(), 7);
        assert!(url.only(&["baud"]).is_ok());
        let unknown = refused(url.only(&["rate_mbit"]));
        assert!(unknown.contains("unknown option \"baud\"; serial has rate_mbit, roles"));
        assert!(
            unknown.ends_with("write for example serial:///dev/ttyUSB0?baud=921600"),
            "{unknown}"
        );
        let strange = LinkUrl::parse("pigeon://loft").unwrap();
        let strange = strange.refuse("why".to_string()).to_string();
        assert!(strange.contains("udp://") && strange.contains("can://"));
    }

    #[test]
    fn values_out_of_range_and_keys_given_twice_are_refused() {
        let url = LinkUrl::parse("x://y?a=5&b=nan&c=0.5").unwrap();
        let high = refused(url.number_in("a", 1, 6..=9));
        assert!(high.contains("a = 5 must be 6 to 9"), "{high}");
        assert!(refused(url.number_in("b", 1, 6..=9)).contains("whole number"));
        assert!(refused(url.decimal_in("b", 0.0..=1.0)).contains("from 0 to 1"));
        assert_eq!(url.decimal_in("c", 0.0..=1.0).unwrap(), Some(0.5));
        assert_eq!(url.decimal_in("d", 0.0..=1.0).unwrap(), None);
        let twice = refused(LinkUrl::parse("serial://x?baud=1&baud=2"));
        assert!(twice.contains("\"baud\" is given twice"), "{twice}");
    }

    #[test]
    fn a_loopback_needs_no_target() {
        let url = LinkUrl::parse_loopback("serial?baud=9600").unwrap();
        assert_eq!((&url.scheme[..], &url.target[..]), ("serial", ""));
        assert_eq!(url.value("baud"), Some("9600"));
        let unknown = refused(LinkUrl::parse_loopback("pigeon"));
        assert!(unknown.contains("memory, udp, serial"), "{unknown}");
    }
}
