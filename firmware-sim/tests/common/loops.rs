//! A mission, and an emulator in a thread to fly it against.

use std::sync::mpsc::{Receiver, Sender as Tx, channel};
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use hifitime::Epoch;
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::ChannelPort;
use skyloop_firmware_sim::profile::Profile;
use skyloop_orbit::StateVector;

use super::emulator::Emulator;

/// Runs an emulator in a thread until the flight computer hangs up; gives it back then.
pub fn over_memory(mut emulator: Emulator) -> (ChannelPort, JoinHandle<Emulator>) {
    let (to_emulator, inbound): (_, Receiver<Vec<u8>>) = channel();
    let (outbound, from_emulator): (Tx<Vec<u8>>, _) = channel();
    let thread = spawn(move || {
        for packet in inbound {
            for answer in emulator.answer(&packet) {
                // The flight computer may have gone.
                let _ = outbound.send(answer);
            }
        }
        emulator
    });
    (ChannelPort::new(to_emulator, from_emulator), thread)
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
