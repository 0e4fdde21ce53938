//! CAN through a LAWICEL-style adapter on a serial port, for hosts without SocketCAN.

use super::bus;
use super::error::{LinkError, OpenError};
use super::kind::{BothEnds, Link, Options};
use super::wire::Wire;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::can::settings::ADAPTER_KEYS;
use skyloop_firmware_sim::can::slcan;

/// Adapters on serial ports.
pub(crate) const SLCAN: Link = Link {
    scheme: "slcan",
    example: "slcan:///dev/ttyACM0?bitrate=500000",
    is_bus: true,
    keys: ADAPTER_KEYS,
    open,
    loopback,
};

fn open(url: &Address, options: &Options) -> Result<Wire, OpenError> {
    let wire = bus::open(url, options, &slcan::settings(url)?, slcan::open)?;
    Ok(wire)
}

/// Both ends on a pseudo-terminal.
#[cfg(unix)]
fn loopback(url: &Address, options: &Options) -> Result<BothEnds, OpenError> {
    use serialport::SerialPort;
    use skyloop_firmware_sim::can::port::CanPort;
    let (master, slave) = super::serial::pseudo_terminal(url)?;
    let settings = bus::loopback_settings(url, &slave.name().unwrap_or_default())?;
    slcan::commands(&settings)?;
    let refused = |refusal| bus::refused(url, &settings, refusal);
    let (ours, client) = (
        slcan::over(Box::new(slave), &settings).map_err(refused)?,
        slcan::over(Box::new(master), &settings).map_err(refused)?,
    );
    let wire = bus::start(url, options, ours, None, &settings)?;
    let port = CanPort::over(&settings.place, client, None, &settings);
    let port = port.map_err(|error| LinkError::no_client(url, error))?;
    Ok((wire, Box::new(port)))
}

#[cfg(not(unix))]
fn loopback(url: &Address, options: &Options) -> Result<BothEnds, OpenError> {
    Err(super::serial::no_pseudo_terminal(url).into())
}
