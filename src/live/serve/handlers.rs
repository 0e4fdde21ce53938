//! The handlers of commands. Each changes settings or the exchange, or refuses.

use super::budget;
use super::clock::CONFIRM_S;
use super::clock::due::{TimeCheck, TriggerRequest};
use super::reasons::CLOCK_SET;
use super::refusal::Refusal;
use super::state::State;
use super::telemetry::add;
use hifitime::Epoch;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_link::{FAULT_REFUSED, Inbound};
use skyloop_protocols::{Attitude, Fault, Header, Output, Positions, WireTime, Withheld};
use skyloop_render::camera::{EXPOSURE_S, GAIN_E_PER_DN, RATE_HZ};
use skyloop_render::scene::turn_at;
use std::ops::RangeInclusive;
use std::time::Instant;

/// A received command.
pub(super) struct Call<'a> {
    /// Index of its link.
    pub link: usize,
    pub header: Header,
    pub inbound: &'a Inbound,
}

impl Call<'_> {
    fn arrived(&self) -> Instant {
        self.inbound.arrived
    }
}

type Done = Result<(), Refusal>;

/// The state in which a command is possible.
#[derive(Clone, Copy)]
pub(super) enum Condition {
    /// Frames come at the camera's cadence.
    Cadence,
    /// An attitude has been accepted.
    HasAttitude,
    /// Exposures are not paused.
    NotPaused,
    /// No single shot is being exposed.
    NoSingleShot,
    /// The client's address is proved.
    AddressProved,
}

impl Condition {
    /// Refuses `command` if the condition is not met.
    pub fn check(self, state: &mut State, link: usize, command: &str) -> Done {
        let client = &mut state.client;
        let tally = &state.session.channels[link].wire.tally;
        let why = match self {
            Condition::Cadence if client.cadence_hz().is_none() => {
                return Err(Refusal::not_supported(format!(
                    "{command} has no effect where each {} requests a frame: send one when a frame is needed",
                    client.clock.requested_by()
                )));
            }
            Condition::HasAttitude if !client.has_attitude() => "no attitude yet; send one first",
            Condition::NotPaused if client.clock.is_paused() => {
                "exposures are paused; send Resume first"
            }
            Condition::NoSingleShot if client.is_exposing_single_shot() => {
                "a single shot is being exposed; wait for its frame"
            }
            Condition::AddressProved if tally.awaits_proof() => {
                "this address is not proved; return the Challenge first"
            }
            _ => return Ok(()),
        };
        Err(Refusal::busy(format!("{command}: {why}")))
    }
}

pub(super) fn attitude(state: &mut State, call: &Call<'_>, attitude: &Attitude) -> Done {
    let vehicle = state.client.vehicle(&call.header, attitude)?;
    if state.client.clock.awaits_time() {
        // After a pause the client may continue at an earlier time: later attitudes are dropped.
        state.client.history.drop_after(vehicle.epoch);
    }
    if let TimeCheck::Doubtful(ahead_s) = observe_time(state, vehicle.epoch, call.arrived())
        && ahead_s > 0.0
    {
        return Err(Refusal::value(format!(
            "time of attitude {} lies {ahead_s:.3} s ahead of the client's clock; it is followed if this lasts {CONFIRM_S} s",
            attitude.sequence
        )));
    }
    let is_out_of_order = state
        .client
        .accept_attitude(vehicle, call.header, call.arrived())?;
    let counter = &mut state.telemetry.counters.time_backwards;
    add(counter, u32::from(is_out_of_order));
    Ok(())
}

/// Evaluates a time stamp of the client, and counts the Triggers that a clock step drops.
fn observe_time(state: &mut State, time: Epoch, arrived: Instant) -> TimeCheck {
    let (check, dropped) = state.client.observe_time(time, arrived);
    state.telemetry.miss_dropped_triggers(dropped);
    state.session.fail_all(dropped, CLOCK_SET);
    check
}

pub(super) fn trigger(state: &mut State, call: &Call<'_>, number: u32, start: WireTime) -> Done {
    if call.header.time != WireTime::default() {
        observe_time(state, to_epoch(call.header.time), call.arrived());
    }
    let camera = state.client.camera().clone();
    state.client.clock.triggered(TriggerRequest {
        number,
        start: to_epoch(start),
        camera,
        arrived: call.arrived(),
    })?;
    add(&mut state.telemetry.counters.triggers, 1);
    state.session.channels[call.link].exchange.triggered = true;
    Ok(())
}

pub(super) fn pause(state: &mut State, call: &Call<'_>) -> Done {
    // The client of the first camera does not know a further camera's single shot: it is dropped.
    if !state.followers.is_follower {
        Condition::NoSingleShot.check(state, call.link, "Pause")?;
    }
    let clock = &mut state.client.clock;
    if !clock.is_paused() {
        clock.pause(call.arrived());
    }
    Ok(())
}

pub(super) fn resume(state: &mut State, call: &Call<'_>) -> Done {
    let clock = &mut state.client.clock;
    if clock.is_paused() {
        clock.resume(call.arrived());
    }
    Ok(())
}

pub(super) fn exposure(state: &mut State, call: &Call<'_>, seconds: f64) -> Done {
    within("Exposure.seconds", seconds, EXPOSURE_S)?;
    let camera = state.client.camera().clone();
    // The readout takes a part of the period.
    let max = 1.0 / camera.rate_hz - (camera.period_s(seconds) - seconds);
    check_overlap(state, "Exposure.seconds", seconds, max, "lower FrameRate")?;
    Condition::NoSingleShot.check(state, call.link, "Exposure")?;
    if let Some(latest) = state.client.history.latest()
        && !state.client.is_stepped()
    {
        let open_s = seconds + camera.readout_s();
        turn_at(latest.vehicle.rates, open_s)
            .map_err(|error| Refusal::value(format!("Exposure.seconds = {seconds}: {error}")))?;
    }
    state.client.camera_mut().exposure_s = seconds;
    Ok(())
}

pub(super) fn gain(state: &mut State, e_per_dn: f64) -> Done {
    within("Gain.e_per_dn", e_per_dn, GAIN_E_PER_DN)?;
    state.client.camera_mut().detector.gain_e_per_dn = e_per_dn;
    Ok(())
}

pub(super) fn frame_rate(state: &mut State, call: &Call<'_>, hz: f64) -> Done {
    within("FrameRate.hz", hz, RATE_HZ)?;
    let camera = state.client.camera().clone();
    let max = 1.0 / camera.period_s(camera.exposure_s);
    check_overlap(state, "FrameRate.hz", hz, max, "shorten Exposure")?;
    state
        .late
        .check_held(hz)
        .map_err(|why| Refusal::value(format!("FrameRate: {why}, or lower the rate")))?;
    for link in 0..state.session.channels.len() {
        let output = state.session.channels[link].exchange.output;
        check_fits(state, link, &output, hz, "FrameRate")?;
    }
    check_in_time(state, hz)?;
    state.client.camera_mut().rate_hz = hz;
    if let Some(cadence) = state.client.clock.cadence() {
        cadence.set_rate(hz, call.arrived());
    }
    Ok(())
}

pub(super) fn single_shot(state: &mut State, call: &Call<'_>) -> Done {
    let exposure_s = state.client.camera().exposure_s;
    if let Some(cadence) = state.client.clock.cadence() {
        cadence.single_shot(exposure_s, call.arrived());
    }
    Ok(())
}

pub(super) fn reset(state: &mut State, call: &Call<'_>) -> Done {
    if state.session.channels[call.link].roles.truth {
        state.restart_client(true, call.arrived());
    }
    let output = state.session.default_output;
    let channel = &mut state.session.channels[call.link];
    channel.reset(output, call.arrived());
    let (apid, count) = (call.header.apid, call.header.sequence_count);
    channel.exchange.gaps.missing(apid, count);
    state.frames.cancel_unwanted(&state.session);
    Ok(())
}

pub(super) fn credit(state: &mut State, call: &Call<'_>, packets: u32) -> Done {
    let exchange = &mut state.session.channels[call.link].exchange;
    let (sent, before) = (exchange.credit.sent(), exchange.credit.granted());
    if !exchange.credit.grant(packets) {
        return Err(Refusal::value(format!(
            "Credit.packets = {packets}: it is below the {sent} packets sent, or 2^31 or more ahead; grant `received + window`"
        )));
    }
    let step = exchange.credit.granted().wrapping_sub(before);
    if exchange.window.is_some() {
        exchange.step = exchange.step.max(step);
    } else {
        exchange.window = Some(packets.wrapping_sub(sent));
    }
    Ok(())
}

pub(super) fn output(state: &mut State, call: &Call<'_>, output: Output) -> Done {
    let camera = state.client.camera();
    let max = camera.detector.width.min(camera.detector.height);
    if usize::from(output.window_size) > max {
        return Err(Refusal::value(format!(
            "Output.window_size = {}: the frame has {max} pixels across; send at most that",
            output.window_size
        )));
    }
    check_fits(state, call.link, &output, camera.rate_hz, "Output")?;
    state.session.channels[call.link].exchange.output = output;
    Ok(())
}

pub(super) fn positions(state: &mut State, call: &Call<'_>, positions: Positions) -> Done {
    let camera = state.client.camera();
    let (detector, rate_hz) = (&camera.detector, camera.rate_hz);
    let outside = positions.centres().iter().find(|[column, row]| {
        usize::from(*column) >= detector.width || usize::from(*row) >= detector.height
    });
    if let Some([column, row]) = outside {
        return Err(Refusal::value(format!(
            "Positions: ({column}, {row}) is outside the frame of {} x {} pixels; give centres inside it",
            detector.width, detector.height
        )));
    }
    let listed = (!positions.centres().is_empty()).then_some(positions);
    let exchange = &mut state.session.channels[call.link].exchange;
    let before = std::mem::replace(&mut exchange.positions, listed);
    let output = exchange.output;
    check_fits(state, call.link, &output, rate_hz, "Positions").inspect_err(|_| {
        state.session.channels[call.link].exchange.positions = before;
    })
}

pub(super) fn resend(
    state: &mut State,
    call: &Call<'_>,
    frame: u32,
    first: u32,
    count: u32,
) -> Done {
    let channel = &mut state.session.channels[call.link];
    let max = (count as usize).min(channel.room());
    let Some(packets) = channel.exchange.packets_of(frame) else {
        return Err(Refusal::value(format!(
            "Resend.frame = {frame}: only the packets of the last two frames are stored"
        )));
    };
    let packets = packets.iter().skip(first as usize).take(max);
    let packets: Vec<_> = packets.cloned().collect();
    let sent = packets.len();
    for packet in packets {
        add(&mut state.telemetry.counters.resent_blocks, 1);
        // The next packet detects a closed link.
        if channel.answer(packet).is_err() {
            return Ok(());
        }
    }
    // A client that sends Credit shows by it what it has received.
    if sent > 0 && channel.exchange.window.is_none() {
        let detail = format!(
            "{sent} packets of frame {frame} are requested again, and the client sends no Credit"
        );
        channel.report(Withheld::Lost, &detail);
    }
    Ok(())
}

/// The link has injected the fault as the packet passed. This handler refuses unsupported kinds.
pub(super) fn fault(state: &mut State, call: &Call<'_>, fault: &Fault) -> Done {
    let outbox = &state.session.channels[call.link].wire.outbox;
    let injects = outbox.injects(fault.kind);
    injects.map_err(|why| Refusal::not_supported(format!("{FAULT_REFUSED}{why}")))
}

fn within(field: &str, value: f64, range: RangeInclusive<f64>) -> Done {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Refusal::value(format!(
        "{field} = {value}: must be {} to {}",
        range.start(),
        range.end()
    )))
}

/// At a cadence, one exposure must end before the next begins.
fn check_overlap(state: &mut State, field: &str, value: f64, max: f64, remedy: &str) -> Done {
    if state.client.clock.cadence().is_none() || value <= max {
        return Ok(());
    }
    Err(Refusal::value(format!(
        "{field} = {value}: exposures would overlap; at most {max}, or {remedy} first"
    )))
}

/// In real time a frame must leave before the next comes: refuses what a link cannot carry.
fn check_fits(state: &State, link: usize, output: &Output, rate_hz: f64, command: &str) -> Done {
    if state.client.is_stepped() {
        return Ok(());
    }
    let channel = &state.session.channels[link];
    let positions = channel.exchange.positions.as_ref();
    let output = &Output {
        windows: positions.map_or(output.windows, |some| some.centres().len() as u8),
        ..*output
    };
    let camera = state.client.camera();
    budget::fits(&channel.wire, channel.roles, camera, output, rate_hz)
        .map_err(|why| Refusal::value(format!("{command}: {why}")))
}

/// If late frames are dropped, refuses a rate at which the device's delay makes all frames late.
fn check_in_time(state: &mut State, hz: f64) -> Done {
    let cadence = state.client.clock.cadence();
    let latency = cadence.map(|cadence| cadence.latency_at(hz));
    let why = latency.and_then(|latency| state.late.never_in_time(latency.as_secs_f64()));
    match why.filter(|_| state.late.drops()) {
        None => Ok(()),
        Some(why) => Err(Refusal::value(format!(
            "FrameRate.hz = {hz}: {why}; set run.latency_s, or lower the rate"
        ))),
    }
}
