//! The table of bad packets.

use crate::support::{EPOCH, Q, attitude, later};
use nalgebra::Vector3;
use skyloop::sky::bodies::Bodies;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_protocols::packet::CRC_LENGTH;
use skyloop_protocols::{Attitude, Command, OrbitState, Reason, WireTime};

pub struct Case {
    /// Kind of damage; empty if the command itself is wrong.
    pub damage: &'static str,
    pub command: Command,
    pub time: WireTime,
    /// Damages the packet, whose CRC is then updated, except for damage of the CRC itself.
    pub damage_packet: fn(&mut Vec<u8>),
    pub reason: Reason,
    pub counter: &'static str,
    /// Words of the refusal, separated by bars.
    pub says: &'static str,
}

/// An attitude whose quaternion has the norm `factor`.
pub fn q_times(factor: f64) -> Command {
    let norm = Q.iter().map(|c| c * c).sum::<f64>().sqrt();
    Command::Attitude(Attitude {
        q_icrf_to_body: Q.map(|c| c / norm * factor),
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

fn with_rate(rate_rad_s: f64) -> Command {
    Command::Attitude(Attitude {
        rates_rad_s: [0.0, rate_rad_s, 0.0],
        ..attitude(904)
    })
}

fn trigger(number: u32) -> Command {
    Command::Trigger {
        number,
        start: EPOCH,
    }
}

/// 1000 km above the Moon's centre at [`EPOCH`], GCRF, m.
fn in_the_moon() -> [f64; 3] {
    let moon_m = Bodies::at(to_epoch(EPOCH)).unwrap().moon_geocentric_m;
    (moon_m + Vector3::new(0.0, 0.0, 1e6)).into()
}

pub fn cases() -> Vec<Case> {
    let back = Case {
        time: later(EPOCH, -0.25),
        reason: Reason::TimeBackwards,
        counter: "time_backwards",
        says: "attitude 905 | 0.250000 s before | Reset",
        ..valid("", Command::Attitude(attitude(905)))
    };
    let cases = commands().into_iter().chain([back]);
    cases.chain(damaged()).collect()
}

fn valid(damage: &'static str, command: Command) -> Case {
    Case {
        damage,
        command,
        time: EPOCH,
        damage_packet: |_| {},
        reason: Reason::NotSupported,
        counter: "",
        says: "",
    }
}

fn commands() -> Vec<Case> {
    const R: [f64; 3] = [7.0e6, 0.0, 0.0];
    const V: [f64; 3] = [0.0, 7.5e3, 0.0];
    let infinite = with_state([f64::INFINITY, 0.0, 0.0], V);
    let in_the_earth = with_state([1e6, 0.0, 0.0], V);
    let in_the_moon = with_state(in_the_moon(), V);
    let fast = with_state(R, [1e6, 0.0, 0.0]);
    let no_position = Command::Attitude(Attitude {
        state: None,
        ..attitude(906)
    });
    let exposure = |seconds| Command::Exposure { seconds };
    let gain = |e_per_dn| Command::Gain { e_per_dn };
    let rate = |hz| Command::FrameRate { hz };
    let not_unit = vec![
        (
            q_times(1.0011),
            "q_icrf_to_body | norm | 1.00220 | normalise",
        ),
        (q_times(0.9989), "q_icrf_to_body | norm"),
        (q_times(0.0), "q_icrf_to_body | norm"),
    ];
    let not_finite = vec![
        (q_times(f64::NAN), "Attitude.q_icrf_to_body | NaN"),
        (with_rate(f64::NAN), "Attitude.rates_rad_s | NaN"),
        (infinite, "Attitude.position_m | infinity"),
        (with_state(R, [f64::NAN; 3]), "Attitude.velocity_m_s"),
    ];
    // 20 rad/s for 0.1 s are 114.6 degrees.
    let out_of_range = vec![
        (in_the_earth, "attitude 902 | position | at least 6356000 m"),
        (
            in_the_moon,
            "attitude 902 | from the Moon's centre | 1737.4 km",
        ),
        (fast, "attitude 902 | velocity | 1e5 m/s"),
        (with_rate(700.0), "attitude 904 | rates | 628.4"),
        (
            with_rate(20.0),
            "attitude 904 | 114.6 deg | 57.3 deg | lower the rates",
        ),
        (
            no_position,
            "attitude 906 | no position | send the orbit state",
        ),
        (exposure(0.0), "Exposure.seconds must be 1e-9 to 1e4 s"),
        (exposure(1e6), "Exposure.seconds | 1000000 | 10000"),
        (exposure(f64::NAN), "Exposure.seconds"),
        (gain(-1.0), "Gain.e_per_dn must be 1e-4 to 1e6 e-/DN"),
        (gain(1e9), "Gain.e_per_dn | 1000000000"),
        (rate(0.0), "FrameRate.hz must be 1e-4 to 1e4 Hz"),
        (trigger(0), "Trigger.number"),
    ];
    let by_the_stepped_clock = vec![
        (rate(5.0), "FrameRate | each Attitude requests a frame"),
        (
            Command::SingleShot,
            "SingleShot | each Attitude requests a frame",
        ),
        (trigger(1), "Trigger | run.trigger = \"packet\""),
    ];
    let groups = [
        (Reason::QuaternionNotUnit, "bad_attitude", not_unit),
        (Reason::NotFinite, "bad_attitude", not_finite),
        (Reason::ValueOutOfRange, "bad_value", out_of_range),
        (Reason::NotSupported, "refused", by_the_stepped_clock),
    ];
    let cases = groups.into_iter().flat_map(|(reason, counter, rows)| {
        let case = move |(command, says)| Case {
            reason,
            counter,
            says,
            ..valid("", command)
        };
        rows.into_iter().map(case)
    });
    cases.collect()
}

type Damage = fn(&mut Vec<u8>);

/// Damaged and unknown packets: kind, damage to an Attitude, and words of the refusal.
fn damaged() -> Vec<Case> {
    let crc: [(_, Damage, _); 2] = [
        (
            "wrong CRC",
            |p| *p.last_mut().unwrap() ^= 1,
            "CRC-16 | 0x | again",
        ),
        ("a bit flipped", |p| p[30] ^= 0x10, "CRC-16"),
    ];
    let version: [(_, Damage, _); 2] = [
        ("of the format", |p| p[14] = 9, "format version | 9 | 3"),
        (
            "of packets",
            |p| p[0] |= 0x20,
            "packet version number | 1 | 0",
        ),
    ];
    let runts: [(_, Damage, _); 1] = [("a header alone", |p| p.truncate(10), "packet | 10 | 17")];
    let length: [(_, Damage, _); 4] = [
        ("cut short", |p| p.truncate(60), "packet | 60 | 126"),
        ("a byte too many", |p| p.push(0), "packet | 127 | 126"),
        ("a layout too short", shorten, "Attitude"),
        ("a layout too long", lengthen, "Attitude"),
    ];
    let of_the_emulator: Damage = |p| p[..2].copy_from_slice(&[0x0a, 0x01]);
    let types: [(_, Damage, _); 5] = [
        ("unknown APID", |p| p[1] = 0x77, "APID 0x177"),
        (
            "an APID of the other direction",
            of_the_emulator,
            "APID 0x201",
        ),
        (
            "the other type bit",
            |p| p[0] &= !0x10,
            "type bit | octet 0",
        ),
        (
            "short header",
            |p| p[0] &= !0x08,
            "secondary header flag | octet 0",
        ),
        ("a segment", |p| p[2] &= 0x3f, "sequence flags | octet 2"),
    ];
    let groups = [
        (Reason::BadCrc, "bad_crc", &crc[..]),
        (Reason::BadVersion, "bad_version", &version),
        (Reason::BadLength, "runts", &runts),
        (Reason::BadLength, "bad_length", &length),
        (Reason::UnknownType, "unknown_type", &types),
    ];
    let mut cases = vec![Case {
        damage_packet: |p| p[15] = 99,
        reason: Reason::UnknownType,
        counter: "unknown_type",
        says: "opcode 99 | octet 15",
        ..valid("unknown opcode", Command::Ping)
    }];
    for (reason, counter, rows) in groups {
        let case = |(name, damage, says): &(&'static str, Damage, &'static str)| Case {
            damage_packet: *damage,
            reason,
            counter,
            says,
            ..valid(name, Command::Attitude(attitude(900)))
        };
        cases.extend(rows.iter().map(case));
    }
    cases
}

/// Shortens the layout, in a packet with a consistent length.
fn shorten(packet: &mut Vec<u8>) {
    packet.truncate(packet.len() - 8);
    packet[5] -= 8;
}

fn lengthen(packet: &mut Vec<u8>) {
    packet.insert(packet.len() - CRC_LENGTH, 0);
    packet[5] += 1;
}
