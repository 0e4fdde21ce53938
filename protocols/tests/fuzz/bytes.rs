//! Decoders of bytes: serial lines, packets, text, compressed pixels.

use crate::common;
use crate::harness::{Seen, Target};
use skyloop_protocols::can::adapter::Adapter;
use skyloop_protocols::can::slcan::{self, Line};
use skyloop_protocols::packet::{identify, reseal};
use skyloop_protocols::{Command, MAX_PACKET, Reply, rice, slip};

/// All golden vectors, as packets.
pub fn golden() -> Vec<Vec<u8>> {
    let vectors = common::golden().into_iter();
    vectors.map(|vector| vector.bytes).collect()
}

pub const SLIP: Target = Target {
    name: "slip",
    seeds: || {
        let frame = |packet: Vec<u8>| {
            let mut line = Vec::new();
            slip::encode(&packet, &mut |byte| line.push(byte));
            line
        };
        golden().into_iter().map(frame).collect()
    },
    run: |input, seen| {
        let mut decoder = slip::Decoder::<{ slip::BUFFER }>::new();
        let mut small = slip::Decoder::<16>::new();
        for byte in input {
            match decoder.push(*byte) {
                Some(Ok(packet)) => {
                    seen.note(("packet", packet.len().ilog2()));
                    let packet = packet.to_vec();
                    let mut line = Vec::new();
                    slip::encode(&packet, &mut |byte| line.push(byte));
                    let mut again = slip::Decoder::<{ slip::BUFFER }>::new();
                    let mut push = |byte| Some(again.push(byte)?.map(<[u8]>::to_vec));
                    let back = line.into_iter().find_map(&mut push);
                    assert_eq!(back, Some(Ok(packet)));
                }
                Some(Err(error)) => seen.note_text(&error.to_string()),
                None => {}
            }
            if let Some(result) = small.push(*byte) {
                assert_eq!(*byte, slip::END);
                seen.note(("small", result.is_ok()));
            }
        }
    },
};

/// An odd first byte corrects length field and CRC, so that mutations reach the fields.
pub const PACKET: Target = Target {
    name: "packet",
    seeds: || {
        let marked = |packet: Vec<u8>| [vec![1], packet].concat();
        golden().into_iter().map(marked).collect()
    },
    run: |input, seen| {
        let Some((mode, packet)) = input.split_first() else {
            return;
        };
        let mut packet = packet.to_vec();
        if mode % 2 == 1 && packet.len() >= 8 {
            let length = (packet.len() - 7) as u16;
            packet[4..6].copy_from_slice(&length.to_be_bytes());
            reseal(&mut packet);
        }
        decode(&packet, seen);
    },
};

/// Decodes at both ends; an accepted message encodes to the same bytes.
pub fn decode(packet: &[u8], seen: &mut Seen) {
    let mut buffer = [0; MAX_PACKET];
    match Command::decode(packet) {
        Ok((header, command)) => {
            seen.note(("command", command.opcode().map(|opcode| opcode.code())));
            let length = command.encode(header.sequence_count, header.time, &mut buffer);
            assert_eq!(&buffer[..length.expect("encodes")], packet);
        }
        Err(error) => seen.note_text(&error.to_string()),
    }
    match Reply::decode(packet) {
        Ok((header, reply)) => {
            seen.note(("reply", header.apid, packet.len().ilog2()));
            let length = reply.encode(header.sequence_count, header.time, &mut buffer);
            assert_eq!(&buffer[..length.expect("encodes")], packet);
            parts(&reply, seen);
        }
        Err(error) => seen.note_text(&error.to_string()),
    }
    let _ = identify(packet);
}

/// Unpacks accepted parts of a frame, as a receiver does.
fn parts(reply: &Reply<'_>, seen: &mut Seen) {
    match reply {
        Reply::PixelBlock(block) => {
            let first = block.first_pixel as usize;
            if first < 100_000 {
                let mut frame = vec![0; first + usize::from(block.count)];
                assert!(block.place(&mut frame) && !block.place(&mut frame[..first]));
                seen.note(("pixels", block.packing.code()));
            }
        }
        Reply::Compressed(block) => {
            let mut pixels = vec![0; block.count.into()];
            for bits in [8, 12, 16] {
                let is_ok = rice::decode(block.data, bits, &mut pixels).is_ok();
                seen.note(("compressed", bits, is_ok));
            }
        }
        Reply::Windows(block) => {
            assert_eq!(block.windows().count(), usize::from(block.count));
            seen.note(("windows", block.size, block.packing.code()));
        }
        Reply::Objects(part) => {
            let bytes = part.objects().flat_map(|object| object.to_bytes());
            seen.note(("objects", bytes.eq(part.data.iter().copied())));
        }
        _ => {}
    }
}

pub const SLCAN: Target = Target {
    name: "slcan",
    seeds: || {
        let lines = [
            "t10021133\r",
            "T0000010021133EA5F\r",
            "r1002\r",
            "R000001002\r",
            "b7FF9000102030405060708090A0B\r",
            "D000001001AA\r",
            "S6\rY8\rZ1\rO\rt1000\rF\rC\r",
            "V\rN\r",
            "V1013\rNA123\rF80\r",
            "z\rZ\r\r\x07",
        ];
        lines.iter().map(|line| line.as_bytes().to_vec()).collect()
    },
    run: |input, seen| {
        let (mut decoder, mut adapter) = (slcan::Decoder::new(), Adapter::new());
        for byte in input {
            let Some(result) = decoder.push(*byte) else {
                continue;
            };
            assert!([slcan::CR, slcan::BEL].contains(byte));
            match result {
                Ok(line) => {
                    note(&line, seen);
                    let mut text = Vec::new();
                    slcan::encode(&line, &mut |byte| text.push(byte));
                    assert!(text.len() <= slcan::MAX_LINE + 1);
                    let mut again = slcan::Decoder::new();
                    let back = text.iter().find_map(|byte| again.push(*byte));
                    assert_eq!(back, Some(Ok(line)));
                    let mut answers = 0;
                    let frame = adapter.take(&line, &mut |_| answers += 1);
                    let (is_open, rate) = (adapter.is_open(), adapter.bit_rate());
                    seen.note((answers, frame.is_some(), is_open, rate));
                }
                Err(error) => seen.note_text(&error.to_string()),
            }
        }
    },
};

fn note(line: &Line, seen: &mut Seen) {
    match line {
        Line::Frame { frame, time_ms } => {
            assert!(frame.is_valid());
            seen.note([frame.extended, frame.fd, frame.brs, frame.remote]);
            seen.note((frame.extended, frame.fd, frame.len, time_ms.is_some()));
        }
        Line::Command(command) => seen.note_text(&format!("{command:?}")),
        Line::Answer(answer) => seen.note(std::mem::discriminant(answer)),
    }
}

/// Bits, number of pixels (two bytes), compressed bytes. The same bytes are also compressed as
/// pixels.
pub const RICE: Target = Target {
    name: "rice",
    seeds: || {
        let mut seeds = Vec::new();
        for bits in [1, 8, 9, 12, 16] {
            for step in [0, 1, 37, 4095] {
                let max = u16::MAX >> (16 - bits);
                let pixels: Vec<u16> = (0..100_u16).map(|at| at.wrapping_mul(step) & max).collect();
                let mut data = [0; 400];
                let (taken, length) = rice::encode(&pixels, bits, &mut data);
                let head = [&[bits][..], &(taken as u16).to_be_bytes()].concat();
                seeds.push([&head[..], &data[..length]].concat());
            }
        }
        seeds
    },
    run: |input, seen| {
        let Some((&[bits, high, low], data)) = input.split_first_chunk() else {
            return;
        };
        let count = usize::from(u16::from_be_bytes([high, low])) % 4096;
        let mut pixels = vec![0; count];
        match rice::decode(data, bits, &mut pixels) {
            Ok(()) => {
                let max = u16::MAX >> (16 - bits);
                assert!(pixels.iter().all(|pixel| *pixel <= max));
                let sizes = [count, data.len()].map(usize::checked_ilog2);
                seen.note(("decoded", bits, sizes));
                round_trip(&pixels, bits, seen);
            }
            Err(error) => seen.note((bits, error.to_string())),
        }
        let bytes = data.as_chunks::<2>().0.iter();
        let pixels: Vec<u16> = bytes
            .map(|bytes| u16::from_be_bytes(*bytes) >> (high % 16))
            .collect();
        round_trip(&pixels, bits, seen);
    },
};

fn round_trip(pixels: &[u16], bits: u8, seen: &mut Seen) {
    let mut data = [0; 1368];
    let (taken, length) = rice::encode(pixels, bits, &mut data);
    let mut back = vec![0; taken];
    if taken > 0 {
        assert_eq!(rice::decode(&data[..length], bits, &mut back), Ok(()));
        assert_eq!(back, pixels[..taken]);
        seen.note(("ratio", bits, (16 * taken).div_ceil(8 * length)));
    }
}
