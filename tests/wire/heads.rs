//! Further cameras of one vehicle: shared and separate state.

use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{
    EPOCH, attitude, await_that, emulator, later, options, quick, seconds, system_time,
};
use crate::table::rows;
use nalgebra::Vector3;
use skyloop::attitude::Attitude;
use skyloop::config::{Clock, Config};
use skyloop::link::{self, Roles};
use skyloop::load::Folder;
use skyloop::serve::{Ended, Server};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Counters, Reason, SyncState};
use std::sync::atomic::{AtomicBool, Ordering};

const OUTPUT_ROLES: Roles = Roles {
    truth: false,
    ..Roles::ALL
};

/// Runs two cameras of 64 x 64 pixels at 20 Hz, the second rolled by 90 deg relative to the first,
/// with a client each. Returns their counters.
fn run_two(
    clock: Clock,
    flight: impl FnOnce(Client<MemoryLine>, Client<MemoryLine>),
) -> [Counters; 2] {
    let mut config = quick(20.0);
    let mut camera = config.camera.clone();
    let half = 0.5_f64.sqrt();
    camera.mounting = Attitude::from_xyzw([0.0, 0.0, half, half]).unwrap();
    let (wire, port) = link::loopback("memory", &options(60.0)).unwrap();
    let (own, second_port) = link::loopback("memory", &options(60.0)).unwrap();
    let emulator = emulator(&mut config);
    let further = emulator.further_camera(&camera, 1);
    let links = [(wire, Roles::ALL)];
    let mut server = Server::new(emulator, links, config.run.output, clock, &NATIVE);
    let mut head = server.head(further, [(own, OUTPUT_ROLES)], &config.run);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let served = scope.spawn(|| {
            assert_ne!(server.run(&stop, None, |_| {}), Ended::Panicked);
            server.close().1
        });
        let further = scope.spawn(|| {
            assert_ne!(head.run(&stop, None, |_| {}), Ended::Panicked);
            head.close().1
        });
        let [first, second] = [port, second_port].map(|port| Client::new(MemoryLine(port)));
        flight(first, second);
        stop.store(true, Ordering::Relaxed);
        [served.join().unwrap(), further.join().unwrap()]
    })
}

/// Attitude of the camera by the label.
fn boresight_frame(frame: &Received) -> Attitude {
    let q = |name: &str| -> Attitude {
        let q = serde_json::from_value(frame.label()[name].clone()).unwrap();
        Attitude::from_xyzw(q).unwrap()
    };
    q("q_icrf_to_body").then(&q("q_body_to_camera"))
}

#[test]
fn each_camera_renders_each_attitude() {
    run_two(Clock::Stepped, |mut first, mut second| {
        // A client is known after its first packet.
        second.status();
        for sequence in 1..4 {
            first.point(attitude(sequence), later(EPOCH, f64::from(sequence)));
            let [a, b] = [first.frame(), second.frame()];
            assert_eq!(b.header.attitude_sequence, sequence);
            assert_eq!((a.time, a.header.frame), (b.time, b.header.frame));
            // Own noise and own mounting: the first one's right is the second one's down.
            assert_ne!(a.header.seed, b.header.seed);
            let [a, b] = [a, b].map(|frame| boresight_frame(&frame));
            let turned = b.rotate(&a.inverse().rotate(&Vector3::x()));
            assert!((turned - Vector3::y()).norm() < 1e-9, "{turned}");
        }
    });
}

#[test]
fn wall_clock_cameras_of_one_rate_expose_simultaneously() {
    let [first, second] = run_two(Clock::Wall, |mut first, mut second| {
        // Each may wait for the other's frame.
        for client in [&mut first, &mut second] {
            client.window = None;
            client.status();
        }
        // The client uses system time, which each camera reads itself.
        first.point(attitude(1), system_time());
        let [mut a, mut b] = [Vec::new(), Vec::new()];
        // Either may miss exposures. Times equal to the nanosecond are no coincidence.
        await_that("two exposures of both", || {
            a.push(first.frame().time);
            b.push(second.frame().time);
            a.iter().filter(|time| b.contains(time)).count() >= 2
        });
    });
    assert_eq!((first.attitudes, second.attitudes), (1, 1));
}

#[test]
fn only_the_first_client_pauses_all_cameras() {
    run_two(Clock::Stepped, |mut first, mut second| {
        second.send(Command::Pause);
        second.refused(Reason::NotSupported, &[]);
        first.done(Command::Pause);
        first.point(attitude(1), EPOCH);
        // X-Val: much longer than both frames take.
        let a_while = std::time::Duration::from_millis(300);
        assert!(first.recv(a_while).is_none() && second.recv(a_while).is_none());
        assert_eq!(second.status().sync, SyncState::Paused);
        first.done(Command::Resume);
        let [a, b] = [first.frame(), second.frame()];
        assert_eq!((a.time, a.header.frame), (b.time, b.header.frame));
    });
}

/// A pause by the first client affects all cameras without the consent of their clients.
#[test]
fn a_pause_cancels_the_single_shot_of_a_further_camera() {
    let [_, second] = run_two(Clock::Wall, |mut first, mut second| {
        second.status();
        first.done(Command::FrameRate { hz: 1e-3 });
        first.point(attitude(1), EPOCH);
        await_that("both have the attitude", || {
            second.counters().attitudes == 1
        });
        second.done(Command::FrameRate { hz: 1e-3 });
        second.forget();
        second.done(Command::Exposure { seconds: 100.0 });
        second.done(Command::SingleShot);
        let before = second.counters().exposures_missed;
        first.done(Command::Pause);
        await_that("all are paused", || {
            second.status().sync == SyncState::Paused
        });
        assert_eq!(first.status().sync, SyncState::Paused);
        assert_eq!(second.counters().exposures_missed, before + 1);
        first.done(Command::Resume);
        // A further single shot is possible, and settings are free again.
        await_that("all go on", || second.status().sync == SyncState::Free);
        second.done(Command::Exposure { seconds: 0.01 });
        second.done(Command::SingleShot);
    });
    // Commands to the first camera alone leave no sequence gap at the second.
    assert_eq!((second.refused, second.sequence_gaps), (0, 0));
}

#[test]
fn settings_and_resets_reach_their_camera() {
    run_two(Clock::Stepped, |mut first, mut second| {
        second.done(Command::Exposure { seconds: 0.02 });
        let exposures_s = [first.status().exposure_s, second.status().exposure_s];
        assert_eq!(exposures_s, [0.01, 0.02]);
        second.send(Command::Attitude(attitude(1)));
        second.refused(Reason::NotSupported, &["over the first camera's link"]);
        // A Reset by the client with the truth restarts all cameras.
        first.done(Command::Reset);
        first.forget();
        first.point(attitude(1), EPOCH);
        first.frame();
        let frame = second.frame();
        let open_s = seconds(frame.header.exposure_start, frame.header.exposure_end);
        // X-Val: 10 ms, with times rounded to nanoseconds.
        assert!((open_s - 0.01).abs() < 3e-9);
    });
}

#[test]
fn wrong_camera_sections_are_refused() {
    const LINK: &str = "link = \"udp://127.0.0.1:1\"";
    let head = |name: &str, keys: &str| {
        let keys = keys.replace("LINK", LINK).replace("; ", "\n");
        format!("[[heads]]\nname = {name:?}\ncamera = \"fai-nir\"\n{keys}\n")
    };
    let refused = |text: &str, words: &[&str]| {
        let config = Config::parse("run.toml", text, &Folder::current());
        let error = config.unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    for (row, words) in rows(
        "B; link = []            | heads[0].link | at least one link
         ; LINK                  | heads[0].name | figures and verdicts
         B; LINK; rate_hz = 0    | heads[0].rate_hz | 0.0001
         B; LINK; rate_hz = 10.1 | heads[0].rate_hz | overlap
         fai-nir; LINK           | heads[0].name | no other camera",
    ) {
        let (name, keys) = row.split_once("; ").unwrap();
        refused(&head(name, keys), &words);
    }
    let twice = head("B", LINK) + &head("B", &LINK.replace(":1\"", ":2\""));
    refused(&twice, &["heads[1].name", "no other camera"]);
    let further = |url: &str| {
        let opened = link::open_further(&[url.to_string()], &options(5.0));
        opened.map(|_| ()).map_err(|error| error.to_string())
    };
    let error = further("udp://127.0.0.1:0?roles=truth+labels").unwrap_err();
    assert!(error.contains("give it roles=pixels+labels"), "{error}");
    assert_eq!(further("udp://127.0.0.1:0"), Ok(()));
}
