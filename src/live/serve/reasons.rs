//! Why clients do not get frames: the causes in the table of a run, and the remedies in the log.

use skyloop_link::{FaultEffect, Unsent};
use skyloop_protocols::Withheld;

// Causes in the table of a run that `Withheld` has no code for.

/// The client sent Reset.
pub(super) const RESET: &str = "client sent Reset";
/// The client has gone, or another followed.
pub(super) const CLIENT_GONE: &str = "client gone";
/// The run ended.
pub(super) const RUN_ENDED: &str = "run ended";
/// A fault held packets of the frame back until the end of the run.
pub(super) const HELD_BACK: &str = "held back by a fault";
/// No attitude has come for the exposure.
pub(super) const NO_ATTITUDE: &str = "no attitude for the exposure";
/// `run.on_overrun = "drop"` drops it.
pub(super) const WOULD_BE_LATE: &str = "would have been late";
/// Its Trigger was dropped because the client's clock was stepped.
pub(super) const CLOCK_SET: &str = "client's clock was set";
/// The exposure ended while the one before was rendered or waited, or was dropped before its end.
pub(super) const PASSED_OVER: &str = "exposure passed over";
/// Placeholder until the cause is determined; never in the table.
pub(super) const UNDETERMINED: &str = "not known yet";

/// Detail of [`Withheld::NoProof`] when packets of a frame were removed from the queue of a link.
pub(super) const LAPSED: &str =
    "packets of it are removed from the queue: the proof of the client's address has lapsed";

/// A short reason for the table of the run.
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

/// Why a frame with unsent packets is withheld, for Status and for the table of the run.
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

/// The log message about frames that do not reach the client.
pub(super) fn not_reached(why: Withheld, detail: &str) -> String {
    format!("frames do not reach the client ({}): {detail}", name(why))
}

/// The remedy on a link with this address, whose injected faults affect packets in and out.
pub(super) fn remedy(why: Withheld, address: &str, effects: [Option<FaultEffect>; 2]) -> String {
    let [inbound, outbound] = effects;
    let [inbound, outbound] = [inbound.zip(Some("in")), outbound.zip(Some("out"))];
    let fault = match why {
        Withheld::NotRead => outbound.filter(|(effect, _)| *effect == FaultEffect::Delays),
        // Frame packets go out, and Credit comes in.
        Withheld::NoCredit | Withheld::Lost => outbound.or(inbound),
        Withheld::NoClient => inbound,
        _ => None,
    };
    let without = remedy_without_faults(why, address);
    match fault {
        Some((FaultEffect::Delays, direction)) => {
            format!("a fault (--faults, Fault) delays packets on the way {direction}: end it first")
        }
        // The fault may have ended, or not be the cause.
        Some((FaultEffect::Loses, direction)) => format!(
            "a fault (--faults, Fault) has lost or damaged packets on the way {direction}: end it, if it lasts; else {without}"
        ),
        None => without.to_string(),
    }
}

/// The remedy if faults are not the cause.
fn remedy_without_faults(why: Withheld, address: &str) -> &'static str {
    match why {
        Withheld::Lost if !address.starts_with("udp:") => {
            "read the link as fast as it brings packets, or pace by Credit with a smaller window"
        }
        Withheld::NoCredit => "grant `received + window` (Credit) after every few frame packets",
        Withheld::NotRead => "read the link, or send Reset when the client ends",
        Withheld::SlowLink => "reduce the output (Output) or the rate, or use a faster link",
        Withheld::NoProof => {
            "let the client send each Challenge (APID 0x20B) back as it came, and Ping where none comes, or add proof=off to the link where addresses cannot be forged"
        }
        Withheld::Lost => {
            "enlarge the client's receive buffer (SO_RCVBUF), pace by Credit with a smaller window, or limit the link (rate_mbit)"
        }
        Withheld::TooLong => "select other labels (Output)",
        Withheld::Refused => "see the Nack's detail",
        Withheld::NoClient => "let the client send Ping or Credit first",
        Withheld::NoTrigger => {
            "run.trigger is \"packet\": let the client send Triggers, or set run.trigger to \"own\""
        }
        Withheld::None => "see the counters",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use FaultEffect::{Delays, Loses};

    /// Late or lost Credit stops frames like late or lost frame packets. Only packets delayed on
    /// the path out can fill a link.
    #[test]
    fn remedy_names_a_fault_that_can_be_the_cause() {
        use Withheld::{
            Lost, NoClient, NoCredit, NoProof, NoTrigger, NotRead, Refused, SlowLink, TooLong,
        };
        const LATE_OUT: Option<&str> = Some("delays packets on the way out");
        const LATE_IN: Option<&str> = Some("delays packets on the way in");
        const LOST_OUT: Option<&str> = Some("lost or damaged packets on the way out");
        const LOST_IN: Option<&str> = Some("lost or damaged packets on the way in");
        for (why, inbound, outbound, expected) in [
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
            let found = remedy(why, udp, [inbound, outbound]);
            let case = format!("{why:?} {inbound:?} {outbound:?}: {found}");
            match expected {
                Some(part) => assert!(found.contains(part), "{case}"),
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
