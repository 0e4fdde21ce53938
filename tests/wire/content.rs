//! Content of frames, and its changes by commands and repetition.

use crate::support::client::{Client, Received};
use crate::support::{EPOCH, attitude, later, memory_client, on_every_link, scene};
use skyloop::config::Clock;
use skyloop_protocols::Command;

#[test]
fn repeated_attitudes_give_equal_frames() {
    for (link, _emulator, line) in on_every_link(scene, Clock::Stepped) {
        let mut client = Client::new(line);
        let (first, second) = (client.good_frame(7), client.good_frame(7));
        assert_eq!((first.header.frame, second.header.frame), (0, 1), "{link}");
        assert!(first.pixels == second.pixels, "{link}: pixels");
        let labels = first.labels.replacen("\"frame\":0", "\"frame\":1", 1);
        assert_eq!(labels, second.labels, "{link}");
        let other = client.good_frame(8);
        assert!(
            other.pixels != first.pixels,
            "{link}: another sequence, other noise"
        );
    }
}

#[test]
fn received_labels_equal_the_json_of_the_frame() {
    for (link, emulator, line) in on_every_link(scene, Clock::Stepped) {
        let mut client = Client::new(line);
        let frame = client.good_frame(1);
        let exposed = emulator.exposed();
        assert!(frame.labels == *exposed.json, "{link}: byte for byte");
        assert!(frame.pixels == exposed.frame.dn, "{link}");
        assert!(frame.header.label_parts > 1, "{link}: {:?}", frame.header);
        let epoch_mid = frame.label()["epoch_mid"].clone();
        assert_eq!(epoch_mid, "2019-06-15T23:35:50.000Z", "{link}");
        assert_eq!(frame.time, EPOCH);
        // X-Val: exposure of 0.1 s around the epoch.
        assert_eq!(frame.header.exposure_start, later(EPOCH, -0.05));
        assert_eq!(frame.header.exposure_end, later(EPOCH, 0.05));
    }
}

#[test]
fn frames_use_the_settings_at_their_attitude() {
    let (_emulator, mut client) = memory_client(scene(), Clock::Stepped);
    // All commands arrive before the first frame is rendered.
    for _ in 0..5 {
        for (sequence, seconds) in [(1, 0.1), (2, 0.5), (3, 0.2)] {
            client.send(Command::Exposure { seconds });
            client.point(attitude(sequence), EPOCH);
        }
        for seconds in [0.1, 0.5, 0.2] {
            let frame = client.frame();
            assert_eq!(frame.label()["exposure_s"], seconds);
        }
    }
}

#[test]
fn commands_change_header_labels_and_pixels_until_a_reset() {
    for (link, _emulator, line) in on_every_link(scene, Clock::Stepped) {
        let mut client = Client::new(line);
        let plain = client.good_frame(3);
        client.done(Command::Exposure { seconds: 0.4 });
        client.done(Command::Gain { e_per_dn: 6.0 });
        let settings = |client: &mut Client<_>| {
            let status = client.status();
            (status.exposure_s, status.gain_e_per_dn)
        };
        assert_eq!(settings(&mut client), (0.4, 6.0), "{link}");
        let changed = client.good_frame(3);
        assert_eq!(changed.header.gain_e_per_dn, 6.0, "{link}");
        assert_eq!(changed.header.exposure_start, later(EPOCH, -0.2), "{link}");
        assert_eq!(changed.label()["exposure_s"], 0.4, "{link}");
        let level = |frame: &Received| {
            let sum: f64 = frame.pixels.iter().map(|dn| f64::from(*dn)).sum();
            sum / frame.pixels.len() as f64 - frame.header.offset_dn
        };
        // Four times the light at half the electrons per DN: eight times the signal.
        let ratio = level(&changed) / level(&plain);
        assert!((7.5..8.5).contains(&ratio), "{link}: {ratio}");
        client.done(Command::Reset);
        // X-Val: configs/cameras/fai-nir.toml.
        assert_eq!(settings(&mut client), (0.1, 12.0), "{link}");
        let again = client.good_frame(3);
        assert!(again.pixels == plain.pixels, "{link}");
        assert_eq!(again.header.gain_e_per_dn, plain.header.gain_e_per_dn);
    }
}
