//! The table of bad packets.

use crate::support::{EPOCH, Q, attitude, later};
use nalgebra::Vector3;
use skyloop::sky::bodies::Bodies;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_protocols::packet::{CRC_LENGTH, reseal};
use skyloop_protocols::{Attitude, Command, OrbitState, Reason, WireTime};

/// A bad packet and what must come of it.
pub struct Case {
    pub name: &'static str,
    pub command: Command,
    pub time: WireTime,
    /// Damages the packet.
    pub spoil: fn(&mut Vec<u8>),
    pub reason: Reason,
    pub counter: &'static str,
    /// Words that the refusal's text must have.
    pub says: &'static [&'static str],
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

/// An attitude whose quaternion has the norm `factor`.
pub fn q_times(factor: f64) -> Command {
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

/// 1000 km above the Moon's centre at [`EPOCH`], GCRF, m.
fn in_the_moon() -> [f64; 3] {
    let moon_m = Bodies::at(to_epoch(EPOCH)).unwrap().moon_geocentric_m;
    (moon_m + Vector3::new(0.0, 0.0, 1e6)).into()
}

/// Leaves the first `length` octets, sealed anew, with the length that the header states left as it was.
fn cut(packet: &mut Vec<u8>, length: usize) {
    packet.truncate(length);
    reseal(packet);
}

/// Every bad packet.
pub fn cases() -> Vec<Case> {
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
            &["attitude 902", "position", "at least 6356000 m"],
        ),
        case(
            "position inside the Moon",
            with_state(in_the_moon(), V),
            ValueOutOfRange,
            "bad_value",
            &["attitude 902", "from the Moon's centre", "1737.4 km"],
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
        case(
            "turning too far during the exposure",
            Command::Attitude(Attitude {
                // 20 rad/s for 0.1 s: 114.6 degrees.
                rates_rad_s: [0.0, 20.0, 0.0],
                ..attitude(905)
            }),
            ValueOutOfRange,
            "bad_value",
            &["attitude 905", "114.6 deg", "57.3 deg", "lower the rates"],
        ),
        case(
            "no position to see the objects from",
            Command::Attitude(Attitude {
                state: None,
                ..attitude(906)
            }),
            ValueOutOfRange,
            "bad_value",
            &["attitude 906", "no position", "send the state"],
        ),
        back,
        case(
            "exposure of zero",
            Command::Exposure { seconds: 0.0 },
            ValueOutOfRange,
            "bad_value",
            &["Exposure.seconds must be 1e-9 to 1e4 s"],
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
            &["Gain.e_per_dn must be 1e-4 to 1e6 e-/DN"],
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
            &["FrameRate.hz must be 1e-4 to 1e4 Hz"],
        ),
        case(
            "frame rate on the stepped clock",
            Command::FrameRate { hz: 5.0 },
            NotSupported,
            "refused",
            &["FrameRate", "each Attitude gives its frame"],
        ),
        case(
            "single shot on the stepped clock",
            Command::SingleShot,
            NotSupported,
            "refused",
            &["SingleShot", "each Attitude gives its frame"],
        ),
        case(
            "trigger on the stepped clock",
            Command::Trigger {
                number: 1,
                start: EPOCH,
            },
            NotSupported,
            "refused",
            &["Trigger", "run.trigger = \"packet\""],
        ),
        case(
            "trigger of number 0",
            Command::Trigger {
                number: 0,
                start: EPOCH,
            },
            ValueOutOfRange,
            "bad_value",
            &["Trigger.number"],
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
                p[14] = 9;
                reseal(p)
            },
            BadVersion,
            "bad_version",
            &["format version", "9", "3"],
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
            "runts",
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
