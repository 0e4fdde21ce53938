//! Addresses of links: `scheme://target?key=value&...`. Both ends of a link read them here.

use crate::roles::Roles;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// An address in parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Address {
    /// As given.
    pub text: String,
    /// Before `://`.
    pub scheme: String,
    /// Between `://` and `?`.
    pub target: String,
    options: Vec<(String, String)>,
}

/// Error when an address cannot be opened.
#[derive(Debug)]
pub enum OpenError<E> {
    /// The address is wrong; holds the reason.
    Wrong(String),
    /// The system refuses it.
    Failed(E),
}

impl<E> From<String> for OpenError<E> {
    fn from(reason: String) -> Self {
        Self::Wrong(reason)
    }
}

impl<E> OpenError<E> {
    /// Converts into the caller's error; `wrong` adds the address and an example to the reason.
    pub fn into_error(self, wrong: impl FnOnce(String) -> E) -> E {
        match self {
            Self::Wrong(reason) => wrong(reason),
            Self::Failed(error) => error,
        }
    }
}

impl Address {
    /// Splits `scheme://target?options`.
    ///
    /// # Errors
    /// The reason; the caller adds the address and an example. This holds for all functions of this
    /// type.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (scheme, rest) = text.split_once("://").ok_or("no scheme")?;
        let (target, options) = rest.split_once('?').unwrap_or((rest, ""));
        Self::of(text, scheme, target, options)
    }

    /// Splits `scheme?options`, for a link that chooses its target.
    pub fn without_target(text: &str) -> Result<Self, String> {
        let (scheme, options) = text.split_once('?').unwrap_or((text, ""));
        Self::of(text, scheme, "", options)
    }

    fn of(text: &str, scheme: &str, target: &str, options: &str) -> Result<Self, String> {
        let mut address = Self {
            text: text.into(),
            scheme: scheme.into(),
            target: target.into(),
            options: Vec::new(),
        };
        for option in options.split('&').filter(|option| !option.is_empty()) {
            let (key, value) = option.split_once('=').unwrap_or((option, ""));
            if address.value(key).is_some() {
                return Err(format!("option {key:?} is given twice"));
            }
            address.options.push((key.into(), value.into()));
        }
        Ok(address)
    }

    /// Refuses options other than `known` and `roles`, which every link has.
    pub fn only(&self, known: &[&str]) -> Result<(), String> {
        let mut keys = self.options.iter().map(|(key, _)| key.as_str());
        match keys.find(|key| *key != "roles" && !known.contains(key)) {
            None => Ok(()),
            Some(key) => {
                let has = [known, &["roles"]].concat().join(", ");
                Err(format!("unknown option {key:?}; {} has {has}", self.scheme))
            }
        }
    }

    /// The value of option `key`, if it is given.
    #[must_use]
    pub fn value(&self, key: &str) -> Option<&str> {
        let mut options = self.options.iter();
        options.find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// The value of option `key`, a whole number within `range`, if it is given.
    pub(crate) fn whole_in(
        &self,
        key: &str,
        range: RangeInclusive<u32>,
    ) -> Result<Option<u32>, String> {
        let Some(number) = self.number(key, "a whole number")? else {
            return Ok(None);
        };
        if range.contains(&number) {
            return Ok(Some(number));
        }
        let (min, max) = range.into_inner();
        Err(format!("{key} = {number} must be {min} to {max}"))
    }

    /// The value of option `key`, a decimal number within `range`, if it is given.
    pub fn decimal_in(&self, key: &str, range: RangeInclusive<f64>) -> Result<Option<f64>, String> {
        let what = format!("a number from {} to {}", range.start(), range.end());
        let number = self.number(key, &what)?;
        match number.filter(|number| !range.contains(number)) {
            None => Ok(number),
            Some(number) => Err(format!("{key} = {number} must be {what}")),
        }
    }

    fn number<N: FromStr>(&self, key: &str, what: &str) -> Result<Option<N>, String> {
        let parse = |value: &str| {
            let number = value.parse();
            number.map_err(|_| format!("{key} = {value:?} must be {what}"))
        };
        self.value(key).map(parse).transpose()
    }

    /// Roles of the link, from option `roles`; all roles without it.
    pub fn roles(&self) -> Result<Roles, String> {
        self.value("roles").map_or(Ok(Roles::ALL), Roles::parse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_split_into_scheme_target_and_options() {
        let address =
            Address::parse("serial:///dev/ttyUSB0?baud=9600&load=0.5&roles=truth").unwrap();
        let parts = (&address.scheme[..], &address.target[..]);
        assert_eq!(parts, ("serial", "/dev/ttyUSB0"));
        assert_eq!(address.whole_in("baud", 9600..=9600), Ok(Some(9600)));
        assert_eq!(address.decimal_in("load", 0.5..=1.0), Ok(Some(0.5)));
        assert_eq!(address.whole_in("other", 1..=2), Ok(None));
        assert_eq!(address.decimal_in("other", 1.0..=2.0), Ok(None));
        assert_eq!(address.roles(), Roles::parse("truth"));
        assert_eq!(address.only(&["baud", "load"]), Ok(()));
        let bare = Address::without_target("serial?baud=9600").unwrap();
        let parts = (&bare.scheme[..], &bare.target[..], bare.value("baud"));
        assert_eq!(parts, ("serial", "", Some("9600")));
        assert_eq!(bare.roles(), Ok(Roles::ALL));
    }

    #[test]
    fn wrong_addresses_are_refused_with_the_reason() {
        for (text, reason) in [
            ("nonsense", "no scheme"),
            ("x://y?a=1&a=1", "option \"a\" is given twice"),
            ("x://y?roles=truth&roles=truth", "\"roles\" is given twice"),
            ("x://y?c=1", "unknown option \"c\"; x has a, b, roles"),
            ("x://y?a=5", "a = 5 must be 6 to 9"),
            ("x://y?a=10", "a = 10 must be 6 to 9"),
            ("x://y?a=nan", "a = \"nan\" must be a whole number"),
            ("x://y?b=z", "b = \"z\" must be a number from 0 to 1"),
            ("x://y?b=nan", "b = NaN must be a number from 0 to 1"),
            ("x://y?b=1.5", "b = 1.5 must be a number from 0 to 1"),
            ("x://y?roles=", "roles= must be"),
            ("x://y?roles=truth+sound", "roles=truth+sound must be"),
        ] {
            let read = Address::parse(text).and_then(|address| {
                address.only(&["a", "b"])?;
                address.whole_in("a", 6..=9)?;
                address.decimal_in("b", 0.0..=1.0)?;
                address.roles()
            });
            let error = read.unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
