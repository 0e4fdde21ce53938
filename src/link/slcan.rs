//! CAN through a LAWICEL-style adapter on a serial port or a pseudo-terminal: for hosts without CAN in their kernel.

use super::{BothEnds, Link, LinkError, LinkUrl, Options, Wire, bus};
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::slcan;

/// Adapters.
pub const SLCAN: Link = Link {
    scheme: "slcan",
    example: "slcan:///dev/ttyACM0?bitrate=500000",
    is_bus: true,
    keys: KEYS,
    open,
    loopback,
};

const KEYS: &[&str] = &["bitrate", "fd", "load", "baud"];

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    let mut settings = bus::settings(url, &url.target, KEYS)?;
    settings.baud.get_or_insert(slcan::BAUD);
    check(url, &settings)?;
    bus::open(url, options, &settings, slcan::open)
}

/// Refuses bit rates that adapters do not have.
fn check(url: &LinkUrl, settings: &Settings) -> Result<(), LinkError> {
    let commands = slcan::commands(settings);
    commands.map(drop).map_err(|reason| url.refuse(reason))
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
    let wire = bus::start(url, options, ours, None, &settings)?;
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
