//! `vectors/golden.txt` in other forms: on a serial line, as CAN frames, compressed pixels.

use crate::common::{Vector, golden, hex};
use skyloop_protocols::can::form::Frames;
use skyloop_protocols::can::{Node, Side};
use skyloop_protocols::{Reply, rice, slip};
use std::collections::BTreeSet;

#[test]
fn serial_vector_in_both_directions() {
    let vectors = golden();
    let v = vectors
        .iter()
        .find(|v| v.has("packet"))
        .expect("a serial vector");
    let packet = hex(v.text("packet"));
    let mut line = Vec::new();
    slip::encode(&packet, &mut |byte| line.push(byte));
    assert_eq!(line, v.bytes);
    let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
    let mut frames = Vec::new();
    for byte in line {
        frames.extend(
            decoder
                .push(byte)
                .map(|frame| frame.expect("good").to_vec()),
        );
    }
    assert_eq!(frames, [packet]);
}

/// Identifier and data of the frames of a vector: `100#0011...`.
fn can_frames(v: &Vector) -> Vec<(u32, Vec<u8>)> {
    let frames = v.text("frames").split_whitespace();
    let parts = frames.map(|frame| frame.split_once('#').expect(frame));
    parts
        .map(|(id, data)| (u32::from_str_radix(id, 16).expect(id), hex(data)))
        .collect()
}

#[test]
fn can_vectors_in_both_directions() {
    let vectors = golden();
    let mut seen = BTreeSet::new();
    for v in vectors.iter().filter(|v| v.has("frames")) {
        let mut packets = vectors.iter().filter(|other| other.name == v.text("of"));
        let packet = packets.next().expect("the packet");
        let expected = can_frames(v);
        let counter = expected[0].1[0] >> 5;
        let mut frames = Frames::of(&packet.bytes, counter).expect(&v.name);
        let side = if expected[0].0 < 0x200 {
            Side::Emulator
        } else {
            Side::Client
        };
        let mut node = Node::new(side, false);
        for (number, (id, data)) in (1..).zip(&expected) {
            let frame = frames.next(false).expect(&v.name);
            assert_eq!((frame.id, frame.payload()), (*id, &data[..]), "{}", v.name);
            seen.insert(*id);
            let received = node.receive(&frame, number);
            assert_eq!(received.is_some(), number == expected.len() as u64);
            let Some(received) = received else { continue };
            if side == Side::Emulator {
                assert_eq!(received, packet.bytes, "{}", v.name);
                continue;
            }
            // The receiver numbers Acks, so only the content is equal.
            let [found, expected] =
                [received, &packet.bytes].map(|packet| Reply::decode(packet).expect(&v.name).1);
            assert_eq!(found, expected, "{}", v.name);
        }
        assert!(frames.is_done(), "{}", v.name);
    }
    assert_eq!(seen.len(), 18, "every plain frame: {seen:?}");
}

#[test]
fn compressed_vectors_in_both_directions() {
    let vectors = golden();
    let compressed: Vec<&Vector> = vectors.iter().filter(|v| v.has("pixel_bits")).collect();
    for v in &compressed {
        let data = hex(v.text("data"));
        let expected: Vec<u16> = v.integers("pixels").iter().map(|p| *p as u16).collect();
        let mut found = vec![0; expected.len()];
        rice::decode(&data, v.integer("pixel_bits"), &mut found).expect(&v.name);
        assert_eq!(found, expected, "{}", v.name);
        let mut code = [0; 1369];
        let made = rice::encode(&expected, v.integer("pixel_bits"), &mut code);
        assert_eq!(made, (expected.len(), data.len()), "{}", v.name);
        assert_eq!(code[..data.len()], data, "{}", v.name);
    }
    assert_eq!(compressed.len(), 2);
}
