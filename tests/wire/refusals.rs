//! Bad packets: each is refused with its reason, counted once, and has no other effect.

use crate::bad_packets::{cases, q_times};
use crate::replay::small;
use crate::support::client::{Client, moved};
use crate::support::line::{Line, PtyLine};
use crate::support::{EPOCH, Q, attitude, later, on_every_link, scene, serial_client, udp_client};
use skyloop::config::Clock;
use skyloop_protocols::packet::reseal;
use skyloop_protocols::slip::{self, END, ESC};
use skyloop_protocols::{Attitude, Command, OrbitState, Reason};

#[test]
fn bad_packets_are_refused_counted_once_and_have_no_other_effect() {
    for (link, _emulator, line) in on_every_link(small, Clock::Stepped) {
        // Any queue holds a whole frame: none is given up because the client is paused for 2 s.
        let mut client = Client::new(line).unpaced();
        let reference = client.good_frame(1);
        for case in cases() {
            let name = format!("{link}: {} {:?}", case.damage, case.command);
            let before = client.counters();
            let counts = client.counts.clone();
            let (mut packet, count) = client.prepare(&case.command, case.time);
            (case.damage_packet)(&mut packet);
            if case.counter != "bad_crc" {
                reseal(&mut packet);
            }
            let stated = u16::from_be_bytes([packet[0], packet[1]]) & 0x7ff;
            if stated != case.command.apid() {
                // Another APID has its own counts.
                client.counts = counts;
            }
            client.line.send(&packet);
            println!("{name}");
            let words: Vec<&str> = case.says.split(" | ").collect();
            let nack = client.refused(case.reason, &words);
            assert_eq!((nack.apid, nack.sequence_count), (stated, count), "{name}");
            let after = client.counters();
            assert_eq!(moved(&before, &after), [(case.counter, 1)], "{name}");
            let of_pings = after.commands - before.commands;
            assert_eq!(of_pings, 1, "{name}: the second Ping alone");
            let frame = client.good_frame(1);
            let is_same = frame.pixels == reference.pixels;
            assert!(is_same, "{name}: the next frame is unchanged");
            let expected = [
                ("attitudes", 1),
                ("frames_rendered", 1),
                ("frames_delivered", 1),
            ];
            assert_eq!(moved(&after, &client.counters()), expected, "{name}");
        }
        assert!(client.has_nothing_left(), "{link}");
    }
}

#[test]
fn quaternions_within_the_tolerance_are_normalised() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    let Command::Attitude(long) = q_times(1.0009) else {
        unreachable!()
    };
    client.point(
        Attitude {
            sequence: 1,
            ..long
        },
        EPOCH,
    );
    let long = client.frame();
    let q: Vec<f64> = serde_json::from_value(long.label()["q_icrf_to_body"].clone()).unwrap();
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    assert!((norm - 1.0).abs() < 1e-12, "{norm}");
    // X-Val: the direction of Q, whose own norm is 1 within 1e-6.
    assert!(q.iter().zip(Q).all(|(a, b)| (a - b).abs() < 2e-6), "{q:?}");
    assert_eq!(client.counters().bad_attitude, 0);
}

#[test]
fn datagrams_of_wrong_length_are_refused() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    let mut before = client.counters();
    for length in [0, 1, 16, 1401, 9000] {
        client.line.send(&vec![0; length]);
        let nack = client.nack();
        assert_eq!(nack.reason, Reason::BadLength, "{length}: {}", nack.detail);
        assert!(
            nack.detail.contains(&format!(" {length} octets")),
            "{}",
            nack.detail
        );
        let counter = if length < 17 { "runts" } else { "oversize" };
        let after = client.counters();
        assert_eq!(moved(&before, &after), [(counter, 1)], "{length}");
        before = after;
    }
    client.good_frame(1);
}

#[test]
fn noise_and_damaged_frames_on_a_serial_line_are_counted() {
    let (_emulator, client) = serial_client(small(), Clock::Stepped);
    let mut client = client.unpaced();
    let reference = client.good_frame(1);
    let whole = |client: &mut Client<PtyLine>| {
        let (packet, _) = client.prepare(&Command::Ping, EPOCH);
        let mut line = Vec::new();
        slip::encode(&packet, &mut |byte| line.push(byte));
        line
    };
    let long = [vec![END], vec![0x55; 3000], vec![END]].concat();
    let mut flipped = whole(&mut client);
    flipped[8] ^= 4;
    let mut cut = whole(&mut client);
    cut.drain(9..14);
    let damaged: [(&str, &str, Vec<u8>); 6] = [
        (
            "garbage",
            "bad_crc",
            b"\x01\x02login: garbage\xff\xfe\xc0".to_vec(),
        ),
        ("a frame too short", "runts", vec![END, 1, 2, 3, END]),
        (
            "a bad escape",
            "bad_framing",
            vec![END, 1, 2, 3, 4, 5, 6, ESC, 0x01, 7, 8, 9, END],
        ),
        ("a frame too long", "oversize", long),
        ("a wrong CRC-32", "bad_crc", flipped),
        ("bytes lost", "bad_crc", cut),
    ];
    for (name, counter, bytes) in damaged {
        let before = client.counters();
        client.line.raw(&bytes);
        let mut found = moved(&before, &client.counters());
        // A packet damaged in transit is missing in the client's counts too.
        found.retain(|(counter, _)| *counter != "sequence_gaps");
        assert_eq!(found, [(counter, 1)], "{name}");
        assert!(client.good_frame(1).pixels == reference.pixels, "{name}");
    }
    // Empty frames between packets are not counted.
    let before = client.counters();
    client.line.raw(&[END, END, END]);
    assert_eq!(moved(&before, &client.counters()), []);
}

#[test]
fn states_that_leave_their_range_during_the_exposure_are_refused() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Stepped, 5.0);
    client.done(Command::Exposure { seconds: 600.0 });
    let falling = OrbitState {
        position_m: [6_600_000.0, 0.0, 0.0],
        velocity_m_s: [0.0, 1000.0, 0.0],
    };
    let falling = Attitude {
        state: Some(falling),
        ..attitude(1)
    };
    client.point(falling, later(EPOCH, 10_000.0));
    client.refused(Reason::ValueOutOfRange, &["propagated to"]);
    client.has_counted(&[("attitudes", 0), ("bad_value", 1)]);
    client.done(Command::Exposure { seconds: 0.1 });
    client.good_frame(2);
}
