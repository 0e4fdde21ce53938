//! Frames at every output level: reassembled, detected, scored.

use std::ops::ControlFlow;

use crate::common::emulator::Emulator;
use crate::common::loops::{computer, mission, over_memory};
use crate::common::wire::{Exposed, Sender, feed, shuffle};
use crate::common::{Field, Noise};
use skyloop_firmware_sim::detector::DetectorSettings;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::RunError;
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::reassembly::{Assembler, AssemblyError, Limits};
use skyloop_firmware_sim::received::{Content, ReceivedFrame};
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::score::score;
use skyloop_protocols::{
    CompressedBlock, LabelLevel, Output, PixelLevel, Positions, Reply, WireTime, packet,
};

fn exposed(frame: u32) -> Exposed {
    let field = Field {
        width: 101,
        height: 67,
        ..Field::default()
    };
    let mut noise = Noise::new(5);
    let stars = field.grid(16, 4000.0, &mut noise);
    let pixels = field.expose(&field.electrons(&stars, (0.0, 0.0)), &mut noise);
    Exposed::new(field, frame, stars, pixels)
}

fn packets(frame: u32, output: &Output, positions: &[[u16; 2]]) -> Vec<Vec<u8>> {
    exposed(frame).packets(&mut Sender::default(), output, positions, WireTime(7))
}

fn level(pixels: PixelLevel, labels: LabelLevel) -> Output {
    Output {
        pixels,
        labels,
        ..Output::default()
    }
}

#[test]
fn every_level_is_reassembled_from_shuffled_duplicates() {
    let sent = exposed(4);
    let mut noise = Noise::new(3);
    let levels = PixelLevel::ALL.iter();
    let levels = levels.flat_map(|pixels| LabelLevel::ALL.iter().map(|l| level(*pixels, *l)));
    for output in levels {
        let mut packets = packets(4, &output, &[]);
        let sent_twice = packets.len() as u64;
        packets.extend(packets.clone());
        shuffle(&mut packets, &mut noise);
        let mut assembler = Assembler::default();
        let (mut frames, errors) = feed(&mut assembler, &packets);
        assert!(errors.is_empty(), "{output:?}: {errors:?}");
        let counts = assembler.counts();
        let found = (frames.len(), counts.refused, counts.duplicates);
        assert_eq!(found, (1, 0, sent_twice), "{output:?}");
        let frame = frames.remove(0);
        let is_whole = matches!(output.pixels, PixelLevel::Frame | PixelLevel::Compressed);
        assert_eq!(frame.pixels() == sent.pixels, is_whole, "{output:?}");
        let has_windows = usize::from(output.pixels == PixelLevel::Windows);
        assert_eq!(frame.windows().len(), has_windows * sent.stars.len());
        let detections = frame.detect(&DetectorSettings::default());
        let objects = frame.objects(&detections).unwrap();
        let text = frame.labels(&detections).unwrap();
        let due = match output.labels {
            LabelLevel::None => (0, ""),
            LabelLevel::Objects => (12, ""),
            LabelLevel::Text => (0, &sent.text[..]),
        };
        assert_eq!((objects.len(), text), due, "{output:?}");
        for (object, star) in objects.iter().zip(&sent.stars) {
            assert_eq!((object.x_px, object.y_px), (star.x, star.y));
        }
    }
}

#[test]
fn windows_are_at_their_positions_within_the_frame() {
    let sent = exposed(0);
    let output = Output {
        window_size: 7,
        ..level(PixelLevel::Windows, LabelLevel::None)
    };
    let centres = [[0, 0], [50, 30], [100, 66]];
    let (frames, _) = feed(&mut Assembler::default(), &packets(0, &output, &centres));
    let windows = frames[0].windows();
    let corners: Vec<_> = windows.iter().map(|w| (w.column, w.row, w.size)).collect();
    // Centres minus half a window; the last window begins at 101 - 7, 67 - 7 at most.
    assert_eq!(corners, [(0, 0, 7), (47, 27, 7), (94, 60, 7)]);
    for window in windows {
        let (column, row) = (usize::from(window.column), usize::from(window.row));
        for (offset, pixel) in window.pixels.iter().enumerate() {
            let place = (row + offset / 7) * sent.field.width + column + offset % 7;
            assert_eq!(*pixel, sent.pixels[place]);
        }
    }
    assert!(frames[0].shows(0.0, 0.0) && frames[0].shows(49.0, 30.0));
    assert!(!frames[0].shows(47.0, 30.0), "too near the window's edge");
    assert!(!frames[0].shows(20.0, 20.0));
}

#[test]
fn stars_in_two_windows_are_detected_once() {
    let star = exposed(0).stars[3];
    let at = [star.x.round() as u16, star.y.round() as u16];
    let output = level(PixelLevel::Windows, LabelLevel::Objects);
    let packets = packets(0, &output, &[at, [at[0] + 3, at[1]]]);
    let (frames, _) = feed(&mut Assembler::default(), &packets);
    let detections = frames[0].detect(&DetectorSettings::default());
    let [found] = detections.list() else {
        panic!("{detections:?}");
    };
    assert!((found.x_px - star.x).hypot(found.y_px - star.y) < 0.2);
    let score = score(&frames[0], &detections).unwrap();
    let (matches, missed) = (score.matches.len(), score.missed.len());
    let counted = (matches, missed, score.false_detections);
    assert_eq!(counted, (1, 0, 0), "{score:?}");
}

#[test]
fn wrong_compressed_blocks_are_refused() {
    let whole = packets(0, &level(PixelLevel::Compressed, LabelLevel::None), &[]);
    assert!(whole.len() > 3, "several blocks");
    let altered = |alter: fn(&mut CompressedBlock<'_>)| {
        let mut packets = whole.clone();
        let (header, reply) = Reply::decode(&whole[2]).unwrap();
        let Reply::Compressed(mut block) = reply else {
            panic!("{reply:?}");
        };
        alter(&mut block);
        packets[2] = Sender::default().reply(&Reply::Compressed(block), header.time);
        let mut assembler = Assembler::default();
        let (frames, errors) = feed(&mut assembler, &packets);
        assert!(frames.is_empty());
        (errors, assembler.counts().bad_pixels)
    };
    let (errors, bad) = altered(|block| block.first_pixel -= 1);
    let gap = matches!(errors[..], [AssemblyError::Gap { block: 1, .. }]);
    assert!(gap && bad == 1, "{errors:?}");
    // Beyond the frame, fewer pixels than the code holds, a wrong index.
    let changes: [fn(&mut CompressedBlock<'_>); 3] = [
        |block| block.first_pixel = 101 * 67 - 1,
        |block| block.count -= 1,
        |block| block.index = 1_000,
    ];
    for change in changes {
        let (errors, _) = altered(change);
        let refused = matches!(errors[..], [AssemblyError::Contradiction { .. }]);
        assert!(refused, "{errors:?}");
    }
}

#[test]
fn parts_of_another_level_are_refused() {
    let windows = level(PixelLevel::Windows, LabelLevel::Objects);
    let other = packets(0, &Output::default(), &[]);
    let mut mixed = packets(0, &windows, &[]);
    // The FrameEnd of the same pixels.
    mixed.splice(1..1, other[1..other.len() - 1].iter().cloned());
    let mut assembler = Assembler::default();
    let (frames, errors) = feed(&mut assembler, &mixed);
    assert_eq!((frames.len(), errors.len()), (1, other.len() - 2));
    assert_eq!(assembler.counts().refused as usize, errors.len());
    // A window that reaches beyond the frame.
    let mut beyond = packets(0, &windows, &[]);
    let column = packet::HEADER_LENGTH + 13;
    beyond[1][column..column + 2].copy_from_slice(&91u16.to_be_bytes());
    packet::reseal(&mut beyond[1]);
    let (frames, errors) = feed(&mut Assembler::default(), &beyond);
    assert!(frames.is_empty() && errors.len() == 1, "{errors:?}");
}

#[test]
fn memory_is_bounded_at_every_pixel_level() {
    let limits = Limits {
        pixels: 1500,
        ..Limits::default()
    };
    for (pixels, refused) in [
        (PixelLevel::Windows, true),
        (PixelLevel::Compressed, true),
        (PixelLevel::None, false),
    ] {
        let header = &packets(0, &level(pixels, LabelLevel::Objects), &[])[..1];
        let (_, errors) = feed(&mut Assembler::new(limits), header);
        assert_eq!(!errors.is_empty(), refused, "{pixels:?}: {errors:?}");
    }
}

/// Runs three frames at an output level. Returns report, frames and emulator.
fn run(output: Output, positions: Option<Positions>) -> (Report, Vec<ReceivedFrame>, Emulator) {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let mission = Mission {
        output: Some(output),
        positions,
        ..mission(3)
    };
    let mut frames = Vec::new();
    let report = computer(port, mission).run(|event| {
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
fn requested_levels_are_received_and_scored() {
    let (whole, frames, _) = run(Output::default(), None);
    assert_eq!(whole.status.unwrap().output, Output::default());
    let pixels: Vec<Vec<u16>> = frames.iter().map(|f| f.pixels().to_vec()).collect();

    let compressed = level(PixelLevel::Compressed, LabelLevel::Text);
    let (report, frames, _) = run(compressed, None);
    assert!(frames.iter().zip(&pixels).all(|(f, p)| f.pixels() == p));
    assert_eq!(report.totals.matched, whole.totals.matched);
    let table = report.to_string();
    assert!(table.contains("times smaller than packed"), "{table}");
    assert!(report.bytes < whole.bytes, "{table}");

    let windows = level(PixelLevel::Windows, LabelLevel::Objects);
    let (report, frames, _) = run(windows, None);
    let are_windows = |f: &ReceivedFrame| matches!(f.content, Content::Windows(_));
    assert!(frames.iter().all(are_windows));
    let table = report.to_string();
    assert!(table.contains("; 60 windows; 36 objects"), "{table}");
    // The frame's twelve objects lie within its twenty windows.
    let totals = &report.totals;
    let counts = (totals.matched, totals.missed, totals.false_detections);
    assert_eq!(counts, (36, 0, 0), "{table}");
    assert!(totals.residual().unwrap().rms_px < 0.1, "{table}");

    let (report, frames, _) = run(level(PixelLevel::None, LabelLevel::Objects), None);
    assert!(frames.iter().all(|f| f.content == Content::None));
    assert_eq!((report.frames, report.contents.objects), (3, 36));
    assert_eq!((report.totals.detections, report.totals.missed), (0, 0));
    assert!(report.latencies.count() == 3 && report.to_string().contains("; 36 objects"));

    let (report, _, emulator) = run(windows, Positions::new(&[[20, 20], [64, 48]]));
    assert_eq!(report.contents.windows, 6);
    assert_eq!(emulator.positions, [[20, 20], [64, 48]]);
}

#[test]
fn refused_outputs_end_the_run_with_the_emulators_reason() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.refuses_output = Some("100,000 octets take 8.7 s at 115,200 baud, a period is 0.1 s");
    let (port, thread) = over_memory(emulator);
    let mission = Mission {
        output: Some(Output::default()),
        ..mission(3)
    };
    let error = crate::common::loops::run_and_print(computer(port, mission)).unwrap_err();
    assert!(matches!(error, RunError::Refused { .. }), "{error:?}");
    let text = error.to_string();
    assert!(text.contains("8.7 s at 115,200 baud"), "{text}");
    assert!(text.contains("change --output"), "{text}");
    let emulator = thread.join().unwrap();
    assert_eq!((emulator.resets, emulator.attitudes.len()), (2, 0));
}
