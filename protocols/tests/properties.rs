//! Properties over random input: any octets decode to a packet or an error, and what is encoded comes back.

mod common;

use common::{Vector, golden};
use proptest::collection::vec;
use proptest::prelude::*;
use skyloop_protocols::command::UNIT_TOLERANCE;
use skyloop_protocols::packet::{self, MAX_PAYLOAD, identify, reseal};
use skyloop_protocols::pixels::{
    LABEL_TEXT_PER_PART, blocks, blocks_in_frame, label_parts, label_texts, pack, packed_length,
    pixels_per_block, unpack,
};
use skyloop_protocols::{
    Ack, Attitude, AttitudeSource, Command, Counters, DecodeError, Direction, Fault, FaultKind,
    FrameEnd, FrameHeader, LabelLevel, LabelPart, MAX_PACKET, Mode, Nack, OrbitState, Output,
    Overrun, Packing, PixelBlock, PixelLevel, Positions, Reason, Reply, Status, SyncState, Timing,
    WireTime, Withheld, apid, slip,
};
use std::sync::LazyLock;

static GOLDEN: LazyLock<Vec<Vector>> = LazyLock::new(golden);

/// Decodes at both ends; what is accepted must be written back to the very same octets.
fn decode_both(bytes: &[u8]) {
    let mut buffer = [0; MAX_PACKET];
    match Command::decode(bytes) {
        Ok((header, command)) => {
            let length = command
                .encode(header.sequence_count, header.time, &mut buffer)
                .expect("encodes");
            assert_eq!(&buffer[..length], bytes);
        }
        Err(error) => assert!(!error.to_string().is_empty() && !error.reason().name().is_empty()),
    }
    match Reply::decode(bytes) {
        Ok((header, reply)) => {
            let length = reply
                .encode(header.sequence_count, header.time, &mut buffer)
                .expect("encodes");
            assert_eq!(&buffer[..length], bytes);
            if let Reply::PixelBlock(block) = reply {
                let mut pixels = vec![0; usize::from(block.count)];
                let unpacked = unpack(block.packing, block.data, &mut pixels);
                assert_eq!(unpacked, pixels.len());
            }
        }
        Err(error) => assert!(!error.to_string().is_empty() && !error.reason().name().is_empty()),
    }
    let _ = identify(bytes);
}

/// Puts a header of the given kind, the right length field and CRC around any payload: only the payload is random.
fn wrap(kind: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; packet::HEADER_LENGTH];
    let first = 0x0800
        | kind
        | if apid::is_telecommand(kind) {
            0x1000
        } else {
            0
        };
    bytes[..2].copy_from_slice(&first.to_be_bytes());
    bytes[2] = 0xC0;
    bytes[14] = packet::VERSION;
    bytes.extend_from_slice(payload);
    bytes.extend_from_slice(&[0; packet::CRC_LENGTH]);
    fix(&mut bytes);
    bytes
}

/// Makes length field and CRC fit, so that damage reaches the fields.
fn fix(bytes: &mut [u8]) {
    if let Some(length) = bytes.len().checked_sub(7)
        && bytes.len() >= 6
    {
        bytes[4..6].copy_from_slice(&u16::try_from(length).expect("short").to_be_bytes());
    }
    reseal(bytes);
}

fn kind() -> impl Strategy<Value = u16> {
    (0..apid::ALL.len()).prop_map(|row| apid::ALL[row].0)
}

fn packing() -> impl Strategy<Value = Packing> {
    prop_oneof![Just(Packing::Bits12), Just(Packing::Bits16)]
}

fn finite() -> impl Strategy<Value = f64> {
    prop::num::f64::NORMAL | prop::num::f64::ZERO | prop::num::f64::SUBNORMAL
}

fn positive() -> impl Strategy<Value = f64> {
    1e-300..1e300
}

/// A quaternion within the tolerance of unit length.
fn quaternion() -> impl Strategy<Value = [f64; 4]> {
    let norm = 1.0 - 0.99 * UNIT_TOLERANCE..1.0 + 0.99 * UNIT_TOLERANCE;
    (prop::array::uniform4(-1.0..1.0), norm).prop_filter_map(
        "too short to normalise",
        |(q, norm)| {
            let length = q.iter().map(|c: &f64| c * c).sum::<f64>().sqrt();
            (length > 0.1).then(|| q.map(|c| c * norm / length))
        },
    )
}

fn command() -> impl Strategy<Value = Command> {
    let vector = || prop::array::uniform3(finite());
    let state = prop::option::of((vector(), vector()));
    let attitude = (any::<u32>(), quaternion(), vector(), state).prop_map(
        |(sequence, q_icrf_to_body, rates, state)| {
            let state = state.map(|(position_m, velocity_m_s)| OrbitState {
                position_m,
                velocity_m_s,
            });
            Command::Attitude(Attitude {
                sequence,
                q_icrf_to_body,
                rates_rad_s: rates,
                state,
            })
        },
    );
    prop_oneof![
        attitude,
        positive().prop_map(|seconds| Command::Exposure { seconds }),
        positive().prop_map(|e_per_dn| Command::Gain { e_per_dn }),
        positive().prop_map(|hz| Command::FrameRate { hz }),
        Just(Command::SingleShot),
        Just(Command::Pause),
        Just(Command::Resume),
        Just(Command::Reset),
        Just(Command::Ping),
        any::<u32>().prop_map(|packets| Command::Credit { packets }),
        (0..4_u8, 0..3_u8, 1..=25_u8, any::<u8>(), any::<u16>()).prop_map(
            |(pixels, labels, window_size, windows, objects)| Command::Output(Output {
                pixels: PixelLevel::from_code(pixels).expect("level"),
                labels: LabelLevel::from_code(labels).expect("level"),
                window_size,
                windows,
                objects,
            })
        ),
        vec(prop::array::uniform2(any::<u16>()), 0..=64)
            .prop_map(|centres| Command::Positions(Positions::new(&centres).expect("few"))),
        prop::array::uniform3(any::<u32>()).prop_map(|[frame, first, count]| Command::Resend {
            frame,
            first,
            count
        }),
        (1..=u32::MAX, any::<u64>()).prop_map(|(number, start)| Command::Trigger {
            number,
            start: WireTime(start),
        }),
        (1..=11_u8, 0..2_u8, 0.0..=1.0, 0.0..1e6).prop_map(|(kind, direction, value, seconds)| {
            let kind = FaultKind::from_code(kind).expect("kind");
            Command::Fault(Fault {
                kind,
                direction: Direction::from_code(direction).expect("direction"),
                value: if kind.is_switch() {
                    f64::round(value)
                } else {
                    value
                },
                seconds,
            })
        }),
    ]
}

fn frame_header() -> impl Strategy<Value = FrameHeader> {
    let numbers = (
        any::<u32>(),
        any::<u32>(),
        any::<u64>(),
        finite(),
        positive(),
    );
    let shape = (
        1..=u16::MAX,
        1..=u16::MAX,
        packing(),
        1..=12_u8,
        0..10_000_000_u32,
    );
    (numbers, shape, any::<u64>(), any::<u64>()).prop_map(|(numbers, shape, a, b)| {
        let (frame, attitude_sequence, seed, offset_dn, gain_e_per_dn) = numbers;
        let (width, height, packing, bits, label_bytes) = shape;
        FrameHeader {
            frame,
            attitude_sequence,
            width,
            height,
            bits,
            packing,
            pixel_level: PixelLevel::Frame,
            label_level: LabelLevel::Text,
            window_size: 0,
            windows: 0,
            blocks: blocks_in_frame(u32::from(width) * u32::from(height), packing),
            label_parts: label_parts(label_bytes).expect("few parts"),
            label_bytes,
            exposure_start: WireTime(a.min(b)),
            exposure_end: WireTime(a.max(b)),
            seed,
            gain_e_per_dn,
            offset_dn,
        }
    })
}

fn timing() -> impl Strategy<Value = Timing> {
    let seconds = prop::array::uniform6(prop::num::f32::NORMAL | prop::num::f32::ZERO);
    seconds.prop_map(|[a, b, c, d, e, f]| Timing {
        attitude_age_s: a,
        first_pixel_s: b,
        last_pixel_s: c,
        first_octet_s: d,
        last_octet_s: e,
        spare_s: f,
    })
}

fn frame_end() -> impl Strategy<Value = FrameEnd> {
    let codes = (
        prop::sample::select(AttitudeSource::ALL),
        prop::sample::select(Overrun::ALL),
        prop::sample::select(SyncState::ALL),
    );
    let numbers = prop::array::uniform3(any::<u32>());
    (codes, numbers, any::<bool>(), timing(), finite()).prop_map(
        |(
            (attitude_source, overrun, sync),
            [frame, pixels_crc32, trigger],
            in_time,
            timing,
            offset,
        )| {
            FrameEnd {
                frame,
                pixels_crc32,
                trigger,
                attitude_source,
                overrun,
                sync,
                in_time,
                timing,
                clock_offset_s: offset,
            }
        },
    )
}

fn status() -> impl Strategy<Value = Status> {
    let shape = (
        any::<bool>(),
        1..=u16::MAX,
        1..=u16::MAX,
        packing(),
        1..=12_u8,
    );
    let numbers = (
        prop::array::uniform3(positive()),
        any::<u32>(),
        any::<u32>(),
        any::<u32>(),
        any::<u32>(),
    );
    (shape, numbers, timing(), finite()).prop_map(
        |(
            (wall, width, height, packing, bits),
            (settings, next_frame, packets_sent, c, d),
            timing,
            clock_offset_s,
        )| {
            let [exposure_s, gain_e_per_dn, frame_rate_hz] = settings;
            let mode = if wall { Mode::Wall } else { Mode::Stepped };
            let counters = Counters {
                attitudes: c,
                sequence_gaps: d,
                rejected_records: c ^ d,
                objects_without_state: d,
                lost_outbound: c,
                exposures_missed: d,
                ..Counters::default()
            };
            Status {
                mode,
                width,
                height,
                bits,
                packing,
                output: Output::default(),
                exposure_s,
                gain_e_per_dn,
                frame_rate_hz,
                next_frame,
                packets_sent,
                sync: SyncState::Holdover,
                clock_offset_s,
                exposure_start: WireTime(u64::from(next_frame) << 32),
                exposure_end: WireTime(u64::MAX - u64::from(packets_sent)),
                timing,
                latency_p50_s: timing.spare_s,
                latency_p99_s: timing.first_octet_s,
                latency_max_s: timing.last_octet_s,
                withheld: Withheld::SlowLink,
                counters,
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_octets_decode_or_are_refused(bytes in vec(any::<u8>(), 0..1500)) {
        decode_both(&bytes);
    }

    #[test]
    fn any_payload_decodes_or_is_refused(kind in kind(), payload in vec(any::<u8>(), 0..=MAX_PAYLOAD)) {
        decode_both(&wrap(kind, &payload));
    }

    #[test]
    fn any_short_payload_decodes_or_is_refused(kind in kind(), payload in vec(prop_oneof![Just(0_u8), Just(1), any::<u8>()], 0..140)) {
        decode_both(&wrap(kind, &payload));
    }

    #[test]
    fn damaged_vectors_decode_or_are_refused(
        pick in any::<prop::sample::Index>(),
        damage in vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        tail in vec(any::<u8>(), 0..4),
        fixed in any::<bool>(),
    ) {
        let vectors = &*GOLDEN;
        let mut bytes = vectors[pick.index(vectors.len())].bytes.clone();
        for (place, octet) in damage {
            if !bytes.is_empty() {
                let place = place.index(bytes.len());
                bytes[place] = octet;
            }
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len() + 1));
        }
        bytes.extend_from_slice(&tail);
        if fixed {
            fix(&mut bytes);
        }
        decode_both(&bytes);
    }

    #[test]
    fn one_wrong_octet_is_always_noticed(command in command(), place in any::<prop::sample::Index>(), flip in 1..=255_u8) {
        let mut buffer = [0; MAX_PACKET];
        let length = command.encode(0, WireTime(1), &mut buffer).expect("encodes");
        buffer[place.index(length)] ^= flip;
        let error = Command::decode(&buffer[..length]).expect_err("damaged");
        prop_assert!(matches!(error, DecodeError::BadCrc { .. } | DecodeError::BadLength { .. }), "{error}");
    }

    #[test]
    fn commands_come_back(command in command(), count in any::<u16>(), time in any::<u64>()) {
        let mut buffer = [0; MAX_PACKET];
        let length = command.encode(count, WireTime(time), &mut buffer).expect("encodes");
        let (header, back) = Command::decode(&buffer[..length]).expect("decodes");
        prop_assert_eq!(back, command);
        prop_assert_eq!((header.apid, header.sequence_count, header.time), (command.apid(), count % 16384, WireTime(time)));
        prop_assert_eq!(identify(&buffer[..length]), Some((header.apid, header.sequence_count)));
        prop_assert!(command.encode(count, WireTime(time), &mut buffer[..length - 1]).is_err(), "one octet too small");
    }

    #[test]
    fn both_ends_of_frames_and_status_come_back(frame in frame_header(), end in frame_end(), status in status(), count in any::<u16>(), time in any::<u64>()) {
        for reply in [Reply::FrameHeader(frame), Reply::FrameEnd(end), Reply::Status(status)] {
            let mut buffer = [0; MAX_PACKET];
            let length = reply.encode(count, WireTime(time), &mut buffer).expect("encodes");
            prop_assert_eq!(Reply::decode(&buffer[..length]).expect("decodes").1, reply);
        }
    }

    #[test]
    fn answers_come_back(apid in 0..0x800_u16, count in 0..16384_u16, reason in 0..Reason::ALL.len(), detail in ".{0,300}") {
        let nack = Nack::new(apid, count, Reason::ALL[reason], &detail);
        prop_assert!(detail.starts_with(nack.detail) && nack.detail.len() <= 200);
        prop_assert!(nack.detail.len() == detail.len() || nack.detail.len() > 196, "cut too early");
        for reply in [Reply::Nack(nack), Reply::Ack(Ack { apid, sequence_count: count })] {
            let mut buffer = [0; MAX_PACKET];
            let length = reply.encode(count, WireTime(0), &mut buffer).expect("encodes");
            prop_assert_eq!(Reply::decode(&buffer[..length]).expect("decodes").1, reply);
        }
    }

    #[test]
    fn frames_come_back_from_their_packets(
        packing in packing(),
        pixels in vec(0..4096_u16, 1..3000),
        text in vec(any::<u8>(), 0..4000),
        order in any::<bool>(),
    ) {
        let mut packets: Vec<Vec<u8>> = Vec::new();
        let mut buffer = [0; MAX_PACKET];
        for block in blocks(&pixels, packing) {
            let count = u16::try_from(block.index).expect("few blocks");
            let mut data = vec![0; packed_length(packing, block.pixels.len())];
            pack(packing, block.pixels, &mut data).expect("packs");
            let block = PixelBlock {
                frame: 9,
                index: block.index,
                first_pixel: block.first_pixel,
                count: u16::try_from(block.pixels.len()).expect("few pixels"),
                packing,
                data: &data,
            };
            let length = Reply::PixelBlock(block).encode(count, WireTime(5), &mut buffer);
            packets.push(buffer[..length.expect("encodes")].to_vec());
        }
        let parts = u16::try_from(label_texts(&text).len()).expect("few parts");
        for (part, text) in (0..).zip(label_texts(&text)) {
            let length = Reply::Labels(LabelPart { frame: 9, part, parts, text }).encode(part, WireTime(5), &mut buffer);
            packets.push(buffer[..length.expect("encodes")].to_vec());
        }
        let pixel_count = u32::try_from(pixels.len()).expect("few pixels");
        let octets = u32::try_from(text.len()).expect("short text");
        let expected = blocks_in_frame(pixel_count, packing) + u32::from(label_parts(octets).expect("few parts"));
        prop_assert_eq!(packets.len(), expected as usize);
        if order {
            packets.reverse();
        }
        let (mut frame, mut labels) = (vec![0xFFFF; pixels.len()], vec![0; text.len()]);
        for packet in &packets {
            prop_assert!(packet.len() <= MAX_PACKET);
            match Reply::decode(packet).expect("decodes").1 {
                Reply::PixelBlock(block) => {
                    let first = block.first_pixel as usize;
                    prop_assert!(block.place(&mut frame));
                    prop_assert!(!block.place(&mut frame[..first]), "beyond the frame");
                }
                Reply::Labels(label) => labels[label.offset()..][..label.text.len()].copy_from_slice(label.text),
                other => prop_assert!(false, "{other:?}"),
            }
        }
        prop_assert_eq!(frame, pixels);
        prop_assert_eq!(labels, text);
        prop_assert!(pixels_per_block(packing) < 1000 && LABEL_TEXT_PER_PART < 1400);
    }

    #[test]
    fn serial_frames_come_back_after_garbage(
        garbage in vec(any::<u8>(), 0..300),
        packets in vec(vec(prop_oneof![Just(0xC0_u8), Just(0xDB), any::<u8>()], 1..300), 1..4),
    ) {
        let mut line = garbage;
        line.push(slip::END); // whatever the garbage began ends here
        for packet in &packets {
            let before = line.len();
            slip::encode(packet, &mut |octet| line.push(octet));
            prop_assert!(line.len() - before <= slip::max_encoded_length(packet.len()));
        }
        let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
        let mut received = Vec::new();
        for octet in line {
            if let Some(Ok(packet)) = decoder.push(octet) {
                received.push(packet.to_vec());
            }
        }
        prop_assert_eq!(received, packets);
    }

    #[test]
    fn a_small_serial_decoder_takes_any_octets(line in vec(any::<u8>(), 0..2000)) {
        let mut decoder = slip::Decoder::<16>::new();
        for octet in line {
            let result = decoder.push(octet).is_some();
            prop_assert!(octet == slip::END || !result, "a frame ends at an END only");
        }
    }

    #[test]
    fn nanoseconds_survive_the_time_code(ns in 0..4_294_967_296_000_000_000_u64) {
        prop_assert_eq!(WireTime::from_tai_nanoseconds(ns).map(WireTime::tai_nanoseconds), Some(ns));
    }

    #[test]
    fn every_time_code_has_nanoseconds(code in any::<u64>()) {
        let ns = WireTime(code).tai_nanoseconds();
        if let Some(back) = WireTime::from_tai_nanoseconds(ns) {
            prop_assert!(back.0.abs_diff(code) <= 3, "half a nanosecond is 2.15 units");
        }
    }
}
