//! CAN links on a real SocketCAN, with the kernel's tools. `tests/vcan/run` boots a kernel with CAN
//! interfaces, and runs these tests one after the other.
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

/// Carries FD and classic frames.
const VCAN0: &str = "vcan0";
/// Carries classic frames only.
const VCAN1: &str = "vcan1";
/// The highest rates.
const FD: &str = "bitrate=1000000&fd=8000000&load=1";
const CLASSIC: &str = "bitrate=1000000&load=1";

fn emulator(interface: &str, rates: &str) -> Running {
    let wire = link::open(&format!("can://{interface}?{rates}"), &options(5.0)).unwrap();
    Running::start(scene(), Clock::Stepped, wire)
}

fn client(interface: &str, rates: &str) -> Client<MemoryLine> {
    let port = skyloop_firmware_sim::link::open(&format!("can://{interface}?{rates}"));
    Client::new(MemoryLine(port.unwrap().0))
}
