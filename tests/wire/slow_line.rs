//! Lines on which a window of packets takes longer than the 2 s after which a client that does nothing has gone.

#[path = "../support/flight.rs"]
mod flight;

use crate::support::client::Client;
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, options, scene};
use skyloop::config::{Clock, Config};
use skyloop::link;
use skyloop_protocols::Command;
use std::time::{Duration, Instant};

/// The built-in scene with a small detector, behind `link`.
fn on(link: &str, side: usize) -> (Running, Client<MemoryLine>) {
    let mut config: Config = scene();
    let (camera, middle) = (&mut config.camera, (side as f64 - 1.0) / 2.0);
    (camera.detector.width, camera.detector.height) = (side, side);
    camera.optics.principal_px = [middle; 2];
    let (wire, port) = link::loopback(link, &options(5.0)).unwrap();
    let mut client = Client::new(MemoryLine(port));
    client.window = None;
    (Running::start(config, Clock::Stepped, wire), client)
}

/// A frame through a window that is granted anew when all of it has come; how long the longest took.
fn by_whole_windows(client: &mut Client<MemoryLine>, window: u32) -> Duration {
    client.send(Command::Credit { packets: window });
    client.point(attitude(0), EPOCH);
    let (mut longest, mut begun) = (Duration::ZERO, Instant::now());
    let frame = client.frame_granting(|client, taken| {
        if taken % window == 0 {
            longest = longest.max(begun.elapsed());
            begun = Instant::now();
            client.send(Command::Credit {
                packets: taken + window,
            });
        }
    });
    assert!(frame.packets > window);
    longest
}

#[test]
fn what_is_on_its_way_is_waited_for() {
    // 1,400 octets take 0.37 s at 38,400 baud: 8 of them 2.9 s, a frame of 13 blocks some 6 s.
    let (emulator, mut client) = on("pty?baud=38400", 108);
    let longest = by_whole_windows(&mut client, 8);
    assert!(longest > Duration::from_millis(2_500), "{longest:?}");
    let counters = emulator.end();
    assert_eq!(
        (counters.frames_delivered, counters.frames_abandoned),
        (1, 0)
    );
}

#[test]
fn answers_keep_no_frame_waiting() {
    let (_emulator, mut client) = on("pty?baud=115200", 64);
    client.send(Command::Credit { packets: 2 });
    client.point(attitude(0), EPOCH);
    let begun = Instant::now();
    // Octets leave all the time, but none of frame packets.
    await_that("the frame is abandoned", || {
        client.status().counters.frames_abandoned == 1
    });
    let took = begun.elapsed();
    assert!(took > Duration::from_secs(2), "{took:?}");
}

#[test]
fn a_frame_larger_than_the_window_comes_whole() {
    // Some 100 packets, most of them labels, of 0.14 s at 100,000 baud: 14 s. The window is 64.
    let course = flight::Course {
        frames: 1,
        side: 128,
    };
    let flight = flight::fly(course, "pty?baud=100000", "frame", "");
    let (report, counters) = (&flight.report, &flight.counters);
    assert_eq!((report.frames, report.recovery.attitudes), (1, 0));
    assert_eq!((report.recovery.asked, counters.resent_blocks), (0, 0));
    assert_eq!(counters.frames_abandoned, 0);
    assert!(report.octets > 80 * 1400, "{}", report.octets);
}
