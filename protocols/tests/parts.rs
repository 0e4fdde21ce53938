//! Each module by itself, against published values and edge cases.

use skyloop_protocols::crc::{Crc32, crc16, crc32};
use skyloop_protocols::credit::CreditAccount;
use skyloop_protocols::packet::{SEQUENCE_MODULUS, apid, identify};
use skyloop_protocols::pixels::{
    blocks, blocks_in_frame, label_parts, label_texts, pack, packed_length, pixels_per_block,
    unpack,
};
use skyloop_protocols::sequence::{GapDetector, SequenceCounts};
use skyloop_protocols::slip::{self, Decoder, END, ESC, FrameError};
use skyloop_protocols::time::TAI_1900_TO_1958_S;
use skyloop_protocols::{
    Attitude, Command, Counters, EncodeError, LabelPart, MAX_PACKET, Packing, PixelBlock, Reason,
    Reply, WireTime,
};

#[test]
fn checksums_have_their_published_check_values() {
    // X-Val: check values of CRC-16/IBM-3740 (alias CCITT-FALSE) and CRC-32/ISO-HDLC in the
    // catalogue of parametrised CRC algorithms.
    assert_eq!(crc16(b"123456789"), 0x29B1);
    assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    assert_eq!(crc16(b""), 0xFFFF);
    assert_eq!(crc32(b""), 0);
}

#[test]
fn checksums_agree_with_division_bit_by_bit_at_every_length() {
    // Up to eleven folded blocks of 128 bytes, and any rest.
    let byte = |n: u32| (n.wrapping_mul(0x9E37_79B1) >> 24) as u8;
    let bytes: Vec<u8> = (0..1450).map(byte).collect();
    for length in 0..bytes.len() {
        let (mut slow16, mut slow32) = (0xFFFF_u16, u32::MAX);
        for byte in &bytes[..length] {
            slow16 ^= u16::from(*byte) << 8;
            slow32 ^= u32::from(*byte);
            for _ in 0..8 {
                slow16 = if slow16 & 0x8000 == 0 {
                    slow16 << 1
                } else {
                    (slow16 << 1) ^ 0x1021
                };
                slow32 = if slow32 & 1 == 0 {
                    slow32 >> 1
                } else {
                    (slow32 >> 1) ^ 0xEDB8_8320
                };
            }
        }
        assert_eq!(crc16(&bytes[..length]), slow16);
        assert_eq!(crc32(&bytes[..length]), !slow32);
        let (head, tail) = bytes[..length].split_at(length / 3);
        assert_eq!(Crc32::new().update(head).update(tail).finish(), !slow32);
    }
}

#[test]
fn pixel_checksum_is_that_of_big_endian_bytes() {
    for count in 0..20 {
        let pixels: Vec<u16> = (0..count).map(|n| n * 3277).collect();
        let bytes: Vec<u8> = pixels
            .iter()
            .flat_map(|pixel| pixel.to_be_bytes())
            .collect();
        assert_eq!(Crc32::new().update_pixels(&pixels).finish(), crc32(&bytes));
    }
}

#[test]
fn time_code_of_known_instants() {
    // 2019-06-15T23:35:50 UTC: 22,445 days and 84,950 s after 1958-01-01, and 37 s of TAI - UTC.
    let seconds = 22_445 * 86_400 + 84_950 + 37;
    assert_eq!(seconds, 0x7397_DF7B); // the golden vectors' time
    // The time code holds 2^32 s.
    const BEYOND: u64 = (1 << 32) * 1_000_000_000;
    for (ns, code) in [
        (0, Some(0)),
        (2, Some(9)), // 8.59 units
        (1_500_000_000, Some(0x1_8000_0000)),
        (seconds * 1_000_000_000, Some(seconds << 32)),
        (BEYOND, None),
        (u64::MAX, None),
    ] {
        let found = WireTime::from_tai_nanoseconds(ns);
        assert_eq!(found, code.map(WireTime), "{ns}");
        assert!(
            found.is_none_or(|time| time.tai_nanoseconds() == ns),
            "{ns}"
        );
    }
    assert_eq!(WireTime(u64::MAX).tai_nanoseconds(), BEYOND);
    // NTP's era 0 begins 1900-01-01, Unix time 1970-01-01, 2,208,988,800 s later (RFC 5905, figure
    // 4). 1958 is 12 years and 3 leap days before 1970.
    assert_eq!(TAI_1900_TO_1958_S, 2_208_988_800 - (12 * 365 + 3) * 86_400);
}

#[test]
fn twelve_bit_pixels_are_packed_first_bit_first() {
    let mut data = [0; 5];
    pack(Packing::Bits12, &[0x123, 0x456, 0x789], &mut data).expect("fits");
    assert_eq!(data, [0x12, 0x34, 0x56, 0x78, 0x90]);
    let mut pixels = [0; 3];
    assert_eq!(unpack(Packing::Bits12, &data, &mut pixels), 3);
    assert_eq!(pixels, [0x123, 0x456, 0x789]);
    assert_eq!(
        pack(Packing::Bits12, &[0x1000], &mut [0; 2]),
        Err(EncodeError::PixelTooLarge)
    );
    for packing in Packing::ALL {
        let error = pack(*packing, &[1, 2], &mut [0; 5]);
        assert!(matches!(error, Err(EncodeError::Inconsistent { .. })));
    }
}

#[test]
fn unpacking_stops_where_pixels_or_bytes_end() {
    const DATA: [u8; 7] = [0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE];
    let (bits12, bits16) = (Packing::Bits12, Packing::Bits16);
    // Bytes, room for pixels, unpacked pixels.
    let cases: [(Packing, usize, usize, &[u16]); 6] = [
        (bits12, 7, 9, &[0x123, 0x456, 0x789, 0xABC]), // a byte alone is no pixel
        (bits12, 7, 3, &[0x123, 0x456, 0x789]),
        (bits12, 5, 9, &[0x123, 0x456]), // an odd pixel only if it is the last of `pixels`
        (bits16, 7, 9, &[0x1234, 0x5678, 0x9ABC]),
        (bits12, 0, 9, &[]),
        (bits16, 7, 0, &[]),
    ];
    for (packing, bytes, room, expected) in cases {
        let mut pixels = vec![0xFFFF; room];
        let count = unpack(packing, &DATA[..bytes], &mut pixels);
        assert_eq!(&pixels[..count], expected, "{packing:?}, {bytes} bytes");
    }
}

#[test]
fn blocks_are_full_and_fit_a_packet() {
    // 1400 - 15 - 2 - 15 = 1368 bytes of pixels.
    for (packing, pixels) in [(Packing::Bits12, 912), (Packing::Bits16, 684)] {
        assert_eq!(pixels_per_block(packing), pixels);
        assert_eq!(packed_length(packing, pixels), 1368);
    }
    assert_eq!(packed_length(Packing::Bits12, 3), 5);
    // Built-in cameras: 256 x 256 and 1280 x 1024.
    assert_eq!(blocks_in_frame(256 * 256, Packing::Bits16), 96);
    assert_eq!(blocks_in_frame(1280 * 1024, Packing::Bits12), 1438);
    assert_eq!(blocks_in_frame(u32::MAX, Packing::Bits16), 6_279_192);
    let lengths = blocks(&[0xFFF; 2000], Packing::Bits12).map(|b| {
        let data = vec![0; packed_length(Packing::Bits12, b.pixels.len())];
        let block = block(b.index, b.first_pixel, b.pixels.len(), &data);
        encode(Reply::PixelBlock(block)).expect("encodes")
    });
    assert!(lengths.eq([1400, 1400, 32 + 176 * 3 / 2]));
}

fn block(index: u32, first_pixel: u32, count: usize, data: &[u8]) -> PixelBlock<'_> {
    PixelBlock {
        frame: 0,
        index,
        first_pixel,
        count: count as u16,
        packing: Packing::Bits12,
        data,
    }
}

/// Encodes a packet and returns its length.
fn encode(reply: Reply<'_>) -> Result<usize, EncodeError> {
    reply.encode(0, WireTime(0), &mut [0; MAX_PACKET])
}

/// The error of a packet of 1401 bytes.
const TOO_LONG: EncodeError = EncodeError::TooLong {
    what: "packet",
    found: 1401,
    limit: 1400,
};

#[test]
fn inconsistent_blocks_are_not_encoded() {
    let long = encode(Reply::PixelBlock(block(0, 0, 914, &[0; 1371])));
    assert_eq!(long, Err(TOO_LONG));
    let short = block(0, 0, 3, &[0; 2]);
    for wrong in [block(0, 0, 0, &[]), block(1, 911, 1, &[0; 2]), short] {
        let error = encode(Reply::PixelBlock(wrong));
        assert!(
            matches!(error, Err(EncodeError::Inconsistent { .. })),
            "{wrong:?}"
        );
    }
    assert!(!short.place(&mut [0; 3]), "data shorter than count");
}

#[test]
fn label_text_is_divided_into_full_parts() {
    for (length, parts) in [
        (0, Some(0)),
        (1, Some(1)),
        (1375, Some(1)),
        (1376, Some(2)),
        (65_535 * 1375, Some(u16::MAX)),
        (65_535 * 1375 + 1, None),
    ] {
        assert_eq!(label_parts(length), parts, "{length}");
    }
    let lengths = label_texts(&[b'x'; 3000]).map(<[u8]>::len);
    assert!(lengths.eq([1375, 1375, 250]));
    let label = |part, parts, text| LabelPart {
        frame: 0,
        part,
        parts,
        text,
    };
    for (part, parts, text) in [(0, 0, "{}"), (2, 2, "{}"), (0, 1, ""), (0, 2, "{}")] {
        let error = encode(Reply::Labels(label(part, parts, text.as_bytes())));
        assert!(error.is_err(), "{part} of {parts}");
    }
    let long = encode(Reply::Labels(label(0, 1, &[b'x'; 1376])));
    assert_eq!(long, Err(TOO_LONG));
}

#[test]
fn quaternion_norm_has_a_tolerance() {
    let norms = [
        (0.0, false),
        (0.9989, false),
        (0.9991, true),
        (1.0, true),
        (1.0009, true),
    ];
    for (norm, accepted) in norms
        .into_iter()
        .chain([(1.0011, false), (2.0, false), (1e200, false)])
    {
        let attitude = Attitude {
            sequence: 0,
            q_icrf_to_body: [0.6 * norm, 0.0, 0.0, -0.8 * norm],
            rates_rad_s: [0.0; 3],
            state: None,
        };
        let reason = attitude.check().map_err(|error| error.reason());
        let expected = if accepted {
            Ok(())
        } else {
            Err(Reason::QuaternionNotUnit)
        };
        assert_eq!(reason, expected, "{norm}");
    }
}

#[test]
fn serial_frame_of_known_bytes() {
    let mut line = Vec::new();
    slip::encode(b"123456789", &mut |byte| line.push(byte));
    // The packet, then CBF43926, its CRC-32.
    assert_eq!(line, b"\xC0123456789\xCB\xF4\x39\x26\xC0");
    line.clear();
    slip::encode(&[END, ESC], &mut |byte| line.push(byte));
    assert_eq!(line[..5], [0xC0, 0xDB, 0xDC, 0xDB, 0xDD]); // RFC 1055
}

#[test]
fn serial_decoder_reports_errors_and_continues() {
    let mut decoder = Decoder::<16>::new();
    let mut feed = |line: &[u8]| -> Vec<Result<Vec<u8>, FrameError>> {
        let frames = line
            .iter()
            .filter_map(|byte| Some(decoder.push(*byte)?.map(<[u8]>::to_vec)));
        frames.collect()
    };
    let good = b"\xC0123456789\xCB\xF4\x39\x26\xC0";
    let damaged = FrameError::BadCrc32 {
        found: 0xCBF4_3926,
        expected: crc32(b"12345678X"),
    };
    assert_eq!(feed(good), [Ok(b"123456789".to_vec())]);
    assert_eq!(feed(b"\xC0\xC0\xC0"), []);
    let lines: [(&[u8], FrameError); 5] = [
        (b"1234\xC0", FrameError::TooShort { found: 4 }),
        (b"12\xDBx34567\xC0", FrameError::BadEscape { found: b'x' }),
        (b"12345\xDB\xC0", FrameError::BadEscape { found: END }),
        (b"12345678901234567\xC0", FrameError::TooLong { limit: 16 }),
        (b"12345678X\xCB\xF4\x39\x26\xC0", damaged),
    ];
    for (line, error) in lines {
        assert_eq!(feed(line), [Err(error)], "{line:02x?}");
    }
    assert_eq!(feed(good), [Ok(b"123456789".to_vec())]);
    assert!(damaged.to_string().contains("0xcbf43926"));
}

#[test]
fn sequence_counts_run_per_kind_and_wrap() {
    let mut counts = SequenceCounts::new();
    for (apid, expected) in [(apid::ACK, 0), (apid::ACK, 1), (apid::NACK, 0)] {
        assert_eq!(counts.next(apid), expected, "{apid:#x}");
    }
    for count in 2..SEQUENCE_MODULUS {
        assert_eq!(counts.next(apid::ACK), count);
    }
    assert_eq!(counts.next(apid::ACK), 0);
    assert_eq!(
        [counts.next(0x7FF), counts.next(0x7FF)],
        [0, 0],
        "unknown APID"
    );
}

#[test]
fn gaps_are_distinguished_from_late_packets() {
    let mut gaps = GapDetector::new();
    for (count, missing, what) in [
        (16380, 0, "the first"),
        (16381, 0, "the next"),
        (16383, 1, "16382"),
        (16382, 0, "late"),
        (16383, 0, "again"),
        (2, 2, "0 and 1, over the wrap"),
        (16382, 0, "late, from before the wrap"),
        (3, 0, "the next"),
    ] {
        assert_eq!(gaps.missing(apid::PIXEL_BLOCK, count), missing, "{what}");
    }
    assert_eq!(gaps.missing(apid::LABELS, 16382), 0, "another kind");
    assert_eq!(gaps.missing(apid::LABELS, 2), 3, "16383, 0 and 1");
    assert_eq!(gaps.missing(0x7FF, 5), 0, "unknown APID");
}

#[test]
fn credit_is_cumulative() {
    let mut account = CreditAccount::new();
    assert!(account.may_send(), "no limit before the first grant");
    // Grant, then number of sent packets. 1 and 4 are late datagrams.
    for (granted, sent) in [(2, 2), (1, 0), (3, 1), (6, 0), (4, 3)] {
        account.grant(granted);
        for _ in 0..sent {
            assert!(account.may_send(), "after {granted}");
            account.spend();
        }
        assert_eq!(account.may_send(), granted == 6, "after {granted}");
    }
    assert_eq!(account.sent(), 6);
    let mut invalid = CreditAccount::new();
    invalid.spend();
    for behind in [0, 1 + (1 << 31), u32::MAX] {
        assert!(!invalid.grant(behind) && invalid.may_send(), "{behind}");
    }
    assert!(invalid.grant(1) && !invalid.may_send());
    let mut account = CreditAccount::new();
    account.grant(0);
    assert!(!account.may_send(), "a grant of 0 stops the frames");
}

#[test]
fn every_reason_has_one_counter() {
    for reason in Reason::ALL {
        let mut counters = Counters::default();
        counters.refuse(*reason);
        let sum: u32 = counters.iter().map(|(_, value)| value).sum();
        assert_eq!(sum, 1, "{reason:?}");
        assert_eq!(Reason::from_code(reason.code()), Some(*reason));
    }
    let mut counters = Counters {
        bad_crc: u32::MAX,
        ..Counters::default()
    };
    counters.refuse(Reason::BadCrc);
    assert_eq!(counters.bad_crc, 0, "modulo 2^32");
}

#[test]
fn a_damaged_packet_is_identified() {
    let mut buffer = [0; MAX_PACKET];
    let length = Command::Ping
        .encode(0xFFFF, WireTime(0), &mut buffer)
        .expect("encodes");
    buffer[length - 1] ^= 1;
    assert_eq!(identify(&buffer[..length]), Some((apid::COMMAND, 16383)));
    assert_eq!(identify(&buffer[..3]), None);
}
