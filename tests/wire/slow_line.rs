//! Lines that take longer for a window of packets than the 2 s after which a frame is abandoned.

use crate::replay::small;
use crate::support::client::Client;
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, memory_client, options, scene};
use skyloop::config::{Clock, Config};
use skyloop::link;
use skyloop_protocols::{Command, LabelLevel, Output, Reply, Withheld};
use std::time::{Duration, Instant};

/// The built-in scene with a small detector and frames without labels, behind `link`.
fn on(link: &str, side: usize) -> (Running, Client<MemoryLine>) {
    let mut config: Config = scene();
    let (camera, middle) = (&mut config.camera, (side as f64 - 1.0) / 2.0);
    (camera.detector.width, camera.detector.height) = (side, side);
    camera.optics.principal_px = [middle; 2];
    config.run.output.labels = LabelLevel::None;
    let (wire, port) = link::loopback(link, &options(5.0)).unwrap();
    let client = Client::new(MemoryLine(port)).unpaced();
    (Running::start(config, Clock::Stepped, wire), client)
}

/// Receives a frame with a grant after each whole window. Returns the longest time of a window.
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
fn in_flight_packets_are_awaited() {
    // 1,400 bytes take 0.37 s at 38,400 baud: 8 of them 2.9 s, a frame of 13 blocks some 6 s.
    let (emulator, mut client) = on("pty?baud=38400", 108);
    let longest = by_whole_windows(&mut client, 8);
    assert!(longest > Duration::from_millis(2_500), "{longest:?}");
    emulator.ends_with(&[("frames_delivered", 1), ("frames_abandoned", 0)]);
}

/// X-Val: 10 bit times a byte; SLIP (RFC 1055) with a CRC-32 of 4 bytes, an END on both sides and
/// an escape for two bytes of 256. Frames of 5 s or more are slow.
#[test]
fn frames_are_slow_by_the_bytes_of_their_packets() {
    for level in ["frame", "compressed", "windows"] {
        let config = || {
            let mut config = small();
            config.run.output = Output::preset(level).unwrap();
            config
        };
        let (_emulator, mut client) = memory_client(config(), Clock::Stepped);
        client.window = None;
        client.point(attitude(0), EPOCH);
        let (mut bytes, mut packets) = (0.0, 0);
        loop {
            let packet = client.next(true);
            bytes += (packet.len() as f64 + 4.0) * (1.0 + 2.0 / 256.0) + 2.0;
            packets += 1;
            if matches!(Reply::decode(&packet), Ok((_, Reply::FrameEnd(_)))) {
                break;
            }
        }
        for (takes_s, withheld) in [(4.95, Withheld::None), (5.05, Withheld::SlowLink)] {
            let baud = (bytes * 10.0 / takes_s).round();
            assert!(
                baud >= 9600.0,
                "{level}: {bytes} bytes in {packets} packets"
            );
            // Credit for the header alone keeps the frame in flight. A client that is late by half
            // a second gets another cause.
            let cause = || {
                let link = format!("pty?baud={baud}");
                let (wire, port) = link::loopback(&link, &options(5.0)).unwrap();
                let _emulator = Running::start(config(), Clock::Stepped, wire);
                let mut client = Client::new(MemoryLine(port)).unpaced();
                client.send(Command::Credit { packets: 1 });
                client.point(attitude(0), EPOCH);
                let header = client.next(true);
                client.put_back(header);
                client.status().withheld
            };
            let mut causes = (0..5).map(|_| cause());
            let found = causes.find(|found| *found != Withheld::NoCredit);
            let found = found.expect("the client is in time");
            assert_eq!(found, withheld, "{level}: {bytes} bytes, {packets} packets");
        }
    }
}

/// Packets count as lost if no grant follows within 0.5 s of their time on the line (1.5 s each at
/// 9,600 baud). A client that polls without a pause, with two Pings in flight so that a reply
/// always waits, gets the report too.
#[test]
fn packets_still_on_a_slow_line_are_not_reported_as_lost() {
    for (polls, pause_ms) in [(1, 300), (2, 0)] {
        assert_loss_is_reported(polls, Duration::from_millis(pause_ms));
    }
}

fn assert_loss_is_reported(polls: u32, pause: Duration) {
    let mut config = small();
    config.run.output = Output {
        windows: 5,
        labels: LabelLevel::None,
        ..Output::preset("windows").unwrap()
    };
    let (wire, port) = link::loopback("pty?baud=9600", &options(5.0)).unwrap();
    let _emulator = Running::start(config, Clock::Stepped, wire);
    let mut client = Client::new(MemoryLine(port)).unpaced();
    client.send(Command::Credit { packets: 64 });
    client.point(attitude(0), EPOCH);
    let header = client.next(true);
    client.send(Command::Credit { packets: 65 });
    client.put_back(header);
    client.parcel();
    assert_eq!(client.status().withheld, Withheld::None);
    for _ in 0..polls {
        client.send(Command::Ping);
    }
    await_that(
        &format!("the packets are reported as lost, {polls}"),
        || {
            let packet = client.next(false);
            let Ok((_, Reply::Status(status))) = Reply::decode(&packet) else {
                return false;
            };
            std::thread::sleep(pause);
            client.send(Command::Ping);
            status.withheld == Withheld::Lost
        },
    );
}

#[test]
fn replies_do_not_keep_a_frame() {
    let (_emulator, mut client) = on("pty?baud=115200", 64);
    client.send(Command::Credit { packets: 2 });
    client.point(attitude(0), EPOCH);
    let begun = Instant::now();
    // Bytes are sent all the time, but none of frame packets.
    await_that("the frame is abandoned", || {
        client.counters().frames_abandoned == 1
    });
    let took = begun.elapsed();
    assert!(took > Duration::from_secs(2), "{took:?}");
}

#[test]
fn frames_larger_than_the_window_are_complete() {
    // Some 100 packets, most of them labels, of 0.07 s at 200,000 baud: 7 s. The window is 64.
    let course = crate::flight::Course {
        frames: 1,
        side: 128,
    };
    let flight = crate::flight::fly(course, "pty?baud=200000", "frame", "");
    let (report, counters) = (&flight.report, &flight.counters);
    assert_eq!((report.frames, report.recovery.attitudes), (1, 0));
    assert_eq!((report.recovery.requested, counters.resent_blocks), (0, 0));
    assert_eq!(counters.frames_abandoned, 0);
    assert!(report.bytes > 80 * 1400, "{}", report.bytes);
}
