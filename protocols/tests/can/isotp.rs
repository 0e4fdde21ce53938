//! ISO-TP without errors: published exchanges, all lengths, valid and invalid data units.

use crate::common::hex;
use skyloop_protocols::can::form::{FROM_EMULATOR, TO_EMULATOR};
use skyloop_protocols::can::isotp::{Pdu, separation_us};
use skyloop_protocols::can::{Busy, CanFrame, Counts, Lane, Node, Parameters, Side};

fn frame(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::new(id, data.len() > 8, data).expect("valid")
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The counts that are not 0, as `incomplete: 1, ignored: 2`.
pub fn counted(counts: Counts) -> String {
    let text = format!("{counts:?}");
    let fields = text
        .trim_start_matches("Counts { ")
        .trim_end_matches(" }")
        .split(", ");
    fields
        .filter(|field| !field.ends_with(": 0"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// Runs a script against one end and returns its final counts. The steps of a script:
///
/// - `@1000`: sets the time, µs
/// - `<data`: receives a frame; `=data` after it: the frame completes this message
/// - `+20`: sends a message of 20 bytes; `?20`: the same, refused as busy
/// - `>data`: expects this next frame; `>`: expects none
/// - `~1000`: expects this wake-up time; `~`: expects none
pub fn play(side: Side, script: &str) -> String {
    let mut node = Node::new(side, false);
    let (receives, sends) = match side {
        Side::Emulator => (TO_EMULATOR, FROM_EMULATOR),
        Side::Client => (FROM_EMULATOR, TO_EMULATOR),
    };
    let (mut now, mut received) = (0, None);
    for step in script.split_whitespace() {
        let rest = &step[1..];
        let number = || rest.parse().expect(step);
        if !step.starts_with('=') {
            assert_eq!(received, None, "before {step} of {script}");
        }
        match &step[..1] {
            "@" => now = number(),
            "<" => received = node.receive(&frame(receives, &hex(rest)), now).map(digits),
            "=" => assert_eq!(received.take().as_deref(), Some(rest), "{script}"),
            "+" => assert_eq!(node.send(&message(number() as usize), now), Ok(())),
            "?" => {
                let sent = node.send(&message(number() as usize), now);
                assert_eq!(sent, Err(Busy(Lane::Long)), "{script}");
            }
            ">" => {
                let next = node.next_frame(now);
                let data = next.map(|frame| digits(frame.payload()));
                assert_eq!(data.unwrap_or_default(), rest, "{script}");
                assert!(next.is_none_or(|frame| frame.id == sends), "{script}");
            }
            "~" => {
                let wake = node.wake_at().map(|wake| wake.to_string());
                assert_eq!(wake.unwrap_or_default(), rest, "{script}");
            }
            _ => panic!("no step {step}"),
        }
    }
    assert_eq!(received, None, "after {script}");
    counted(node.counts())
}

/// All frames of a message from the emulator (`A`) to a client (`B`), in hexadecimal digits.
fn exchange(message: &[u8], parameters: Parameters) -> String {
    let mut emulator = Node::with(Side::Emulator, parameters);
    let mut client = Node::with(Side::Client, parameters);
    let (mut lines, mut received) = (Vec::new(), None);
    emulator.send(message, 0).expect("idle");
    loop {
        let before = lines.len();
        while let Some(frame) = emulator.next_frame(0) {
            let fd = parameters.fd;
            assert_eq!((frame.id, frame.fd, frame.brs), (FROM_EMULATOR, fd, fd));
            lines.push(format!("A {}", digits(frame.payload())));
            received = client.receive(&frame, 0).map(<[u8]>::to_vec).or(received);
        }
        while let Some(frame) = client.next_frame(0) {
            assert_eq!(frame.id, TO_EMULATOR);
            lines.push(format!("B {}", digits(frame.payload())));
            assert!(emulator.receive(&frame, 0).is_none());
        }
        if lines.len() == before {
            break;
        }
    }
    assert_eq!(received.as_deref(), Some(message));
    assert_eq!([emulator.counts(), client.counts()], [Counts::default(); 2]);
    lines.join("|")
}

/// Bytes 3, 10, 17 ...
pub fn message(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 7 + 3) as u8).collect()
}

/// X-Val: the vehicle identification number 3FADP4FJ2BM113913 read by OBD2 in CSS Electronics'
/// "CAN bus UDS explained".
#[test]
fn vehicle_identification_number() {
    let vin = [&[0x49, 0x02, 0x01], &b"3FADP4FJ2BM113913"[..]].concat();
    let expected = "A 1014490201334641|B 300000|A 21445034464a3242|A 224d313133393133";
    assert_eq!(exchange(&vin, Parameters::CLASSIC), expected);
}

/// X-Val: PyPI can-isotp 2.0.7, an exchange of two transport layers.
#[test]
fn exchanges_equal_those_of_another_implementation() {
    let (classic, fd) = (Parameters::CLASSIC, Parameters::FD);
    let blocks = Parameters {
        block_size: 2,
        ..classic
    };
    let padded = Parameters {
        padding: Some(0xCC),
        ..classic
    };
    let short_fd = Parameters {
        frame_bytes: 16,
        ..fd
    };
    let in_a_frame = "030a11181f262d343b424950575e656c737a81888f969da4abb2b9c0c7ced5dce3eaf1f8ff060d141b222930373e454c535a61686f767d848b9299a0a7ae";
    let check = |length, parameters, expected: &str| {
        let found = exchange(&message(length), parameters);
        assert_eq!(found, expected, "{length} bytes");
    };
    check(7, classic, "A 07030a11181f262d");
    check(8, classic, "A 1008030a11181f26|B 300000|A 212d34");
    let in_blocks = "A 1014030a11181f26|B 300200|A 212d343b42495057|A 225e656c737a8188";
    check(20, blocks, in_blocks);
    check(
        20,
        padded,
        &in_blocks.replace("B 300200", "B 300000cccccccccc"),
    );
    check(8, fd, "A 0008030a11181f262d34cccc");
    check(62, fd, &format!("A 003e{in_a_frame}"));
    check(63, fd, &format!("A 103f{in_a_frame}|B 300000|A 21b5"));
    let rest = "A 21b5bcc3cad1d8dfe6edf4fb020910171e252c333a41484f565d646b727980878e959ca3aab1b8bfc6cdd4dbe2e9f0f7fe050c131a21282f363d444b52596067|\
                A 226e757c838a91989fa6adb4bbc2c9d0d7dee5ecf3fa01080f16cccccccccccc";
    check(150, fd, &format!("A 1096{in_a_frame}|B 300000|{rest}"));
    let of_16 =
        "A 101e030a11181f262d343b424950575e|B 300000|A 21656c737a81888f969da4abb2b9c0c7|A 22ce";
    check(30, short_fd, of_16);
}

/// X-Val: Linux can-isotp, `net/can/isotp.c`: default of no padding, block size and separation
/// time 0.
#[test]
fn defaults_are_those_of_the_kernel() {
    let kernel = Parameters::CLASSIC;
    assert_eq!((kernel.frame_bytes, kernel.padding), (8, None));
    assert_eq!((kernel.block_size, kernel.st_min), (0, 0));
    assert_eq!(exchange(&message(3), kernel), "A 03030a11");
}

#[test]
fn all_frame_lengths_and_block_sizes_transfer_all_lengths() {
    for frame_bytes in [8, 12, 16, 20, 24, 32, 48, 64] {
        for block_size in [0, 1, 2, 15, 16, 255] {
            let parameters = Parameters {
                fd: frame_bytes > 8,
                frame_bytes,
                block_size,
                ..Parameters::CLASSIC
            };
            let padded = Parameters {
                padding: Some(0xCC),
                ..parameters
            };
            for length in [6, 8, 12, 62, 64, 112, 1400] {
                exchange(&message(length), parameters);
                exchange(&message(length), padded);
            }
            for length in [1, 7, 11, 13, 63, 111, 113, 1399] {
                exchange(&message(length), padded);
            }
        }
    }
    let wrong = Parameters {
        fd: true,
        frame_bytes: 9,
        ..Parameters::CLASSIC
    };
    let first = exchange(&message(20), wrong).find('|');
    assert_eq!(first, Some(2 + 2 * 12), "rounded up to 12");
}

#[test]
fn separation_times() {
    for (code, us) in [(0, 0), (1, 1000), (0x7F, 127_000), (0xF1, 100), (0xF9, 900)] {
        assert_eq!(separation_us(code), us, "{code:#x}");
    }
    for reserved in [0x80, 0xF0, 0xFA, 0xFF] {
        assert_eq!(separation_us(reserved), 127_000, "{reserved:#x}");
    }
}

#[test]
fn invalid_pdus_are_counted() {
    // Reserved types; lengths of 0, beyond the frame, or of a shorter frame; truncated heads.
    let data = "4011 f0 00 0011223344556677 0711223344 08081122334455667788aabb \
                0000112233445566778899aa 0007112233445566778899aa 000b112233445566778899aa \
                100811223344 1007112233445566 100a112233445566778899aa 100000000fff1122 \
                20 30 3000";
    for data in data.split(' ').chain([""]) {
        assert_eq!(Pdu::parse(&hex(data)), None, "{data}");
        let counts = play(Side::Emulator, &format!("<{data}"));
        assert_eq!(counts, "malformed: 1", "{data}");
    }
    let long = Pdu::First {
        length: 4096,
        data: &[0x11, 0x22],
    };
    assert_eq!(Pdu::parse(&hex("1000000010001122")), Some(long));
}
