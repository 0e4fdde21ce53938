//! Output levels: each client gets its requested level, with the pixels of the whole frame.

use crate::support::client::{Client, Received, moved};
use crate::support::line::Line;
use crate::support::{EPOCH, attitude, memory_client, scene, serial_client, udp_client};
use serde_json::Value;
use skyloop::config::Clock;
use skyloop_protocols::pixels::unpack;
use skyloop_protocols::{
    Command, FrameEnd, FrameHeader, LabelLevel, ObjectRecord, Output, PixelLevel, Positions,
    Reason, Reply, rice,
};

/// The frame at `output`, and the CRC-32 of all its pixels.
fn frame_at(
    client: &mut Client<impl Line>,
    output: Output,
    sequence: u32,
) -> (FrameHeader, Vec<Vec<u8>>, u32) {
    client.done(Command::Output(output));
    client.point(attitude(sequence), EPOCH);
    let (header, packets, end) = client.parcel();
    // Equal at all levels, and without times in stepped mode.
    let expected = FrameEnd {
        frame: header.frame,
        pixels_crc32: end.pixels_crc32,
        ..FrameEnd::default()
    };
    assert_eq!(end, expected);
    assert_eq!(header.attitude_sequence, sequence);
    let levels = (header.pixel_level, header.label_level);
    assert_eq!(levels, (output.pixels, output.labels));
    (header, packets, end.pixels_crc32)
}

fn only(pixels: PixelLevel, labels: LabelLevel) -> Output {
    Output {
        pixels,
        labels,
        ..Output::default()
    }
}

/// Labelled objects in the frame, brightest first.
fn by_brightness(whole: &Received) -> Vec<Value> {
    let label = whole.label();
    let objects = label["objects"].as_array().unwrap().iter();
    let in_frame = objects.filter(|object| object["in_frame"] == true);
    let mut objects: Vec<Value> = in_frame.cloned().collect();
    let electrons = |object: &Value| object["electrons"].as_f64().unwrap();
    objects.sort_by(|a, b| electrons(b).total_cmp(&electrons(a)));
    objects
}

/// Column and row of each window's first pixel, and its pixels.
fn windows_of(header: &FrameHeader, packets: &[Vec<u8>]) -> Vec<([u16; 2], Vec<u16>)> {
    let mut all = Vec::new();
    for (index, packet) in packets.iter().take(header.blocks as usize).enumerate() {
        let Ok((_, Reply::Windows(block))) = Reply::decode(packet) else {
            panic!("packet {index} has windows");
        };
        assert_eq!((block.frame, block.index as usize), (header.frame, index));
        assert_eq!(usize::from(block.first), all.len());
        for window in block.windows() {
            let mut pixels = vec![0; usize::from(block.size).pow(2)];
            assert_eq!(
                unpack(block.packing, window.data, &mut pixels),
                pixels.len()
            );
            all.push(([window.column, window.row], pixels));
        }
    }
    assert_eq!(all.len(), usize::from(header.windows));
    all
}

/// The same window of the whole frame.
fn crop(whole: &Received, [column, row]: [u16; 2], size: u8) -> Vec<u16> {
    let (width, size) = (usize::from(whole.header.width), usize::from(size));
    let first = |y: usize| (usize::from(row) + y) * width + usize::from(column);
    (0..size)
        .flat_map(|y| whole.pixels[first(y)..first(y) + size].to_vec())
        .collect()
}

#[test]
fn objects_are_the_brightest_of_the_label_text() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    let whole = client.good_frame(7);
    let expected = by_brightness(&whole);
    for count in [0_u16, 1, 12, 60, 65535] {
        let output = Output {
            objects: count,
            ..only(PixelLevel::None, LabelLevel::Objects)
        };
        let (header, packets, crc32) = frame_at(&mut client, output, 7);
        assert_eq!((header.blocks, crc32), (0, whole.end.pixels_crc32));
        let mut records: Vec<ObjectRecord> = Vec::new();
        for packet in &packets {
            let Ok((_, Reply::Objects(part))) = Reply::decode(packet) else {
                panic!("objects expected");
            };
            records.extend(part.objects());
        }
        assert_eq!(records.len(), expected.len().min(usize::from(count)));
        for (record, object) in records.iter().zip(&expected) {
            let id = String::from_utf8_lossy(&record.id);
            let id = id.trim_end_matches('\0');
            assert_eq!(id, object["id"].as_str().unwrap());
            assert_eq!(record.is_rso, object["kind"] == "rso", "{id}");
            assert_eq!(record.visible, object["visible"] == true, "{id}");
            // The text has six decimals of a pixel and four of an electron.
            let near = |value: f64, key: &str, error: f64| {
                let text = object[key].as_f64().unwrap();
                assert!(
                    (value - text).abs() <= error,
                    "{id} {key}: {value} and {text}"
                );
            };
            near(record.x_px, "x_px", 1e-6);
            near(record.y_px, "y_px", 1e-6);
            let electrons = f64::from(record.electrons);
            near(electrons, "electrons", 1e-4 + electrons * 1e-6);
            near(f64::from(record.snr), "snr", 1e-3);
        }
    }
}

#[test]
fn windows_surround_the_brightest_stars() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    let whole = client.good_frame(7);
    let mut stars = by_brightness(&whole);
    stars.retain(|object| object["kind"] == "star");
    for (size, count) in [(11, 20), (1, 255), (25, 3), (2, 0)] {
        let output = Output {
            window_size: size,
            windows: count,
            ..only(PixelLevel::Windows, LabelLevel::Objects)
        };
        let (header, packets, _) = frame_at(&mut client, output, 7);
        assert_eq!(
            (header.window_size, header.windows),
            (size, u16::from(count))
        );
        let windows = windows_of(&header, &packets);
        for (([column, row], pixels), star) in windows.iter().zip(&stars) {
            assert_eq!(*pixels, crop(&whole, [*column, *row], size), "{size}");
            let inside = |first: u16, centre: f64| {
                let centre = centre.round().clamp(0.0, 255.0);
                (f64::from(first)..f64::from(first) + f64::from(size)).contains(&centre)
            };
            let [x, y] = ["x_px", "y_px"].map(|key| star[key].as_f64().unwrap());
            assert!(
                inside(*column, x) && inside(*row, y),
                "{column} {row}: {x} {y}"
            );
        }
    }
}

#[test]
fn windows_surround_listed_positions_within_the_frame() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    let whole = client.good_frame(7);
    let centres = [[0, 0], [100, 50], [255, 255], [250, 3]];
    client.done(Command::Positions(Positions::new(&centres).unwrap()));
    let output = only(PixelLevel::Windows, LabelLevel::None);
    let (header, packets, _) = frame_at(&mut client, output, 7);
    let windows = windows_of(&header, &packets);
    let corners: Vec<[u16; 2]> = windows.iter().map(|(corner, _)| *corner).collect();
    // By hand: 11 columns around 100 begin at 95; at an edge they begin at 0 or 256 - 11.
    assert_eq!(corners, [[0, 0], [95, 45], [245, 245], [245, 0]]);
    for (corner, pixels) in &windows {
        assert_eq!(*pixels, crop(&whole, *corner, 11));
    }
    client.send(Command::Positions(Positions::new(&[[256, 0]]).unwrap()));
    client.refused(Reason::ValueOutOfRange, &["(256, 0)", "256 x 256"]);
    client.done(Command::Positions(Positions::new(&[]).unwrap()));
    let (header, ..) = frame_at(&mut client, output, 7);
    assert_eq!(header.windows, 20, "the brightest stars again");
}

#[test]
fn compressed_frames_are_smaller_and_equal() {
    let (_emulator, mut client) = serial_client(scene(), Clock::Stepped);
    let whole = client.good_frame(7);
    let output = only(PixelLevel::Compressed, LabelLevel::None);
    let (header, packets, _) = frame_at(&mut client, output, 7);
    let mut pixels: Vec<u16> = Vec::new();
    for packet in &packets {
        let Ok((_, Reply::Compressed(block))) = Reply::decode(packet) else {
            panic!("compressed blocks expected");
        };
        assert_eq!(block.first_pixel as usize, pixels.len(), "no gaps");
        let at = pixels.len();
        pixels.resize(at + usize::from(block.count), 0);
        rice::decode(block.data, header.bits, &mut pixels[at..]).expect("it decodes");
    }
    assert_eq!(pixels, whole.pixels);
    let bytes: usize = packets.iter().map(Vec::len).sum();
    assert!(bytes < 2 * pixels.len() / 2, "{bytes} bytes");
}

#[test]
fn packets_of_the_last_two_frames_are_resent_unchanged() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    client.window = None;
    client.point(attitude(1), EPOCH);
    let (first, packets, end) = client.parcel();
    client.point(attitude(2), EPOCH);
    let (second, ..) = client.parcel();
    let before = client.status();
    let resend = |frame, first, count| Command::Resend {
        frame,
        first,
        count,
    };
    client.send(resend(first.frame, 3, 2));
    assert_eq!([client.next(true), client.next(true)], packets[2..4]);
    // The last one with labels and the frame's end; the count exceeds the remaining packets.
    client.send(resend(first.frame, packets.len() as u32, 1000));
    assert_eq!(client.next(true), packets[packets.len() - 1]);
    let again = client.next(true);
    assert!(matches!(Reply::decode(&again), Ok((_, Reply::FrameEnd(again))) if again == end));
    client.send(resend(second.frame, 0, 1));
    let header = client.next(true);
    assert!(
        matches!(Reply::decode(&header), Ok((_, Reply::FrameHeader(again))) if again == second)
    );
    client.send(resend(second.frame, 1_000_000, u32::MAX));
    let after = client.status();
    assert_eq!(
        moved(&before.counters, &after.counters),
        [("resent_blocks", 5)]
    );
    assert_eq!(
        after.packets_sent, before.packets_sent,
        "resent packets take no credit"
    );
    client.point(attitude(3), EPOCH);
    client.parcel();
    client.send(resend(first.frame, 0, 1));
    client.refused(Reason::ValueOutOfRange, &["Resend.frame = 0"]);
}

#[test]
fn output_settings_show_in_status_until_a_reset() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    assert_eq!(client.status().output, Output::default());
    let output = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::None,
        window_size: 3,
        windows: 4,
        objects: 5,
    };
    client.done(Command::Output(output));
    assert_eq!(client.status().output, output);
    client.done(Command::Reset);
    assert_eq!(client.status().output, Output::default());
}

/// A pseudo-terminal has no rate; its URL states the rate of the line.
#[test]
fn wall_clock_output_too_large_for_the_line_is_refused_with_numbers() {
    let mut config = scene();
    config.run.output = only(PixelLevel::Windows, LabelLevel::None);
    config.camera.rate_hz = 1.0;
    let (_emulator, mut client) = serial_client(config, Clock::Wall);
    client.send(Command::Output(only(PixelLevel::Frame, LabelLevel::None)));
    let nack = client.nack();
    assert_eq!(nack.reason, Reason::ValueOutOfRange);
    // 256 x 256 pixels of 16 bits at 92,160 bytes/s: 1.42 s, and some overhead.
    for word in [
        "the frame of 1",
        "takes 1.4",
        "1 Hz leaves 1.000 s",
        "at most 0.6",
    ] {
        assert!(nack.detail.contains(word), "{word:?} in {:?}", nack.detail);
    }
    client.done(Command::FrameRate { hz: 9.0 });
    // 20 windows of 11 x 11 at 921,600 baud: 5 kB, 54 ms with their packets.
    client.send(Command::Exposure { seconds: 0.01 });
    client.next(false);
    client.send(Command::FrameRate { hz: 20.0 });
    let parts = [
        "FrameRate: 20 windows of 11 x 11 of 5",
        "takes 0.05",
        "20 Hz leaves 0.050 s",
    ];
    let nack = client.refused(Reason::ValueOutOfRange, &parts);
    assert!(nack.detail.contains("at most 17."), "{}", nack.detail);
    let centres: Vec<[u16; 2]> = (0..64).map(|n| [n, n]).collect();
    client.send(Command::Positions(Positions::new(&centres).unwrap()));
    client.refused(Reason::ValueOutOfRange, &["Positions: 64 windows"]);
    client.done(Command::Positions(Positions::new(&centres[..3]).unwrap()));
    // Three windows fit where twenty did not.
    client.done(Command::FrameRate { hz: 20.0 });
}
