//! CAN through the kernel's SocketCAN, classic or FD.

use super::bus;
use super::error::{LinkError, OpenError};
use super::kind::{BothEnds, Link, Options};
use super::wire::Wire;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::can::port::CanPort;
use skyloop_firmware_sim::can::settings::{KEYS, Settings};
use skyloop_firmware_sim::can::socket;

/// CAN interfaces.
pub(crate) const CAN: Link = Link {
    scheme: "can",
    example: "can://vcan0?bitrate=500000&fd=8000000",
    is_bus: true,
    keys: KEYS,
    open,
    loopback,
};

const VIRTUAL: &str = "vcan0";

fn open(url: &Address, options: &Options) -> Result<Wire, OpenError> {
    let wire = bus::open(url, options, &Settings::of(url)?, socket::open)?;
    Ok(wire)
}

/// Both ends on the virtual interface, which the user must have set up.
fn loopback(url: &Address, options: &Options) -> Result<BothEnds, OpenError> {
    let settings = bus::loopback_settings(url, VIRTUAL)?;
    let wire = bus::open(url, options, &settings, socket::open)?;
    let bus = socket::open(&settings).map_err(|refusal| bus::refused(url, &settings, refusal))?;
    let port = CanPort::over(VIRTUAL, bus, None, &settings);
    let port = port.map_err(|error| LinkError::no_client(url, error))?;
    Ok((wire, Box::new(port)))
}
