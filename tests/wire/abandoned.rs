//! Frames that take long: commands are answered meanwhile, a Reset abandons them, and frames above
//! the work limit are refused.

use crate::replay::{replay, small};
use crate::support::client::Client;
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, later, memory_client, options};
use serde_json::json;
use skyloop::config::{Clock, Config, OnOverrun};
use skyloop::fidelity::{Coarser, Fidelity};
use skyloop::link;
use skyloop::link::capture::{Capture, Origin};
use skyloop_protocols::{Attitude, Command, Reason};
use std::path::Path;
use std::time::{Duration, Instant};

/// A camera whose frames may take this long, s on one core.
pub fn limited(work_limit_s: f64) -> Config {
    let mut config = small();
    (config.camera.detector.width, config.camera.detector.height) = (512, 512);
    config.camera.exposure_s = 1.0;
    config.run.work_limit_s = work_limit_s;
    config
}

/// An attitude whose frame takes minutes: limb and stars smeared over 57 degrees.
pub fn turning(sequence: u32) -> Attitude {
    Attitude {
        rates_rad_s: [0.69, 0.69, 0.0],
        ..attitude(sequence)
    }
}

/// A stepped emulator during such a frame, and its client. `file` records the packets.
pub fn during_a_long_frame(file: Option<&Path>) -> (Running, Client<MemoryLine>, Option<Capture>) {
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
    await_that("the frame is being rendered", || emulator.is_rendering());
    (emulator, client, capture)
}

/// Times of the replies to a Ping and a Reset, and until the frame is abandoned.
fn reply_times(client: &mut Client<MemoryLine>) -> [Duration; 3] {
    let requested = Instant::now();
    let status = client.status();
    let ping = requested.elapsed();
    let made = (status.next_frame, status.counters.frames_rendered);
    assert_eq!(
        made,
        (0, 0),
        "the frame was complete too early for this test"
    );
    let requested = Instant::now();
    client.done(Command::Reset);
    let reset = requested.elapsed();
    await_that("the frame is abandoned", || {
        client.counters().frames_abandoned == 1
    });
    [ping, reset, requested.elapsed()]
}

#[test]
fn commands_are_answered_during_a_frame_and_a_reset_abandons_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut client, capture) = during_a_long_frame(Some(&file));
    reply_times(&mut client);
    // The next frame has the next number.
    client.point(attitude(2), later(EPOCH, 1.0));
    let frame = client.frame();
    assert_eq!((frame.header.frame, frame.header.attitude_sequence), (1, 2));
    let counters = emulator.end();
    let counts = (counters.frames_rendered, counters.frames_abandoned);
    assert_eq!((counts, counters.frames_delivered), ((1, 1), 1));
    // A replay of the recording agrees.
    capture.unwrap().finish().unwrap();
    let again = replay(&file, limited(1e6));
    assert_eq!(again.difference, None);
    let frames: Vec<(u32, bool)> = again.frames.iter().map(|f| (f.frame, f.whole)).collect();
    assert_eq!(frames, [(1, true)]);
}

#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_replies_take_less_than_a_tenth_of_a_second() {
    const LIMIT: Duration = Duration::from_millis(100);
    let (emulator, mut client, _) = during_a_long_frame(None);
    let took = reply_times(&mut client);
    client.point(turning(2), later(EPOCH, 1.0));
    client.status();
    let requested = Instant::now();
    emulator.end();
    let end = requested.elapsed();
    println!("Ping, Reset, abandoned: {took:?}; end: {end:?}");
    assert!(took.iter().all(|took| *took < LIMIT) && end < LIMIT);
}

#[test]
fn frames_above_the_work_limit_are_refused_at_every_clock() {
    for clock in [Clock::Stepped, Clock::Wall] {
        let mut config = limited(0.3);
        config.camera.rate_hz = 0.9;
        let (emulator, mut client) = memory_client(config, clock);
        client.point(turning(1), EPOCH);
        let parts = ["more than 0.3 s of a core", "images move by up to "];
        let nack = client.refused(Reason::ValueOutOfRange, &parts);
        assert!(nack.detail.contains("raise run.work_limit_s"));
        client.point(attitude(2), later(EPOCH, 1.0));
        let frame = client.frame();
        assert_eq!((frame.header.frame, frame.header.attitude_sequence), (0, 2));
        let counters = emulator.end();
        assert!(counters.exposures_missed >= 1, "{clock:?}: {counters:?}");
    }
}

#[test]
fn frames_above_the_work_limit_are_coarsened_if_configured() {
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
