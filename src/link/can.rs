//! CAN through the kernel's SocketCAN, classic or FD.

use super::{BothEnds, Link, LinkError, LinkUrl, Options, Wire, bus};
use skyloop_firmware_sim::can::port::CanPort;
use skyloop_firmware_sim::can::socket;

/// CAN interfaces.
pub const CAN: Link = Link {
    scheme: "can",
    example: "can://vcan0?bitrate=500000&fd=8000000",
    is_bus: true,
    keys: KEYS,
    open,
    loopback,
};

const KEYS: &[&str] = &["bitrate", "fd", "load"];
/// The interface of a loopback.
const VIRTUAL: &str = "vcan0";

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    let settings = bus::settings(url, &url.target, KEYS)?;
    bus::open(url, options, &settings, socket::open)
}

/// Both ends on the virtual interface that the user has set up.
fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    let settings = bus::loopback_settings(url, VIRTUAL, KEYS)?;
    let wire = bus::open(url, options, &settings, socket::open)?;
    let bus = socket::open(&settings).map_err(|refusal| bus::refused(url, &settings, refusal))?;
    let port = CanPort::over(VIRTUAL, bus, None, &settings);
    let port = port.map_err(|error| url.no_client(error))?;
    Ok((wire, Box::new(port)))
}
