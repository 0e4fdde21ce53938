//! Credit: the emulator sends as many packets as granted; clients without grants or reads are
//! bounded.

use crate::support::client::Client;
use crate::support::line::Line;
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, memory_client, scene, serial_client, udp_client,
};
use skyloop::camera::Camera;
use skyloop::config::{Clock, Config};
use skyloop::load::Folder;
use skyloop_protocols::{Command, Reply, Withheld};
use std::time::Duration;

/// The built-in scene with the largest camera: 1280 x 1024 pixels in some 1,400 packets.
fn large() -> Config {
    let camera = Camera::load("cots-wide", &Folder::current()).unwrap();
    Config { camera, ..scene() }
}

/// Receives a frame with a window of `window` packets. The emulator never sends more than granted.
fn through_a_window(client: &mut Client<impl Line>, window: u32, sequence: u32) {
    client.window = None;
    let start = client.taken;
    assert_eq!(client.status().packets_sent, start);
    client.send(Command::Credit {
        packets: start + window,
    });
    client.point(attitude(sequence), EPOCH);
    let frame = client.frame_granting(|client, taken| {
        // All granted packets have arrived, and no other may arrive before the next grant.
        if taken % window == 0 {
            if taken < 4 * window || taken % (128 * window) == 0 {
                assert_eq!(
                    client.status().packets_sent,
                    start + taken,
                    "no more than granted"
                );
            }
            client.send(Command::Credit {
                packets: start + taken + window,
            });
        }
    });
    assert_eq!((frame.header.width, frame.header.height), (1280, 1024));
    assert_eq!(frame.header.attitude_sequence, sequence);
    assert!(frame.packets > 1400, "{}", frame.packets);
    assert_eq!(client.status().packets_sent, start + frame.packets);
    assert_eq!(client.taken, start + frame.packets);
}

#[test]
fn any_window_carries_the_largest_frame() {
    let (_emulator, mut client) = udp_client(large(), Clock::Stepped, 5.0);
    for (sequence, window) in (0..).zip([1, 3, 64]) {
        through_a_window(&mut client, window, sequence);
    }
    client.has_counted(&[("frames_delivered", 3), ("frames_abandoned", 0)]);
    let (_emulator, mut client) = memory_client(large(), Clock::Stepped);
    for (sequence, window) in (0..).zip([1, 64]) {
        through_a_window(&mut client, window, sequence);
    }
}

#[test]
fn clients_that_stop_granting_lose_only_their_frame() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 60.0);
    client.window = None;
    client.send(Command::Credit { packets: 5 });
    client.point(attitude(1), EPOCH);
    await_that("the frame is abandoned", || {
        let status = client.status();
        assert!(
            status.packets_sent <= 5,
            "no more than granted: {}",
            status.packets_sent
        );
        status.counters.frames_abandoned == 1
    });
    let before = client.status();
    assert_eq!(
        (before.packets_sent, before.counters.frames_delivered),
        (5, 0)
    );
    // A lower, late Credit is ignored; a higher one lets the next frame through.
    client.send(Command::Credit { packets: 2 });
    assert_eq!(client.taken, 5);
    client.forget();
    client.window = Some(32);
    client.send(Command::Credit { packets: 5 + 32 });
    client.good_frame(2);
    let after = client.counters();
    assert_eq!((after.frames_delivered, after.frames_abandoned), (1, 1));
}

/// Each cause on the client's side shows in Status before the frame is abandoned. A whole frame
/// clears it.
#[test]
fn status_reports_why_a_frame_is_withheld() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 60.0);
    let reports = |client: &mut Client<_>, why| {
        await_that(&format!("Status reports {why:?}"), || {
            client.status().withheld == why
        });
        let abandoned = client.counters().frames_abandoned;
        client.done(Command::Reset);
        client.forget();
        client.start_anew();
        abandoned
    };
    client.window = None;
    client.send(Command::Credit { packets: 5 });
    client.point(attitude(1), EPOCH);
    reports(&mut client, Withheld::NoCredit);
    // The grant confirms only 3 of 64 packets.
    client.window = None;
    client.send(Command::Credit { packets: 64 });
    client.point(attitude(2), EPOCH);
    client.send(Command::Credit { packets: 3 + 64 });
    reports(&mut client, Withheld::Lost);
    client.line.send(b"not a packet, but as long as some are");
    client.nack();
    assert_eq!(client.status().withheld, Withheld::Refused);
    client.window = Some(32);
    let packets = client.good_frame(3).packets;
    assert_eq!(client.status().withheld, Withheld::None);
    // The grants confirm all but the last 20 packets of a frame sent whole.
    client.done(Command::Reset);
    client.window = None;
    client.send(Command::Credit { packets: 64 });
    client.point(attitude(4), EPOCH);
    client.frame_granting(|client, taken| {
        if taken + 20 <= packets {
            client.send(Command::Credit {
                packets: taken + 64,
            });
        }
    });
    reports(&mut client, Withheld::Lost);
}

/// A client without Credit reports losses by Resend only.
#[test]
fn status_reports_packets_requested_again_without_credit() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    client.window = None;
    client.point(attitude(1), EPOCH);
    let frame = client.frame().header.frame;
    assert_eq!(client.status().withheld, Withheld::None);
    let (first, count) = (3, 2);
    client.send(Command::Resend {
        frame,
        first,
        count,
    });
    assert_eq!(client.status().withheld, Withheld::Lost);
}

/// Sends attitudes and reads nothing until the emulator has processed them.
fn without_reading(emulator: &Running, client: &mut Client<impl Line>, frames: u32) {
    client.window = None;
    for sequence in 0..frames {
        client.send(Command::Attitude(attitude(sequence)));
    }
    for sequence in 0..frames {
        assert_eq!(emulator.exposed().key.sequence, sequence);
    }
}

#[test]
fn clients_that_never_read_their_socket_do_not_block_the_emulator() {
    let (emulator, mut client) = udp_client(scene(), Clock::Stepped, 60.0);
    without_reading(&emulator, &mut client, 4);
    // Unread datagrams are lost, except the first ones in the socket's buffer.
    while client.line.recv(Duration::from_millis(50)).is_some() {}
    let mut client = Client::new(client.line);
    client.done(Command::Reset);
    assert_eq!(client.good_frame(9).header.frame, 4);
}

#[test]
fn clients_that_never_read_their_serial_line_do_not_block_the_emulator() {
    let (emulator, mut client) = serial_client(scene(), Clock::Stepped);
    // A frame has more packets than queue and line hold: each one is abandoned.
    without_reading(&emulator, &mut client, 3);
    // Queued packets still arrive undamaged.
    while client.line.recv(Duration::from_millis(200)).is_some() {}
    let mut client = Client::new(client.line);
    client.done(Command::Reset);
    client.has_counted(&[
        ("frames_rendered", 3),
        ("frames_delivered", 0),
        ("frames_abandoned", 3),
    ]);
    client.good_frame(9);
}

/// Numbers of Acks and Statuses until no more arrive.
fn replies(client: &mut Client<impl Line>) -> (u32, u32) {
    let (mut acks, mut statuses) = (0, 0);
    while let Some(packet) = client.line.recv(Duration::from_millis(300)) {
        match Reply::decode(&packet).unwrap().1 {
            Reply::Ack(_) => acks += 1,
            Reply::Status(_) => statuses += 1,
            _ => {}
        }
    }
    (acks, statuses)
}

#[test]
fn replies_wait_behind_an_unpaced_frame() {
    let (emulator, mut client) = memory_client(large(), Clock::Stepped);
    client.window = None;
    client.point(attitude(0), EPOCH);
    // The frame fills the queue of 256 packets, which has no space for 200 replies.
    let header = client.line.recv(TIMEOUT).expect("the frame begins");
    assert!(matches!(
        Reply::decode(&header),
        Ok((_, Reply::FrameHeader(_)))
    ));
    for _ in 0..100 {
        client.send(Command::Ping);
    }
    assert_eq!(replies(&mut client), (100, 100));
    emulator.exposed();
    client.has_counted(&[("frames_delivered", 1), ("lost_outbound", 0)]);
}

/// Sends hundreds of commands without reading the replies.
fn unread(client: &mut Client<impl Line>, command: Command, hundreds: u32) {
    for _ in 0..hundreds {
        for _ in 0..100 {
            client.send(command);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn unread_replies_are_counted() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    unread(&mut client, Command::Ping, 20);
    let (acks, statuses) = replies(&mut client);
    let counters = client.counters();
    assert_eq!(
        acks + statuses + counters.lost_outbound,
        2 * (counters.commands - 1)
    );
    // 256 in the queue and 1024 waiting (ICD, 5.2), of 4000.
    let lost_commands = counters.overflows;
    assert!(counters.lost_outbound + 2 * lost_commands >= 4000 - 1280 - 2);
}

#[test]
fn unread_resets_are_bounded() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    unread(&mut client, Command::Reset, 50);
    let (acks, _) = replies(&mut client);
    // 256 in the queue and 1024 waiting (ICD, 5.2); the link may have handled some Resets.
    assert!((1024..=1280).contains(&acks), "{acks}");
    let counters = client.counters();
    assert_eq!(acks + counters.lost_outbound, counters.commands - 1);
}

#[test]
fn attitudes_sent_ahead_wait_up_to_a_limit() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    client.window = None;
    // Without credit the first frame stops, 64 attitudes wait (ICD, 5.4), and one is refused.
    client.send(Command::Credit { packets: 0 });
    client.send(Command::Attitude(attitude(0)));
    await_that("the first frame is rendered", || {
        client.status().next_frame == 1
    });
    for sequence in 1..=65 {
        client.send(Command::Attitude(attitude(sequence)));
    }
    let nack = client.nack();
    assert_eq!(
        nack.reason,
        skyloop_protocols::Reason::Busy,
        "{}",
        nack.detail
    );
    assert!(nack.detail.contains("64 attitudes"), "{}", nack.detail);
    client.has_counted(&[("attitudes", 65), ("refused", 1)]);
}
