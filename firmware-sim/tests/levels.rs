//! Frames at every output level: put together again, detected, scored.

mod common;

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use common::emulator::Emulator;
use common::levels::Exposed;
use common::loops::{mission, over_memory};
use common::wire::Sender;
use common::{Field, Noise, Star};
use skyloop_firmware_sim::detector::DetectorSettings;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::{FlightComputer, RunError};
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::reassembly::{Assembler, AssemblyError, Limits};
use skyloop_firmware_sim::received::{Content, ReceivedFrame};
use skyloop_firmware_sim::report::Report;
use skyloop_protocols::{
    CompressedBlock, LabelLevel, Output, PixelLevel, Positions, Reply, WireTime, packet,
};

const TIME: WireTime = WireTime(7);

/// A field with its stars and pixels.
fn exposed() -> (Field, Vec<Star>, Vec<u16>) {
    let field = Field {
        width: 101,
        height: 67,
        ..Field::default()
    };
    let mut noise = Noise::new(5);
    let stars = field.grid(16, 4000.0, &mut noise);
    let pixels = field.expose(&field.electrons(&stars, (0.0, 0.0)), &mut noise);
    (field, stars, pixels)
}

fn packets(frame: u32, output: &Output, positions: &[[u16; 2]]) -> Vec<Vec<u8>> {
    let (field, stars, pixels) = exposed();
    let exposed = Exposed {
        field: &field,
        frame,
        attitude: frame,
        stars: &stars,
        pixels: &pixels,
    };
    exposed.packets(&mut Sender::default(), output, positions, TIME)
}

fn feed(packets: &[Vec<u8>]) -> (Vec<ReceivedFrame>, Vec<AssemblyError>, Assembler) {
    let mut assembler = Assembler::new(Limits::default());
    let (mut frames, mut errors) = (Vec::new(), Vec::new());
    for packet in packets {
        let (header, reply) = Reply::decode(packet).unwrap();
        match assembler.accept(packet, &header, &reply, Instant::now()) {
            Ok(frame) => frames.extend(frame),
            Err(error) => errors.push(error),
        }
    }
    (frames, errors, assembler)
}

fn level(pixels: PixelLevel, labels: LabelLevel) -> Output {
    Output {
        pixels,
        labels,
        ..Output::default()
    }
}

#[test]
fn every_level_makes_its_frame_in_any_order_and_with_repetitions() {
    let (_, stars, pixels) = exposed();
    let mut noise = Noise::new(3);
    for pixel_level in PixelLevel::ALL.iter().copied() {
        for label_level in LabelLevel::ALL.iter().copied() {
            let output = level(pixel_level, label_level);
            let mut packets = packets(4, &output, &[]);
            packets.extend(packets.clone());
            for index in (1..packets.len()).rev() {
                packets.swap(index, noise.bits() as usize % (index + 1));
            }
            let (mut frames, errors, assembler) = feed(&packets);
            assert!(
                frames.len() == 1 && errors.is_empty(),
                "{output:?}: {errors:?}"
            );
            assert_eq!(assembler.counts().refused, 0, "{output:?}");
            let frame = frames.remove(0);
            let whole = matches!(pixel_level, PixelLevel::Frame | PixelLevel::Compressed);
            assert_eq!(frame.pixels() == pixels, whole, "{output:?}");
            let windows = if pixel_level == PixelLevel::Windows {
                stars.len()
            } else {
                0
            };
            assert_eq!(frame.windows().len(), windows, "{output:?}");
            let detections = frame.detect(&DetectorSettings::default());
            let objects = frame.objects(&detections).unwrap();
            let text = frame.labels(&detections).unwrap();
            let due = match label_level {
                LabelLevel::None => (0, false),
                LabelLevel::Objects => (12, false),
                LabelLevel::Text => (0, true),
            };
            assert_eq!((objects.len(), !text.is_empty()), due, "{output:?}");
            for (object, star) in objects.iter().zip(&stars) {
                assert_eq!((object.x_px, object.y_px), (star.x, star.y));
            }
        }
    }
}

#[test]
fn windows_are_where_they_say_and_lie_inside() {
    let (field, _, pixels) = exposed();
    let output = Output {
        window_size: 7,
        ..level(PixelLevel::Windows, LabelLevel::None)
    };
    let centres = [[0, 0], [50, 30], [100, 66]];
    let (frames, ..) = feed(&packets(0, &output, &centres));
    let windows = frames[0].windows();
    let places: Vec<_> = windows.iter().map(|w| (w.column, w.row, w.size)).collect();
    // Centres less half a window; the last may begin at 101 - 7, 67 - 7.
    assert_eq!(places, [(0, 0, 7), (47, 27, 7), (94, 60, 7)]);
    for window in windows {
        for (index, pixel) in window.pixels.iter().enumerate() {
            let (column, row) = (
                usize::from(window.column) + index % 7,
                usize::from(window.row) + index / 7,
            );
            assert_eq!(*pixel, pixels[row * field.width + column]);
        }
    }
    assert!(frames[0].shows(0.0, 0.0) && frames[0].shows(49.0, 30.0));
    assert!(!frames[0].shows(47.0, 30.0), "too near the window's edge");
    assert!(!frames[0].shows(20.0, 20.0));
}

#[test]
fn a_star_in_two_windows_is_one_detection() {
    let (_, stars, _) = exposed();
    let at = [stars[3].x.round() as u16, stars[3].y.round() as u16];
    let beside = [at[0] + 3, at[1]];
    let output = level(PixelLevel::Windows, LabelLevel::Objects);
    let (frames, ..) = feed(&packets(0, &output, &[at, beside]));
    let detections = frames[0].detect(&DetectorSettings::default());
    let [found] = detections.list() else {
        panic!("{detections:?}");
    };
    assert!((found.x_px - stars[3].x).hypot(found.y_px - stars[3].y) < 0.2);
    let score = skyloop_firmware_sim::score::score(&frames[0], &detections).unwrap();
    let counted = (
        score.matches.len(),
        score.missed.len(),
        score.false_detections,
    );
    assert_eq!(counted, (1, 0, 0), "{score:?}");
}

#[test]
fn compressed_blocks_that_leave_a_gap_or_lie_are_noticed() {
    let output = level(PixelLevel::Compressed, LabelLevel::None);
    let whole = packets(0, &output, &[]);
    assert!(whole.len() > 3, "several blocks");
    let altered = |alter: &dyn Fn(&mut CompressedBlock<'_>)| {
        let mut packets = whole.clone();
        let (header, reply) = Reply::decode(&whole[2]).unwrap();
        let Reply::Compressed(mut block) = reply else {
            panic!("{reply:?}");
        };
        alter(&mut block);
        packets[2] = Sender::default().reply(&Reply::Compressed(block), header.time);
        feed(&packets)
    };
    let (frames, errors, assembler) = altered(&|block| block.first_pixel -= 1);
    assert!(
        frames.is_empty() && matches!(errors[..], [AssemblyError::Gap { block: 1, .. }]),
        "{errors:?}"
    );
    assert_eq!(assembler.counts().bad_pixels, 1);
    // Beyond the frame, and fewer pixels than the code holds.
    for lie in [
        (&|block: &mut CompressedBlock<'_>| block.first_pixel = 101 * 67 - 1)
            as &dyn Fn(&mut CompressedBlock<'_>),
        &|block| block.count -= 1,
        &|block| block.index = 1_000,
    ] {
        let (frames, errors, _) = altered(lie);
        assert!(
            frames.is_empty() && matches!(errors[..], [AssemblyError::Contradiction { .. }]),
            "{errors:?}"
        );
    }
}

#[test]
fn parts_of_another_level_contradict_the_header() {
    let windows = level(PixelLevel::Windows, LabelLevel::Objects);
    let other = packets(0, &Output::default(), &[]);
    let mut mixed = packets(0, &windows, &[]);
    // Its end is of the same pixels.
    mixed.splice(1..1, other[1..other.len() - 1].iter().cloned());
    let (frames, errors, assembler) = feed(&mixed);
    assert_eq!(
        (frames.len(), errors.len()),
        (1, other.len() - 2),
        "{errors:?}"
    );
    assert_eq!(assembler.counts().refused as usize, errors.len());
    // A window that reaches beyond the frame.
    let mut beyond = packets(0, &windows, &[]);
    let column = packet::HEADER_LENGTH + 13;
    beyond[1][column..column + 2].copy_from_slice(&91u16.to_be_bytes());
    packet::reseal(&mut beyond[1]);
    let (frames, errors, _) = feed(&beyond);
    assert!(frames.is_empty() && errors.len() == 1, "{errors:?}");
}

#[test]
fn memory_for_windows_is_bounded_and_none_is_taken_without_pixels() {
    let limits = Limits {
        pixels: 1500,
        ..Limits::default()
    };
    for (output, refused) in [
        (level(PixelLevel::Windows, LabelLevel::Objects), true),
        (level(PixelLevel::Compressed, LabelLevel::Objects), true),
        (level(PixelLevel::None, LabelLevel::Objects), false),
    ] {
        let mut assembler = Assembler::new(limits);
        let packet = &packets(0, &output, &[])[0];
        let (header, reply) = Reply::decode(packet).unwrap();
        let taken = assembler.accept(packet, &header, &reply, Instant::now());
        assert_eq!(taken.is_err(), refused, "{output:?}: {taken:?}");
    }
}

/// Flies three frames at an output level; gives the report and the frames.
fn fly(output: Output, positions: Option<Positions>) -> (Report, Vec<ReceivedFrame>, Emulator) {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let mission = Mission {
        output: Some(output),
        positions,
        ..mission(3)
    };
    let mut frames = Vec::new();
    let report = FlightComputer::new(port, mission).run(|event| {
        match event {
            Event::Frame { frame, .. } => frames.push(frame.clone()),
            Event::Tick | Event::Progress => {}
            other => panic!("{other:?}"),
        }
        ControlFlow::Continue(())
    });
    (report.unwrap(), frames, thread.join().unwrap())
}

#[test]
fn the_flight_computer_asks_for_its_level_and_scores_what_comes() {
    let (whole, frames, _) = fly(Output::default(), None);
    assert_eq!(whole.status.unwrap().output, Output::default());
    let pixels: Vec<Vec<u16>> = frames.iter().map(|f| f.pixels().to_vec()).collect();

    let compressed = level(PixelLevel::Compressed, LabelLevel::Text);
    let (report, frames, _) = fly(compressed, None);
    assert!(frames.iter().zip(&pixels).all(|(f, p)| f.pixels() == p));
    assert_eq!(report.totals.matched, whole.totals.matched);
    let table = report.to_string();
    assert!(
        report.octets < whole.octets && table.contains("times smaller than packed"),
        "{table}"
    );

    let windows = level(PixelLevel::Windows, LabelLevel::Objects);
    let (report, frames, _) = fly(windows, None);
    assert!(
        frames
            .iter()
            .all(|f| matches!(f.content, Content::Windows(_)))
    );
    let table = report.to_string();
    assert!(table.contains("; 60 windows; 36 objects"), "{table}");
    // Twelve objects a frame lie in twenty windows.
    let totals = &report.totals;
    assert_eq!(
        (totals.matched, totals.missed, totals.false_detections),
        (36, 0, 0),
        "{table}"
    );
    assert!(totals.residual().unwrap().rms_px < 0.1, "{table}");

    let labels = level(PixelLevel::None, LabelLevel::Objects);
    let (report, frames, _) = fly(labels, None);
    assert!(frames.iter().all(|f| f.content == Content::None));
    assert_eq!((report.frames, report.contents.objects), (3, 36));
    assert_eq!((report.totals.detections, report.totals.missed), (0, 0));
    assert!(report.latencies.count() == 3 && report.to_string().contains("; 36 objects"));

    let listed = Positions::new(&[[20, 20], [64, 48]]);
    let (report, _, emulator) = fly(windows, listed);
    assert_eq!(report.contents.windows, 6);
    assert_eq!(emulator.positions, [[20, 20], [64, 48]]);
}

#[test]
fn an_output_that_does_not_fit_ends_the_run_with_the_emulators_arithmetic() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.refuses_output = Some("100,000 octets take 8.7 s at 115,200 baud, a period is 0.1 s");
    let (port, thread) = over_memory(emulator);
    let mission = Mission {
        output: Some(Output::default()),
        timeout: Duration::from_secs(5),
        ..mission(3)
    };
    let flown = FlightComputer::new(port, mission).run(|_| ControlFlow::Continue(()));
    let error = flown.unwrap_err();
    assert!(matches!(error, RunError::Refused { .. }), "{error:?}");
    let text = error.to_string();
    assert!(
        text.contains("8.7 s at 115,200 baud") && text.contains("change --output"),
        "{text}"
    );
    let emulator = thread.join().unwrap();
    assert_eq!((emulator.resets, emulator.attitudes.len()), (2, 0));
}
