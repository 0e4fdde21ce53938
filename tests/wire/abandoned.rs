//! A frame that takes long: commands are answered meanwhile, it can be abandoned, and it is refused
//! where it takes longer than the limit.

use crate::replay::{replay, small};
use crate::support::client::Client;
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, later, memory_client, options};
use serde_json::json;
use skyloop::config::{Clock, Config, OnOverrun};
use skyloop::fidelity::{Coarser, Fidelity};
use skyloop::link;
use skyloop::link::capture::{Capture, Origin};
use skyloop_protocols::{Attitude, Command, Reason};
use std::path::Path;
use std::time::{Duration, Instant};

/// Any answer comes sooner, on a machine that others use too; a frame of [`turning`] takes longer.
const SOON: Duration = Duration::from_secs(2);

/// Frames may cost so much, s on one core.
pub fn limited(work_limit_s: f64) -> Config {
    let mut config = small();
    (config.camera.detector.width, config.camera.detector.height) = (512, 512);
    config.camera.exposure_s = 1.0;
    config.run.work_limit_s = work_limit_s;
    config
}

/// An attitude whose frame takes minutes: the limb and all stars smeared over 57 degrees.
pub fn turning(sequence: u32) -> Attitude {
    Attitude {
        rates_rad_s: [0.69, 0.69, 0.0],
        ..attitude(sequence)
    }
}

/// An emulator in step while it renders such a frame, and its client. `file` records the packets.
pub fn in_the_midst(file: Option<&Path>) -> (Running, Client<MemoryLine>, Option<Capture>) {
    let (mut wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let links = ["memory".to_string()];
    let capture = file.map(|file| {
        let mut capture = Capture::packets(file, false, &links).unwrap();
        capture.begin(&Origin::default()).unwrap();
        capture
    });
    capture.iter().for_each(|capture| capture.tap(&mut wire, 0));
    let emulator = Running::start(limited(1e6), Clock::Stepped, wire);
    let mut client = Client::new(MemoryLine(port));
    client.point(turning(1), EPOCH);
    client.status();
    std::thread::sleep(Duration::from_millis(300));
    (emulator, client, capture)
}

/// How long an answer to a Ping takes, and then a Reset's, after which the frame is abandoned.
fn answered(client: &mut Client<MemoryLine>) -> [Duration; 3] {
    let requested = Instant::now();
    let status = client.status();
    let ping = requested.elapsed();
    let made = (status.next_frame, status.counters.frames_rendered);
    assert_eq!(made, (0, 0), "the frame was made already: this is no test");
    let requested = Instant::now();
    client.done(Command::Reset);
    let reset = requested.elapsed();
    while client.counters().frames_abandoned == 0 {
        assert!(requested.elapsed() < SOON, "the frame is not abandoned");
    }
    [ping, reset, requested.elapsed()]
}

#[test]
fn commands_are_answered_while_a_frame_is_made_and_a_reset_abandons_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut client, capture) = in_the_midst(Some(&file));
    let took = answered(&mut client);
    assert!(took.iter().all(|took| *took < SOON), "{took:?}");
    // The next frame has the next number.
    client.point(attitude(2), later(EPOCH, 1.0));
    let frame = client.frame();
    assert_eq!((frame.header.frame, frame.header.attitude_sequence), (1, 2));
    let counters = emulator.end();
    let counts = (counters.frames_rendered, counters.frames_abandoned);
    assert_eq!((counts, counters.frames_delivered), ((1, 1), 1));
    // Its recording comes again likewise.
    capture.unwrap().finish().unwrap();
    let again = replay(&file, limited(1e6));
    assert_eq!(again.difference, None);
    let frames: Vec<(u32, bool)> = again.frames.iter().map(|f| (f.frame, f.whole)).collect();
    assert_eq!(frames, [(1, true)]);
}

#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_answers_come_within_a_tenth_of_a_second() {
    const LIMIT: Duration = Duration::from_millis(100);
    let (emulator, mut client, _) = in_the_midst(None);
    let took = answered(&mut client);
    client.point(turning(2), later(EPOCH, 1.0));
    client.status();
    let requested = Instant::now();
    emulator.end();
    let end = requested.elapsed();
    println!("Ping, Reset, abandoned: {took:?}; end: {end:?}");
    assert!(took.iter().all(|took| *took < LIMIT) && end < LIMIT);
}

#[test]
fn a_frame_that_costs_too_much_is_refused_by_every_clock_and_the_next_is_made() {
    for clock in [Clock::Stepped, Clock::Wall] {
        let mut config = limited(0.3);
        config.camera.rate_hz = 0.9;
        let (emulator, mut client) = memory_client(config, clock);
        client.point(turning(1), EPOCH);
        let says = ["more than 0.3 s of a core", "images move by up to "];
        let nack = client.refused(Reason::ValueOutOfRange, &says);
        assert!(nack.detail.contains("raise run.work_limit_s"));
        client.point(attitude(2), later(EPOCH, 1.0));
        let frame = client.frame();
        assert_eq!((frame.header.frame, frame.header.attitude_sequence), (0, 2));
        let counters = emulator.end();
        assert!(counters.exposures_missed >= 1, "{clock:?}: {counters:?}");
    }
}

#[test]
fn a_frame_that_costs_too_much_is_made_coarser_where_that_is_configured() {
    let mut config = limited(0.3);
    config.fidelity = Fidelity::REFERENCE;
    config.run.on_overrun = OnOverrun::Coarsen;
    config.run.coarsen = vec![Coarser::Preset("realtime", Fidelity::REALTIME)];
    let (emulator, mut client) = memory_client(config, Clock::Stepped);
    client.point(attitude(1), EPOCH);
    let frame = client.frame();
    let label = frame.label();
    assert_eq!(label["overrun"], "coarsen");
    assert_eq!(label["fidelity"], json!({"preset": "realtime"}));
    assert_eq!(frame.end.overrun.name(), "Coarsen");
    assert_eq!(emulator.end().frames_coarsened, 1);
}
