//! Why the client of a link does not get its frames, and the reports about it.

use super::channel::Channel;
use super::delivery::Delivery;
use super::exchange::Exchange;
use super::frame_packets::FramePackets;
use super::reasons::{CLIENT_GONE, RUN_ENDED, UNDETERMINED, name, not_reached};
use crate::stats::Pending;
use skyloop_link::SOON;
use skyloop_protocols::{MAX_PACKET, Withheld};
use std::mem::replace;
use std::time::{Duration, Instant};

/// A client that sends attitudes for this long without a required Trigger is reported.
const UNTRIGGERED: Duration = Duration::from_secs(2);
/// A frame that takes longer on its link is reported: a client may not wait for it.
const SLOW: Duration = Duration::from_secs(5);
/// If no byte leaves a link for this long, its client does not read.
const UNREAD: Duration = Duration::from_millis(100);

/// Why a client with room on its link and without credit blocks a frame.
fn without_credit(channel: &Channel) -> (Withheld, String) {
    let credit = &channel.exchange.credit;
    let (granted, sent) = (credit.granted(), credit.sent());
    match channel.exchange.window {
        // The client grants received packets plus a window, so lost packets reduce its grants.
        Some(window) if window != granted && granted.wrapping_sub(window) != sent => (
            Withheld::Lost,
            format!(
                "{sent} packets are sent, and the client's Credit counts {} of them as received",
                granted.wrapping_sub(window)
            ),
        ),
        _ => (
            Withheld::NoCredit,
            format!("{sent} packets are sent, and Credit grants {granted}"),
        ),
    }
}

/// Why a frame is blocked on a link; `has_room`: the link's queue has room for it.
pub(super) fn standstill(channel: &Channel, has_room: bool) -> (Withheld, String) {
    if channel.wire.tally.awaits_proof() {
        return (Withheld::NoProof, "its address is not proved".to_string());
    }
    if has_room {
        return without_credit(channel);
    }
    (Withheld::NotRead, "the link has no room".to_string())
}

/// The cause of an unsent frame. At the end of the run, a reported standstill that still lasts
/// takes precedence.
fn unless_blocked(channel: &Channel, cause: &'static str) -> &'static str {
    if cause != RUN_ENDED {
        return cause;
    }
    let lasts = |why: &Withheld| match why {
        Withheld::NoProof => channel.wire.tally.awaits_proof(),
        Withheld::NotRead => channel.stands_still(SOON),
        _ => !channel.exchange.credit.may_send(),
    };
    let blocking = [
        Withheld::NoProof,
        Withheld::NotRead,
        without_credit(channel).0,
    ];
    let mut reported = blocking
        .into_iter()
        .filter(|why| channel.report_log.has(*why));
    reported.find(lasts).map_or(cause, name)
}

/// Counts a withheld frame.
pub(super) fn count_withheld(channel: &mut Channel, entry: Pending, cause: &'static str) {
    let cause = unless_blocked(channel, cause);
    channel.frames.withhold(entry, cause);
}

/// Counts a withheld frame, now or once the cause is known.
pub(super) fn withhold(channel: &mut Channel, frame: u32, entry: Pending, cause: &'static str) {
    if cause == UNDETERMINED {
        channel.supersede(frame, entry);
    } else {
        count_withheld(channel, entry, cause);
    }
}

/// Why a frame is superseded on this link; none: not known yet.
fn of_superseded(channel: &Channel) -> Option<(Withheld, String)> {
    let found = standstill(channel, !channel.exchange.credit.may_send());
    let is_open = found.0 == Withheld::NotRead
        && !channel.wire.tally.is_held_back()
        && !channel.stands_still(UNREAD);
    (!is_open).then_some(found)
}

fn superseded(frame: u32, detail: &str) -> String {
    format!("frame {frame} is replaced by a newer one: {detail}")
}

/// Reports a frame that is superseded by a newer one, and returns the cause.
pub(super) fn report_superseded(channel: &mut Channel, frame: u32) -> &'static str {
    let Some((why, detail)) = of_superseded(channel) else {
        return UNDETERMINED;
    };
    channel.report(why, &superseded(frame, &detail));
    name(why)
}

/// Counts and reports superseded frames once their cause is known.
fn settle_superseded(channel: &mut Channel) {
    if !channel.has_superseded() {
        return;
    }
    if channel.has_gone(channel.exchange.number) {
        channel.settle_superseded(CLIENT_GONE);
        return;
    }
    // A frame that is no longer in the queue has left, or was dropped there.
    let has_moved =
        channel.wire.tally.bytes() != channel.superseded.bytes || !channel.carries_frames();
    let found = if has_moved {
        let detail = "the previous one is still being sent".to_string();
        Some((Withheld::SlowLink, detail))
    } else {
        of_superseded(channel)
    };
    let Some((why, detail)) = found else { return };
    let frame = channel.superseded.frame;
    channel.settle_superseded(name(why));
    channel.report(why, &superseded(frame, &detail));
}

/// Number of sent packets that the client's grants do not show as received, once per loss. It must
/// exceed the largest single grant, some time after all packets have left.
fn lost_packets(channel: &mut Channel, now: Instant) -> Option<u32> {
    let Exchange {
        credit,
        window: Some(window),
        step,
        ..
    } = &channel.exchange
    else {
        return None;
    };
    let state = [credit.granted(), credit.sent()];
    // Answers in the queue do not count: a client that polls always has some.
    let waits = channel.carries_frames();
    let is_sending = !channel.deliveries.is_empty();
    let silent = &mut channel.report_log.silent;
    let Some((_, since, reported)) = silent
        .as_mut()
        .filter(|(of, ..)| *of == state && !is_sending)
    else {
        *silent = Some((state, now, false));
        return None;
    };
    // The client has received the packets in its grants.
    let received = credit.granted().wrapping_sub(*window);
    let lost = credit.sent().wrapping_sub(received);
    // A client that grants far ahead does not show what it has received.
    let is_lost = *step > 0 && lost > *step && lost <= *window;
    if !is_lost || waits || *reported {
        return None;
    }
    // A slow line may still carry them.
    let timeout = SOON + channel.wire.packet_airtime().saturating_mul(lost);
    *reported = now.saturating_duration_since(*since) >= timeout;
    reported.then_some(lost)
}

/// Reports a standstill of the link, and a client that does not grant credit for sent packets or
/// sends no Trigger. `needs_trigger`: frames wait for Triggers, and attitudes have come.
pub(super) fn report_silence(channel: &mut Channel, needs_trigger: bool, now: Instant) {
    settle_superseded(channel);
    report_stalled(channel, now);
    report_untriggered(channel, needs_trigger, now);
    // Packets in a blocked queue are not lost.
    if let Some(lost) = lost_packets(channel, now)
        && !channel.flow.in_status
    {
        let detail = format!("the client's Credit does not count {lost} of the packets sent");
        channel.report(Withheld::Lost, &detail);
    }
}

/// Reports once that frame packets wait in the link's queue and no byte leaves.
fn report_stalled(channel: &mut Channel, now: Instant) {
    channel.watch(now);
    if !channel.stands_still(SOON) || replace(&mut channel.flow.reported, true) {
        return;
    }
    let packets = channel.wire.tally.waiting();
    let (why, _) = standstill(channel, false);
    let detail = format!("{packets} packets wait in the link's queue, and none leaves");
    channel.report(why, &detail);
    channel.flow.in_status = true;
}

/// Reports a client that sends attitudes for a while without a required Trigger.
fn report_untriggered(channel: &mut Channel, needs_trigger: bool, now: Instant) {
    let waits = needs_trigger && channel.roles.truth && !channel.exchange.triggered;
    let untriggered = &mut channel.report_log.untriggered;
    *untriggered = waits.then(|| untriggered.unwrap_or((now, false)));
    let Some((since, is_logged)) = untriggered else {
        return;
    };
    if now.saturating_duration_since(*since) < UNTRIGGERED {
        return;
    }
    let is_first = !replace(is_logged, true);
    let exchange = &mut channel.exchange;
    // Status reports each refusal at least once.
    if exchange.withheld != Withheld::Refused || exchange.is_in_status {
        exchange.withheld = Withheld::NoTrigger;
    }
    if is_first {
        let message = not_reached(Withheld::NoTrigger, "attitudes come and no Trigger");
        channel.log(Withheld::NoTrigger, &message);
    }
}

/// Reports a frame that takes long on its link.
pub(super) fn report_slow(channel: &mut Channel, frame: u32, packets: &FramePackets) {
    let Some(airtime) = &channel.wire.airtime else {
        return;
    };
    let count = packets.count();
    if airtime(MAX_PACKET).saturating_mul(count) < SLOW {
        return;
    }
    let sizes = packets.sizes().into_iter();
    let takes: Duration = sizes
        .map(|one| airtime(one.length) * one.count as u32)
        .sum();
    if takes >= SLOW {
        let s = takes.as_secs_f64();
        let message =
            format!("frame {frame} has {count} packets and takes some {s:.0} s on this link");
        channel.warn(Withheld::SlowLink, &message);
    }
}

/// Reports once that a frame is blocked.
pub(super) fn report_standstill(channel: &mut Channel, delivery: &mut Delivery, has_room: bool) {
    if !replace(&mut delivery.reported, true) {
        let (why, detail) = standstill(channel, has_room);
        channel.report(why, &format!("frame {} waits: {detail}", delivery.frame));
    }
}
