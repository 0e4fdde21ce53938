//! Properties over random input: damage is detected, and encoded messages decode to themselves.

use crate::common::{Vector, golden};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use skyloop_protocols::pixels::{
    blocks, blocks_in_frame, label_parts, label_texts, pack, packed_length,
};
use skyloop_protocols::{
    Ack, Command, DecodeError, EncodeError, LabelPart, MAX_PACKET, Nack, Packing, PixelBlock,
    Reason, Reply, WireTime, slip,
};
use std::sync::LazyLock;

static GOOD: LazyLock<Vec<Vector>> =
    LazyLock::new(|| golden().into_iter().filter(|v| v.has("message")).collect());

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn one_wrong_byte_is_detected(pick in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), flip in 1..=255_u8) {
        let mut packet = GOOD[pick.index(GOOD.len())].bytes.clone();
        let at = at.index(packet.len());
        packet[at] ^= flip;
        for error in [Command::decode(&packet).err(), Reply::decode(&packet).err()] {
            let detected = matches!(error, Some(DecodeError::BadCrc { .. } | DecodeError::BadLength { .. }));
            prop_assert!(detected, "{error:?}");
        }
    }

    #[test]
    fn a_buffer_too_small_is_refused(pick in any::<prop::sample::Index>(), short in 1..=MAX_PACKET) {
        let packet = &GOOD[pick.index(GOOD.len())].bytes;
        let mut buffer = vec![0; packet.len().saturating_sub(short)];
        let error = match Command::decode(packet) {
            Ok((_, command)) => command.encode(0, WireTime(0), &mut buffer),
            Err(_) => Reply::decode(packet).expect("decodes").1.encode(0, WireTime(0), &mut buffer),
        };
        let refused = matches!(error, Err(EncodeError::BufferTooSmall { .. }));
        prop_assert!(refused, "{error:?}");
    }

    #[test]
    fn answers_survive_the_round_trip(apid in 0..0x800_u16, count in 0..16384_u16, reason in select(Reason::ALL), detail in ".{0,300}") {
        let nack = Nack::new(apid, count, reason, &detail);
        prop_assert!(detail.starts_with(nack.detail) && nack.detail.len() <= 200);
        prop_assert!(nack.detail.len() == detail.len() || nack.detail.len() > 196, "cut too early");
        for reply in [Reply::Nack(nack), Reply::Ack(Ack { apid, sequence_count: count })] {
            let mut buffer = [0; MAX_PACKET];
            let length = reply.encode(count, WireTime(0), &mut buffer).expect("encodes");
            prop_assert_eq!(Reply::decode(&buffer[..length]).expect("decodes").1, reply);
        }
    }

    #[test]
    fn frames_survive_the_round_trip(
        packing in select(Packing::ALL),
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
        let bytes = u32::try_from(text.len()).expect("short text");
        let expected = blocks_in_frame(pixel_count, packing) + u32::from(label_parts(bytes).expect("few parts"));
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
    }

    #[test]
    fn serial_frames_after_garbage_are_decoded(
        garbage in vec(any::<u8>(), 0..300),
        packets in vec(vec(prop_oneof![Just(0xC0_u8), Just(0xDB), any::<u8>()], 1..300), 1..4),
    ) {
        let mut line = garbage;
        line.push(slip::END); // ends the garbage
        for packet in &packets {
            let before = line.len();
            slip::encode(packet, &mut |byte| line.push(byte));
            prop_assert!(line.len() - before <= slip::max_encoded_length(packet.len()));
        }
        let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
        let mut received = Vec::new();
        for byte in line {
            if let Some(Ok(packet)) = decoder.push(byte) {
                received.push(packet.to_vec());
            }
        }
        prop_assert_eq!(received, packets);
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
