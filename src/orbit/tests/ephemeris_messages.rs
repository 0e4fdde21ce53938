//! CCSDS OEM files: accepted messages, interpolation, and refused messages.

use crate::support::texts::{oem as message, rows};
use hifitime::{Epoch, TimeScale, Unit};
use proptest::prelude::*;
use skyloop_orbit::ephemeris::NotCovered;
use skyloop_orbit::frames::{eme2000_to_gcrf, teme_to_gcrf};
use skyloop_orbit::{Loaded, Object, Orbit, OrbitError, StateVector, load, parse};
use std::path::PathBuf;

const NAMES: [&str; 4] = ["cassiope", "rcm-1", "rcm-2", "rcm-3"];

/// The files of a scene: four objects, states A and B.
fn scene() -> Vec<PathBuf> {
    let folder =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../configs/scenes/rcm-2019-06-15");
    (NAMES.iter())
        .flat_map(|name| [format!("{name}-A.oem"), format!("{name}-B.oem")])
        .map(|file| folder.join(file))
        .collect()
}

fn utc(hour: u8, minute: u8, second: u8, nanos: u32) -> Epoch {
    Epoch::from_gregorian_utc(2019, 6, 15, hour, minute, second, nanos)
}

const STATES: [&str; 4] = [
    "2019-06-15T00:00:00 7000 0 0 1 0 0",
    "2019-06-15T00:00:10.000 7010 0 0 1 0 0",
    "2019-166T00:00:20.0Z 7020 0 0 1 0 0 0.1 0.2 0.3",
    "2019-06-15T00:00:30 7030 0 0 1 0 0",
];

fn read(text: &str) -> Loaded {
    parse(text, "test.oem").unwrap()
}

fn only(text: &str) -> Object {
    let mut loaded = read(text);
    assert_eq!(loaded.rejected, []);
    assert_eq!(loaded.objects.len(), 1);
    loaded.objects.remove(0)
}

fn distance(a: &StateVector, b: &StateVector) -> f64 {
    (a.position_m - b.position_m).norm()
}

#[test]
fn the_scene_loads_and_gives_its_own_states() {
    for path in scene() {
        let loaded = load(&path).unwrap();
        assert_eq!(loaded.rejected, []);
        let [object] = &loaded.objects[..] else {
            panic!("{}: not one object", path.display())
        };
        let Orbit::Ephemeris(ephemeris) = &object.orbit else {
            panic!("not an ephemeris")
        };
        let (start, stop) = (utc(23, 35, 30, 0), utc(23, 36, 30, 0));
        assert!(ephemeris.state(start).is_ok() && ephemeris.state(stop).is_ok());
        for beyond in [start - Unit::Nanosecond, stop + Unit::Nanosecond] {
            let covered = NotCovered { start, stop };
            assert_eq!(ephemeris.state(beyond), Err(covered));
        }
    }
    let cassiope = load(&scene()[0]).unwrap().objects.remove(0);
    assert_eq!(cassiope.label(), "2013-055A (CASSIOPE)");
    // X-Val: third state line of cassiope-A.oem
    let state = cassiope.state(utc(23, 35, 32, 0)).unwrap();
    let written = [-4_439_732.948, 903_220.618, -5_282_553.351];
    assert!((state.position_m - nalgebra::Vector3::from(written)).norm() < 1e-6);
    let written = [5451.014509, -3004.102491, -4500.059537];
    assert!((state.velocity_m_s - nalgebra::Vector3::from(written)).norm() < 1e-9);
}

#[test]
fn odd_states_are_interpolated_from_even_ones() {
    let (mut worst_m, mut worst_m_s) = (0.0_f64, 0.0_f64);
    for path in scene() {
        let text = std::fs::read_to_string(&path).unwrap();
        let full = only(&text);
        let is_state = |line: &str| line.starts_with("2019");
        let (even, mut index) = (text.lines(), 0);
        let even: Vec<&str> = even
            .filter(|line| {
                index += usize::from(is_state(line));
                !is_state(line) || index % 2 == 1
            })
            .collect();
        let thinned = only(&even.join("\n"));
        for second in (1..60).step_by(2) {
            let t = utc(23, 35, 30, 0) + f64::from(second) * Unit::Second;
            let (a, b) = (full.state(t).unwrap(), thinned.state(t).unwrap());
            worst_m = worst_m.max(distance(&a, &b));
            worst_m_s = worst_m_s.max((a.velocity_m_s - b.velocity_m_s).norm());
        }
    }
    println!("odd from even states: at most {worst_m:.2e} m, {worst_m_s:.2e} m/s");
    // The files have 1 mm and 1 um/s; a window at an end amplifies the rounding.
    assert!(
        worst_m < 5e-3 && worst_m_s < 5e-6,
        "{worst_m} m, {worst_m_s} m/s"
    );
}

#[test]
fn comments_covariance_accelerations_and_both_date_forms_are_read() {
    let text = message("COMMENT a remark = here\n", &STATES)
        + "COVARIANCE_START\nEPOCH = 2019-06-15T00:00:00\nCX_X = 1\n1 2 3\nCOVARIANCE_STOP\n";
    let texts = [text.replace('\n', "\r\n"), format!("\u{feff}{text}"), text];
    for text in texts {
        let object = only(&text);
        assert_eq!((&*object.id, &*object.names[0]), ("2019-001A", "MADE UP"));
        let state = object.state(utc(0, 0, 25, 500_000_000)).unwrap();
        assert!((state.position_m.x - 7_025_500.0).abs() < 1e-6);
    }
}

#[test]
fn the_error_outside_the_interval_names_object_epoch_and_interval() {
    let useable = "USEABLE_START_TIME = 2019-06-15T00:00:05\n\
                   USEABLE_STOP_TIME = 2019-06-15T00:00:25\n";
    let object = only(&message(useable, &STATES));
    let (first, last) = (utc(0, 0, 5, 0), utc(0, 0, 25, 0));
    assert!(object.state(first).is_ok() && object.state(last).is_ok());
    for t in [first - Unit::Nanosecond, last + Unit::Nanosecond] {
        let wanted = OrbitError::OutsideInterval {
            object: "2019-001A (MADE UP)".to_owned(),
            epoch: t,
            start: first,
            stop: last,
        };
        assert_eq!(object.state(t), Err(wanted));
    }
    let message = object.state(utc(1, 0, 0, 0)).unwrap_err().to_string();
    for part in [
        "2019-001A (MADE UP)",
        "2019-06-15T01:00:00.000Z",
        "2019-06-15T00:00:05.000Z to 2019-06-15T00:00:25.000Z",
    ] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn nothing_is_extrapolated_past_the_states() {
    let stated = "START_TIME = 2019-06-14T00:00:00\nSTOP_TIME = 2019-06-16T00:00:00\n";
    let object = only(&message(stated, &STATES));
    assert!(object.state(utc(0, 0, 30, 0)).is_ok());
    assert!(object.state(utc(0, 0, 30, 1)).is_err());
}

#[test]
fn segments_are_not_mixed() {
    let span = "START_TIME = 2019-06-15T00:01:00\nSTOP_TIME = 2019-06-15T00:01:10\n";
    let second = [
        "2019-06-15T00:01:00 8000 0 0 2 0 0",
        "2019-06-15T00:01:10 8020 0 0 2 0 0",
    ];
    let object = only(&(message("", &STATES) + headless(&message(span, &second))));
    let x = |t| object.state(t).map(|state| state.position_m.x);
    assert!((x(utc(0, 0, 29, 0)).unwrap() - 7_029_000.0).abs() < 1e-6);
    assert!((x(utc(0, 1, 5, 0)).unwrap() - 8_010_000.0).abs() < 1e-6);
    // In the gap the nearer interval is named.
    let Err(OrbitError::OutsideInterval { start, .. }) = object.state(utc(0, 0, 50, 0)) else {
        panic!("the gap is not covered")
    };
    assert_eq!(start, utc(0, 1, 0, 0));
}

/// The segment of a message without its version line.
fn headless(message: &str) -> &str {
    message.split_once('\n').unwrap().1
}

#[test]
fn a_bad_segment_is_reported_and_the_rest_loads() {
    let bad = message("REF_FRAME = LVLH\n", &STATES);
    let good = message("OBJECT_ID = 2019-002A\n", &STATES);
    let loaded = read(&(bad + headless(&good)));
    assert_eq!(loaded.objects.len(), 1);
    assert_eq!(loaded.objects[0].id, "2019-002A");
    let [refused] = &loaded.rejected[..] else {
        panic!("{:?}", loaded.rejected)
    };
    assert_eq!(
        refused.to_string(),
        "test.oem:3: REF_FRAME 'LVLH'; expected GCRF, ICRF, EME2000, J2000, MOD, TOD, TEME, \
         ITRF (of any year), WGS84, TDR, GTOD and PEF: give the data in one of them, GCRF at best"
    );
}

/// Metadata, or the second state after its year; line and reason of the refusal.
const DAMAGE: &str = r"
        CENTER_NAME = MARS | 3 | CENTER_NAME 'MARS'; only EARTH is read: give the states from the Earth's
        REF_FRAME = GCRF\nREF_FRAME = TEME | 4 | REF_FRAME twice: 'GCRF' and 'TEME'; keep one
        TIME_SYSTEM = UT1        | 3 | TIME_SYSTEM UT1 needs UT1 - UTC
        REF_FRAME = ITRF-97\nCOMMENT UT1-UTC = -163 ms | 4 | UT1-UTC '-163 ms' is not a number of seconds
        TIME_SYSTEM = X          | 3 | TIME_SYSTEM 'X'
        START_TIME = x           | 3 | START_TIME 'x'
        START_TIME = 2019-06-16T00:00:00 | 2 | no state lies between
        OBJECT_IDS = A           | 2 | no OBJECT_ID
        INTERPOLATION = SPLINE   | 3 | INTERPOLATION 'SPLINE'
        INTERPOLATION_DEGREE = 0 | 3 | INTERPOLATION_DEGREE '0'
        what is this             | 3 | not KEY = VALUE
        06-15T00:00:10 0 0 0 0 0 0          | 12 | nearer than 1000 km to the Earth's centre
        // Velocities of 0.
        06-15T00:00:10 7010 0 0 0 0 0       | 12 | velocities 50 % off
        06-15T00:00:10 7000 0 0 1 0         | 12 | not 6 values
        06-15T00:00:10 7000 0 0 1 0 x       | 12 | not a number
        06-15T00:00:10 7000 0 0 1 0 NaN     | 12 | not a number
        // In metres.
        06-15T00:00:10 7000000 0 0 7500 0 0 | 12 | km and km/s
        06-15T00:00:10 7000 0 0 7500 0 0    | 12 | km and km/s
        06-15T00:00:10 1e300 0 0 1 0 0      | 12 | km and km/s
        06-15T00:00:00 7000 0 0 1 0 0       | 12 | not after the one before
        02-29T00:00:10 7000 0 0 1 0 0       | 12 | no epoch
        06-15T24:00:00 7000 0 0 1 0 0       | 12 | no epoch
        06-15T00:00:60 7000 0 0 1 0 0       | 12 | no epoch
        ";

#[test]
fn every_kind_of_damage_is_reported_with_its_line() {
    for [given, line, reason] in rows(DAMAGE) {
        let text = if given.starts_with('0') {
            message("", &[STATES[0], &format!("2019-{given}"), STATES[3]])
        } else {
            message(&format!("{given}\n"), &STATES)
        };
        assert_refused(&text, line.parse().unwrap(), &reason);
    }
    // Inertial velocities in an Earth-fixed frame: w r = 0.51 km/s of 7.5 km/s.
    let inertial = [
        "2019-06-15T00:00:00 7000 0 0 0 7.5 0",
        "2019-06-15T00:00:10 7000 69.9 0 0 7.5 0",
    ];
    let misspelt = message("", &STATES).replace("META_START", "META_BEGIN");
    for (text, line, reason) in [
        (
            message("REF_FRAME = ITRF2014\n", &inertial),
            12,
            "velocities 7 % off",
        ),
        (message("", &STATES[..0]), 2, "no states"),
        (
            message("", &STATES[..1]),
            2,
            "a single state, and nothing is extrapolated",
        ),
        (misspelt, 2, "outside of every segment"),
        (
            "CCSDS_OEM_VERS = 2.0\nMETA_START\n".to_owned(),
            2,
            "without META_STOP",
        ),
    ] {
        assert_refused(&text, line, reason);
    }
}

fn assert_refused(text: &str, line: usize, reason: &str) {
    let loaded = read(text);
    assert!(loaded.objects.is_empty(), "{reason}");
    let [refused] = &loaded.rejected[..] else {
        panic!("{reason}: {:?}\n{text}", loaded.rejected)
    };
    let text = refused.to_string();
    let has_line = text.starts_with(&format!("test.oem:{line}: "));
    assert!(
        has_line && text.contains(reason),
        "{reason}, line {line}: {text}"
    );
}

#[test]
fn time_systems_have_their_offsets() {
    // X-Val: UT1 - UTC as given. 2019: TAI = UTC + 37 s, TT = TAI + 32.184 s, GPS = TAI - 19 s
    // (IERS Bulletin C 57). pyerfa 2.0.1.5, dtdb: TDB = TT + 0.0005631 s; skyloop is within 10 us.
    for (system, ahead_s, tolerance_m) in [
        ("UTC", 0.0, 1e-6),
        ("TAI", 37.0, 1e-6),
        ("TT", 69.184, 1e-6),
        ("GPS", 18.0, 1e-6),
        ("TDB", 69.184_563_1, 0.01),
        ("UT1", -0.1634, 1e-6),
    ] {
        let meta = format!("TIME_SYSTEM = {system}\nCOMMENT UT1-UTC = -0.1634 s\n");
        let t = utc(0, 0, 20, 0) - ahead_s * Unit::Second;
        let state = only(&message(&meta, &STATES)).state(t).unwrap();
        assert!(
            (state.position_m.x - 7_020_000.0).abs() < tolerance_m,
            "{system}"
        );
    }
}

#[test]
fn a_leap_second_in_a_segment_lasts_a_second() {
    let states = [
        "2016-12-31T23:59:58 7000 0 0 1 0 0",
        "2016-12-31T23:59:60 7002 0 0 1 0 0",
        "2017-01-01T00:00:00.5 7003.5 0 0 1 0 0",
        "2017-01-01T00:00:02 7005 0 0 1 0 0",
    ];
    let interval = "START_TIME = 2016-12-31T23:59:58\nSTOP_TIME = 2017-01-01T00:00:02\n";
    let object = only(&message(interval, &states));
    let start =
        Epoch::from_gregorian_utc(2016, 12, 31, 23, 59, 58, 0).to_time_scale(TimeScale::TAI);
    for half_seconds in 0..=10 {
        let dt = f64::from(half_seconds) / 2.0;
        let state = object.state(start + dt * Unit::Second).unwrap();
        assert!(
            (state.position_m.x - 7_000_000.0 - dt * 1000.0).abs() < 1e-6,
            "{dt}"
        );
    }
}

#[test]
fn frames_are_rotated_to_gcrf() {
    let t = utc(0, 0, 10, 0);
    let gcrf = only(&message("", &STATES)).state(t).unwrap();
    for (frame, rotation) in [
        ("ICRF", nalgebra::Matrix3::identity()),
        ("EME2000", eme2000_to_gcrf()),
        ("J2000", eme2000_to_gcrf()),
        ("TEME", teme_to_gcrf(t)),
    ] {
        let object = only(&message(&format!("REF_FRAME = {frame}\n"), &STATES));
        assert!(
            distance(&object.state(t).unwrap(), &gcrf.rotated(&rotation)) < 1e-6,
            "{frame}"
        );
    }
    // X-Val: the frame bias is 23 milliarcseconds (IERS Conventions 2010, section 5.4.4)
    let bias = (eme2000_to_gcrf() - nalgebra::Matrix3::identity()).norm() / 2.0_f64.sqrt();
    assert!((bias.to_degrees() * 3.6e6 - 23.0).abs() < 1.0);
}

fn cubic(t: f64) -> f64 {
    7000.0 + 5.0 * t + t.powi(3) / 100.0
}

#[test]
fn each_degree_uses_its_number_of_states() {
    // x = 5 t + t^3 / 100: exact from degree 3 on only.
    let states: Vec<String> = (0..9)
        .map(|k| {
            let (x, v) = (cubic(f64::from(k)), 5.0 + 0.03 * f64::from(k * k));
            format!("2019-06-15T00:00:0{k} {x:.9} 0 0 {v:.9} 0 0")
        })
        .collect();
    for degree in 1..=9 {
        let method = if degree == 1 { "LINEAR" } else { "LAGRANGE" };
        let meta = format!("INTERPOLATION = {method}\nINTERPOLATION_DEGREE = {degree}\n");
        let object = only(&message(&meta, &states));
        for tenth in 0..=80_u32 {
            let t = f64::from(tenth) / 10.0;
            let at = utc(0, 0, 0, 0) + i64::from(tenth) * 100 * Unit::Millisecond;
            let error = object.state(at).unwrap().position_m.x / 1e3 - cubic(t);
            let exact = degree >= 3 || tenth % 10 == 0;
            assert_eq!(
                error.abs() < 1e-9,
                exact,
                "degree {degree} at {t} s: {error}"
            );
        }
    }
}

proptest! {
    #[test]
    fn any_text_in_a_message_is_read_without_panic(
        meta in "([A-Z_]{1,20} = [ -~é]{0,20}\n){0,3}",
        state in "[-0-9T:.Z]{0,24}( [-0-9.eE]{1,8}){0,9}[ -~é]{0,4}",
        tail in "(?s).{0,80}",
    ) {
        let text = message(&meta, &[STATES[0], &state, STATES[3]]) + &tail;
        for text in [text.clone(), text.replace("META_STOP\n", "META_STOP\nMETA_START\n")] {
            if let Ok(loaded) = parse(&text, "any") {
                for object in &loaded.objects {
                    let _ = object.state(utc(0, 0, 10, 0));
                }
            }
        }
    }
}
