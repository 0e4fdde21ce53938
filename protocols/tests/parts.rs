//! The parts by themselves, against published values and edge cases.

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
    Attitude, Command, Counters, DecodeError, EncodeError, LabelPart, MAX_PACKET, Packing,
    PixelBlock, Reason, Reply, WireTime,
};

#[test]
fn checksums_have_their_published_check_values() {
    // X-Val: check values of CRC-16/IBM-3740 (alias CCITT-FALSE) and CRC-32/ISO-HDLC in the catalogue of parametrised
    // CRC algorithms.
    assert_eq!(crc16(b"123456789"), 0x29B1);
    assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    assert_eq!(crc16(b""), 0xFFFF);
    assert_eq!(crc32(b""), 0);
}

#[test]
fn checksums_agree_with_division_bit_by_bit_at_every_length() {
    // Of every kind of length that is folded together: up to eleven blocks of 128 and any rest.
    let octet = |n: u32| (n.wrapping_mul(0x9E37_79B1) >> 24) as u8;
    let octets: Vec<u8> = (0..1450).map(octet).collect();
    for length in 0..octets.len() {
        let (mut slow16, mut slow32) = (0xFFFF_u16, u32::MAX);
        for octet in &octets[..length] {
            slow16 ^= u16::from(*octet) << 8;
            slow32 ^= u32::from(*octet);
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
        assert_eq!(crc16(&octets[..length]), slow16);
        assert_eq!(crc32(&octets[..length]), !slow32);
        let (head, tail) = octets[..length].split_at(length / 3);
        assert_eq!(Crc32::new().update(head).update(tail).finish(), !slow32);
    }
}

#[test]
fn pixel_checksum_is_that_of_big_endian_octets() {
    for count in 0..20 {
        let pixels: Vec<u16> = (0..count).map(|n| n * 3277).collect();
        let octets: Vec<u8> = pixels
            .iter()
            .flat_map(|pixel| pixel.to_be_bytes())
            .collect();
        assert_eq!(Crc32::new().update_pixels(&pixels).finish(), crc32(&octets));
    }
}

#[test]
fn time_code_of_known_instants() {
    assert_eq!(WireTime::from_tai_nanoseconds(0), Some(WireTime(0)));
    assert_eq!(
        WireTime::from_tai_nanoseconds(1_500_000_000),
        Some(WireTime(0x1_8000_0000))
    );
    assert_eq!(WireTime(0x1_8000_0000).tai_nanoseconds(), 1_500_000_000);
    // 2019-06-15T23:35:50 UTC: 22,445 days and 84,950 s after 1958-01-01, and 37 s of TAI - UTC.
    let seconds = 22_445 * 86_400 + 84_950 + 37;
    assert_eq!(
        WireTime::from_tai_nanoseconds(seconds * 1_000_000_000),
        Some(WireTime(seconds << 32))
    );
    assert_eq!(seconds, 0x7397_DF7B); // the golden vectors' time
    // The time code holds 2^32 s and no more.
    assert_eq!(
        WireTime::from_tai_nanoseconds((1 << 32) * 1_000_000_000),
        None
    );
    assert_eq!(WireTime::from_tai_nanoseconds(u64::MAX), None);
    assert_eq!(
        WireTime(u64::MAX).tai_nanoseconds(),
        (1 << 32) * 1_000_000_000
    );
    // NTP's era 0 begins 1900-01-01, Unix time 1970-01-01, 2,208,988,800 s later (RFC 5905, figure 4): 12 years and 3
    // leap days before that is 1958.
    assert_eq!(TAI_1900_TO_1958_S, 2_208_988_800 - (12 * 365 + 3) * 86_400);
}

#[test]
fn twelve_bit_pixels_stand_first_bit_first() {
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
fn unpacking_stops_where_pixels_or_octets_end() {
    let unpack12 = |data: &[u8], pixels: &mut [u16]| unpack(Packing::Bits12, data, pixels);
    let unpack16 = |data: &[u8], pixels: &mut [u16]| unpack(Packing::Bits16, data, pixels);
    let data = [0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE];
    let mut pixels = [0xFFFF; 9];
    assert_eq!(unpack12(&data, &mut pixels), 4); // an octet alone is no pixel
    assert_eq!(pixels[..5], [0x123, 0x456, 0x789, 0xABC, 0xFFFF]);
    let mut odd = [0; 3];
    assert_eq!(unpack12(&data, &mut odd), 3);
    assert_eq!(odd, [0x123, 0x456, 0x789]);
    assert_eq!(
        unpack12(&data[..5], &mut pixels),
        3 - 1,
        "an even number asked for: pairs only"
    );
    assert_eq!(unpack16(&data, &mut pixels), 3);
    assert_eq!(pixels[..3], [0x1234, 0x5678, 0x9ABC]);
    assert_eq!(
        (unpack12(&[], &mut pixels), unpack16(&data, &mut [])),
        (0, 0)
    );
}

#[test]
fn blocks_are_full_and_fit_a_packet() {
    // 1400 - 15 - 2 - 15 = 1368 octets of pixels.
    assert_eq!(
        (
            pixels_per_block(Packing::Bits12),
            pixels_per_block(Packing::Bits16)
        ),
        (912, 684)
    );
    assert_eq!(
        (
            packed_length(Packing::Bits12, 912),
            packed_length(Packing::Bits16, 684)
        ),
        (1368, 1368)
    );
    assert_eq!(packed_length(Packing::Bits12, 3), 5);
    // Built-in cameras: 256 x 256 and 1280 x 1024.
    assert_eq!(blocks_in_frame(256 * 256, Packing::Bits16), 96);
    assert_eq!(blocks_in_frame(1280 * 1024, Packing::Bits12), 1438);
    assert_eq!(blocks_in_frame(u32::MAX, Packing::Bits16), 6_279_192);
    let lengths: Vec<usize> = blocks(&[0xFFF; 2000], Packing::Bits12)
        .map(|b| {
            let data = vec![0; packed_length(Packing::Bits12, b.pixels.len())];
            let block = block(b.index, b.first_pixel, b.pixels.len(), &data);
            encode(block).expect("encodes")
        })
        .collect();
    assert_eq!(lengths, [1400, 1400, 32 + 176 * 3 / 2]);
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

/// Octets of the block's packet.
fn encode(block: PixelBlock<'_>) -> Result<usize, EncodeError> {
    Reply::PixelBlock(block).encode(0, WireTime(0), &mut [0; MAX_PACKET])
}

#[test]
fn blocks_that_contradict_themselves_are_not_written() {
    assert!(matches!(
        encode(block(0, 0, 914, &[0; 1371])),
        Err(EncodeError::TooLong {
            found: 1401,
            limit: 1400,
            ..
        })
    ));
    for wrong in [
        block(0, 0, 0, &[]),
        block(1, 911, 1, &[0; 2]),
        block(0, 0, 3, &[0; 2]),
    ] {
        assert!(matches!(
            encode(wrong),
            Err(EncodeError::Inconsistent { .. })
        ));
    }
    let short = block(0, 0, 3, &[0; 2]);
    assert!(!short.place(&mut [0; 3]), "data shorter than count");
}

#[test]
fn label_text_is_cut_into_full_parts() {
    assert_eq!(
        (
            label_parts(0),
            label_parts(1),
            label_parts(1375),
            label_parts(1376)
        ),
        (Some(0), Some(1), Some(1), Some(2))
    );
    assert_eq!(
        (label_parts(65_535 * 1375), label_parts(65_535 * 1375 + 1)),
        (Some(u16::MAX), None)
    );
    assert_eq!(
        label_texts(&[b'x'; 3000])
            .map(<[u8]>::len)
            .collect::<Vec<_>>(),
        [1375, 1375, 250]
    );
    let mut buffer = [0; MAX_PACKET];
    for (part, parts, text) in [(0, 0, "{}"), (2, 2, "{}"), (0, 1, ""), (0, 2, "{}")] {
        let label = LabelPart {
            frame: 0,
            part,
            parts,
            text: text.as_bytes(),
        };
        assert!(
            Reply::Labels(label)
                .encode(0, WireTime(0), &mut buffer)
                .is_err(),
            "{part} of {parts}"
        );
    }
    let long = LabelPart {
        frame: 0,
        part: 0,
        parts: 1,
        text: &[b'x'; 1376],
    };
    let error = Reply::Labels(long).encode(0, WireTime(0), &mut buffer);
    assert_eq!(
        error,
        Err(EncodeError::TooLong {
            what: "packet",
            found: 1401,
            limit: 1400
        })
    );
}

#[test]
fn quaternion_is_accepted_up_to_a_thousandth_off() {
    let attitude = |norm: f64| Attitude {
        sequence: 0,
        q_icrf_to_body: [0.6 * norm, 0.0, 0.0, -0.8 * norm],
        rates_rad_s: [0.0; 3],
        state: None,
    };
    for norm in [0.9991, 1.0, 1.0009] {
        assert_eq!(attitude(norm).check(), Ok(()), "{norm}");
    }
    for norm in [0.0, 0.9989, 1.0011, 2.0, 1e200] {
        assert!(
            matches!(
                attitude(norm).check(),
                Err(DecodeError::QuaternionNotUnit { .. })
            ),
            "{norm}"
        );
    }
}

#[test]
fn serial_frame_of_known_octets() {
    let mut line = Vec::new();
    slip::encode(b"123456789", &mut |octet| line.push(octet));
    // The packet, then CBF43926, its CRC-32.
    assert_eq!(line, b"\xC0123456789\xCB\xF4\x39\x26\xC0");
    line.clear();
    slip::encode(&[END, ESC], &mut |octet| line.push(octet));
    assert_eq!(line[..5], [0xC0, 0xDB, 0xDC, 0xDB, 0xDD]); // RFC 1055
}

#[test]
fn serial_decoder_names_what_is_wrong_and_goes_on() {
    let mut decoder = Decoder::<16>::new();
    let mut feed = |line: &[u8]| -> Vec<Result<Vec<u8>, FrameError>> {
        line.iter()
            .filter_map(|octet| decoder.push(*octet).map(|frame| frame.map(<[u8]>::to_vec)))
            .collect()
    };
    let good = b"\xC0123456789\xCB\xF4\x39\x26\xC0";
    assert_eq!(feed(good), [Ok(b"123456789".to_vec())]);
    assert_eq!(feed(b"\xC0\xC0\xC0"), []);
    assert_eq!(feed(b"1234\xC0"), [Err(FrameError::TooShort { found: 4 })]);
    assert_eq!(
        feed(b"12\xDBx34567\xC0"),
        [Err(FrameError::BadEscape { found: b'x' })]
    );
    assert_eq!(
        feed(b"12345\xDB\xC0"),
        [Err(FrameError::BadEscape { found: END })]
    );
    assert_eq!(
        feed(b"12345678901234567\xC0"),
        [Err(FrameError::TooLong { limit: 16 })]
    );
    let damaged = FrameError::BadCrc32 {
        found: 0xCBF4_3926,
        expected: crc32(b"12345678X"),
    };
    assert_eq!(feed(b"12345678X\xCB\xF4\x39\x26\xC0"), [Err(damaged)]);
    assert_eq!(feed(good), [Ok(b"123456789".to_vec())]);
    assert!(damaged.to_string().contains("0xcbf43926"));
}

#[test]
fn sequence_counts_run_per_kind_and_wrap() {
    let mut counts = SequenceCounts::new();
    assert_eq!(
        [
            counts.next(apid::ACK),
            counts.next(apid::ACK),
            counts.next(apid::NACK)
        ],
        [0, 1, 0]
    );
    for _ in 2..SEQUENCE_MODULUS {
        counts.next(apid::ACK);
    }
    assert_eq!(
        (
            counts.next(apid::ACK),
            counts.next(0x7FF),
            counts.next(0x7FF)
        ),
        (0, 0, 0)
    );
}

#[test]
fn gaps_are_told_from_late_packets() {
    let mut gaps = GapDetector::new();
    let mut missing = |count| gaps.missing(apid::PIXEL_BLOCK, count);
    assert_eq!(missing(16380), 0); // the first
    assert_eq!(missing(16381), 0);
    assert_eq!(missing(16383), 1);
    assert_eq!(missing(16382), 0); // late
    assert_eq!(missing(16383), 0); // again
    assert_eq!(missing(2), 2); // 0 and 1, over the wrap
    assert_eq!(missing(16382), 0); // late, from before the wrap
    assert_eq!(missing(3), 0);
    assert_eq!(gaps.missing(apid::LABELS, 77), 0); // another kind
    assert_eq!(gaps.missing(0x7FF, 5), 0); // no kind of ours
    // The gap begins before the wrap and ends behind it: 16383, 0 and 1 are missing.
    let mut gaps = GapDetector::new();
    assert_eq!(gaps.missing(apid::LABELS, 16382), 0);
    assert_eq!(gaps.missing(apid::LABELS, 2), 3);
}

#[test]
fn credit_is_cumulative() {
    let mut account = CreditAccount::new();
    assert!(
        account.may_send(),
        "a client that never grants is not paced"
    );
    account.grant(2);
    account.spend();
    assert!(account.may_send());
    account.spend();
    assert!(!account.may_send());
    account.grant(1); // a late datagram
    assert!(!account.may_send());
    account.grant(3);
    assert!(account.may_send());
    assert_eq!(account.sent(), 2);
    let mut astray = CreditAccount::new();
    astray.spend();
    for behind in [0, 1 + (1 << 31), u32::MAX] {
        assert!(!astray.grant(behind), "{behind}");
        assert!(astray.may_send(), "not taken");
    }
    assert!(astray.grant(1) && !astray.may_send());
    account.grant(6);
    account.grant(4); // late, and still ahead of what was sent
    for _ in 2..6 {
        assert!(account.may_send());
        account.spend();
    }
    assert!(!account.may_send());

    let mut account = CreditAccount::new();
    account.grant(0);
    assert!(
        !account.may_send(),
        "a grant of nothing holds the frames back"
    );
}

#[test]
fn every_reason_has_one_counter() {
    for reason in Reason::ALL {
        let mut counters = Counters::default();
        counters.refuse(*reason);
        assert_eq!(
            counters.iter().map(|(_, value)| value).sum::<u32>(),
            1,
            "{reason:?}"
        );
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
fn a_packet_says_which_one_it_is_even_when_damaged() {
    let mut buffer = [0; MAX_PACKET];
    let length = Command::Ping
        .encode(0xFFFF, WireTime(0), &mut buffer)
        .expect("encodes");
    buffer[length - 1] ^= 1;
    assert_eq!(identify(&buffer[..length]), Some((apid::COMMAND, 16383)));
    assert_eq!(identify(&buffer[..3]), None);
}
