//! A minute of attitudes at 10 Hz over each wire, at the output level that fits it: what arrives is what the in-process
//! link brings for the same attitude, and what does not arrive is counted.

use hifitime::Epoch;
use skyloop::attitude::Attitude;
use skyloop::config::{Clock, Config, Sequence, TimedAttitude};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::link::fault::{Book, Plan, wrap};
use skyloop::link::{self, Options, Roles};
use skyloop::serve::Server;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::received::Cutout;
use skyloop_firmware_sim::report::Report;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Counters, ObjectRecord, Output};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A minute at 10 Hz.
const FRAMES: u32 = 600;

/// The sky of the built-in scene from CASSIOPE, slowly turning.
fn config() -> Config {
    let mut config = Config::builtin().unwrap();
    // The ephemerides cover 23:35:30 to 23:36:30, light time and exposures included.
    config.camera.exposure_s = 0.05;
    let epoch = Epoch::from_gregorian_utc(2019, 6, 15, 23, 35, 30, 50_000_000);
    // X-Val: the touchstone of the conventions, RA 248.112 Dec +9.215 degrees.
    let attitude = Attitude::from_xyzw([-0.070834, -0.644137, 0.733522, -0.204975]).unwrap();
    let attitudes = vec![TimedAttitude { epoch, attitude }];
    config.sequence = Some(Sequence {
        epoch,
        frames: FRAMES,
        period_s: 0.1,
        attitudes,
        rates: [0.001, -0.002, 0.0005],
    });
    config
}

/// What came of one attitude.
#[derive(Debug, Clone, PartialEq)]
struct Delivered {
    pixels_crc32: u32,
    pixels: Vec<u16>,
    windows: Vec<Cutout>,
    objects: Vec<ObjectRecord>,
    text: String,
}

/// What came of a run.
struct Flight {
    report: Report,
    /// By the attitude's number.
    frames: BTreeMap<u32, Delivered>,
    counters: Counters,
}

/// Flies the minute over `loopback`'s link `link`, under the faults of `plan`.
fn fly(link: &str, level: &str, plan: &str) -> Flight {
    let mut config = config();
    let mut mission = flight::mission(&config).unwrap();
    mission.output = Output::preset(level);
    let options = Options {
        idle: Duration::from_secs(5),
        personality: &NATIVE,
        bus: None,
    };
    let (mut wire, port) = link::loopback(link, &options).unwrap();
    if !plan.is_empty() {
        let plan = Plan::parse("faults", plan, false).unwrap();
        let book = Arc::new(Mutex::new(Book::default()));
        wire = wrap(wire, &plan, &NATIVE, &book).unwrap();
    }
    let stop = AtomicBool::new(false);
    let emulator = Emulator::new(&mut config);
    let links = [(wire, Roles::ALL)];
    let mut server = Server::new(emulator, links, Output::default(), Clock::Stepped, &NATIVE);
    let mut frames = BTreeMap::new();
    let (report, counters) = std::thread::scope(|scope| {
        let stop = &stop;
        let emulator = scope.spawn(move || {
            server
                .run(stop, None, |_| {})
                .expect("no error of the link");
            server.close().1
        });
        let report = FlightComputer::new(port, mission).run(|event| {
            if let Event::Frame {
                frame,
                detections,
                labels,
                ..
            } = event
            {
                let delivered = Delivered {
                    pixels_crc32: frame.header.pixels_crc32,
                    pixels: frame.pixels().to_vec(),
                    windows: frame.windows().to_vec(),
                    objects: frame.objects(detections).unwrap(),
                    text: labels.unwrap_or_default().to_string(),
                };
                frames.insert(frame.header.attitude_sequence, delivered);
            }
            ControlFlow::Continue(())
        });
        stop.store(true, Ordering::Relaxed);
        (report.unwrap(), emulator.join().unwrap())
    });
    eprintln!("{link} {level}: {counters:?}\n{report}");
    Flight {
        report,
        frames,
        counters,
    }
}

/// Every attitude has its frame or is counted as lost, and every frame is the in-process link's.
fn compare(flight: &Flight, reference: &Flight) {
    let report = &flight.report;
    assert_eq!(report.frames + report.lost + report.refused, FRAMES);
    assert_eq!(flight.frames.len() as u32, report.frames);
    for (sequence, frame) in &flight.frames {
        assert!(
            *frame == reference.frames[sequence],
            "the frame of attitude {sequence} is another"
        );
    }
}

/// The label's frame number is that of the frame, not of the attitude: after an attitude that came twice they differ.
fn without_number(mut flight: Flight) -> Flight {
    for frame in flight.frames.values_mut() {
        if let Some((_, rest)) = frame.text.split_once(",\"seed\":") {
            frame.text = rest.to_string();
        }
    }
    flight
}

#[test]
fn a_minute_over_every_wire_is_the_minute_in_memory() {
    let labels = || fly("memory", "labels", "");
    let windows = || fly("memory", "windows", "");
    std::thread::scope(|scope| {
        let narrow = scope.spawn(move || {
            let reference = labels();
            let flight = fly("pty?baud=115200", "labels", "");
            compare(&flight, &reference);
            assert_eq!(flight.report.frames, FRAMES);
        });
        let middle = scope.spawn(move || {
            let reference = windows();
            for link in [
                "pty?baud=921600",
                "slcan?bitrate=1000000&load=1&baud=3000000",
            ] {
                let flight = fly(link, "windows", "");
                compare(&flight, &reference);
                assert_eq!(flight.report.frames, FRAMES);
            }
        });
        let lossy = "[[faults]]\ndirection = \"in\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"in\"\nkind = \"reorder\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"reorder\"\nvalue = 0.05\n";
        let reference = without_number(fly("memory", "frame", ""));
        let flight = without_number(fly("udp", "frame", lossy));
        compare(&flight, &reference);
        // What is lost is asked for again: all frames come in the end.
        assert_eq!(flight.report.frames, FRAMES);
        assert!(flight.counters.sequence_gaps > 0 && flight.counters.resent_blocks > 1000);
        // The pixels in memory are the light that the narrow levels show.
        let windows = windows();
        for (sequence, frame) in &windows.frames {
            let whole = &reference.frames[sequence];
            assert_eq!(frame.pixels_crc32, whole.pixels_crc32);
            for window in &frame.windows {
                let (first, size) = (usize::from(window.row), usize::from(window.size));
                let rows = whole.pixels.chunks(256).skip(first).take(size);
                let column = usize::from(window.column);
                let crop: Vec<u16> = rows
                    .flat_map(|row| row[column..column + size].to_vec())
                    .collect();
                assert_eq!(window.pixels, crop, "attitude {sequence}");
            }
        }
        narrow.join().unwrap();
        middle.join().unwrap();
    });
}
