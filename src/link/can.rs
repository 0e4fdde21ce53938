//! CAN through the kernel's SocketCAN, classic or FD.

use super::{Airtime, BothEnds, Link, LinkError, LinkUrl, Options, Wire, bus};
use skyloop_firmware_sim::can::port::CanPort;
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::{Opener, socket};
use std::sync::Arc;

/// CAN interfaces.
pub const CAN: Link = Link {
    scheme: "can",
    example: "can://vcan0?bitrate=500000&fd=8000000",
    open,
    loopback,
};

const KEYS: &[&str] = &["bitrate", "fd", "load"];
/// The interface of a loopback.
const VIRTUAL: &str = "vcan0";

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    start(url, options, &bus::settings(url, &url.target, KEYS)?)
}

fn start(url: &LinkUrl, options: &Options, settings: &Settings) -> Result<Wire, LinkError> {
    let open = socket::open(settings).map_err(|refusal| bus::refused(url, settings, refusal))?;
    let again = settings.clone();
    let opener: Opener = Box::new(move || socket::open(&again));
    bus::start(
        url,
        options,
        open,
        Some(opener),
        settings,
        airtime(settings),
    )
}

/// Time of a packet in segments.
pub(super) fn airtime(settings: &Settings) -> Airtime {
    let settings = settings.clone();
    Arc::new(move |octets| settings.packet_duration(octets))
}

/// Both ends on the virtual interface that the user has set up.
fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    let settings = bus::loopback_settings(url, VIRTUAL, KEYS)?;
    let wire = start(url, options, &settings)?;
    let bus = socket::open(&settings).map_err(|refusal| bus::refused(url, &settings, refusal))?;
    let port = CanPort::over(VIRTUAL, bus, None, &settings);
    Ok((
        wire,
        Box::new(port.map_err(|error| bus::no_client(url, error))?),
    ))
}
