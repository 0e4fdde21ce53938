//! The CAN form: its frames bit by bit, and the choice between plain frames and ISO-TP.

use super::bus::{Bus, attitude, command_packet};
use super::isotp::counted;
use proptest::prelude::*;
use skyloop_protocols::can::form::{Frames, join, split};
use skyloop_protocols::can::{CanFrame, Lane, Node, Side};
use skyloop_protocols::{Attitude, Command, OrbitState};

const EXAMPLE: Attitude = Attitude {
    sequence: 7,
    q_icrf_to_body: [-0.070834, -0.644137, 0.733522, -0.204975],
    rates_rad_s: [0.001, -0.0005, 0.00025],
    state: Some(OrbitState {
        position_m: [-4_340_768.444, 848_975.278, -5_362_534.303],
        velocity_m_s: [5_544.406_469, -3_022.740_43, -4_386.550_226],
    }),
};

fn frames_of(packet: &[u8], counter: u8) -> Vec<CanFrame> {
    let mut frames = Frames::of(packet, counter).expect("plain frames");
    let all = std::iter::from_fn(|| frames.next(false)).collect();
    assert!(frames.is_done());
    all
}

fn ids(frames: &[CanFrame]) -> impl Iterator<Item = u32> {
    frames.iter().map(|frame| frame.id)
}

fn word(frame: &CanFrame) -> u64 {
    u64::from_be_bytes(frame.payload().try_into().expect("eight bytes"))
}

/// X-Val: Python's struct and NumPy's float32, which share nothing with the code: the attitude of
/// the ICD's worked example, counter 5, time 0x7397df7b89abcdef.
#[test]
fn an_attitude_bit_by_bit() {
    let packet = command_packet(&Command::Attitude(EXAMPLE), 5, 0x7397_DF7B_89AB_CDEF);
    let expected = [
        0xb00000000007e000,
        0x7397df7b89abcded,
        0xbd91116a8b8f14dd,
        0xbf24e6299524bfd5,
        0x3f3bc81908e581d5,
        0xbe51e4f765fd8add,
        0x3a83126e978d4fe5,
        0xba03126e978d4fe5,
        0x3983126e978d4fe5,
        0xca847840e353f7d5,
        0x494f44f472b020cd,
        0xcaa3a6cc9b22d0ed,
        0x45ad434072d1aeb5,
        0xc53cebd8cd20afa5,
        0xc5891466dce39b4d,
    ];
    let frames = frames_of(&packet, 5);
    assert!(ids(&frames).eq(0x100..=0x10F));
    let words: Vec<u64> = frames.iter().map(word).collect();
    assert_eq!(words[..15], expected);
    let crc = u16::from_be_bytes(*packet.last_chunk().expect("a CRC"));
    assert_eq!(words[15], 0xA000_0014_0000_0000 | u64::from(crc) << 16);

    let without = Command::Attitude(Attitude {
        state: None,
        ..EXAMPLE
    });
    let frames = frames_of(&command_packet(&without, 5, 0), 13);
    assert!(ids(&frames).eq((0x100..=0x108).chain([0x10F])));
    let head = word(&frames[0]) >> 60;
    assert_eq!(head, 0xA, "counter 13 modulo 8, no state");
}

#[test]
fn each_attitude_has_the_next_counter() {
    let mut node = Node::new(Side::Client, false);
    let counters = (0..10).map(|sequence| {
        node.send(&attitude(sequence, false), 0).expect("idle");
        let frames: Vec<CanFrame> = std::iter::from_fn(|| node.next_frame(0)).collect();
        assert_eq!(frames.len(), 10);
        frames[0].data[0] >> 5
    });
    assert!(counters.eq([0, 1, 2, 3, 4, 5, 6, 7, 0, 1]));
}

#[test]
fn frames_of_an_attitude_follow_each_other() {
    let mut node = Node::new(Side::Client, false);
    for sequence in 0..2 {
        node.send(&attitude(sequence, true), 0).expect("idle");
        assert!((0..8).all(|_| node.next_frame(0).is_some()));
        // During the attitude the emulator starts a message that needs flow control.
        let first = CanFrame::new(0x220, false, &[0x10, 20, 0, 0, 0, 0, 0, 0]).expect("valid");
        node.receive(&first, 0);
        let rest: Vec<CanFrame> = std::iter::from_fn(|| node.next_frame(0)).collect();
        assert!(ids(&rest).eq((0x108..=0x10F).chain([0x120])));
        // The last packet is a plain one, which gives the next turn to the long lane.
        let ping = command_packet(&Command::Ping, 0, 0);
        node.send(&ping, 0).expect("idle");
        assert!(node.next_frame(0).is_some());
    }
}

#[test]
fn short_commands_bit_by_bit() {
    let packets = 0x0102_0304;
    for (command, data) in [
        (Command::Credit { packets }, [7, 0x12, 0x34, 1, 2, 3, 4]),
        (Command::Ping, [6, 0x12, 0x34, 0, 0, 0, 0]),
    ] {
        let frames = frames_of(&command_packet(&command, 0x1234, 99), 0);
        let found = (frames.len(), frames[0].id, frames[0].payload());
        assert_eq!(found, (1, 0x110, &data[..]), "{command:?}");
    }
}

#[test]
fn other_packets_are_sent_by_isotp() {
    let node = Node::new(Side::Client, false);
    let packet = |command: &Command| command_packet(command, 0, 0);
    let lane_of_rate = |rate| {
        let rates_rad_s = [rate, 0.0, 0.0];
        node.lane(&packet(&Command::Attitude(Attitude {
            rates_rad_s,
            ..EXAMPLE
        })))
    };
    for plain in [0.0, -0.0, 1.2e-38, 3.4e38, -1.0, f64::INFINITY] {
        assert_eq!(lane_of_rate(plain), Lane::Plain, "{plain}");
    }
    for whole in [1.1e-38, 5e-324, 3.5e38, f64::MAX, f64::NAN] {
        assert_eq!(lane_of_rate(whole), Lane::Long, "{whole}");
    }
    // Damaged packets are sent whole, so that the receiver can report them.
    let mut damaged = packet(&Command::Ping);
    damaged[7] ^= 1;
    let exposure = packet(&Command::Exposure { seconds: 1.0 });
    for packet in [damaged, exposure, vec![]] {
        assert_eq!(node.lane(&packet), Lane::Long, "{packet:02x?}");
    }
}

#[test]
fn packets_of_one_kind_keep_their_order() {
    let commands: Vec<Vec<u8>> = (0..50)
        .map(|count| match count % 3 {
            0 => command_packet(&Command::Exposure { seconds: 0.1 }, count, 0),
            _ => command_packet(&Command::Ping, count, 0),
        })
        .collect();
    for fd in [false, true] {
        let mut bus = Bus::perfect(fd);
        // One queue for both lanes: no packet overtakes another.
        for packet in &commands {
            while bus.nodes[1].send(packet, bus.now_us).is_err() {
                bus.step();
            }
        }
        bus.run();
        assert_eq!(bus.received[0], commands);
    }
}

/// The emulator's packets from these frames, and its counts `incomplete` and `ignored`.
fn receive(frames: &[CanFrame]) -> (Vec<Vec<u8>>, u32, u32) {
    let mut node = Node::new(Side::Emulator, false);
    let packet = |frame| node.receive(frame, 0).map(<[u8]>::to_vec);
    let packets = frames.iter().filter_map(packet).collect();
    let counts = node.counts();
    (packets, counts.incomplete, counts.ignored)
}

#[test]
fn an_attitude_is_received_whole_or_counted_once() {
    // 10 frames, and 16 with position.
    let packet = attitude(2, true);
    let (first, second) = (frames_of(&attitude(1, false), 0), frames_of(&packet, 1));
    for at in 0..first.len() {
        let mut lost = [&first[..], &second].concat();
        lost.remove(at);
        // Without its first frame, the second counts as incomplete and the others are ignored.
        let ignored = if at == 0 { 8 } else { 0 };
        assert_eq!(
            receive(&lost),
            (vec![packet.clone()], 1, ignored),
            "frame {at} lost"
        );

        let mut damaged = [&first[..], &second].concat();
        damaged[at].data[3] ^= 1;
        let (received, ..) = receive(&damaged);
        // In the last frame these bits are spare.
        let max = if at == first.len() - 1 { 2 } else { 1 };
        assert_eq!(received.last(), Some(&packet), "frame {at} damaged");
        assert!(received.len() <= max, "frame {at} damaged");

        let mut repeated = first.clone();
        repeated.insert(at, first[at]);
        assert_eq!(
            receive(&repeated),
            (vec![attitude(1, false)], 0, 1),
            "frame {at} twice"
        );
    }
    // A frame of another transmission of the same attitude: content and CRC are right, the counter
    // is not.
    let zeros = frames_of(&packet, 0);
    for at in 0..zeros.len() {
        let mut frames = zeros.clone();
        frames[at] = second[at];
        let (received, incomplete, _) = receive(&frames);
        assert!(
            received.is_empty() && incomplete >= 1,
            "frame {at} of another"
        );
    }
    // Between the first and the last, any order is accepted.
    let mut frames = second.clone();
    frames[1..15].reverse();
    assert_eq!(receive(&frames), (vec![packet.clone()], 0, 0));
    // A position without has_state in the first frame is refused.
    let mut frames = second.clone();
    frames[0].data[0] &= !0x10;
    assert_eq!(receive(&frames), (vec![], 1, 0));
}

#[test]
fn an_interrupted_attitude_times_out() {
    let frames = frames_of(&attitude(1, false), 0);
    let mut node = Node::new(Side::Emulator, false);
    for frame in &frames[..9] {
        assert!(node.receive(frame, 0).is_none());
    }
    assert_eq!(node.wake_at(), Some(1_000_000));
    assert!(node.receive(&frames[9], 1_000_000).is_none());
    let counts = counted(node.counts());
    assert_eq!(counts, "timeouts: 1, incomplete: 1, ignored: 1");
}

#[test]
fn malformed_and_foreign_frames_are_counted_apart() {
    let data = |id, bytes| CanFrame::new(id, bytes > 8, &vec![0; bytes]).expect("valid");
    let remote = |id, extended| CanFrame {
        extended,
        remote: true,
        ..data(id, 0)
    };
    let (malformed, ignored) = ("malformed: 1", "ignored: 1");
    for (frame, expected) in [
        (data(0x100, 7), malformed),
        (data(0x10F, 12), malformed),
        (data(0x110, 8), malformed),
        (data(0x110, 6), malformed),
        (data(0x111, 8), ignored),
        (data(0x210, 4), ignored),
        (data(0x0FF, 8), ignored),
        // Remote frames. A 29-bit identifier is always foreign.
        (remote(0x100, false), malformed),
        (remote(0x110, false), malformed),
        (remote(0x120, false), malformed),
        (remote(0x110, true), ignored),
        (remote(0x7FF, false), ignored),
    ] {
        let mut node = Node::new(Side::Emulator, true);
        assert_eq!(node.receive(&frame, 0), None, "{frame:?}");
        assert_eq!(counted(node.counts()), expected, "{frame:?}");
    }
    // Any opcode gives a packet: the emulator's decoder reports its error.
    let mut node = Node::new(Side::Emulator, true);
    let unknown = CanFrame::new(0x110, false, &[0xEE, 0, 1, 0, 0, 0, 0]).expect("valid");
    let packet = node.receive(&unknown, 0).expect("a packet");
    assert!(Command::decode(packet).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn f64_survives_the_round_trip(number in prop_oneof![prop::num::f64::ANY.prop_filter("a number", |x| !x.is_nan()), -1e10..1e10_f64, 1.2e-38..3.4e38_f64]) {
        let (high, low) = split(number);
        let back = join(high, low);
        let size = number.abs();
        let (min, limit) = (f64::from(f32::MIN_POSITIVE), 2_f64.powi(128));
        if size == 0.0 || (min..limit).contains(&size) {
            prop_assert_eq!(back.to_bits(), number.to_bits());
            let near = f64::from(f32::from_bits(high));
            prop_assert!((near - number).abs() <= size * f64::from(f32::EPSILON), "value in a DBC tool");
        } else {
            prop_assert_eq!(back, if size >= limit { f64::INFINITY } else { 0.0 }.copysign(number));
        }
    }
}
