//! One frame leaves while the next is made, and its upper rows while the lower ones are.

use super::{TIMEOUT, quick, rest};
use crate::support::client::Client;
use crate::support::{EPOCH, attitude, await_that, memory_client, scene};
use skyloop::config::Clock;
use skyloop_protocols::Command;
use std::time::{Duration, Instant};

#[test]
fn frames_are_made_and_commands_heard_while_a_client_takes_nothing() {
    let (_emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    client.window = None;
    client.send(Command::Credit { packets: 1 });
    client.point(attitude(1), EPOCH);
    let mut granted = 1;
    let held = await_frames(&mut client, 8, || {
        // One packet now and then: a client that is slow, and not one that has gone.
        granted += 1;
        Command::Credit { packets: granted }
    });
    assert!(held.frames_delivered == 0 && held.frames_rendered >= 8);
    assert!(held.frames_dropped > 0);
    client.done(Command::Gain { e_per_dn: 2.0 });
    // Then all: the frame that stood still comes whole, after it the newest.
    client.send(Command::Credit { packets: 1 << 20 });
    let first = client.frame();
    let second = client.frame();
    assert_eq!(first.header.frame, 0);
    assert!(second.header.frame >= held.frames_rendered - 2);
    let mut frames = vec![first, second];
    frames.extend(rest(&mut client));
    let last = frames[frames.len() - 1].header.frame;
    let counters = client.counters();
    // Each frame came or was dropped, and was counted once.
    assert_eq!(counters.frames_dropped, last + 1 - frames.len() as u32);
    assert_eq!(counters.frames_rendered, last + 1);
    assert_eq!(counters.frames_delivered as usize, frames.len());
    assert_eq!(counters.frames_abandoned, counters.frames_dropped);
}

/// Waits for so many frames and sends `meanwhile` every 50 ms. The counters at the end.
fn await_frames(
    client: &mut Client<crate::support::line::MemoryLine>,
    frames: u32,
    mut meanwhile: impl FnMut() -> Command,
) -> skyloop_protocols::Counters {
    let began = Instant::now();
    loop {
        let counters = client.counters();
        if counters.frames_rendered >= frames {
            return counters;
        }
        assert!(began.elapsed() < TIMEOUT, "{counters:?}");
        client.send(meanwhile());
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn rows_leave_before_the_last_one_is_there() {
    let mut config = scene();
    (config.camera.detector.width, config.camera.detector.height) = (1024, 1024);
    config.camera.optics.principal_px = [511.5; 2];
    config.camera.exposure_s = 0.01;
    config.camera.rate_hz = 5.0;
    let (_emulator, mut client) = memory_client(config, Clock::Wall);
    client.window = None;
    client.point(attitude(1), EPOCH);
    await_that("a frame whose first rows left early", || {
        let times = client.frame().end.timing;
        assert!(times.first_pixel_s <= times.last_pixel_s);
        times.first_octet_s < times.last_pixel_s
    });
}
