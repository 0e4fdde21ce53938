//! Frames that a client does not get, and why: logged with the remedy, reported in Status, counted in the run's table.

use super::Server;
use super::channel::{Channel, Exchange};
use super::cut::Cut;
use super::deliver::Delivery;
use crate::stats::{FrameAccount, Request};
use skyloop_link::{Every, Harm, SOON, Unsent};
use skyloop_protocols::{MAX_PACKET, Withheld};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A client that sends attitudes for so long and no Trigger, where frames need one, is reported.
const UNTRIGGERED: Duration = Duration::from_secs(2);
/// A frame that takes longer on its link is reported: a client may not wait for it.
const SLOW: Duration = Duration::from_secs(5);

/// The messages of one link, and since when its client is silent about what it got.
#[derive(Debug, Default)]
pub(super) struct Messages {
    every: BTreeMap<u8, Every>,
    /// Since when attitudes come and no Trigger, where frames need one, and whether that is in the log.
    untriggered: Option<(Instant, bool)>,
    /// Packets granted and sent, since when, and whether it is reported.
    silent: Option<([u32; 2], Instant, bool)>,
}

impl Messages {
    /// A Trigger has come that was refused: its refusal is the reason, and not that there was none.
    pub fn note_trigger(&mut self) {
        self.untriggered = None;
    }
}

/// In the run's table: a frame that ended with a Reset of its client.
pub(super) const RESET: &str = "client sent Reset";
/// Likewise with its client, which has gone or was followed by another.
pub(super) const CLIENT_GONE: &str = "client gone";
/// Likewise with the run.
pub(super) const RUN_ENDED: &str = "run ended";
/// In the log: packets of a frame were removed from the queue of a link.
pub(super) const LAPSED: &str =
    "packets of it are removed from the queue: the proof of the client's address has lapsed";
/// In the run's table: a fault held its packets back until the run had ended.
pub(super) const HELD_BACK: &str = "held back by a fault";
/// Likewise: no attitude has come that its exposure could show.
pub(super) const NO_ATTITUDE: &str = "no attitude for the exposure";
/// Likewise: `run.on_overrun = "drop"` leaves it out.
pub(super) const LEFT_OUT: &str = "would have been late";
/// Likewise: its Trigger was forgotten, since the client's clock has jumped.
pub(super) const CLOCK_SET: &str = "client's clock was set";
/// Likewise: its exposure ended while the one before was still rendered or waited, or was given up before its end.
const PASSED_OVER: &str = "exposure passed over";

/// A reason in a few words, for the run's table.
pub(super) fn name(why: Withheld) -> &'static str {
    match why {
        Withheld::None => "other",
        Withheld::NoCredit => "no credit",
        Withheld::NotRead => "client does not read",
        Withheld::SlowLink => "link too slow",
        Withheld::NoProof => "address not proved",
        Withheld::Lost => "packets lost on the way",
        Withheld::TooLong => "cannot be encoded",
        Withheld::Refused => "refused",
        Withheld::NoClient => "no client",
        Withheld::NoTrigger => "no Trigger",
    }
}

/// Why a frame is withheld of which packets were not sent, in Status and in the run's table.
pub(super) fn of_unsent(lost: Unsent) -> (Withheld, &'static str) {
    let why = match lost {
        Unsent::ClientGone => return (Withheld::NoClient, CLIENT_GONE),
        Unsent::HeldBack => return (Withheld::NotRead, HELD_BACK),
        Unsent::RunEnded => return (Withheld::SlowLink, RUN_ENDED),
        Unsent::NotProved => Withheld::NoProof,
        Unsent::NotRead => Withheld::NotRead,
        Unsent::Failed => Withheld::Lost,
    };
    (why, name(why))
}

/// The cause of a frame that is not sent on a link: at the end of the run what has held up the frames before it, where that was reported and
/// still holds.
pub(super) fn unless_blocked(channel: &Channel, cause: &'static str) -> &'static str {
    let (tally, credit) = (&channel.wire.tally, &channel.exchange.credit);
    let holds = |why: &Withheld| match why {
        Withheld::NoProof => tally.awaits_proof(),
        Withheld::NotRead => channel.stands_still(SOON),
        _ => !credit.may_send(),
    };
    let blocking = [Withheld::NoProof, Withheld::NotRead, of_credit(channel).0];
    let is_reported = |why: &Withheld| channel.messages.every.contains_key(&why.code());
    let mut blocking = blocking.into_iter().filter(is_reported);
    match blocking.find(holds) {
        Some(why) if cause == RUN_ENDED => name(why),
        _ => cause,
    }
}

fn not_reached(why: Withheld, detail: &str) -> String {
    format!("frames do not reach the client ({}): {detail}", name(why))
}

/// What to do about it, on a link of that address whose faults do this to packets in and out.
fn remedy(why: Withheld, address: &str, harm: [Option<Harm>; 2]) -> String {
    let [way_in, way_out] = harm;
    let [way_in, way_out] = [way_in.zip(Some("in")), way_out.zip(Some("out"))];
    let fault = match why {
        Withheld::NotRead => way_out.filter(|(harm, _)| *harm == Harm::Delays),
        // Frame packets go out, and Credit comes in.
        Withheld::NoCredit | Withheld::Lost => way_out.or(way_in),
        Withheld::NoClient => way_in,
        _ => None,
    };
    let without = remedy_without_faults(why, address);
    match fault {
        Some((Harm::Delays, way)) => {
            format!("a fault (--faults, Fault) delays packets on the way {way}: end it first")
        }
        // It may be over, and not the cause.
        Some((Harm::Loses, way)) => {
            format!(
                "a fault (--faults, Fault) has lost or damaged packets on the way {way}: end it, if it lasts; else {without}"
            )
        }
        None => without.to_string(),
    }
}

/// What to do about it on a link where faults are not the cause.
fn remedy_without_faults(why: Withheld, address: &str) -> &'static str {
    match why {
        Withheld::Lost if !address.starts_with("udp:") => {
            "read the link as fast as it brings packets, or pace by Credit with a smaller window"
        }
        Withheld::NoCredit => "grant `received + window` (Credit) after every few frame packets",
        Withheld::NotRead => "read the link, or send Reset when the client ends",
        Withheld::SlowLink => "ask for less (Output), a lower rate or a faster link",
        Withheld::NoProof => {
            "let the client send each Challenge (APID 0x20B) back as it came, and Ping where none comes, or add proof=off to the link where addresses cannot be forged"
        }
        Withheld::Lost => {
            "enlarge the client's receive buffer (SO_RCVBUF), pace by Credit with a smaller window, or limit the link (rate_mbit)"
        }
        Withheld::TooLong => "ask for other labels (Output)",
        Withheld::Refused => "see the Nack's detail",
        Withheld::NoClient => "let the client send Ping or Credit first",
        Withheld::NoTrigger => {
            "run.trigger is \"packet\": let the client send Triggers, or set run.trigger to \"own\""
        }
        Withheld::None => "see the counters",
    }
}

/// Why a client that has room on its link and no credit holds a frame up.
fn of_credit(channel: &Channel) -> (Withheld, String) {
    let credit = &channel.exchange.credit;
    let (granted, sent) = (credit.granted(), credit.sent());
    match channel.exchange.window {
        // It grants what it has received and a window: the window is missing in what has not come.
        Some(window) if window != granted && granted.wrapping_sub(window) != sent => (
            Withheld::Lost,
            format!(
                "{sent} packets are sent, and the client grants as if {} of them had come",
                granted.wrapping_sub(window)
            ),
        ),
        _ => (
            Withheld::NoCredit,
            format!("{sent} packets are sent, and Credit grants {granted}"),
        ),
    }
}

/// Why a frame does not move on a link, which `has_room` for it.
pub(super) fn standstill(channel: &Channel, has_room: bool) -> (Withheld, String) {
    if channel.wire.tally.awaits_proof() {
        return (Withheld::NoProof, "its address is not proved".to_string());
    }
    if has_room {
        return of_credit(channel);
    }
    (Withheld::NotRead, "the link has no room".to_string())
}

impl Channel {
    /// Packets that its client has not granted for, when all has left for a while: more than it grants at once. Each loss is reported once.
    fn is_silent_about(&mut self, now: Instant) -> Option<u32> {
        let Exchange {
            credit,
            window: Some(window),
            step,
            ..
        } = &self.exchange
        else {
            return None;
        };
        let state = [credit.granted(), credit.sent()];
        // Answers that wait behind them are none of the packets that may be lost: a client that polls always has some.
        let waits = self.carries_frames();
        let is_sending = !self.deliveries.is_empty();
        let silent = &mut self.messages.silent;
        match silent {
            Some((of, since, reported)) if *of == state && !is_sending => {
                // Of packets sent the client knows all but those that it does not grant for.
                let known = credit.granted().wrapping_sub(*window);
                let lost = credit.sent().wrapping_sub(known);
                // A grant far ahead says nothing.
                let is_lost = *step > 0 && lost > *step && lost <= *window;
                if !is_lost || waits || *reported {
                    return None;
                }
                // A slow line may carry them still.
                let takes = self.wire.packet_airtime().saturating_mul(lost);
                let patience = SOON + takes;
                *reported = now.saturating_duration_since(*since) >= patience;
                reported.then_some(lost)
            }
            _ => {
                *silent = Some((state, now, false));
                None
            }
        }
    }
}

impl Server {
    /// Reports that the client of a link does not get a frame, or will not: in the log, not too often, and in Status.
    pub(super) fn report(&mut self, at: usize, why: Withheld, detail: &str) {
        self.warn(at, why, &not_reached(why, detail));
    }

    /// Notes why frames do not come, or come late, in Status, and logs it with the remedy, not too often.
    fn warn(&mut self, at: usize, why: Withheld, message: &str) {
        let channel = &mut self.channels[at];
        channel.exchange.withheld = why;
        channel.exchange.is_in_status = false;
        channel.flow.in_status = false;
        self.log(at, why, message);
    }

    /// Logs why frames do not come, with the remedy, not too often.
    fn log(&mut self, at: usize, why: Withheld, message: &str) {
        let channel = &mut self.channels[at];
        let every = channel.messages.every.entry(why.code()).or_default();
        let Some(times) = every.count(Instant::now()) else {
            return;
        };
        let before = match times {
            1 => String::new(),
            more => format!(" ({more} times since the last message)"),
        };
        let address = &channel.wire.address;
        let remedy = remedy(why, address, channel.harm());
        tracing::warn!("{address}: {message}; {remedy}{before}");
    }

    /// Counts a request that gives no frame, on all links.
    pub(super) fn fail(&mut self, request: Request, cause: &'static str) {
        let bring = |channel: &&mut Channel| channel.roles.bring_frames();
        for channel in self.channels.iter_mut().filter(bring) {
            let entry = channel.frames.open(&request);
            channel
                .frames
                .withhold(entry, unless_blocked(channel, cause));
        }
    }

    /// Counts an Attitude or a Trigger (`what`) that was refused, where it requests a frame.
    pub(super) fn fail_refused(&mut self, what: &str) {
        if self.is_requested_by(what) {
            self.fail(Request::default(), name(Withheld::Refused));
        }
    }

    /// Whether each Attitude or each Trigger (`what`) requests a frame: by a cadence frames come of themselves.
    pub(super) fn is_requested_by(&mut self, what: &str) -> bool {
        self.clock.cadence().is_none() && self.clock.asks() == what
    }

    /// The account of a link, with the exposures that the clock has passed over.
    pub(super) fn account(&self, channel: &Channel) -> FrameAccount {
        let passed_over = self.clock.missed() as usize;
        channel.frames.clone().with(passed_over, PASSED_OVER)
    }

    /// Reports a frame that its link takes long for.
    pub(super) fn report_slow(&mut self, at: usize, frame: u32, cut: &Cut) {
        let Some(airtime) = &self.channels[at].wire.airtime else {
            return;
        };
        let packets = cut.packets();
        if airtime(MAX_PACKET).saturating_mul(packets) < SLOW {
            return;
        }
        let takes: Duration = cut.lengths().map(|bytes| airtime(bytes)).sum();
        if takes >= SLOW {
            let s = takes.as_secs_f64();
            let message =
                format!("frame {frame} has {packets} packets and takes some {s:.0} s on this link");
            self.warn(at, Withheld::SlowLink, &message);
        }
    }

    /// Reports a client that for a while sends attitudes and no Trigger, where frames need one.
    fn report_untriggered(&mut self, at: usize, now: Instant) {
        let by_trigger = self.is_requested_by("Trigger");
        let has_attitude = self.truth.history.latest().is_some();
        let Channel {
            roles,
            exchange,
            messages,
            ..
        } = &mut self.channels[at];
        let waits = by_trigger && has_attitude && roles.truth && !exchange.triggered;
        let untriggered = &mut messages.untriggered;
        *untriggered = waits.then(|| untriggered.unwrap_or((now, false)));
        let Some((since, is_logged)) = untriggered else {
            return;
        };
        if now.saturating_duration_since(*since) < UNTRIGGERED {
            return;
        }
        // Status brings each refusal once at least.
        if exchange.withheld != Withheld::Refused || exchange.is_in_status {
            exchange.withheld = Withheld::NoTrigger;
        }
        if !std::mem::replace(is_logged, true) {
            let detail = "attitudes come and no Trigger";
            self.log(
                at,
                Withheld::NoTrigger,
                &not_reached(Withheld::NoTrigger, detail),
            );
        }
    }

    /// Reports once packets of frames that wait in a link's queue of which for a while no byte leaves.
    fn report_stalled(&mut self, at: usize, now: Instant) {
        let channel = &mut self.channels[at];
        channel.watch(now);
        if !channel.stands_still(SOON) || std::mem::replace(&mut channel.flow.reported, true) {
            return;
        }
        let packets = channel.wire.tally.waiting();
        let (why, _) = standstill(channel, false);
        let detail = format!("{packets} packets wait in the link's queue, and none leaves");
        self.report(at, why, &detail);
        self.channels[at].flow.in_status = true;
    }

    /// Reports links that stand still, and clients that for a while have not granted for what was sent, or send no Trigger.
    pub(super) fn report_silence(&mut self, now: Instant) {
        for at in 0..self.channels.len() {
            self.count_passed(at);
            self.report_stalled(at, now);
            self.report_untriggered(at, now);
            // What still waits in a queue that stands still is not lost.
            if let Some(lost) = self.channels[at].is_silent_about(now)
                && !self.channels[at].flow.in_status
            {
                let detail =
                    format!("{lost} packets sent, and the client grants as if they had not come");
                self.report(at, Withheld::Lost, &detail);
            }
        }
    }

    /// Reports once a frame that has stood still for a while.
    pub(super) fn report_standstill(&mut self, at: usize, delivery: &mut Delivery, has_room: bool) {
        if !std::mem::replace(&mut delivery.reported, true) {
            let (why, detail) = standstill(&self.channels[at], has_room);
            let detail = format!("frame {} waits: {detail}", delivery.frame);
            self.report(at, why, &detail);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Harm::{Delays, Loses};

    /// Credit that is late or lost stops frames as frame packets do. A full link can only come of packets that are late
    /// on the way out.
    #[test]
    fn a_fault_is_the_remedy_where_it_can_be_the_cause() {
        use Withheld::{
            Lost, NoClient, NoCredit, NoProof, NoTrigger, NotRead, Refused, SlowLink, TooLong,
        };
        const LATE_OUT: Option<&str> = Some("delays packets on the way out");
        const LATE_IN: Option<&str> = Some("delays packets on the way in");
        const LOST_OUT: Option<&str> = Some("lost or damaged packets on the way out");
        const LOST_IN: Option<&str> = Some("lost or damaged packets on the way in");
        for (why, way_in, way_out, says) in [
            (NoCredit, None, Some(Delays), LATE_OUT),
            (NoCredit, Some(Delays), None, LATE_IN),
            (NoCredit, Some(Loses), None, LOST_IN),
            (NoCredit, None, None, None),
            (Lost, None, Some(Delays), LATE_OUT),
            (Lost, None, Some(Loses), LOST_OUT),
            (Lost, Some(Delays), None, LATE_IN),
            (Lost, Some(Loses), None, LOST_IN),
            (Lost, Some(Delays), Some(Loses), Some("on the way out")),
            (Lost, None, None, None),
            (NotRead, None, Some(Delays), LATE_OUT),
            (NotRead, Some(Delays), Some(Loses), None),
            (NoClient, Some(Loses), None, LOST_IN),
            (NoClient, None, Some(Loses), None),
            (SlowLink, Some(Delays), Some(Delays), None),
            (NoProof, Some(Delays), Some(Delays), None),
            (TooLong, Some(Delays), Some(Delays), None),
            (Refused, Some(Delays), Some(Delays), None),
            (NoTrigger, Some(Delays), Some(Delays), None),
        ] {
            let udp = "udp://127.0.0.1:1";
            let found = remedy(why, udp, [way_in, way_out]);
            let case = format!("{why:?} {way_in:?} {way_out:?}: {found}");
            match says {
                Some(says) => assert!(found.contains(says), "{case}"),
                None => assert_eq!(found, remedy_without_faults(why, udp), "{case}"),
            }
        }
        for (address, has_socket) in [("udp://[::1]:1", true), ("pty:///a", false)] {
            let found = remedy(Lost, address, [None; 2]);
            assert_eq!(
                found.contains("SO_RCVBUF"),
                has_socket,
                "{address}: {found}"
            );
        }
    }
}
