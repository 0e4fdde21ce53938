//! Missions, emulators in threads, and runs against them.

use std::net::UdpSocket;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::{FlightComputer, RunError};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::{Port, PortError};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::roles::Roles;
use skyloop_orbit::StateVector;

use super::emulator::Emulator;

/// A link through memory between two threads.
pub struct ChannelPort {
    pub to_emulator: Sender<Vec<u8>>,
    pub from_emulator: Receiver<Vec<u8>>,
}

impl ChannelPort {
    /// A port, and the emulator's ends.
    pub fn new() -> (Self, Receiver<Vec<u8>>, Sender<Vec<u8>>) {
        let (to_emulator, inbound) = channel();
        let (outbound, from_emulator) = channel();
        let port = Self {
            to_emulator,
            from_emulator,
        };
        (port, inbound, outbound)
    }
}

impl Port for ChannelPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let sent = self.to_emulator.send(packet.to_vec());
        sent.map_err(|_| PortError::Closed)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        match self.from_emulator.recv_timeout(timeout) {
            Ok(packet) => Ok(Some(packet)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(PortError::Closed),
        }
    }
}

/// Runs an emulator in a thread until the flight computer drops its port, and returns it then.
pub fn over_memory(mut emulator: Emulator) -> (ChannelPort, JoinHandle<Emulator>) {
    let (port, inbound, outbound) = ChannelPort::new();
    let thread = spawn(move || {
        for packet in inbound {
            for answer in emulator.answer(&packet) {
                // The flight computer may have ended.
                let _ = outbound.send(answer);
            }
        }
        emulator
    });
    (port, thread)
}

/// The same over UDP, by its address; it ends after a silence of `timeout`.
pub fn over_udp(
    mut emulator: Emulator,
    timeout: Duration,
) -> (std::net::SocketAddr, JoinHandle<Emulator>) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap();
    socket.set_read_timeout(Some(timeout)).unwrap();
    let thread = spawn(move || {
        let mut buffer = [0; 2048];
        while let Ok((length, client)) = socket.recv_from(&mut buffer) {
            for answer in emulator.answer(&buffer[..length]) {
                socket.send_to(&answer, client).unwrap();
            }
        }
        emulator
    });
    (address, thread)
}

pub fn start() -> Epoch {
    Epoch::from_gregorian_utc_at_midnight(2019, 6, 15)
}

pub fn mission(frames: u32) -> Mission {
    Mission {
        start: start(),
        period_s: 0.5,
        frames,
        profile: Profile::Slew {
            start: start(),
            attitude: UnitQuaternion::identity(),
            rates_rad_s: Vector3::new(0.0, 0.01, 0.0),
        },
        orbit: Some(std::sync::Arc::new(|_| {
            Ok(StateVector {
                position_m: Vector3::new(7.0e6, 0.0, 0.0),
                velocity_m_s: Vector3::new(0.0, 7.5e3, 0.0),
            })
        })),
        timeout: Duration::from_secs(10),
        pace: Pace::Stepped { most_hz: None },
        output: None,
        positions: None,
    }
}

pub fn within(timeout: Duration, frames: u32) -> Mission {
    Mission {
        timeout,
        ..mission(frames)
    }
}

pub fn by_wall(rate_hz: f64, frames: u32) -> Mission {
    Mission {
        pace: Pace::Wall { rate_hz },
        ..mission(frames)
    }
}

pub fn computer(port: impl Port + Send + 'static, mission: Mission) -> FlightComputer {
    FlightComputer::new(Box::new(port), mission)
}

pub fn on_links<P: Port + Send + 'static>(
    links: Vec<(P, Roles)>,
    mission: Mission,
) -> FlightComputer {
    let links = links.into_iter();
    let links = links.map(|(port, roles)| (Box::new(port) as Box<dyn Port + Send>, roles));
    FlightComputer::on_links(links.collect(), mission)
}

/// Runs to the end; prints lost frames, problems and the report.
pub fn run_and_print(computer: FlightComputer) -> Result<Report, RunError> {
    let report = computer.run(|event| {
        if !matches!(event, Event::Frame { .. } | Event::Tick | Event::Progress) {
            println!("{event:?}");
        }
        ControlFlow::Continue(())
    })?;
    println!("{report}");
    Ok(report)
}
