//! Transmission overlaps with the next frame, and upper rows with the rendering of lower ones.

use super::{quick, rest};
use crate::support::{EPOCH, attitude, await_that, memory_client, scene};
use skyloop::config::Clock;
use skyloop_protocols::Command;
use std::time::Duration;

#[test]
fn rendering_and_commands_continue_while_a_client_is_blocked() {
    let (emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    client.window = None;
    client.send(Command::Credit { packets: 1 });
    client.point(attitude(1), EPOCH);
    let mut blocked = client.counters();
    await_that("eight frames are rendered", || {
        // A packet for each of them, of more than eight: the client is slow, not gone.
        let packets = blocked.frames_rendered + 1;
        client.send(Command::Credit { packets });
        std::thread::sleep(Duration::from_millis(20));
        blocked = client.counters();
        blocked.frames_rendered >= 8
    });
    assert_eq!(blocked.frames_delivered, 0);
    assert!(blocked.frames_dropped > 0);
    client.done(Command::Gain { e_per_dn: 2.0 });
    // Full credit: the blocked frame becomes complete, then the newest follows.
    client.send(Command::Credit { packets: 1 << 20 });
    let first = client.frame();
    let second = client.frame();
    assert_eq!(first.header.frame, 0);
    assert!(second.header.frame >= blocked.frames_rendered - 2);
    let mut frames = vec![first, second];
    frames.extend(rest(&emulator, &mut client));
    let last = frames[frames.len() - 1].header.frame;
    let counters = client.counters();
    // Each frame was received or dropped, and counted once.
    assert_eq!(counters.frames_dropped, last + 1 - frames.len() as u32);
    assert_eq!(counters.frames_rendered, last + 1);
    assert_eq!(counters.frames_delivered as usize, frames.len());
    assert_eq!(counters.frames_abandoned, counters.frames_dropped);
}

#[test]
fn rows_are_sent_before_the_last_one_is_rendered() {
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
