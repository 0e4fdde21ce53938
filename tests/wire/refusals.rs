//! Bad packets: each is refused by name, counted once, and costs nothing else.

use crate::support::client::{Client, moved};
use crate::support::line::{Line, PtyLine};
use crate::support::{EPOCH, Q, attitude, later, on_every_link, on_serial, on_udp, scene};
use skyloop::config::Clock;
use skyloop_protocols::packet::{CRC_LENGTH, reseal};
use skyloop_protocols::slip::{self, END, ESC};
use skyloop_protocols::{Attitude, Command, OrbitState, Reason, WireTime};

/// A bad packet and what must come of it.
struct Case {
    name: &'static str,
    command: Command,
    time: WireTime,
    /// Damages the packet.
    spoil: fn(&mut Vec<u8>),
    reason: Reason,
    counter: &'static str,
    /// Words that the refusal's text must have.
    says: &'static [&'static str],
}

fn case(
    name: &'static str,
    command: Command,
    reason: Reason,
    counter: &'static str,
    says: &'static [&'static str],
) -> Case {
    Case {
        name,
        command,
        time: EPOCH,
        spoil: |_| {},
        reason,
        counter,
        says,
    }
}

fn spoilt(
    name: &'static str,
    spoil: fn(&mut Vec<u8>),
    reason: Reason,
    counter: &'static str,
    says: &'static [&'static str],
) -> Case {
    let command = Command::Attitude(attitude(900));
    Case {
        name,
        command,
        time: EPOCH,
        spoil,
        reason,
        counter,
        says,
    }
}

fn q_times(factor: f64) -> Command {
    let unit = |q: [f64; 4]| {
        let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        q.map(|c| c / norm)
    };
    Command::Attitude(Attitude {
        q_icrf_to_body: unit(Q).map(|c| c * factor),
        ..attitude(901)
    })
}

fn with_state(position_m: [f64; 3], velocity_m_s: [f64; 3]) -> Command {
    Command::Attitude(Attitude {
        state: Some(OrbitState {
            position_m,
            velocity_m_s,
        }),
        ..attitude(902)
    })
}

/// Leaves the first `length` octets, sealed anew, with the length that the header states left as it was.
fn cut(packet: &mut Vec<u8>, length: usize) {
    packet.truncate(length);
    reseal(packet);
}

fn cases() -> Vec<Case> {
    use Reason::*;
    const R: [f64; 3] = [7.0e6, 0.0, 0.0];
    const V: [f64; 3] = [0.0, 7.5e3, 0.0];
    let nan_rates = Attitude {
        rates_rad_s: [0.0, f64::NAN, 0.0],
        ..attitude(903)
    };
    let turning = Attitude {
        rates_rad_s: [0.0, 700.0, 0.0],
        ..attitude(904)
    };
    let mut back = case(
        "time backwards",
        Command::Attitude(attitude(905)),
        TimeBackwards,
        "time_backwards",
        &["attitude 905", "0.250000 s before", "Reset"],
    );
    back.time = later(EPOCH, -0.25);
    vec![
        case(
            "quaternion too long",
            q_times(1.0011),
            QuaternionNotUnit,
            "bad_attitude",
            &["q_icrf_to_body", "norm", "1.00220", "normalise"],
        ),
        case(
            "quaternion too short",
            q_times(0.9989),
            QuaternionNotUnit,
            "bad_attitude",
            &["q_icrf_to_body", "norm"],
        ),
        case(
            "quaternion of zeros",
            q_times(0.0),
            QuaternionNotUnit,
            "bad_attitude",
            &["q_icrf_to_body", "norm"],
        ),
        case(
            "NaN in the quaternion",
            q_times(f64::NAN),
            NotFinite,
            "bad_attitude",
            &["Attitude.q_icrf_to_body", "NaN"],
        ),
        case(
            "NaN in the rates",
            Command::Attitude(nan_rates),
            NotFinite,
            "bad_attitude",
            &["Attitude.rates_rad_s", "NaN"],
        ),
        case(
            "infinite position",
            with_state([f64::INFINITY, 0.0, 0.0], V),
            NotFinite,
            "bad_attitude",
            &["Attitude.position_m", "infinity"],
        ),
        case(
            "NaN velocity",
            with_state(R, [f64::NAN; 3]),
            NotFinite,
            "bad_attitude",
            &["Attitude.velocity_m_s"],
        ),
        case(
            "position inside the Earth",
            with_state([1e6, 0.0, 0.0], V),
            ValueOutOfRange,
            "bad_value",
            &["attitude 902", "position", "outside of the Earth"],
        ),
        case(
            "velocity beyond reason",
            with_state(R, [1e6, 0.0, 0.0]),
            ValueOutOfRange,
            "bad_value",
            &["attitude 902", "velocity", "1e5 m/s"],
        ),
        case(
            "rates beyond reason",
            Command::Attitude(turning),
            ValueOutOfRange,
            "bad_value",
            &["attitude 904", "rates", "628.4"],
        ),
        back,
        case(
            "exposure of zero",
            Command::Exposure { seconds: 0.0 },
            ValueOutOfRange,
            "bad_value",
            &["Exposure.seconds", "above 0"],
        ),
        case(
            "exposure too long",
            Command::Exposure { seconds: 1e6 },
            ValueOutOfRange,
            "bad_value",
            &["Exposure.seconds", "1000000", "10000"],
        ),
        case(
            "exposure NaN",
            Command::Exposure { seconds: f64::NAN },
            ValueOutOfRange,
            "bad_value",
            &["Exposure.seconds"],
        ),
        case(
            "gain below zero",
            Command::Gain { e_per_dn: -1.0 },
            ValueOutOfRange,
            "bad_value",
            &["Gain.e_per_dn", "above 0"],
        ),
        case(
            "gain too large",
            Command::Gain { e_per_dn: 1e9 },
            ValueOutOfRange,
            "bad_value",
            &["Gain.e_per_dn", "1000000000"],
        ),
        case(
            "frame rate of zero",
            Command::FrameRate { hz: 0.0 },
            ValueOutOfRange,
            "bad_value",
            &["FrameRate.hz", "above 0"],
        ),
        case(
            "frame rate on the stepped clock",
            Command::FrameRate { hz: 5.0 },
            NotSupported,
            "refused",
            &["FrameRate", "stepped", "attitude"],
        ),
        case(
            "single shot on the stepped clock",
            Command::SingleShot,
            NotSupported,
            "refused",
            &["SingleShot", "stepped", "Attitude"],
        ),
        spoilt(
            "wrong CRC",
            |p| *p.last_mut().unwrap() ^= 1,
            BadCrc,
            "bad_crc",
            &["CRC-16", "0x", "again"],
        ),
        spoilt(
            "a payload bit flipped",
            |p| p[30] ^= 0x10,
            BadCrc,
            "bad_crc",
            &["CRC-16"],
        ),
        spoilt(
            "wrong format version",
            |p| {
                p[14] = 2;
                reseal(p)
            },
            BadVersion,
            "bad_version",
            &["format version", "2", "1"],
        ),
        spoilt(
            "wrong packet version",
            |p| {
                p[0] |= 0x20;
                reseal(p)
            },
            BadVersion,
            "bad_version",
            &["packet version number", "1", "0"],
        ),
        spoilt(
            "a header and nothing else",
            |p| cut(p, 10),
            BadLength,
            "bad_length",
            &["packet", "10", "17"],
        ),
        spoilt(
            "cut short",
            |p| cut(p, 60),
            BadLength,
            "bad_length",
            &["packet", "60", "126"],
        ),
        spoilt(
            "an octet too many",
            |p| {
                p.push(0);
                reseal(p)
            },
            BadLength,
            "bad_length",
            &["packet", "127", "126"],
        ),
        spoilt(
            "a layout too short",
            |p| {
                p.truncate(p.len() - 8);
                p[5] -= 8;
                reseal(p)
            },
            BadLength,
            "bad_length",
            &["Attitude"],
        ),
        spoilt(
            "a layout too long",
            |p| {
                p.insert(p.len() - CRC_LENGTH, 0);
                p[5] += 1;
                reseal(p)
            },
            BadLength,
            "bad_length",
            &["Attitude"],
        ),
        spoilt(
            "unknown APID",
            |p| {
                p[1] = 0x77;
                reseal(p)
            },
            UnknownType,
            "unknown_type",
            &["APID 0x177"],
        ),
        spoilt(
            "an APID of the other direction",
            |p| {
                p[0] = 0x0a;
                p[1] = 0x01;
                reseal(p)
            },
            UnknownType,
            "unknown_type",
            &["APID 0x201"],
        ),
        spoilt(
            "the type bit of the other direction",
            |p| {
                p[0] &= !0x10;
                reseal(p)
            },
            UnknownType,
            "unknown_type",
            &["type bit", "octet 0"],
        ),
        spoilt(
            "no secondary header",
            |p| {
                p[0] &= !0x08;
                reseal(p)
            },
            UnknownType,
            "unknown_type",
            &["secondary header flag", "octet 0"],
        ),
        spoilt(
            "a segmented packet",
            |p| {
                p[2] &= 0x3f;
                reseal(p)
            },
            UnknownType,
            "unknown_type",
            &["sequence flags", "octet 2"],
        ),
        Case {
            command: Command::Ping,
            ..spoilt(
                "unknown opcode",
                |p| {
                    p[15] = 99;
                    reseal(p)
                },
                UnknownType,
                "unknown_type",
                &["opcode 99", "octet 15"],
            )
        },
    ]
}

#[test]
fn a_bad_packet_is_refused_by_name_counted_once_and_costs_nothing_else() {
    for (link, _emulator, line) in on_every_link(Clock::Stepped) {
        let mut client = Client::new(line);
        let reference = client.good_frame(1);
        for Case {
            name,
            command,
            time,
            spoil,
            reason,
            counter,
            says,
        } in cases()
        {
            let name = format!("{link}: {name}");
            let before = client.status().counters;
            let counts = client.counts.clone();
            let (mut packet, count) = client.prepare(&command, time);
            spoil(&mut packet);
            let stated = u16::from_be_bytes([packet[0], packet[1]]) & 0x7ff;
            if stated != command.apid() {
                // Another APID has counts of its own.
                client.counts = counts;
            }
            client.line.send(&packet);
            let nack = client.nack();
            assert_eq!((nack.apid, nack.sequence_count), (stated, count), "{name}");
            assert_eq!(nack.reason, reason, "{name}: {}", nack.detail);
            for word in says {
                assert!(
                    nack.detail.contains(word),
                    "{name}: {:?} in {:?}",
                    word,
                    nack.detail
                );
            }
            let after = client.status().counters;
            assert_eq!(moved(&before, &after), [(counter, 1)], "{name}");
            assert_eq!(
                after.commands,
                before.commands + 1,
                "{name}: the second Ping alone"
            );
            let frame = client.good_frame(1);
            assert!(
                frame.pixels == reference.pixels,
                "{name}: the next frame is as before"
            );
            let sound = client.status().counters;
            let expected = [
                ("attitudes", 1),
                ("frames_rendered", 1),
                ("frames_delivered", 1),
            ];
            assert_eq!(moved(&after, &sound), expected, "{name}");
        }
        assert!(client.has_nothing_left(), "{link}");
    }
}

#[test]
fn a_quaternion_within_the_tolerance_is_normalised() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 5.0);
    let mut client = Client::new(line);
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
    // X-Val: the same direction as Q, whose own norm is 1 within 1e-6.
    assert!(q.iter().zip(Q).all(|(a, b)| (a - b).abs() < 2e-6), "{q:?}");
    assert_eq!(client.status().counters.bad_attitude, 0);
}

#[test]
fn an_oversize_or_empty_datagram_is_refused_for_its_length() {
    let (_emulator, line) = on_udp(scene(), Clock::Stepped, 5.0);
    let mut client = Client::new(line);
    let before = client.status().counters;
    for (sent, length) in [0, 1, 16, 1401, 9000].into_iter().enumerate() {
        client.line.send(&vec![0; length]);
        let nack = client.nack();
        assert_eq!(nack.reason, Reason::BadLength, "{length}: {}", nack.detail);
        assert!(
            nack.detail
                .contains(&format!("{} octets", length.min(1401))),
            "{}",
            nack.detail
        );
        assert_eq!(
            client.status().counters.bad_length,
            before.bad_length + sent as u32 + 1
        );
    }
    client.good_frame(1);
}

#[test]
fn garbage_and_damaged_frames_on_a_serial_line_are_counted_and_passed_over() {
    let (_emulator, line) = on_serial(scene(), Clock::Stepped);
    let mut client = Client::new(line);
    let reference = client.good_frame(1);
    let whole = |client: &mut Client<PtyLine>| {
        let (packet, _) = client.prepare(&Command::Ping, EPOCH);
        let mut line = Vec::new();
        slip::encode(&packet, &mut |octet| line.push(octet));
        line
    };
    let long = [vec![END], vec![0x55; 3000], vec![END]].concat();
    let mut flipped = whole(&mut client);
    flipped[8] ^= 4;
    let mut cut = whole(&mut client);
    cut.drain(9..14);
    let damaged: [(&str, Vec<u8>); 6] = [
        ("garbage", b"\x01\x02login: garbage\xff\xfe\xc0".to_vec()),
        ("a frame too short", vec![END, 1, 2, 3, END]),
        (
            "a bad escape",
            vec![END, 1, 2, 3, 4, 5, 6, ESC, 0x01, 7, 8, 9, END],
        ),
        ("a frame too long", long),
        ("a wrong CRC-32", flipped),
        ("octets lost", cut),
    ];
    for (name, octets) in damaged {
        let before = client.status().counters;
        client.line.raw(&octets);
        let after = client.status().counters;
        let found = moved(&before, &after);
        let frames = found.iter().find(|(counter, _)| *counter == "bad_framing");
        assert_eq!(frames, Some(&("bad_framing", 1)), "{name}: {found:?}");
        assert!(client.good_frame(1).pixels == reference.pixels, "{name}");
    }
    // Empty frames and line noise between packets: nothing at all is counted.
    let before = client.status().counters;
    client.line.raw(&[END, END, END]);
    assert_eq!(moved(&before, &client.status().counters), []);
}
