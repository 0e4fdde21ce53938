//! ISO-TP with errors: unexpected frames, too long messages, slow and silent ends.

use super::bus::bytes;
use super::isotp::{counted, play};
use crate::common::hex;
use skyloop_protocols::can::form::{FROM_EMULATOR, TO_EMULATOR};
use skyloop_protocols::can::{CanFrame, Node, Side};

/// A client has received the first of three frames and sent flow control.
const RECEIVING: &str = "<1014030a11181f26 >300000";
const SECOND: &str = "212d343b42495057";
const THIRD: &str = "225e656c737a8188";
const MESSAGE: &str = "030a11181f262d343b424950575e656c737a8188";

/// ISO 15765-2, table of unexpected PDUs, at a receiver.
#[test]
fn unexpected_frames_at_a_receiver() {
    for (what, script, counts) in [
        (
            "a single frame replaces the message",
            format!("{RECEIVING} @1 <03aabbcc =aabbcc"),
            "incomplete: 1",
        ),
        (
            "a first frame replaces the message",
            format!("{RECEIVING} @1 <1008aabbccddeeff >300000 <210102 =aabbccddeeff0102"),
            "incomplete: 1",
        ),
        (
            "unexpected flow control, an unknown type, a frame too short",
            format!("{RECEIVING} @1 <300000 <50 <212d343b <{SECOND} <{THIRD} ={MESSAGE}"),
            "malformed: 1, ignored: 2",
        ),
        (
            "a wrong number, then the right one",
            format!("{RECEIVING} @1 <222d343b42495057 <{SECOND}"),
            "sequence_errors: 1, incomplete: 1, ignored: 1",
        ),
        (
            "longer than the first frame",
            format!("{RECEIVING} @1 <{SECOND} <{THIRD}ffffffff <{THIRD} ={MESSAGE}"),
            "ignored: 1",
        ),
        (
            "a repeated frame",
            format!("{RECEIVING} @1 <{SECOND} <{SECOND}"),
            "sequence_errors: 1, incomplete: 1",
        ),
        (
            "no flow control for a dropped message",
            "<1014030a11181f26 <03aabbcc =aabbcc >".to_owned(),
            "incomplete: 1",
        ),
        ("no message", format!("<{SECOND}"), "ignored: 1"),
    ] {
        assert_eq!(play(Side::Client, &script), counts, "{what}");
    }
    let mut idle = Node::new(Side::Client, false);
    for (id, extended) in [(TO_EMULATOR, false), (FROM_EMULATOR, true)] {
        let frame = CanFrame::new(id, false, &hex("03aabbcc")).expect("valid");
        let foreign = CanFrame { extended, ..frame };
        assert!(idle.receive(&foreign, 0).is_none());
    }
    assert_eq!(counted(idle.counts()), "ignored: 2");
}

/// X-Val: Linux `isotp_rcv_ff`: the answer to a too long message is overflow.
#[test]
fn a_message_longer_than_a_packet_is_refused() {
    for head in ["1579112233445566", "1fff112233445566", "1000ffffffff1122"] {
        let counts = play(Side::Client, &format!("<{head} >320000 ~"));
        assert_eq!(counts, "oversize: 1", "{head}");
    }
    // 1400 bytes are accepted.
    assert_eq!(play(Side::Client, "<1578112233445566 >300000"), "");
}

/// An emulator has sent the first of three frames and awaits flow control.
const SENDING: &str = "+20 >1014030a11181f26 >";

#[test]
fn a_sender_follows_flow_control() {
    let waits = "<310000 ".repeat(10);
    let mut max_waits = SENDING.to_owned();
    for wait in 1..=10 {
        max_waits += &format!(
            " @{} <310000 ~{}",
            wait * 900_000,
            wait * 900_000 + 1_000_000
        );
    }
    for (what, script, counts) in [
        (
            "block size 1, 5 ms apart",
            format!("{SENDING} @100 <300105 >{SECOND} @1000099 > <300000 >{THIRD} ~"),
            "",
        ),
        (
            "900 us apart",
            format!("{SENDING} @100 <3000f9 >{SECOND} @999 > ~1000 @1000 >{THIRD} ~"),
            "",
        ),
        (
            "overflow",
            format!("{SENDING} @100 <320000 > ~"),
            "unsent: 1",
        ),
        (
            "an invalid status",
            format!("{SENDING} @100 <330000 > ~"),
            "unsent: 1",
        ),
        (
            "too many waits, then unexpected flow control",
            format!("{max_waits} @9900000 <310000 ~ <300000"),
            "unsent: 1, ignored: 1",
        ),
        (
            "the full number of waits in each block",
            format!("{SENDING} {waits} <300100 >{SECOND} {waits} <300000 >{THIRD} ~"),
            "",
        ),
    ] {
        assert_eq!(play(Side::Emulator, &script), counts, "{what}");
    }
}

#[test]
fn silence_times_out() {
    let sender = format!("{SENDING} ~1000000 @999999 ?30 @1000000 > +30");
    assert_eq!(
        play(Side::Emulator, &sender),
        "timeouts: 1, unsent: 1",
        "N_Bs"
    );
    let receiver = format!("{RECEIVING} ~1000000 @999999 <{SECOND} ~1999999 @1999999 <{THIRD}");
    let counts = "timeouts: 1, incomplete: 1, ignored: 1";
    assert_eq!(
        play(Side::Client, &receiver),
        counts,
        "N_Cr: exactly at the deadline"
    );
}

#[test]
fn empty_and_too_long_messages_are_not_sent() {
    let mut node = Node::new(Side::Client, false);
    assert_eq!(
        [node.send(&[], 0), node.send(&bytes(1401, 1), 0)],
        [Ok(()), Ok(())]
    );
    assert_eq!((node.next_frame(0), node.counts().unsent), (None, 2));
}
