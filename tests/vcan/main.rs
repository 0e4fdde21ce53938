//! The CAN links on a real SocketCAN, against the kernel's own tools. They need CAN interfaces: `tests/vcan/run` boots
//! a kernel that has them, and runs these tests there, one after the other.
#![cfg(target_os = "linux")]

mod attitude;
#[path = "../support/flight.rs"]
mod flight;
mod levels;
mod loopback;
mod minute;
mod pacing;
#[path = "../support/mod.rs"]
mod support;
mod tools;
mod transport;
mod trouble;

use skyloop::config::Clock;
use skyloop::link;
use support::client::Client;
use support::line::MemoryLine;
use support::{Running, options, scene};

/// Carries FD frames too.
const VCAN0: &str = "vcan0";
/// Carries classic frames only.
const VCAN1: &str = "vcan1";
/// The highest rates.
const FD: &str = "bitrate=1000000&fd=8000000&load=1";
const CLASSIC: &str = "bitrate=1000000&load=1";

/// An emulator on an interface.
fn emulator(interface: &str, rates: &str) -> Running {
    let wire = link::open(&format!("can://{interface}?{rates}"), &options(5.0)).unwrap();
    Running::start(scene(), Clock::Stepped, wire)
}

/// A client on an interface, as `skyloop-fc` opens it.
fn client(interface: &str, rates: &str) -> Client<MemoryLine> {
    let port = skyloop_firmware_sim::link::open(&format!("can://{interface}?{rates}"));
    Client::new(MemoryLine(port.unwrap().0))
}
