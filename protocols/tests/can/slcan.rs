//! Lines of text: those of the adapters' manuals, invalid ones, and round trips.

use crate::common::Random;
use proptest::collection::vec;
use proptest::prelude::*;
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::adapter::Adapter;
use skyloop_protocols::can::frame::{LENGTHS, MAX_EXTENDED_ID};
use skyloop_protocols::can::slcan::{
    Answer, Command, DATA_RATES, Decoder, Line, LineError, MAX_LINE, State, encode,
};

fn decode(text: &[u8]) -> Vec<Result<Line, LineError>> {
    let mut decoder = Decoder::new();
    text.iter().filter_map(|byte| decoder.push(*byte)).collect()
}

fn text(line: &Line) -> String {
    let mut bytes = Vec::new();
    encode(line, &mut |byte| bytes.push(byte));
    String::from_utf8(bytes).expect("ASCII")
}

fn frame(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::new(id, false, data).expect("valid")
}

fn received(frame: CanFrame) -> Line {
    Line::Frame {
        frame,
        time_ms: None,
    }
}

/// Checks both directions of a line.
fn check(written: &str, line: Line) {
    assert_eq!(decode(written.as_bytes()), [Ok(line)], "{written:?}");
    assert_eq!(text(&line), written);
}

/// X-Val: LAWICEL's CAN232 manual, version 3.0: `t10021133`, `T0000010021133`, `V1013`, `NA123`,
/// time stamps up to EA5F; the other lines follow its grammar.
#[test]
fn lines_of_the_lawicel_manual() {
    let two = frame(0x100, &[0x11, 0x33]);
    let requested = CanFrame {
        remote: true,
        len: 2,
        ..frame(0x100, &[])
    };
    let extended = |frame| {
        received(CanFrame {
            extended: true,
            ..frame
        })
    };
    check("t10021133\r", received(two));
    check("T0000010021133\r", extended(two));
    check("r1002\r", received(requested));
    check("R000001002\r", extended(requested));
    check("t0200\r", received(frame(0x20, &[])));
    // The largest time stamp is 59,999 ms.
    let stamped = Line::Frame {
        frame: two,
        time_ms: Some(59_999),
    };
    check("t10021133EA5F\r", stamped);
    for (written, command) in [
        ("S8\r", Command::BitRate(8)),
        ("Y5\r", Command::DataRate(5)),
        ("O\r", Command::Open),
        ("L\r", Command::Listen),
        ("C\r", Command::Close),
        ("F\r", Command::Status),
        ("V\r", Command::Version),
        ("N\r", Command::Serial),
        ("Z0\r", Command::TimeStamps(false)),
        ("Z1\r", Command::TimeStamps(true)),
    ] {
        check(written, Line::Command(command));
    }
    let state = |state, receive_errors, transmit_errors| Answer::State {
        state,
        receive_errors,
        transmit_errors,
    };
    for (written, answer) in [
        ("F01\r", Answer::Status(1)),
        ("V1013\r", Answer::Version(*b"1013")),
        ("NA123\r", Answer::Serial(*b"A123")),
        // X-Val: Linux, drivers/net/can/slcan/slcan-core.c, slcan_bump_state and slcan_bump_err.
        ("sb256256\r", state(State::BusOff, 256, 256)),
        ("sa057033\r", state(State::Active, 57, 33)),
        ("e1a\r", Answer::Errors(*b"a\0\0\0\0\0\0\0")),
        ("e3bcO\r", Answer::Errors(*b"bcO\0\0\0\0\0")),
        ("\r", Answer::Done),
        ("z\r", Answer::Sent { extended: false }),
        ("Z\r", Answer::Sent { extended: true }),
        ("\x07", Answer::Refused),
    ] {
        check(written, Line::Answer(answer));
    }
}

/// X-Val: the FD lines of the CANable 2.0 firmware's README.
#[test]
fn lines_of_canable_2() {
    let twelve = CanFrame::new(0x7FF, true, &[0xAB; 12]).expect("valid");
    let data = "AB".repeat(12);
    for (first, brs) in [("d", false), ("b", true)] {
        let line = received(CanFrame { brs, ..twelve });
        check(&format!("{first}7FF9{data}\r"), line);
        let small = format!("{first}7ff9{data}\r");
        assert_eq!(decode(small.as_bytes()), [Ok(line)], "lower case");
    }
}

#[test]
fn invalid_lines_have_their_error() {
    let malformed = "t1002113 t10021133EA5F0 t1009112233445566778899 t80021133 t100211334 t1002113G \
                     T2000000021133 S9 S S10 Y3 O1 Z2 F1 zz r100211 d1001 t1 t";
    for text in malformed.split(' ') {
        let first = text.as_bytes()[0];
        let found = decode(format!("{text}\r").as_bytes());
        assert_eq!(found, [Err(LineError::Malformed { first })], "{text}");
    }
    let first = b't';
    assert_eq!(decode(b"t1002\x07"), [Err(LineError::Malformed { first })]);
    let first = 0xC0;
    assert_eq!(decode(b"\xC0abc\r"), [Err(LineError::Unknown { first })]);
    let long = [&[b'T'; MAX_LINE + 1], &b"\rO\r"[..]].concat();
    let open = Ok(Line::Command(Command::Open));
    assert_eq!(
        decode(&long),
        [Err(LineError::TooLong), open],
        "synchronised again"
    );
    assert_eq!(decode(b"O\r\nC\r\n").len(), 2, "line feeds are ignored");
    let mut decoder = Decoder::default();
    let bounded = (0..1_000_000).all(|_| decoder.push(b'x').is_none());
    assert!(bounded);
}

#[test]
fn an_adapter_answers() {
    let mut adapter = Adapter::new();
    let send = |adapter: &mut Adapter, text: &str| {
        let mut answers = Vec::new();
        let mut frames = Vec::new();
        for line in decode(text.as_bytes()) {
            match line {
                Ok(line) => frames.extend(adapter.take(&line, &mut |byte| answers.push(byte))),
                Err(_) => adapter.refuse(&mut |byte| answers.push(byte)),
            }
        }
        (String::from_utf8(answers).expect("ASCII"), frames)
    };
    let answers = [
        ("\r\r\r", ""), // start of a host
        ("t10021133\r", "\x07"),
        ("O\r", "\x07"), // no bit rate yet
        ("F\r", "\x07"),
        ("C\r", "\x07"),
        ("S6\r", "\r"),
        ("Y8\r", "\r"),
        ("Z1\r", "\r"),
        ("O\r", "\r"),
        ("S8\r", "\x07"),
        ("O\r", "\x07"),
        ("V\r", "V1013\r"),
        ("N\r", "NSKYL\r"),
        ("F\r", "F00\r"),
        ("tgarbage\r", "\x07"),
        ("t100211330001\r", "\x07"), // only received frames have a time
    ];
    for (command, answer) in answers {
        let found = send(&mut adapter, command);
        assert_eq!(found, (answer.into(), vec![]), "{command:?}");
    }
    assert_eq!(adapter.bit_rate(), Some(500_000));
    assert_eq!(adapter.data_rate(), Some(8_000_000));
    let sent = vec![frame(0x100, &[0x11, 0x33])];
    assert_eq!(send(&mut adapter, "t10021133\r"), ("z\r".into(), sent));
    assert_eq!(send(&mut adapter, "T0000010021133\r").0, "Z\r");
    let mut delivered = Vec::new();
    adapter.deliver(&frame(0x7FF, &[1]), 60_001, &mut |byte| {
        delivered.push(byte)
    });
    assert_eq!(delivered, b"t7FF1010001\r");
    // Close, then open to listen only.
    let answers = send(&mut adapter, "C\rL\rt10021133\r");
    assert_eq!(answers, ("\r\r\x07".into(), vec![]));
}

fn any_frame() -> impl Strategy<Value = CanFrame> {
    (any::<[bool; 4]>(), any::<u32>(), 0..16_usize, any::<u64>()).prop_map(
        |([extended, fd, brs, remote], id, code, seed)| {
            let (brs, remote) = (fd && brs, !fd && remote);
            let len = LENGTHS[if fd { code } else { code % 9 }];
            let mut random = Random(seed);
            let mut data = [0; 64];
            if !remote {
                data[..len.into()].fill_with(|| random.next() as u8);
            }
            let id = id & if extended { MAX_EXTENDED_ID } else { 0x7FF };
            CanFrame {
                id,
                extended,
                fd,
                brs,
                remote,
                error: false,
                len,
                data,
            }
        },
    )
}

fn any_line() -> impl Strategy<Value = Line> {
    let four = || any::<[u8; 4]>().prop_map(|text| text.map(|c| b'0' + c % 10));
    let command = prop_oneof![
        (0..9_u8).prop_map(Command::BitRate),
        (0..DATA_RATES.len()).prop_map(|at| Command::DataRate(DATA_RATES[at].0)),
        any::<bool>().prop_map(Command::TimeStamps),
        Just(Command::Close),
    ];
    let answer = prop_oneof![
        any::<bool>().prop_map(|extended| Answer::Sent { extended }),
        any::<u8>().prop_map(Answer::Status),
        four().prop_map(Answer::Version),
        four().prop_map(Answer::Serial),
        (0_u16..1000, 0_u16..1000).prop_map(|(receive_errors, transmit_errors)| Answer::State {
            state: State::Passive,
            receive_errors,
            transmit_errors,
        }),
        (1_usize..=8).prop_map(|count| {
            let mut letters = [0; 8];
            letters[..count].fill(b's');
            Answer::Errors(letters)
        }),
        Just(Answer::Refused),
    ];
    prop_oneof![
        4 => (any_frame(), any::<Option<u16>>()).prop_map(|(frame, time_ms)| Line::Frame { frame, time_ms }),
        1 => command.prop_map(Line::Command),
        1 => answer.prop_map(Line::Answer),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn lines_after_garbage_are_decoded(garbage in vec(any::<u8>(), 0..300), lines in vec(any_line(), 1..5)) {
        let mut bytes = garbage;
        bytes.push(b'\r'); // ends the garbage
        let before = decode(&bytes).len();
        for line in &lines {
            prop_assert!(text(line).len() <= MAX_LINE + 1);
            bytes.extend_from_slice(text(line).as_bytes());
        }
        let received: Vec<_> = decode(&bytes).into_iter().skip(before).collect();
        prop_assert_eq!(received, lines.into_iter().map(Ok).collect::<Vec<_>>());
    }
}
