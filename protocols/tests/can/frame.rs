//! One frame: its validity and its time on the bus.

use crate::common::Random;
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::frame::{LENGTHS, WireBits, dlc, padded_length};

fn classic(bytes: usize) -> CanFrame {
    CanFrame::new(0x123, false, &vec![0; bytes]).expect("valid")
}

fn fd(bytes: usize) -> CanFrame {
    CanFrame::new(0x123, true, &vec![0; bytes]).expect("valid")
}

fn extended(frame: CanFrame) -> CanFrame {
    CanFrame {
        extended: true,
        ..frame
    }
}

fn remote(frame: CanFrame) -> CanFrame {
    CanFrame {
        remote: true,
        ..frame
    }
}

#[test]
fn lengths_have_their_codes() {
    for (code, length) in LENGTHS.into_iter().enumerate() {
        assert_eq!(dlc(length.into()), Some(code as u8));
        assert_eq!(padded_length(length.into()), length.into());
    }
    assert_eq!([9, 13, 25, 33, 49, 65].map(dlc), [None; 6]);
    assert_eq!(
        [9, 13, 25, 33, 49, 65].map(padded_length),
        [12, 16, 32, 48, 64, 64]
    );
}

#[test]
fn invalid_frames_are_refused() {
    for (id, fd, bytes, valid) in [
        (0x7FF, false, 8, true),
        (0x800, false, 0, false),
        (0x7FF, false, 9, false),
        (0x7FF, true, 9, false), // no code
        (0x7FF, true, 65, false),
    ] {
        let frame = CanFrame::new(id, fd, &vec![0; bytes]);
        assert_eq!(frame.is_some(), valid, "{id:#x}, {bytes} bytes");
    }
    let base = classic(8);
    let with_id = |id| CanFrame { id, ..classic(8) };
    let long = CanFrame { len: 200, ..base };
    for (what, frame, valid) in [
        ("classic", base, true),
        ("29 bits", extended(with_id(0x1FFF_FFFF)), true),
        ("30 bits", extended(with_id(0x2000_0000)), false),
        ("two rates, classic", CanFrame { brs: true, ..base }, false),
        ("remote, FD", remote(fd(8)), false),
        ("200 bytes", long, false),
    ] {
        assert_eq!(frame.is_valid(), valid, "{what}");
    }
    assert_eq!(long.payload().len(), 64, "bounded");
    assert!(remote(base).payload().is_empty());
}

fn bits(nominal: u32, data: u32) -> WireBits {
    WireBits { nominal, data }
}

/// X-Val: Davis, Burns, Bril and Lukkien, "Controller Area Network (CAN) schedulability analysis",
/// Real-Time Systems 35 (2007), equations (1) and (2): at most 55 + 10 s bits with 11-bit
/// identifiers, 80 + 10 s with 29-bit ones.
#[test]
fn classic_frames_have_their_published_lengths() {
    for bytes in 0..=8 {
        let base = classic(bytes);
        let extended = extended(base);
        let s = bytes as u32;
        assert_eq!(base.bits(), bits(47 + 8 * s, 0));
        assert_eq!(base.worst_bits().nominal, 55 + 10 * s);
        assert_eq!(extended.bits().nominal, 67 + 8 * s);
        assert_eq!(extended.worst_bits().nominal, 80 + 10 * s);
    }
    let base = classic(8);
    // 135 bits at 500 kbit/s.
    assert_eq!(base.worst_bits().duration_ns(500_000, 0), 270_000);
    let error = CanFrame {
        error: true,
        ..base
    };
    assert_eq!(
        (remote(base).bits().nominal, error.worst_bits().nominal),
        (47, 23)
    );
}

/// From ISO 11898-1:2015, frame format: 64 bytes with the base identifier.
/// Nominal: SOF 1, identifier 11, RRS 1, IDE 1, FDF 1, res 1, BRS 1; ACK 2, EOF 7, intermission 3.
/// Data: ESI 1, DLC 4, data 512, stuff count 4, CRC 21, fixed stuff bits 7, CRC delimiter 1.
#[test]
fn fd_frames_have_two_rates() {
    let full = fd(64);
    let slow = CanFrame { brs: false, ..full };
    assert_eq!(fd(16).bits(), bits(29, 5 + 128 + 4 + 17 + 6 + 1));
    for (what, frame, bare, worst) in [
        // At most (17 + 5 + 512 - 1) / 4 = 133 stuff bits, 4 of them at the nominal rate.
        ("two rates", full, bits(29, 550), bits(33, 679)),
        ("one rate", slow, bits(579, 0), bits(579 + 133, 0)),
        // (36 + 5 + 512 - 1) / 4 = 138.
        (
            "29 bits",
            extended(full),
            bits(48, 550),
            bits(48 + 8, 550 + 130),
        ),
    ] {
        assert_eq!((frame.bits(), frame.worst_bits()), (bare, worst), "{what}");
    }
    let worst = full.worst_bits().duration_ns(500_000, 8_000_000);
    assert_eq!(worst, 66_000 + 84_875);
    assert!(full.bits().duration_ns(0, 0) > 0, "no division by zero");
}

/// The worst case, stuffed bit by bit: five equal bits, then alternating groups of four. Random
/// bits stay below it.
#[test]
fn the_bound_of_stuffing_is_reached() {
    let stuffed = |bits: &[bool]| {
        let (mut count, mut run, mut last) = (0, 0, None);
        for bit in bits {
            run = if last == Some(*bit) { run + 1 } else { 1 };
            last = Some(*bit);
            if run == 5 {
                // The stuff bit starts a new run.
                (count, run, last) = (count + 1, 1, Some(!bit));
            }
        }
        count
    };
    let region = 34 + 64;
    let bound = classic(8).worst_bits().nominal - classic(8).bits().nominal;
    let five_then_fours: Vec<bool> = (0..region)
        .map(|at| at > 4 && (at - 5) / 4 % 2 == 0)
        .collect();
    assert_eq!(stuffed(&five_then_fours), bound as usize);
    let mut random = Random(1);
    for _ in 0..1000 {
        let any: Vec<bool> = (0..region).map(|_| random.one_in(9)).collect();
        assert!(stuffed(&any) <= bound as usize);
    }
}
