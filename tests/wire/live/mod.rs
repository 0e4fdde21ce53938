//! Live runs: clocks, triggers, late and early attitudes, delays, deadlines, and faults.
//!
//! Tests check order, counts, states and flags, and that nothing is early. Lateness depends on the
//! machine.

mod busy;
mod clients;
mod deadlines;
mod delay;
mod external;
mod figures;
mod floods;
mod overlap;
mod pause;
mod staleness;
mod triggers;
mod wall_clock;

use crate::support::client::{Client, Received};
use crate::support::line::Line;
use crate::support::{
    EPOCH, EXPOSURE_S, Q, Running, TIMEOUT, attitude, await_that, later, quick, seconds,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_protocols::{Attitude, Command, Reply, WireTime};
use std::time::Duration;

/// Body rates of the tests, rad/s.
const RATES: [f64; 3] = [0.02, -0.01, 0.03];

fn unit(q: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]))
}

fn xyzw(q: UnitQuaternion<f64>) -> [f64; 4] {
    [q.i, q.j, q.k, q.w]
}

/// The attitude `s` seconds after [`EPOCH`] of a body with [`Q`] at [`EPOCH`] and [`RATES`]: dR/dt
/// = -[w x] R, so q(t) = exp(-w t / 2) q(0).
fn turned(s: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::from(RATES) * -s) * unit(Q)
}

fn label_attitude(frame: &Received) -> UnitQuaternion<f64> {
    let q = frame.label()["q_icrf_to_body"].clone();
    unit(serde_json::from_value(q).unwrap())
}

fn shows(frame: &Received, attitude: UnitQuaternion<f64>) -> bool {
    label_attitude(frame).angle_to(&attitude) < 1e-9
}

/// Middle of a frame's exposure, s after [`EPOCH`].
fn mid_s(frame: &Received) -> f64 {
    seconds(EPOCH, frame.time)
}

/// Sends a Trigger for an exposure that starts `start_s` after [`EPOCH`]. Its packet has no time.
fn trigger<L: Line>(client: &mut Client<L>, number: u32, start_s: f64) {
    let start = later(EPOCH, start_s);
    let command = Command::Trigger { number, start };
    client.send_alone(&command, WireTime::default());
}

/// Sets a very low frame rate, and returns the frames still in flight.
fn rest<L: Line>(emulator: &Running, client: &mut Client<L>) -> Vec<Received> {
    client.done(Command::FrameRate { hz: 1e-3 });
    in_flight(emulator, client)
}

/// Receives the frames that are being rendered or sent. No further exposure may end meanwhile.
fn in_flight<L: Line>(emulator: &Running, client: &mut Client<L>) -> Vec<Received> {
    let mut before = None;
    await_that("no frame is in flight", || {
        emulator.await_round();
        let is_rendering = emulator.is_rendering();
        let counters = client.counters();
        let over = counters.frames_delivered + counters.frames_abandoned;
        // A frame that was completed after the first check changes the second one.
        let is_still = over == counters.frames_rendered && before == Some(over);
        before = Some(over);
        is_still && !is_rendering
    });
    let mut frames = Vec::new();
    while !client.has_nothing_left() {
        frames.push(client.frame());
    }
    frames
}

/// Periods from `from` to the end of a frame's exposure: a whole number, at least one.
#[track_caller]
fn whole_periods(from: WireTime, frame: &Received, rate_hz: f64) -> f64 {
    let periods = (seconds(from, frame.time) + EXPOSURE_S / 2.0) * rate_hz;
    let off = (periods - periods.round()).abs();
    assert!(off < 1e-5 && periods > 0.5, "{periods}");
    periods
}

/// Attitude `q` of the body, with its [`RATES`].
fn turning(sequence: u32, q: UnitQuaternion<f64>) -> Attitude {
    Attitude {
        q_icrf_to_body: xyzw(q),
        rates_rad_s: RATES,
        ..attitude(sequence)
    }
}

/// A mission that holds [`Q`] and sends it 20 times a second.
fn mission(start: hifitime::Epoch, frames: u32, timeout: Duration) -> Mission {
    Mission {
        start,
        period_s: 1.0,
        frames,
        profile: Profile::Hold(unit(Q)),
        orbit: None,
        timeout,
        pace: Pace::Wall { rate_hz: 20.0 },
        output: None,
        positions: None,
    }
}

fn frame_of<L: Line>(client: &mut Client<L>, sequence: u32) -> Received {
    let mut frame = client.frame();
    await_that("a frame of the attitude", || {
        let is_it = frame.header.attitude_sequence == sequence;
        if !is_it {
            frame = client.frame();
        }
        is_it
    });
    frame
}

/// Number of the next complete frame; parts of others are ignored.
fn whole_frame<L: Line>(client: &mut Client<L>) -> u32 {
    let mut in_flight = None;
    loop {
        let packet = client.next(true);
        match Reply::decode(&packet).unwrap().1 {
            Reply::FrameHeader(header) => {
                let due = header.blocks_due().unwrap_or(header.blocks);
                in_flight = Some((header.frame, due + u32::from(header.label_parts)));
            }
            Reply::FrameEnd(end) => {
                if in_flight == Some((end.frame, 0)) {
                    return end.frame;
                }
                in_flight = None;
            }
            _ => {
                in_flight = in_flight.and_then(|(frame, left)| Some((frame, left.checked_sub(1)?)))
            }
        }
    }
}
