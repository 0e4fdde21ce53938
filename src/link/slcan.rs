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
    use serialport::SerialPort;
    use skyloop_firmware_sim::can::port::CanPort;
    let (master, slave) = super::serial::pseudo_terminal(url)?;
    let settings = bus::loopback_settings(url, &slave.name().unwrap_or_default(), KEYS)?;
    check(url, &settings)?;
    let refused = |refusal| bus::refused(url, &settings, refusal);
    let (ours, client) = (
        slcan::over(Box::new(slave), &settings).map_err(refused)?,
        slcan::over(Box::new(master), &settings).map_err(refused)?,
    );
    let wire = bus::start(url, options, ours, None, &settings)?;
    let port = CanPort::over(&settings.place, client, None, &settings);
    let port = port.map_err(|error| url.no_client(error))?;
    Ok((wire, Box::new(port)))
}

#[cfg(not(unix))]
fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    Err(super::serial::no_pseudo_terminal(url))
}
