//! Frames put together from packets that got lost, came twice, in another order, or lie.

mod common;

use common::wire::{Sender, header, labels};
use common::{Field, Noise, Star};
use skyloop_firmware_sim::detector::{DetectorSettings, detect};
use skyloop_firmware_sim::reassembly::{Assembler, AssemblyCounts, AssemblyError, Limits};
use skyloop_firmware_sim::received::{ReceivedFrame, SealError};
use skyloop_firmware_sim::score::score;
use skyloop_protocols::{FrameHeader, PixelBlock, Reply, WireTime};
use std::time::Instant;

/// A frame of odd size: its last block is short, and its pixels are random.
fn material(frame: u32) -> (FrameHeader, Vec<u16>, String) {
    let field = Field {
        width: 101,
        height: 67,
        ..Field::default()
    };
    let mut noise = Noise::new(u64::from(frame) + 1);
    let pixels: Vec<u16> = (0..101 * 67)
        .map(|_| (noise.bits() & 0xFFF) as u16)
        .collect();
    let text = labels(&field, frame, &field.grid(10, 5000.0, &mut noise));
    (
        header(&field, frame, 40 + frame, &pixels, &text),
        pixels,
        text,
    )
}

fn packets(frame: u32) -> Vec<Vec<u8>> {
    let (header, pixels, text) = material(frame);
    Sender::default().frame(&header, &pixels, &text, WireTime(7))
}

/// Feeds packets; gives the frames that came whole and the errors.
fn feed(
    assembler: &mut Assembler,
    packets: &[Vec<u8>],
) -> (Vec<ReceivedFrame>, Vec<AssemblyError>) {
    let (mut frames, mut errors) = (Vec::new(), Vec::new());
    for packet in packets {
        let (header, reply) = Reply::decode(packet).unwrap();
        match assembler.accept(packet, &header, &reply, Instant::now()) {
            Ok(frame) => frames.extend(frame),
            Err(error) => errors.push(error),
        }
    }
    (frames, errors)
}

fn assert_is_frame(frame: &ReceivedFrame, number: u32) {
    let (header, pixels, text) = material(number);
    assert_eq!(
        (frame.header, frame.pixels(), frame.mid_exposure),
        (header, &pixels[..], WireTime(7))
    );
    let detections = detect(&frame.image(), &DetectorSettings::default());
    assert_eq!(frame.labels(&detections), Ok(text.as_str()));
}

#[test]
fn packets_in_order_make_a_frame() {
    let mut assembler = Assembler::new(Limits::default());
    let (frames, errors) = feed(&mut assembler, &packets(3));
    assert!(errors.is_empty() && frames.len() == 1);
    assert_is_frame(&frames[0], 3);
    assert_eq!(assembler.counts(), AssemblyCounts::default());
}

#[test]
fn an_emulator_that_counts_anew_is_heard() {
    let mut assembler = Assembler::new(Limits::default());
    let (header, pixels, text) = material(3);
    for time in [7, 8] {
        let packets = Sender::default().frame(&header, &pixels, &text, WireTime(time));
        assert_eq!(feed(&mut assembler, &packets).0.len(), 1, "{time}");
    }
    assert_eq!(assembler.counts(), AssemblyCounts::default());
}

#[test]
fn any_order_and_any_repetition_make_the_same_frame() {
    let mut noise = Noise::new(21);
    for round in 0..20 {
        let mut shuffled = packets(round);
        let length = shuffled.len();
        for _ in 0..5 {
            shuffled.push(shuffled[noise.bits() as usize % length].clone());
        }
        for index in (1..shuffled.len()).rev() {
            shuffled.swap(index, noise.bits() as usize % (index + 1));
        }
        let mut assembler = Assembler::new(Limits::default());
        let (frames, errors) = feed(&mut assembler, &shuffled);
        assert!(
            errors.is_empty() && frames.len() == 1,
            "round {round}: {errors:?}"
        );
        assert_is_frame(&frames[0], round);
        let counts = assembler.counts();
        assert_eq!((counts.duplicates, counts.refused), (5, 0), "round {round}");
    }
}

#[test]
fn a_lost_packet_of_any_kind_leaves_the_frame_open_and_the_next_one_whole() {
    let whole = packets(0);
    for lost in 0..whole.len() {
        let mut assembler = Assembler::new(Limits::default());
        let mut rest = whole.clone();
        rest.remove(lost);
        assert!(feed(&mut assembler, &rest).0.is_empty(), "packet {lost}");
        let given_up = assembler.abandon();
        if let Some(progress) = given_up.first() {
            let missing = progress.blocks.1 - progress.blocks.0
                + u32::from(progress.label_parts.1 - progress.label_parts.0)
                + u32::from(!progress.end);
            assert_eq!((progress.frame, missing), (0, 1), "packet {lost}");
        } else {
            assert_eq!(lost, 0, "only a lost header leaves no trace");
        }
        let (frames, errors) = feed(&mut assembler, &packets(1));
        assert!(frames.len() == 1 && errors.is_empty());
        assert_is_frame(&frames[0], 1);
        // What was given up stays given up, even if the missing packet comes after all.
        if lost > 0 {
            assert!(feed(&mut assembler, &whole).0.is_empty());
        }
    }
}

#[test]
fn frames_may_interleave_and_the_oldest_gives_way() {
    let mut assembler = Assembler::new(Limits::default());
    let (a, b) = (packets(0), packets(1));
    let mixed: Vec<Vec<u8>> = a
        .iter()
        .zip(&b)
        .flat_map(|(a, b)| [a.clone(), b.clone()])
        .collect();
    assert_eq!(feed(&mut assembler, &mixed).0.len(), 2);
    for frame in 2..6 {
        assert!(feed(&mut assembler, &packets(frame)[..3]).0.is_empty());
    }
    assert_eq!(
        (assembler.counts().incomplete, assembler.abandon().len()),
        (2, 2)
    );
}

#[test]
fn wrong_pixels_are_noticed() {
    let (header, mut pixels, text) = material(0);
    let mut sender = Sender::default();
    let end = sender.end(0, &pixels, WireTime(7));
    pixels[77] ^= 1;
    let mut packets = sender.opened(&header, &pixels, &text, WireTime(7));
    packets.push(end);
    let mut assembler = Assembler::new(Limits::default());
    let (frames, errors) = feed(&mut assembler, &packets);
    assert!(
        frames.is_empty() && matches!(errors[..], [AssemblyError::BadPixels { frame: 0, .. }]),
        "{errors:?}"
    );
    assert_eq!(assembler.counts().bad_pixels, 1);
}

#[test]
fn memory_is_bounded() {
    let mut assembler = Assembler::new(Limits {
        pixels: 6000,
        label_bytes: 1 << 20,
        early: 4,
    });
    let (frames, errors) = feed(&mut assembler, &packets(0));
    assert!(frames.is_empty());
    let error = errors[0].to_string();
    assert!(
        error.contains("width * height is 6767, at most 6000"),
        "{error}"
    );
    // Its blocks have no header: four of them are kept at most, whatever comes.
    for frame in 0..20 {
        feed(&mut assembler, &packets(frame)[1..3]);
    }
    let tight = Limits {
        label_bytes: 100,
        ..Limits::default()
    };
    let (_, errors) = feed(&mut Assembler::new(tight), &packets(0));
    assert!(errors[0].to_string().contains("label text"), "{errors:?}");
}

#[test]
fn packets_that_contradict_the_header_are_refused_and_do_no_harm() {
    let mut assembler = Assembler::new(Limits::default());
    let whole = packets(0);
    feed(&mut assembler, &whole[..1]);
    let (header, ..) = material(0);
    let size = skyloop_protocols::pixels::pixels_per_block(header.packing);
    let data = vec![0; 3000];
    let mut sender = Sender::default();
    let mut block = |index: usize, count: usize, length: usize| {
        let block = PixelBlock {
            frame: 0,
            index: index as u32,
            first_pixel: (index * size) as u32,
            count: count as u16,
            packing: header.packing,
            data: &data[..length],
        };
        sender.reply(&Reply::PixelBlock(block), WireTime(7))
    };
    // Beyond the frame; and shorter than its place in the frame asks for.
    let lies = [block(100, 2, 3), block(1_000_000, 2, 3), block(0, 2, 3)];
    let other = FrameHeader { seed: 99, ..header };
    let second = Sender::default().reply(&Reply::FrameHeader(other), WireTime(7));
    // The end, and another one.
    let ends = [
        whole[whole.len() - 1].clone(),
        Sender::default().end(0, &[1], WireTime(7)),
    ];
    let (frames, errors) = feed(&mut assembler, &[&lies[..], &[second], &ends].concat());
    assert!(frames.is_empty());
    assert_eq!(
        (errors.len(), assembler.counts().refused),
        (5, 5),
        "{errors:?}"
    );
    let (frames, errors) = feed(&mut assembler, &whole[1..]);
    assert!(frames.len() == 1 && errors.is_empty(), "{errors:?}");
}

#[test]
fn labels_open_for_the_detections_of_their_own_frame_only() {
    let mut assembler = Assembler::new(Limits::default());
    let (first, _) = feed(&mut assembler, &packets(0));
    let (second, _) = feed(&mut assembler, &packets(1));
    let detections = detect(&first[0].image(), &DetectorSettings::default());
    assert_eq!(
        second[0].labels(&detections),
        Err(SealError::OtherFrame {
            frame: 1,
            detected: 0
        })
    );
}

/// A frame of stars through packets, detector and score.
fn scored(stars: &[Star], labelled: &[Star]) -> skyloop_firmware_sim::score::Score {
    let field = Field {
        width: 64,
        height: 64,
        ..Field::default()
    };
    let pixels = field.expose(&field.electrons(stars, (0.0, 0.0)), &mut Noise::new(2));
    let text = labels(&field, 0, labelled);
    let packets = Sender::default().frame(
        &header(&field, 0, 0, &pixels, &text),
        &pixels,
        &text,
        WireTime(7),
    );
    let frame = feed(&mut Assembler::new(Limits::default()), &packets)
        .0
        .remove(0);
    let detections = detect(&frame.image(), &DetectorSettings::default());
    score(&frame, &detections).unwrap()
}

#[test]
fn the_score_knows_matches_misses_strays_and_what_counts() {
    let star = |x, y, electrons| Star { x, y, electrons };
    let lone = star(20.3, 20.4, 4000.0);
    let pair = [star(40.0, 40.0, 4000.0), star(44.0, 40.0, 3000.0)];
    let edge = star(1.0, 50.0, 4000.0);
    let bright = star(50.0, 15.0, 300_000.0);
    let unlabelled = star(30.0, 55.0, 4000.0);
    let absent = star(10.0, 40.0, 4000.0);
    let faint = star(10.0, 10.0, 60.0);
    let stars = [lone, pair[0], pair[1], edge, bright, unlabelled];
    let score = scored(
        &stars,
        &[absent, lone, pair[0], pair[1], edge, bright, faint],
    );
    assert_eq!(
        (score.stars, score.detections, score.matches.len()),
        (6, 6, 5),
        "{score:?}"
    );
    assert_eq!(
        (score.missed, score.false_detections),
        (vec!["HIP 0".to_string()], 1)
    );
    let counted: Vec<&str> = score
        .matches
        .iter()
        .filter(|m| m.counts())
        .map(|m| m.label.id.as_str())
        .collect();
    assert_eq!(counted, ["HIP 1"]);
    for m in &score.matches {
        let why = (m.isolated, m.saturated, m.edge);
        let expected = match m.label.id.as_str() {
            "HIP 1" => (true, false, false),
            "HIP 2" | "HIP 3" => (false, false, false),
            "HIP 4" => (true, false, true),
            _ => (true, true, false),
        };
        assert_eq!(why, expected, "{m:?}");
        assert!(m.dx_px.hypot(m.dy_px) < 0.3, "{m:?}");
    }
}

#[test]
fn one_detection_takes_one_label_and_the_nearest() {
    let star = Star {
        x: 30.0,
        y: 30.0,
        electrons: 4000.0,
    };
    let beside = Star {
        x: 31.2,
        y: 30.0,
        electrons: 100.0,
    };
    let score = scored(&[star], &[beside, star]);
    assert_eq!((score.matches.len(), score.false_detections), (1, 0));
    assert_eq!(score.matches[0].label.id, "HIP 1");
    assert!(
        score.matches[0].isolated,
        "a neighbour with a fortieth of the light disturbs nothing"
    );
}

#[test]
fn labels_that_cannot_be_read_are_an_error_with_the_place() {
    let field = Field {
        width: 64,
        height: 64,
        ..Field::default()
    };
    let pixels = vec![100; 64 * 64];
    for text in [
        "",
        "{",
        "{\"objects\":[{\"kind\":\"star\"}]}",
        "{\"objects\":7}",
    ] {
        let packets = Sender::default().frame(
            &header(&field, 0, 0, &pixels, text),
            &pixels,
            text,
            WireTime(7),
        );
        let frame = feed(&mut Assembler::new(Limits::default()), &packets)
            .0
            .remove(0);
        let detections = detect(&frame.image(), &DetectorSettings::default());
        let error = score(&frame, &detections).unwrap_err().to_string();
        assert!(
            error.contains("labels of frame 0") && error.contains("column"),
            "{text:?}: {error}"
        );
    }
}
