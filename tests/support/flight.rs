//! A minute of attitudes at 10 Hz over a link, and the comparison with the same minute over another
//! link.
#![allow(dead_code, reason = "each test program uses its own part of this")]

use hifitime::Epoch;
use skyloop::attitude::Attitude;
use skyloop::config::{Clock, Config, Sequence, TimedAttitude};
use skyloop::engine::Emulator;
use skyloop::link::fault::{BusFaults, FaultLog, Plan, wrap};
use skyloop::link::{self, Airtime, BothEnds, BusInstruments, Options, Roles};
use skyloop::serve::{Ended, Server};
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
use std::time::{Duration, Instant};

/// The flown sequence: the sky of the built-in scene from CASSIOPE, slowly turning, at 10 Hz.
#[derive(Clone, Copy)]
pub struct Course {
    /// Number of attitudes.
    pub frames: u32,
    /// Columns and rows of the centre of the detector.
    pub side: usize,
}

/// A minute with the whole detector.
pub const MINUTE: Course = Course {
    frames: 600,
    side: 256,
};

fn config(course: Course) -> Config {
    let mut config = Config::builtin().unwrap();
    let (camera, side) = (&mut config.camera, course.side);
    (camera.detector.width, camera.detector.height) = (side, side);
    camera.optics.principal_px = [(side as f64 - 1.0) / 2.0; 2];
    // The ephemerides cover 23:35:30 to 23:36:30, light time and exposures included.
    config.camera.exposure_s = 0.05;
    let epoch = Epoch::from_gregorian_utc(2019, 6, 15, 23, 35, 30, 50_000_000);
    // X-Val: the touchstone of the conventions, RA 248.112 Dec +9.215 degrees.
    let attitude = Attitude::from_xyzw([-0.070834, -0.644137, 0.733522, -0.204975]).unwrap();
    let attitudes = vec![TimedAttitude { epoch, attitude }];
    config.sequence = Some(Sequence {
        epoch,
        frames: course.frames,
        period_s: 0.1,
        attitudes,
        look_at: None,
        attitude_file: None,
        rates: [0.001, -0.002, 0.0005],
    });
    config
}

/// The frame of one attitude.
#[derive(Debug, Clone, PartialEq)]
pub struct Delivered {
    pub pixels_crc32: u32,
    pub pixels: Vec<u16>,
    pub windows: Vec<Cutout>,
    pub objects: Vec<ObjectRecord>,
    pub text: String,
}

/// The result of a run.
pub struct Flight {
    pub report: Report,
    /// Frames by the number of their attitude.
    pub frames: BTreeMap<u32, Delivered>,
    pub counters: Counters,
    /// Time from the first frame to the last.
    pub took: Duration,
    /// Shortest time from one frame to the next, for rendering and transmission.
    pub shortest: Duration,
    /// The link's airtime of packets.
    pub airtime: Option<Airtime>,
}

/// Both ends of `link`, with the faults of `plan`.
fn both_ends(link: &str, plan: &str) -> BothEnds {
    let (plan, book) = (Plan::parse("faults", plan, false).unwrap(), Arc::default());
    let (mut wire, port) = link::loopback(link, &options(None)).unwrap();
    if !plan.is_empty() {
        wire = wrap(wire, &plan, &NATIVE, &book).unwrap();
    }
    (wire, port)
}

/// The options of a link; on a bus, with these faults, which are recorded in the book.
pub fn options(faults: Option<(Plan, Arc<Mutex<FaultLog>>)>) -> Options {
    Options {
        idle: Duration::from_secs(5),
        personality: &NATIVE,
        bus: faults.map(|(plan, book)| BusInstruments {
            faults: true,
            at: Arc::new(move |address, tally| {
                let faults = BusFaults::new(address, tally, &plan, &NATIVE, &book);
                Box::new(move |bus| faults.around(bus))
            }),
        }),
    }
}

/// Flies over the loopback link `link` with the faults of `plan`.
pub fn fly(course: Course, link: &str, level: &str, plan: &str) -> Flight {
    fly_between(course, link, both_ends(link, plan), level, |_| {})
}

/// Flies between two ends; `seen` gets the number of each attitude whose frame has arrived.
pub fn fly_between(
    course: Course,
    link: &str,
    (wire, port): BothEnds,
    level: &str,
    mut seen: impl FnMut(u32),
) -> Flight {
    let mut config = config(course);
    let mut mission = skyloop::flight::mission(&config).unwrap();
    mission.output = Output::preset(level);
    let airtime = wire.airtime.clone();
    let stop = AtomicBool::new(false);
    let emulator = Emulator::new(&mut config);
    let links = [(wire, Roles::ALL)];
    let mut server = Server::new(emulator, links, Output::default(), Clock::Stepped, &NATIVE);
    let mut frames = BTreeMap::new();
    let mut times = Vec::new();
    let (report, counters) = std::thread::scope(|scope| {
        let stop = &stop;
        let emulator = scope.spawn(move || {
            assert_ne!(server.run(stop, None, |_| {}), Ended::Panicked);
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
                times.push(Instant::now());
                let delivered = Delivered {
                    pixels_crc32: frame.end.pixels_crc32,
                    pixels: frame.pixels().to_vec(),
                    windows: frame.windows().to_vec(),
                    objects: frame.objects(detections).unwrap(),
                    text: labels.unwrap_or_default().to_string(),
                };
                frames.insert(frame.header.attitude_sequence, delivered);
                seen(frame.header.attitude_sequence);
            }
            ControlFlow::Continue(())
        });
        stop.store(true, Ordering::Relaxed);
        (report.unwrap(), emulator.join().unwrap())
    });
    let between = times.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest = between.clone().min().unwrap_or_default();
    let took = between.sum();
    println!("{link} {level}: {took:.1?}, {shortest:.1?} a frame at least; {counters:?}\n{report}");
    Flight {
        report,
        frames,
        counters,
        took,
        shortest,
        airtime,
    }
}

impl Flight {
    /// The link's airtime of a frame of 20 windows and 12 objects.
    // X-Val: packets of a header, four times five windows, and the objects: 90, 1260 and 673 bytes
    // (src/live/serve/budget.rs).
    pub fn windows_airtime(&self) -> Duration {
        let airtime = self.airtime.as_ref().unwrap();
        airtime(90) + 4 * airtime(1260) + airtime(673)
    }
}

/// Asserts that every attitude has its frame or is counted as lost, and that every frame equals the
/// reference.
pub fn compare(flight: &Flight, reference: &Flight) {
    let report = &flight.report;
    assert_eq!(
        report.frames + report.lost + report.refused,
        report.requested
    );
    assert_eq!(flight.frames.len() as u32, report.frames);
    for (sequence, frame) in &flight.frames {
        assert!(
            *frame == reference.frames[sequence],
            "the frame of attitude {sequence} differs"
        );
    }
}

/// Removes the frame numbers from the labels: after a repeated attitude they differ from its
/// number.
pub fn without_number(mut flight: Flight) -> Flight {
    for frame in flight.frames.values_mut() {
        if let Some((_, rest)) = frame.text.split_once(",\"seed\":") {
            frame.text = rest.to_string();
        }
    }
    flight
}
