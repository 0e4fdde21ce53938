//! CAN through a LAWICEL-style adapter on a serial port or a pseudo-terminal: for hosts without CAN in their kernel.

use super::{Airtime, BothEnds, Link, LinkError, LinkUrl, Options, Wire, bus, can};
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::{Opener, slcan};
use std::sync::Arc;
use std::time::Duration;

/// Adapters.
pub const SLCAN: Link = Link {
    scheme: "slcan",
    example: "slcan:///dev/ttyACM0?bitrate=500000",
    open,
    loopback,
};

const KEYS: &[&str] = &["bitrate", "fd", "load", "baud"];

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    let settings = bus::settings(url, &url.target, KEYS)?;
    check(url, &settings)?;
    start(url, options, &settings)
}

/// Refuses bit rates that adapters do not have.
fn check(url: &LinkUrl, settings: &Settings) -> Result<(), LinkError> {
    let commands = slcan::commands(settings);
    commands.map(drop).map_err(|reason| url.refuse(reason))
}

fn start(url: &LinkUrl, options: &Options, settings: &Settings) -> Result<Wire, LinkError> {
    let open = slcan::open(settings).map_err(|refusal| bus::refused(url, settings, refusal))?;
    let again = settings.clone();
    let opener: Opener = Box::new(move || slcan::open(&again));
    bus::start(
        url,
        options,
        open,
        Some(opener),
        settings,
        airtime(settings),
    )
}

/// The bus or, where its baud rate is given, the serial line: 10 bit times an octet, two octets a digit pair.
fn airtime(settings: &Settings) -> Airtime {
    let on_bus = can::airtime(settings);
    let Some(baud) = settings.baud else {
        return on_bus;
    };
    // Data octets of a frame that segments carry, and octets of its line: letter, identifier 3, length 1, digits, CR.
    let (carried, line) = if settings.fd {
        (63, 6 + 2 * 64)
    } else {
        (7, 6 + 2 * 8)
    };
    let frame = Duration::from_secs(10) * line / baud;
    Arc::new(move |octets| {
        // The first frame of a packet carries one octet less.
        let frames = (octets + 1).div_ceil(carried);
        on_bus(octets).max(frame * u32::try_from(frames).unwrap_or(u32::MAX))
    })
}

/// Both ends on a pseudo-terminal.
#[cfg(unix)]
fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    use serialport::{SerialPort, TTYPort};
    use skyloop_firmware_sim::can::port::CanPort;
    let (master, slave) = TTYPort::pair().map_err(|error| {
        const REMEDY: &str = "check that /dev/ptmx and /dev/pts exist";
        url.failed("open a pseudo-terminal pair", error.into(), REMEDY)
    })?;
    let settings = bus::loopback_settings(url, &slave.name().unwrap_or_default(), KEYS)?;
    check(url, &settings)?;
    let refused = |refusal| bus::refused(url, &settings, refusal);
    let (ours, client) = (
        slcan::over(Box::new(slave), &settings).map_err(refused)?,
        slcan::over(Box::new(master), &settings).map_err(refused)?,
    );
    let wire = bus::start(url, options, ours, None, &settings, airtime(&settings))?;
    let port = CanPort::over(&settings.place, client, None, &settings);
    Ok((
        wire,
        Box::new(port.map_err(|error| bus::no_client(url, error))?),
    ))
}

#[cfg(not(unix))]
fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    const REMEDY: &str = "this system has none: use --link udp or memory";
    let error = std::io::ErrorKind::Unsupported.into();
    Err(url.failed("open a pseudo-terminal pair", error, REMEDY))
}
