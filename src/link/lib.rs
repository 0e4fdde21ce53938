//! Links. Each carries whole packets between its own threads and two bounded queues. Of their
//! contents it only checks validity and whether they belong to a frame. A new link is a file here
//! and a row in [`LINKS`].

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bus;
mod can;
pub mod capture;
mod error;
pub mod fault;
mod inbox;
mod kind;
mod line;
mod lock;
mod log_rate_limit;
#[cfg(target_os = "linux")]
mod low_latency;
mod memory;
#[cfg(target_os = "linux")]
mod name;
mod outbox;
mod pace;
#[cfg(target_os = "linux")]
mod paced;
#[cfg(target_os = "linux")]
mod pseudo;
#[cfg(target_os = "linux")]
mod pty;
mod relay;
mod serial;
mod slcan;
mod tally;
mod tx_complete;
mod udp;
mod wire;

pub use error::{LinkError, OpenError};
pub use inbox::QUEUE;
pub use inbox::{Inbound, Inbox, InboxSender, Observer};
pub use kind::{AroundBus, AtBus, BothEnds, BusInstruments, Link, Options};
pub use lock::lock;
pub use log_rate_limit::LogRateLimit;
pub use outbox::FAULT_REFUSED;
pub use outbox::{Outbound, Outbox};
#[cfg(target_os = "linux")]
pub use pty::Pair;
pub use relay::{Relay, relay};
pub use skyloop_firmware_sim::address::Address;
pub use skyloop_firmware_sim::roles::Roles;
pub use tally::{Airtime, Tally};
pub use tally::{FaultEffect, SOON, Standstill, is_of_frame, standstill_timeout};
pub use tx_complete::{Exit, Mark, Unsent};
pub use wire::Wire;

/// All kinds of links.
pub const LINKS: &[Link] = &[
    memory::MEMORY,
    udp::UDP,
    serial::SERIAL,
    #[cfg(target_os = "linux")]
    pty::PTY,
    can::CAN,
    slcan::SLCAN,
];

/// Opens the emulator's end of the link that `url` names.
pub fn open(url: &str, options: &Options) -> Result<Wire, LinkError> {
    Known::of(url)?.open(options)
}

/// Opens the emulator's ends of a run's links. Exactly one of them carries the truth.
pub fn open_all(urls: &[String], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    open_each(&with_roles(urls)?, options)
}

/// Opens the emulator's ends of a further camera's links, which carry its frames and no truth.
pub fn open_further(urls: &[String], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    open_each(&with_further_roles(urls)?, options)
}

/// Checks `urls` as [`open_all`] does before it opens a link.
pub fn check_all(urls: &[String]) -> Result<(), LinkError> {
    with_roles(urls).map(drop)
}

/// Checks `urls` as [`open_further`] does before it opens a link.
pub fn check_further(urls: &[String]) -> Result<(), LinkError> {
    with_further_roles(urls).map(drop)
}

/// Whether a URL has the scheme of a link.
///
/// Errors: it has none, or an unknown one.
pub fn check_scheme(text: &str) -> Result<(), LinkError> {
    Known::of(text).map(drop)
}

/// An address with valid options, and its kind of link.
struct Known {
    link: &'static Link,
    address: Address,
}

impl Known {
    fn of(text: &str) -> Result<Known, LinkError> {
        let wrong = |reason| wrong(text, reason);
        let address = Address::parse(text).map_err(wrong)?;
        let Some(link) = by_scheme(&address.scheme) else {
            return Err(wrong(format!("unknown scheme {:?}", address.scheme)));
        };
        address.only(link.keys).map_err(wrong)?;
        Ok(Known { link, address })
    }

    fn roles(&self) -> Result<Roles, LinkError> {
        let roles = self.address.roles();
        roles.map_err(|reason| wrong(&self.address.text, reason))
    }

    fn open(&self, options: &Options) -> Result<Wire, LinkError> {
        let opened = (self.link.open)(&self.address, options);
        opened.map_err(|error| error.into_error(|reason| wrong(&self.address.text, reason)))
    }

    /// The error for wrong roles, with `roles` in the example.
    fn wrong_roles(&self, reason: &str, roles: &str) -> LinkError {
        let example = self.link.example;
        let sign = if example.contains('?') { '&' } else { '?' };
        LinkError::Url {
            url: self.address.text.clone(),
            reason: reason.to_string(),
            examples: format!("{example}{sign}roles={roles}"),
        }
    }
}

fn open_each(links: &[(Known, Roles)], options: &Options) -> Result<Vec<(Wire, Roles)>, LinkError> {
    let links = links.iter();
    links
        .map(|(link, roles)| Ok((link.open(options)?, *roles)))
        .collect()
}

fn with_roles(urls: &[String]) -> Result<Vec<(Known, Roles)>, LinkError> {
    let known = |url: &String| {
        let link = Known::of(url)?;
        let roles = link.roles()?;
        Ok((link, roles))
    };
    let links: Vec<(Known, Roles)> = urls.iter().map(known).collect::<Result<_, _>>()?;
    let mut truth = links.iter().filter(|(_, roles)| roles.truth);
    match (truth.next(), truth.next(), links.first()) {
        (_, Some((second, _)), _) => {
            let reason = "a second link for the truth; give it roles=pixels+labels";
            Err(second.wrong_roles(reason, "pixels+labels"))
        }
        (None, None, Some((first, _))) => {
            let reason =
                "no link has the role truth, so no attitude can arrive; give one roles=truth";
            Err(first.wrong_roles(reason, "truth"))
        }
        _ => Ok(links),
    }
}

fn with_further_roles(urls: &[String]) -> Result<Vec<(Known, Roles)>, LinkError> {
    let further = |url: &String| {
        let link = Known::of(url)?;
        let roles = link.roles()?;
        if roles.truth && roles != Roles::ALL {
            let reason = "a further camera gets the vehicle's state over the first camera's link; give it roles=pixels+labels, or none";
            return Err(link.wrong_roles(reason, "pixels+labels"));
        }
        let truth = false;
        Ok((link, Roles { truth, ..roles }))
    };
    urls.iter().map(further).collect()
}

/// Opens both ends of the link `text`: a scheme, and options after a question mark.
pub fn loopback(text: &str, options: &Options) -> Result<BothEnds, LinkError> {
    let scheme = text.split('?').next().unwrap_or(text);
    let link = by_scheme(scheme).ok_or_else(|| {
        let schemes: Vec<&str> = LINKS.iter().map(|link| link.scheme).collect();
        LinkError::Url {
            url: text.to_string(),
            reason: format!("no link is called {scheme:?}"),
            examples: format!("one of {}", schemes.join(", ")),
        }
    })?;
    let opened = || {
        let address = Address::without_target(text)?;
        address.only(link.keys)?;
        (link.loopback)(&address, options)
    };
    let wrong = |reason| LinkError::Url {
        url: text.to_string(),
        reason,
        examples: scheme.to_string(),
    };
    opened().map_err(|error: OpenError| error.into_error(wrong))
}

fn by_scheme(scheme: &str) -> Option<&'static Link> {
    LINKS.iter().find(|link| link.scheme == scheme)
}

/// Whether a link, by URL or scheme, is a CAN bus.
pub fn is_bus(text: &str) -> bool {
    let scheme = text.split([':', '?']).next();
    scheme.and_then(by_scheme).is_some_and(|link| link.is_bus)
}

/// The error for a wrong URL, with an example of its scheme or of all schemes.
fn wrong(url: &str, reason: String) -> LinkError {
    let named = url.split_once("://").map(|(scheme, _)| scheme);
    let examples = match named.and_then(by_scheme) {
        Some(link) => link.example.to_string(),
        None => {
            let examples = LINKS.iter().map(|link| link.example);
            let with_target = examples.filter(|example| example.contains("://"));
            with_target.collect::<Vec<_>>().join(" or ")
        }
    };
    LinkError::Url {
        url: url.to_string(),
        reason,
        examples,
    }
}

/// Helpers of the tests of several links.
#[cfg(test)]
pub(crate) mod fixture {
    use super::{Options, Outbound, Wire};
    use bytes::Bytes;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::slip;
    use std::time::Duration;

    pub(crate) const TIMEOUT: Duration = Duration::from_secs(20);

    /// Native packets and no bus.
    pub(crate) fn options() -> Options {
        Options {
            idle: TIMEOUT,
            personality: &NATIVE,
            bus: None,
        }
    }

    /// A packet as a serial line carries it.
    pub(crate) fn framed(packet: &[u8]) -> Vec<u8> {
        let mut line = Vec::new();
        slip::encode(packet, &mut |byte| line.push(byte));
        line
    }

    /// Queues a packet; panics if the queue is full.
    pub(crate) fn offer(wire: &mut Wire, exchange: u32, packet: &[u8]) {
        let packet = Bytes::copy_from_slice(packet);
        let full = wire.outbox.offer(Outbound::Packet { exchange, packet });
        assert!(full.unwrap().is_none());
    }
}
