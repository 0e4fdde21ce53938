//! Opens a link by its address.

use crate::address::{Address, OpenError};
use crate::can::port::{CAN, SLCAN};
use crate::port::{Port, PortError, Scheme};
use crate::roles::Roles;
use crate::serial::SERIAL;
use crate::udp::UDP;

/// All schemes of addresses.
pub(crate) const SCHEMES: &[Scheme] = &[UDP, SERIAL, CAN, SLCAN];

type WithRoles = (Box<dyn Port + Send>, Roles);

/// Opens a link of the scheme `udp`, `serial`, `can` or `slcan`, such as `udp://HOST:PORT` or
/// `serial://PATH[?baud=N]`, with the roles of its option `roles`.
///
/// # Errors
/// [`PortError::Address`] if the text is no address, [`PortError::Io`] if the link cannot be
/// opened.
pub fn open(link: &str) -> Result<WithRoles, PortError> {
    let name = link.split("://").next();
    let scheme = SCHEMES.iter().find(|scheme| Some(scheme.name) == name);
    let wrong = |reason| PortError::Address {
        text: link.into(),
        reason,
        examples: match scheme {
            Some(scheme) => scheme.example.into(),
            None => {
                let examples = SCHEMES.iter().map(|scheme| scheme.example);
                examples.collect::<Vec<_>>().join(" or ")
            }
        },
    };
    open_as(scheme, link).map_err(|error| error.into_error(wrong))
}

fn open_as(scheme: Option<&Scheme>, link: &str) -> Result<WithRoles, OpenError<PortError>> {
    let address = Address::parse(link)?;
    let Some(scheme) = scheme else {
        let reason = match address.scheme.as_str() {
            "pty" => "a pty of the emulator is opened as serial://NAME".into(),
            other => format!("no scheme is called {other:?}"),
        };
        return Err(reason.into());
    };
    address.only(scheme.keys)?;
    let roles = address.roles()?;
    Ok(((scheme.open)(&address)?, roles))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_addresses_are_refused_with_an_example() {
        for row in [
            "udp://127.0.0.1 => no IP address and port",
            "udp://localhost:5 => no IP address and port",
            "tcp://127.0.0.1:5 => no scheme is called \"tcp\"",
            "serial:///dev/ttyX?baud=fast => must be a whole number",
            "serial:///dev/ttyX?baud=12 => 9600 to 3000000",
            "serial:///dev/ttyX?speed=9600 => unknown option \"speed\"; serial has baud, roles",
            "serial:///dev/ttyX?baud=9600&baud=9600 => option \"baud\" is given twice",
            "udp://127.0.0.1:5?roles=eyes => roles=eyes must be truth",
            "udp://127.0.0.1:5?role=pixels => unknown option \"role\"; udp has roles",
            "can://vcan0?role=pixels => unknown option \"role\"; can has bitrate, fd, load, roles",
            "vcan0 => no scheme",
            "pty://tracker => is opened as serial://NAME",
        ] {
            let (text, part) = row.split_once(" => ").unwrap();
            let error = open(text).err().unwrap().to_string();
            let names = SCHEMES.iter().map(|scheme| scheme.name);
            let shown = names
                .clone()
                .filter(|name| error.contains(&format!("{name}://")));
            let examples: Vec<&str> = shown.collect();
            let name = text.split(':').next().unwrap();
            let due = if names.clone().any(|known| known == name) {
                vec![name]
            } else {
                names.collect()
            };
            assert!(error.contains(part), "{text}: {error}");
            assert_eq!(examples, due, "{text}: {error}");
        }
        let error = open("serial:///dev/there-is-no-such-port").err();
        let error = error.unwrap().to_string();
        assert!(error.contains("/dev/there-is-no-such-port"), "{error}");
    }
}
