//! Reassembly of lost, repeated, reordered and wrong packets.

use crate::common::wire::{Exposed, Sender, feed};
use crate::common::{Field, Noise, Star};
use skyloop_firmware_sim::detector::{DetectorSettings, detect};
use skyloop_firmware_sim::reassembly::{Assembler, AssemblyCounts, AssemblyError, Limits};
use skyloop_firmware_sim::received::{ReceivedFrame, SealError};
use skyloop_firmware_sim::score::{Score, ScoreError, score};
use skyloop_protocols::pixels::pixels_per_block;
use skyloop_protocols::{FrameHeader, Output, PixelBlock, Reply, WireTime};

const TIME: WireTime = WireTime(7);

/// A frame of odd size, with a short last block and random pixels.
fn exposed(frame: u32) -> Exposed {
    let field = Field {
        width: 101,
        height: 67,
        ..Field::default()
    };
    let mut noise = Noise::new(u64::from(frame) + 1);
    let pixels = (0..101 * 67).map(|_| (noise.bits() & 0xFFF) as u16);
    let pixels = pixels.collect();
    Exposed {
        attitude: 40 + frame,
        ..Exposed::new(field, frame, field.grid(10, 5000.0, &mut noise), pixels)
    }
}

fn whole(exposed: &Exposed, time: WireTime) -> Vec<Vec<u8>> {
    exposed.packets(&mut Sender::default(), &Output::default(), &[], time)
}

fn packets(frame: u32) -> Vec<Vec<u8>> {
    whole(&exposed(frame), TIME)
}

fn assert_is_frame(frame: &ReceivedFrame, number: u32) {
    let sent = exposed(number);
    assert_eq!(frame.header, sent.header(&Output::default(), 0));
    assert_eq!(
        (frame.pixels(), frame.mid_exposure),
        (&sent.pixels[..], TIME)
    );
    let detections = detect(&frame.image(), &DetectorSettings::default());
    assert_eq!(frame.labels(&detections), Ok(sent.text.as_str()));
}

#[test]
fn ordered_packets_and_restarted_counters_are_reassembled() {
    let mut assembler = Assembler::default();
    let (frames, errors) = feed(&mut assembler, &packets(3));
    assert!(errors.is_empty() && frames.len() == 1);
    assert_is_frame(&frames[0], 3);
    let anew = whole(&exposed(3), WireTime(8));
    assert_eq!(feed(&mut assembler, &anew).0.len(), 1);
    assert_eq!(assembler.counts(), AssemblyCounts::default());
}

#[test]
fn any_lost_packet_leaves_only_its_frame_incomplete() {
    let whole = packets(0);
    for lost in 0..whole.len() {
        let mut assembler = Assembler::default();
        let mut rest = whole.clone();
        rest.remove(lost);
        assert!(feed(&mut assembler, &rest).0.is_empty(), "packet {lost}");
        match assembler.abandon().first() {
            None => assert_eq!(lost, 0, "only a lost header leaves no trace"),
            Some(progress) => {
                let missing = progress.blocks.1 - progress.blocks.0
                    + u32::from(progress.label_parts.1 - progress.label_parts.0)
                    + u32::from(!progress.end);
                assert_eq!((progress.frame, missing), (0, 1), "packet {lost}");
            }
        }
        let (frames, errors) = feed(&mut assembler, &packets(1));
        assert!(frames.len() == 1 && errors.is_empty());
        assert_is_frame(&frames[0], 1);
        // A dropped frame stays dropped, even if the missing packet arrives.
        assert!(lost == 0 || feed(&mut assembler, &whole).0.is_empty());
    }
}

#[test]
fn interleaved_frames_are_reassembled_and_the_oldest_is_dropped() {
    let mut assembler = Assembler::default();
    let pairs = packets(0).into_iter().zip(packets(1));
    let mixed: Vec<Vec<u8>> = pairs.flat_map(|(a, b)| [a, b]).collect();
    assert_eq!(feed(&mut assembler, &mixed).0.len(), 2);
    for frame in 2..6 {
        assert!(feed(&mut assembler, &packets(frame)[..3]).0.is_empty());
    }
    assert_eq!(assembler.counts().incomplete, 2);
    assert_eq!(assembler.abandon().len(), 2);
}

#[test]
fn wrong_pixels_are_refused() {
    let mut sent = exposed(0);
    let end = packets(0).pop().unwrap();
    sent.pixels[77] ^= 1;
    let mut packets = whole(&sent, TIME);
    *packets.last_mut().unwrap() = end;
    let mut assembler = Assembler::default();
    let (frames, errors) = feed(&mut assembler, &packets);
    let noticed = matches!(errors[..], [AssemblyError::BadPixels { frame: 0, .. }]);
    assert!(frames.is_empty() && noticed, "{errors:?}");
    assert_eq!(assembler.counts().bad_pixels, 1);
}

#[test]
fn memory_is_bounded() {
    let limits = Limits {
        pixels: 6000,
        label_bytes: 1 << 20,
        early: 4,
    };
    let mut assembler = Assembler::new(limits);
    let (frames, errors) = feed(&mut assembler, &packets(0));
    assert!(frames.is_empty());
    let error = errors[0].to_string();
    let says = "width * height is 6767, at most 6000";
    assert!(error.contains(says), "{error}");
    // Without a header, four blocks are stored at most.
    let before = assembler.counts().refused;
    for frame in 1..21 {
        feed(&mut assembler, &packets(frame)[1..3]);
    }
    assert!(assembler.counts().refused - before >= 36);
    let tight = Limits {
        label_bytes: 100,
        ..Limits::default()
    };
    let (_, errors) = feed(&mut Assembler::new(tight), &packets(0));
    assert!(errors[0].to_string().contains("label text"), "{errors:?}");
}

#[test]
fn contradictory_packets_are_refused_without_effect() {
    let mut assembler = Assembler::default();
    let whole = packets(0);
    feed(&mut assembler, &whole[..1]);
    let header = exposed(0).header(&Output::default(), 0);
    let mut sender = Sender::default();
    // Beyond the frame, and shorter than expected.
    let wrong = [100, 1_000_000, 0].map(|index| {
        let block = PixelBlock {
            frame: 0,
            index,
            first_pixel: index * pixels_per_block(header.packing) as u32,
            count: 2,
            packing: header.packing,
            data: &[0; 3],
        };
        sender.reply(&Reply::PixelBlock(block), TIME)
    });
    let other = FrameHeader { seed: 99, ..header };
    let second = sender.reply(&Reply::FrameHeader(other), TIME);
    // The right end and a wrong one.
    let ends = [whole[whole.len() - 1].clone(), sender.end(0, &[1], TIME)];
    let (frames, errors) = feed(&mut assembler, &[&wrong[..], &[second], &ends].concat());
    assert!(frames.is_empty());
    assert_eq!(errors.len(), 5, "{errors:?}");
    assert_eq!(assembler.counts().refused, 5);
    let (frames, errors) = feed(&mut assembler, &whole[1..]);
    assert!(frames.len() == 1 && errors.is_empty(), "{errors:?}");
}

#[test]
fn labels_open_only_for_detections_of_their_frame() {
    let [first, second] = [0, 1].map(|frame| {
        let (mut frames, _) = feed(&mut Assembler::default(), &packets(frame));
        frames.remove(0)
    });
    let detections = detect(&first.image(), &DetectorSettings::default());
    let (frame, detected) = (1, 0);
    let refused = SealError::OtherFrame { frame, detected };
    assert_eq!(second.labels(&detections), Err(refused));
}

/// Score of a frame of stars through packets and detector; `text` replaces its labels.
fn scored(stars: &[Star], labelled: &[Star], text: Option<&str>) -> Result<Score, ScoreError> {
    let field = Field {
        width: 64,
        height: 64,
        ..Field::default()
    };
    let pixels = field.expose(&field.electrons(stars, (0.0, 0.0)), &mut Noise::new(2));
    let mut exposed = Exposed::new(field, 0, labelled.to_vec(), pixels);
    text.into_iter().for_each(|text| exposed.text = text.into());
    let (mut frames, _) = feed(&mut Assembler::default(), &whole(&exposed, TIME));
    let frame = frames.remove(0);
    let detections = detect(&frame.image(), &DetectorSettings::default());
    score(&frame, &detections)
}

#[test]
fn scores_count_matches_misses_and_false_detections() {
    let star = |x, y, electrons| Star { x, y, electrons };
    let lone = star(20.3, 20.4, 4000.0);
    let pair = [star(40.0, 40.0, 4000.0), star(44.0, 40.0, 3000.0)];
    let edge = star(1.0, 50.0, 4000.0);
    let bright = star(50.0, 15.0, 300_000.0);
    let unlabelled = star(30.0, 55.0, 4000.0);
    let absent = star(10.0, 40.0, 4000.0);
    let faint = star(10.0, 10.0, 60.0);
    let stars = [lone, pair[0], pair[1], edge, bright, unlabelled];
    let labelled = [absent, lone, pair[0], pair[1], edge, bright, faint];
    let score = scored(&stars, &labelled, None).unwrap();
    let counts = (score.stars, score.detections, score.matches.len());
    assert_eq!(counts, (6, 6, 5), "{score:?}");
    assert_eq!(score.missed, ["HIP 0"]);
    assert_eq!(score.false_detections, 1);
    for m in &score.matches {
        let why = (m.isolated, m.saturated, m.edge);
        let (expected, counts) = match m.label.id.as_str() {
            "HIP 1" => ((true, false, false), true),
            "HIP 2" | "HIP 3" => ((false, false, false), false),
            "HIP 4" => ((true, false, true), false),
            _ => ((true, true, false), false),
        };
        assert_eq!((why, m.counts()), (expected, counts), "{m:?}");
        assert!(m.dx_px.hypot(m.dy_px) < 0.3, "{m:?}");
    }
    // A detection matches only the nearest label; a neighbour with a fortieth of its signal leaves
    // it isolated.
    let (star, neighbour) = (star(30.0, 30.0, 4000.0), star(31.2, 30.0, 100.0));
    let score = scored(&[star], &[neighbour, star], None).unwrap();
    assert_eq!((score.matches.len(), score.false_detections), (1, 0));
    assert_eq!(score.matches[0].label.id, "HIP 1");
    assert!(score.matches[0].isolated);
}

#[test]
fn unreadable_labels_are_an_error_with_line_and_column() {
    let fieldless = "{\"objects\":[{\"kind\":\"star\"}]}";
    for text in ["", "{", fieldless, "{\"objects\":7}"] {
        let error = scored(&[], &[], Some(text)).unwrap_err().to_string();
        let located = error.contains("labels of frame 0") && error.contains("column");
        assert!(located, "{text:?}: {error}");
    }
}
