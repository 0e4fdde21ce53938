//! Runs with several links: truth in, pixels out, labels out.

use crate::support::client::Client;
use crate::support::line::UdpLine;
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, options, role_clients, scene_at,
};
use crate::table::rows;
use skyloop::config::Clock;
use skyloop::link;
use skyloop_protocols::{Command, LabelLevel, Output, PixelLevel, Reason};
use std::time::Instant;

/// An emulator with one UDP port for each of `roles`, and a client at each. Frames fit into the
/// buffers of unread sockets.
fn at<const N: usize>(roles: [&str; N]) -> (Running, [Client<UdpLine>; N]) {
    role_clients(scene_at("windows"), Clock::Stepped, roles, 5.0)
}

#[test]
fn truth_pixels_and_labels_have_their_links() {
    let (_one, [mut all]) = at(["truth+pixels+labels"]);
    all.point(attitude(7), EPOCH);
    let (_, packets, whole) = all.parcel();
    let (_three, [mut truth, mut pixels, mut labels]) = at(["truth", "pixels", "labels"]);
    // Each client announces itself, without a credit limit.
    for client in [&mut pixels, &mut labels] {
        client.window = None;
        client.done(Command::Ping);
        client.next(false);
    }
    truth.point(attitude(7), EPOCH);
    let (header, blocks, end) = pixels.parcel();
    let levels = (header.pixel_level, header.label_level);
    assert_eq!(levels, (PixelLevel::Windows, LabelLevel::None));
    assert_eq!(end, whole);
    assert_eq!(payloads(&blocks), payloads(&packets[..4]));
    let (header, parts, end) = labels.parcel();
    let levels = (header.pixel_level, header.label_level);
    assert_eq!(levels, (PixelLevel::None, LabelLevel::Objects));
    assert_eq!(end, whole);
    assert_eq!(payloads(&parts), payloads(&packets[4..]));
    // Only replies go to the truth link.
    assert!(truth.has_nothing_left());
    // Each link has its own output.
    let few = Output {
        pixels: PixelLevel::Windows,
        windows: 3,
        ..Output::default()
    };
    pixels.done(Command::Output(few));
    truth.point(attitude(8), EPOCH);
    assert_eq!(pixels.parcel().0.windows, 3);
    assert_eq!(labels.parcel().0.label_level, LabelLevel::Objects);
    assert_eq!(truth.counters().frames_delivered, 2);
}

/// Bytes between header and CRC.
fn payloads(packets: &[Vec<u8>]) -> Vec<&[u8]> {
    let payload = packets.iter().map(|packet| &packet[15..packet.len() - 2]);
    payload.collect()
}

#[test]
fn only_the_truth_link_takes_attitudes_and_camera_settings() {
    let (_emulator, [mut pixels, mut truth]) = at(["pixels", "truth+labels"]);
    truth.done(Command::Exposure { seconds: 0.2 });
    pixels.window = None;
    for command in [
        Command::Attitude(attitude(1)),
        Command::Exposure { seconds: 0.3 },
        Command::Gain { e_per_dn: 2.0 },
        Command::FrameRate { hz: 2.0 },
        Command::SingleShot,
    ] {
        pixels.send(command);
        pixels.refused(Reason::NotSupported, &["send them over udp://127.0.0.1:"]);
    }
    // A Reset on another link resets only that exchange.
    pixels.done(Command::Reset);
    assert_eq!(truth.status().exposure_s, 0.2);
    truth.done(Command::Reset);
    assert_ne!(truth.status().exposure_s, 0.2);
}

#[test]
fn blocked_clients_cost_others_no_frame() {
    let (emulator, [mut truth, mut pixels]) = at(["truth+labels", "pixels"]);
    // It takes one packet only.
    pixels.window = None;
    pixels.send(Command::Credit { packets: 1 });
    pixels.status();
    truth.point(attitude(1), EPOCH);
    let (_, parts, _) = truth.parcel();
    assert!(!parts.is_empty());
    pixels.next(true);
    // Its frame is abandoned after 2 s. It delays no other, and gets none until it sends again.
    let begin = Instant::now();
    for sequence in 2..14 {
        truth.point(attitude(sequence), EPOCH);
        assert_eq!(truth.parcel().0.attitude_sequence, sequence);
    }
    // X-Val: otherwise each frame would take 2 s.
    assert!(begin.elapsed() < TIMEOUT);
    pixels.send(Command::Credit { packets: 1000 });
    pixels.done(Command::Ping);
    pixels.next(false);
    truth.point(attitude(14), EPOCH);
    assert_eq!(pixels.parcel().0.attitude_sequence, 14);
    assert_eq!(truth.parcel().0.attitude_sequence, 14);
    emulator.ends_with(&[("frames_delivered", 13), ("frames_abandoned", 1)]);
}

#[test]
fn frames_without_a_client_count_as_abandoned() {
    let (emulator, [mut truth, mut frames]) = at(["truth", "pixels+labels"]);
    truth.point(attitude(1), EPOCH);
    await_that("the frame is abandoned", || {
        truth.counters().frames_abandoned == 1
    });
    frames.done(Command::Ping);
    frames.next(false);
    truth.point(attitude(2), EPOCH);
    assert_eq!(frames.parcel().0.attitude_sequence, 2);
    assert_eq!(truth.counters().frames_rendered, 2);
    emulator.ends_with(&[("frames_delivered", 1), ("frames_abandoned", 1)]);
}

#[test]
fn wrong_roles_are_refused_with_an_example() {
    // Roles of each link, words of the refusal, and the end of its example. A wrong key is reported
    // before a missing role.
    for (roles, words) in rows(
        "truth truth+pixels | a second link for the truth | 4810?roles=pixels+labels
         pixels labels      | no link has the role truth | 4810?roles=truth
         truth+video        | must be truth, pixels or labels | 4810
         NONE               | must be truth, pixels or labels | 4810
         truth+truth        | each once | 4810
         truth truth&role=pixels
         | unknown option \"role\"; udp has rate_mbit, proof, roles | 4810",
    ) {
        let roles = roles.split(' ').map(|roles| roles.replace("NONE", ""));
        let url = |roles: String| format!("udp://127.0.0.1:0?roles={roles}");
        let urls: Vec<String> = roles.map(url).collect();
        let Err(error) = link::open_all(&urls, &options(5.0)) else {
            panic!("{urls:?} was accepted");
        };
        let text = error.to_string();
        assert!(text.contains(words[0]) && text.contains("roles="), "{text}");
        let example = format!("; write for example udp://127.0.0.1:{}", words[1]);
        assert!(text.ends_with(&example), "{text}");
    }
}
