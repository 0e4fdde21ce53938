//! ISO-TP where it does not go well: frames out of place, too long messages, slow and silent ends.

use crate::bus::octets;
use crate::isotp::{from_emulator, hex, message, to_emulator};
use skyloop_protocols::can::{Busy, CanFrame, Counts, Lane, Node, Side};

/// A client that has the first frame of 20 octets and has asked for the rest.
fn receiving() -> Node {
    let mut client = Node::new(Side::Client, false);
    assert!(
        client
            .receive(&from_emulator(&hex("1014030a11181f26")), 0)
            .is_none()
    );
    let flow = client.next_frame(0).expect("flow control");
    assert_eq!(flow.payload(), hex("300000"));
    client
}

/// ISO 15765-2, table of unexpected PDUs, at a receiver.
#[test]
fn unexpected_frames_at_a_receiver() {
    let incomplete = Counts {
        incomplete: 1,
        ..Counts::default()
    };
    let ignored = Counts {
        ignored: 1,
        ..Counts::default()
    };

    let mut client = receiving();
    assert_eq!(
        client.receive(&from_emulator(&hex("03aabbcc")), 1),
        Some(&hex("aabbcc")[..]),
        "a single frame begins anew"
    );
    assert_eq!(client.counts(), incomplete);

    let mut client = receiving();
    assert!(
        client
            .receive(&from_emulator(&hex("1008aabbccddeeff")), 1)
            .is_none(),
        "so does a first frame"
    );
    assert_eq!(client.counts(), incomplete);
    assert_eq!(
        client.next_frame(1).expect("asks again").payload(),
        hex("300000")
    );
    assert_eq!(
        client.receive(&from_emulator(&hex("210102")), 1),
        Some(&hex("aabbccddeeff0102")[..])
    );

    let mut client = receiving();
    assert!(
        client.receive(&from_emulator(&hex("300000")), 1).is_none(),
        "flow control for nothing"
    );
    assert_eq!(client.counts(), ignored);
    assert!(
        client.receive(&from_emulator(&hex("50")), 1).is_none(),
        "unknown type"
    );
    assert!(
        client
            .receive(&from_emulator(&hex("212d343b")), 1)
            .is_none(),
        "too short for one that is not the last"
    );
    assert_eq!(
        client.counts(),
        Counts {
            ignored: 2,
            malformed: 1,
            ..ignored
        }
    );
    assert!(
        client
            .receive(&from_emulator(&hex("212d343b42495057")), 1)
            .is_none()
    );
    assert_eq!(
        client.receive(&from_emulator(&hex("225e656c737a8188")), 1),
        Some(&message(20)[..]),
        "none of it harmed"
    );

    let mut client = receiving();
    assert!(
        client
            .receive(&from_emulator(&hex("222d343b42495057")), 1)
            .is_none(),
        "wrong number"
    );
    assert_eq!(
        client.counts(),
        Counts {
            sequence_errors: 1,
            ..incomplete
        }
    );
    assert!(
        client
            .receive(&from_emulator(&hex("212d343b42495057")), 1)
            .is_none(),
        "too late"
    );
    assert_eq!(
        client.counts(),
        Counts {
            sequence_errors: 1,
            ignored: 1,
            ..incomplete
        }
    );

    let mut client = receiving();
    let (second, longer) = (hex("212d343b42495057"), hex("225e656c737a8188ffffffff"));
    assert!(client.receive(&from_emulator(&second), 1).is_none());
    assert!(
        client.receive(&from_emulator(&longer), 1).is_none(),
        "longer than the first frame"
    );
    assert_eq!(client.counts(), ignored);
    assert!(
        client.receive(&from_emulator(&second), 1).is_none(),
        "a repeated one"
    );
    assert_eq!(client.counts().sequence_errors, 1);

    let mut client = Node::new(Side::Client, false);
    assert!(
        client
            .receive(&from_emulator(&hex("1014030a11181f26")), 0)
            .is_none()
    );
    assert!(
        client
            .receive(&from_emulator(&hex("03aabbcc")), 0)
            .is_some()
    );
    assert_eq!(
        client.next_frame(0),
        None,
        "asks for nothing more of a message that is given up"
    );

    let mut idle = Node::new(Side::Client, false);
    assert!(
        idle.receive(&from_emulator(&hex("212d343b42495057")), 0)
            .is_none(),
        "nothing begun"
    );
    assert_eq!(idle.counts(), ignored);
    assert!(
        idle.receive(&to_emulator(&hex("03aabbcc")), 0).is_none(),
        "its own direction"
    );
    let foreign = CanFrame {
        extended: true,
        ..from_emulator(&hex("03aabbcc"))
    };
    assert!(idle.receive(&foreign, 0).is_none());
    assert_eq!(idle.counts().ignored, 3);
}

/// X-Val: Linux `isotp_rcv_ff`: a message that is too long is answered with overflow.
#[test]
fn a_message_longer_than_a_packet_is_refused() {
    for head in ["1579112233445566", "1fff112233445566", "1000ffffffff1122"] {
        let mut client = Node::new(Side::Client, false);
        assert!(client.receive(&from_emulator(&hex(head)), 0).is_none());
        assert_eq!(
            client.next_frame(0).expect("an answer").payload(),
            hex("320000")
        );
        assert_eq!(client.wake_at(), None, "waits for nothing");
        assert_eq!(
            client.counts(),
            Counts {
                oversize: 1,
                ..Counts::default()
            }
        );
    }
    let mut client = Node::new(Side::Client, false);
    client.receive(&from_emulator(&hex("1578112233445566")), 0);
    assert_eq!(
        client.next_frame(0).expect("an answer").payload(),
        hex("300000"),
        "1400 are not too many"
    );
}

/// An emulator that has sent the first frame of 20 octets.
fn sending() -> Node {
    let mut emulator = Node::new(Side::Emulator, false);
    emulator.send(&message(20), 0).expect("idle");
    assert_eq!(
        emulator.next_frame(0).expect("first frame").payload(),
        hex("1014030a11181f26")
    );
    assert_eq!(emulator.next_frame(0), None, "waits for flow control");
    emulator
}

#[test]
fn a_sender_does_as_it_is_told() {
    // Block size 1, 5 ms apart.
    let mut emulator = sending();
    emulator.receive(&to_emulator(&hex("300105")), 100);
    assert_eq!(
        emulator.next_frame(100).expect("at once").payload(),
        hex("212d343b42495057")
    );
    assert_eq!(emulator.next_frame(1_000_099), None, "waits again");
    emulator.receive(&to_emulator(&hex("300000")), 1_000_099);
    assert_eq!(
        emulator.next_frame(1_000_099).expect("the last").payload(),
        hex("225e656c737a8188")
    );
    assert!(emulator.is_idle(Lane::Long));

    // 900 us apart.
    let mut emulator = sending();
    emulator.receive(&to_emulator(&hex("3000f9")), 100);
    assert!(emulator.next_frame(100).is_some());
    assert_eq!(
        (emulator.next_frame(999), emulator.wake_at()),
        (None, Some(1000))
    );
    assert!(emulator.next_frame(1000).is_some());

    // Overflow, an invalid status: given up.
    for flow in ["320000", "330000"] {
        let mut emulator = sending();
        emulator.receive(&to_emulator(&hex(flow)), 100);
        assert_eq!((emulator.next_frame(100), emulator.wake_at()), (None, None));
        assert_eq!(
            emulator.counts(),
            Counts {
                unsent: 1,
                ..Counts::default()
            }
        );
    }

    // Wait: so often and no more.
    let mut emulator = sending();
    for wait in 1..=10 {
        emulator.receive(&to_emulator(&hex("310000")), wait * 900_000);
        assert_eq!(emulator.wake_at(), Some(wait * 900_000 + 1_000_000));
    }
    emulator.receive(&to_emulator(&hex("310000")), 9_900_000);
    assert_eq!((emulator.wake_at(), emulator.counts().unsent), (None, 1));

    // As often again after the next block.
    let mut patient = sending();
    for flow in ["310000"; 10].iter().chain(&["300100"]) {
        patient.receive(&to_emulator(&hex(flow)), 0);
    }
    assert!(patient.next_frame(0).is_some());
    for flow in ["310000"; 10].iter().chain(&["300000"]) {
        patient.receive(&to_emulator(&hex(flow)), 0);
    }
    assert!(patient.next_frame(0).is_some() && patient.is_idle(Lane::Long));

    // Flow control when none is awaited.
    emulator.receive(&to_emulator(&hex("300000")), 9_900_000);
    assert_eq!(emulator.counts().ignored, 1);
}

#[test]
fn silence_ends_in_time() {
    let mut emulator = sending();
    assert_eq!(emulator.wake_at(), Some(1_000_000), "N_Bs");
    assert_eq!(emulator.send(&message(30), 999_999), Err(Busy(Lane::Long)));
    assert_eq!(emulator.next_frame(1_000_000), None);
    assert_eq!(
        emulator.counts(),
        Counts {
            timeouts: 1,
            unsent: 1,
            ..Counts::default()
        }
    );
    assert_eq!(emulator.send(&message(30), 1_000_000), Ok(()));

    let mut client = receiving();
    assert_eq!(client.wake_at(), Some(1_000_000), "N_Cr");
    client.receive(&from_emulator(&hex("212d343b42495057")), 999_999);
    assert_eq!(client.wake_at(), Some(1_999_999));
    assert_eq!(
        client.receive(&from_emulator(&hex("225e656c737a8188")), 1_999_999),
        None,
        "too late by nothing"
    );
    assert_eq!(
        client.counts(),
        Counts {
            timeouts: 1,
            incomplete: 1,
            ignored: 1,
            ..Counts::default()
        }
    );
}

#[test]
fn what_is_no_message_is_not_sent() {
    let mut node = Node::new(Side::Client, false);
    assert_eq!(
        [node.send(&[], 0), node.send(&octets(1401, 1), 0)],
        [Ok(()), Ok(())]
    );
    assert_eq!((node.next_frame(0), node.counts().unsent), (None, 2));
}
