//! Packets from the links: decoded, executed by the table of commands, answered.

use super::commands::{Answer, row_of};
use super::frame_queue::RECEIVE_TIME;
use super::handlers::Call;
use super::reasons::name;
use super::refusal::Refusal;
use super::state::State;
use super::status::status;
use super::telemetry::add;
use crate::stats::Request;
use skyloop_link::{Inbound, LinkError, QUEUE};
use skyloop_protocols::apid::{ATTITUDE, CHALLENGE, COMMAND};
use skyloop_protocols::{Command, DecodeError, Header, Reason, Reply, Withheld, packet};
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

/// Detail of the refusal of a wrong Challenge.
const WRONG_CHALLENGE: &str = "this Challenge is not of this address or time";

/// Waits up to `timeout` for a packet or an event of the renderer; handles the waiting packets.
/// False if a link has ended.
pub(super) fn receive(state: &mut State, timeout: Duration) -> Result<bool, LinkError> {
    let timeout = if state.session.flush()? {
        timeout
    } else {
        timeout.min(RECEIVE_TIME)
    };
    let received = take_one_each(state)?;
    if received == Some(false) {
        // Each link's queue and the renderer unpark this thread.
        std::thread::park_timeout(timeout);
    }
    Ok(received.is_some())
}

/// Handles at most a full queue of received packets, so that a flood does not stop the frames.
/// False if a link has ended.
pub(super) fn receive_waiting(state: &mut State) -> Result<bool, LinkError> {
    state.session.flush()?;
    for _ in 0..QUEUE {
        match take_one_each(state)? {
            Some(true) => {}
            Some(false) => break,
            None => return Ok(false),
        }
    }
    Ok(true)
}

/// Handles the next packet of each link; returns whether there was one, or none if a link has
/// ended.
fn take_one_each(state: &mut State) -> Result<Option<bool>, LinkError> {
    let mut received = false;
    for link in 0..state.session.channels.len() {
        let channel = &mut state.session.channels[link];
        match channel.wire.inbox.try_recv() {
            Ok(inbound) => {
                handle(state, link, &inbound)?;
                received = true;
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => {
                channel.gone = true;
                return Ok(None);
            }
        }
    }
    Ok(Some(received))
}

fn handle(state: &mut State, link: usize, inbound: &Inbound) -> Result<(), LinkError> {
    if !enter_exchange(state, link, inbound.exchange) {
        return Ok(());
    }
    match (state.session.personality.decode_command)(&inbound.packet) {
        Ok((header, command)) => {
            let call = Call {
                link,
                header,
                inbound,
            };
            execute(state, &call, command)
        }
        Err(error) => refuse_undecodable(state, link, &inbound.packet, &error),
    }
}

/// Opens the exchange of a packet, if it is new. False if the packet is late: another client
/// followed.
fn enter_exchange(state: &mut State, link: usize, exchange: u32) -> bool {
    let channel = &mut state.session.channels[link];
    let newer = exchange.wrapping_sub(channel.exchange.number);
    if newer > u32::MAX / 2 {
        add(&mut state.telemetry.counters.foreign_packets, 1);
        return false;
    }
    if newer != 0 {
        channel.open_exchange(exchange, state.session.default_output);
        if channel.roles.truth {
            state.restart_client(false, Instant::now());
        }
        state.frames.cancel_unwanted(&state.session);
    }
    if let Some(mute) = &mut state.session.channels[link].exchange.muted {
        mute.has_sent = true;
    }
    true
}

fn execute(state: &mut State, call: &Call<'_>, command: Command) -> Result<(), LinkError> {
    count_gaps(state, call, &command);
    let row = row_of(command);
    let (name, answer, is_relayed) = (row.name, row.answer, row.is_relayed);
    if let Err(refusal) = row.run(state, call) {
        return refuse(state, call, name, &refusal);
    }
    if is_relayed && state.session.channels[call.link].roles.truth {
        state.followers.relay(call.inbound);
    }
    let counters = &mut state.telemetry.counters;
    add(
        match command {
            Command::Attitude(_) => &mut counters.attitudes,
            _ => &mut counters.commands,
        },
        1,
    );
    if answer != Answer::Silent {
        state.session.ack(call.link, &call.header)?;
    }
    if answer == Answer::AckAndStatus {
        send_status(state, call.link)?;
    }
    Ok(())
}

/// Counts missing packets. Reset restarts the counts. A further camera gets only some of the
/// packets of the first camera's client.
fn count_gaps(state: &mut State, call: &Call<'_>, command: &Command) {
    let channel = &mut state.session.channels[call.link];
    channel.exchange.has_client = true;
    let is_relay = state.followers.is_follower && channel.roles.truth;
    if is_relay || matches!(command, Command::Reset) {
        return;
    }
    let Header {
        apid,
        sequence_count,
        ..
    } = call.header;
    let missing = channel.exchange.gaps.missing(apid, sequence_count);
    let counter = &mut state.telemetry.counters.sequence_gaps;
    add(counter, u32::from(missing));
}

fn send_status(state: &mut State, link: usize) -> Result<(), LinkError> {
    if let Some(cadence) = state.client.clock.cadence() {
        cadence.advance(Instant::now());
    }
    state.session.channels[link].exchange.is_in_status = true;
    let status = Reply::Status(status(state, link));
    state.session.send(link, &status, state.client.now())
}

/// Refuses a command, with the frame that it requests.
fn refuse(
    state: &mut State,
    call: &Call<'_>,
    packet: &str,
    refusal: &Refusal,
) -> Result<(), LinkError> {
    let Refusal { reason, detail } = refusal;
    state.telemetry.counters.refuse(*reason);
    let is_requested = fail_refused(state, packet);
    // At a cadence frames continue with the previous attitude.
    let is_first = packet == "Attitude" && !state.client.has_attitude();
    let channel = &mut state.session.channels[call.link];
    if packet == "Trigger" {
        // The refusal is the reason, not a missing Trigger.
        channel.report_log.untriggered = None;
    }
    if is_first || is_requested {
        channel.report(Withheld::Refused, detail);
    }
    let id = (call.header.apid, call.header.sequence_count);
    let now = state.client.now();
    state.session.nack(call.link, id, *reason, detail, now)
}

/// Counts the frame that a refused packet requests; returns whether it requests one.
fn fail_refused(state: &mut State, packet: &str) -> bool {
    let is_requested = state.client.is_requested_by(packet);
    if is_requested {
        let cause = name(Withheld::Refused);
        state.session.fail(Request::default(), cause);
    }
    is_requested
}

/// Refuses a packet that cannot be decoded.
fn refuse_undecodable(
    state: &mut State,
    link: usize,
    packet: &[u8],
    error: &DecodeError,
) -> Result<(), LinkError> {
    let id @ (apid, _) = packet::identify(packet).unwrap_or((0, 0));
    count_refused(state, link, id);
    let now = state.client.now();
    let counters = &mut state.telemetry.counters;
    // The link removes valid Challenges.
    let reply = (state.session.personality.decode_reply)(packet);
    if matches!(reply, Ok((_, Reply::Challenge(_)))) {
        let reason = Reason::ValueOutOfRange;
        counters.refuse(reason);
        let channel = &mut state.session.channels[link];
        if channel.wire.tally.awaits_proof() {
            channel.report(Withheld::NoProof, WRONG_CHALLENGE);
        }
        return state.session.nack(link, id, reason, WRONG_CHALLENGE, now);
    }
    counters.refuse_undecodable(error);
    let detail = error.to_string();
    let is_attitude = apid == ATTITUDE;
    // A damaged packet requests nothing: its kind is unknown.
    let is_value = matches!(
        error.reason(),
        Reason::QuaternionNotUnit | Reason::NotFinite | Reason::ValueOutOfRange
    );
    if is_value && is_attitude {
        fail_refused(state, "Attitude");
    }
    // All packets of another version are refused: no frame will come.
    let is_foreign = apid != CHALLENGE && error.reason() == Reason::BadVersion;
    // An unknown packet may be the first attitude.
    let may_be_first = ![COMMAND, CHALLENGE].contains(&apid) && !state.client.has_attitude();
    let is_needed = is_attitude && state.client.is_requested_by("Attitude");
    if is_foreign || may_be_first || is_needed {
        state.session.channels[link].report(Withheld::Refused, &detail);
    }
    state.session.nack(link, id, error.reason(), &detail, now)
}

/// Counts a refused packet as received if its sequence count is the expected one. Other counts of a
/// damaged header are not used.
fn count_refused(state: &mut State, link: usize, (apid, count): (u16, u16)) {
    let known = &mut state.session.channels[link].exchange.gaps;
    let mut gaps = known.clone();
    if gaps.missing(apid, count) == 0 {
        *known = gaps;
    }
}
