//! Leap seconds to the nanosecond, years from 1950 to 2100, and the clock of long missions.

use crate::stage::{camera, check_numbers, epoch, noon, starry, vehicle};
use hifitime::{Duration, Epoch, Unit};
use skyloop::attitude::Attitude;
use skyloop::fidelity::Fidelity;
use skyloop::orbit::time::{parse_utc, seconds, utc_text};
use skyloop::scene::Unobservable;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::time::{to_epoch, to_wire};

/// The days that ended with a leap second.
// X-Val: IERS Bulletin C 52 and its predecessors; 10 s on 1 January 1972.
const LEAPS: [&str; 27] = [
    "1972-06-30",
    "1972-12-31",
    "1973-12-31",
    "1974-12-31",
    "1975-12-31",
    "1976-12-31",
    "1977-12-31",
    "1978-12-31",
    "1979-12-31",
    "1981-06-30",
    "1982-06-30",
    "1983-06-30",
    "1985-06-30",
    "1987-12-31",
    "1989-12-31",
    "1990-12-31",
    "1992-06-30",
    "1993-06-30",
    "1994-06-30",
    "1995-12-31",
    "1997-06-30",
    "1998-12-31",
    "2005-12-31",
    "2008-12-31",
    "2012-06-30",
    "2015-06-30",
    "2016-12-31",
];

/// Every nanosecond around every leap second has its own text, which reads back as that nanosecond. Reference: the count of nanoseconds from the second before the leap second.
#[test]
fn text_is_exact_to_the_nanosecond_around_every_leap_second() {
    for (number, day) in (1..).zip(LEAPS) {
        let before = epoch(&format!("{day}T23:59:59"));
        for (clock, ns) in [
            ("23:59:59.000000001", 1),
            ("23:59:59.999999", 999_999_000),
            ("23:59:59.9999998", 999_999_800),
            ("23:59:59.999999999", 999_999_999),
            ("23:59:60.000", 1_000_000_000),
            ("23:59:60.000000001", 1_000_000_001),
            ("23:59:60.500", 1_500_000_000),
            ("23:59:60.9999998", 1_999_999_800),
            ("23:59:60.999999999", 1_999_999_999),
        ] {
            let text = format!("{day}T{clock}Z");
            let at = parse_utc(&text).unwrap();
            assert_eq!((at - before).total_nanoseconds(), ns, "{text}");
            assert_eq!(utc_text(at), text);
        }
        let after = before + Unit::Second * 2;
        let (year, month, date, hour, ..) = after.to_gregorian_utc();
        assert!(
            (month, date, hour) == (1, 1, 0) || (month, date, hour) == (7, 1, 0),
            "{year}"
        );
        assert_eq!(
            utc_text(after - Unit::Nanosecond),
            format!("{day}T23:59:60.999999999Z")
        );
        assert_eq!(
            utc_text(after + Unit::Nanosecond)[10..],
            *"T00:00:00.000000001Z"
        );
        // TAI - UTC.
        let midnight = Epoch::from_gregorian_tai(year, month, date, 0, 0, 0, 0);
        assert_eq!(after - midnight, Unit::Second * (10 + number));
        assert_eq!(
            to_epoch(to_wire(after - Unit::Nanosecond).unwrap()),
            after - Unit::Nanosecond
        );
    }
}

/// Any nanosecond of three centuries, on either side of nothing in particular, comes back from its text.
#[test]
fn text_is_exact_from_1900_to_2199() {
    let start = Epoch::from_tai_duration(Duration::ZERO);
    for i in 0..20_000_i128 {
        // Some five days, and a prime number of nanoseconds, a step.
        let at = start + Duration::from_total_nanoseconds(i * 472_392_000_000_007);
        assert_eq!(parse_utc(&utc_text(at)).unwrap(), at, "{}", utc_text(at));
    }
}

/// Frames from 1950 to 2099, and on leap seconds: the same stars stand in the field but for their own ways, and all numbers are numbers; beyond the series they are refused.
#[test]
fn frames_of_the_years_1950_to_2100() {
    let attitude = Attitude::towards(1.4, -0.1, 0.0);
    let shoot = |at: Epoch| {
        let mut emulator = starry(
            camera(&[("optics.focal_length_mm", "5.0")]),
            Fidelity::REALTIME,
        );
        let mut vehicle = vehicle(&attitude, [0.0; 3]);
        vehicle.epoch = at;
        emulator.shoot(&vehicle, 0)
    };
    let mut counts = Vec::new();
    for text in [
        "1950-01-01T00:00:00",
        "1957-12-31T23:59:59",
        "1971-12-31T23:59:59",
        "2016-12-31T23:59:60",
        "2016-12-31T23:59:60.999999999",
        "2050-06-15T12:00:00",
        "2099-12-31T23:59:59",
    ] {
        let shot = shoot(epoch(text)).unwrap();
        check_numbers(&shot, text);
        assert!(
            shot.label.epoch_mid.starts_with(text),
            "{text}: {}",
            shot.label.epoch_mid
        );
        counts.push(shot.label.objects.len());
        for object in shot.label.objects.iter().take(50) {
            assert!(object.electrons.is_finite() && object.snr.is_finite());
        }
    }
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(*least > 10 && most - least <= 3, "{counts:?}");
    for text in [
        "1899-06-01T00:00:00",
        "2100-06-01T00:00:00",
        "0001-01-01T00:00:00",
        "9999-12-31T23:59:59",
    ] {
        let refused = shoot(epoch(text));
        assert!(matches!(refused, Err(Unobservable::Epoch(_))), "{text}");
    }
    // No text, and no end of time, stops anything.
    for at in [
        Epoch::from_tai_duration(Duration::MAX),
        Epoch::from_tai_duration(Duration::MIN),
    ] {
        assert!(utc_text(at).len() > 20);
        assert!(shoot(at).is_err());
    }
}

/// Reference: whole nanoseconds, by integers.
#[test]
fn seconds_are_the_nearest_nanosecond() {
    for (s, ns) in [
        (0.0, 0),
        (1e-9, 1),
        (0.4e-9, 0),
        (-1.6e-9, -2),
        (0.1 + 0.2, 300_000_000),
        // A last digit below 29, which hifitime cuts off to 28.999999999.
        (100.0 * 0.29, 29_000_000_000),
        (-100.0 * 0.29, -29_000_000_000),
        (1e9 + 0.25, 1_000_000_000_250_000_000),
        (f64::NAN, 0),
    ] {
        assert_eq!(seconds(s).total_nanoseconds(), ns, "{s}");
    }
    assert_eq!(seconds(f64::INFINITY), Duration::MAX);
    assert_eq!(seconds(f64::NEG_INFINITY), Duration::MIN);
    assert_eq!(seconds(1e300), Duration::MAX);
}

/// Ten million periods on, a mission's clock is where the product is, to the nanosecond, for periods that a binary number has and that it has not.
/// Reference: integers.
#[test]
fn ten_million_periods_do_not_drift() {
    for (period_s, period_ns) in [
        (0.1, 100_000_000_i128),
        (0.29, 290_000_000),
        (1.0 / 64.0, 15_625_000),
        (0.033, 33_000_000),
    ] {
        let mission = Mission {
            start: noon(),
            period_s,
            frames: u32::MAX,
            profile: Profile::Nadir,
            orbit: None,
            timeout: std::time::Duration::ZERO,
            pace: Pace::Stepped { most_hz: None },
            output: None,
            positions: None,
        };
        let mut last = mission.epoch(0);
        for step in 1..=10_000_000_u32 {
            let at = mission.epoch(step);
            let exact = i128::from(step) * period_ns;
            assert!(
                step % 9973 != 0 || (at - noon()).total_nanoseconds() == exact,
                "{period_s} {step}"
            );
            assert!(at > last);
            last = at;
        }
        assert_eq!(
            (last - noon()).total_nanoseconds(),
            10_000_000 * period_ns,
            "{period_s}"
        );
    }
}
