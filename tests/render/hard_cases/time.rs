//! Leap seconds to the nanosecond, years from 1950 to 2100, and the clock of long missions.

use super::stage::{
    camera, check_numbers, emulator, epoch, falling, noon, oem, orbiter, square, starry, still,
    towards,
};
use hifitime::{Duration, Epoch, Unit};
use nalgebra::Vector3;
use skyloop::attitude::Attitude;
use skyloop::fidelity::Fidelity;
use skyloop::orbit::time::{parse_utc, seconds, utc_duration, utc_text};
use skyloop::scene::Unobservable;
use skyloop::sky::bodies::Bodies;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::time::{to_epoch, to_wire};
use std::collections::BTreeSet;

/// The days that ended with a leap second.
// X-Val: IERS Bulletin C 52 and its predecessors; 10 s on 1 January 1972.
const LEAPS: &str = "\
    1972-06-30 1972-12-31 1973-12-31 1974-12-31 1975-12-31 1976-12-31 1977-12-31 1978-12-31 \
    1979-12-31 1981-06-30 1982-06-30 1983-06-30 1985-06-30 1987-12-31 1989-12-31 1990-12-31 \
    1992-06-30 1993-06-30 1994-06-30 1995-12-31 1997-06-30 1998-12-31 2005-12-31 2008-12-31 \
    2012-06-30 2015-06-30 2016-12-31";

/// Every nanosecond around every leap second has its own text, which parses to that nanosecond.
/// Reference: the count of nanoseconds from the second before the leap second.
#[test]
fn text_is_exact_to_the_nanosecond_around_every_leap_second() {
    assert_eq!(LEAPS.split(' ').count(), 27);
    for (number, day) in (1..).zip(LEAPS.split(' ')) {
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
        let text = utc_text(after);
        let year: i32 = text[..4].parse().unwrap();
        let month = if text[4..].starts_with("-01") { 1 } else { 7 };
        assert_eq!(text[4..], format!("-{month:02}-01T00:00:00.000Z"));
        // UTC days have 86,400 s: a second of UTC is one of TAI, except for the leap second.
        let utc_after = utc_duration(after);
        for seconds in [-86_400, -40, -36, -10, -2, 0, 10, 40] {
            let at = after + Unit::Second * seconds;
            let leap = Unit::Second * i64::from(seconds < 0);
            let utc = utc_duration(at) - utc_after;
            assert_eq!(utc, at - after + leap, "{text} {seconds} s");
        }
        let (last, first) = (after - Unit::Nanosecond, after + Unit::Nanosecond);
        assert_eq!(utc_text(last), format!("{day}T23:59:60.999999999Z"));
        assert_eq!(utc_text(first)[10..], *"T00:00:00.000000001Z");
        // TAI - UTC.
        let midnight = Epoch::from_gregorian_tai(year, month, 1, 0, 0, 0, 0);
        assert_eq!(after - midnight, Unit::Second * (10 + number));
        assert_eq!(to_epoch(to_wire(last).unwrap()), last);
    }
}

/// Before 1972 there were no leap seconds, and UTC counts as TAI. Reference: TAI - UTC was 10 s on
/// 1 January 1972.
#[test]
fn before_1972_utc_is_tai() {
    let last = epoch("1971-12-31T23:59:59");
    assert_eq!(epoch("1972-01-01T00:00:00") - last, Unit::Second * 11);
    assert_eq!(last, Epoch::from_gregorian_tai(1971, 12, 31, 23, 59, 59, 0));
    assert_eq!(utc_text(last), "1971-12-31T23:59:59.000Z");
}

/// Any nanosecond of three centuries, also far from leap seconds, round-trips through its text.
#[test]
fn text_is_exact_from_1900_to_2199() {
    let start = Epoch::from_tai_duration(Duration::ZERO);
    for i in 0..20_000_i128 {
        // Some five days, and a prime number of nanoseconds, a step.
        let at = start + Duration::from_total_nanoseconds(i * 472_392_000_000_007);
        assert_eq!(parse_utc(&utc_text(at)).unwrap(), at, "{}", utc_text(at));
    }
}

/// Frames from 1950 to 2100, and on leap seconds: the field has the same stars except for proper
/// motion, and all numbers are finite. Epochs beyond the series are refused.
#[test]
fn frames_of_the_years_1950_to_2100() {
    let attitude = Attitude::towards(1.4, -0.1, 0.0);
    let expose = |at: Epoch| {
        let camera = camera("optics.focal_length_mm = 5.0");
        let mut emulator = starry(camera, Fidelity::REALTIME);
        let mut vehicle = still(&attitude);
        vehicle.epoch = at;
        emulator.expose(&vehicle, 0)
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
        "2100-01-01T00:00:00",
        // A Julian century, 36,525 days of TT, from J2000.0; UTC is 69.184 s behind until the next
        // leap second.
        "2100-01-01T11:58:50",
    ] {
        let exposed = expose(epoch(text)).unwrap();
        check_numbers(&exposed, text);
        let epoch_mid = &exposed.label.epoch_mid;
        assert!(epoch_mid.starts_with(text), "{text}: {epoch_mid}");
        counts.push(exposed.label.objects.len());
        for object in exposed.label.objects.iter().take(50) {
            assert!(object.electrons.is_finite() && object.snr.is_finite());
        }
    }
    let (min, max) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(*min > 10 && max - min <= 3, "{counts:?}");
    for text in [
        "1899-06-01T00:00:00",
        "2100-01-01T11:58:51",
        "2100-06-01T00:00:00",
        "0001-01-01T00:00:00",
        "9999-12-31T23:59:59",
    ] {
        let refused = expose(epoch(text));
        assert!(matches!(refused, Err(Unobservable::Epoch(_))), "{text}");
    }
    // No text and no extreme time fails.
    for at in [Duration::MAX, Duration::MIN].map(Epoch::from_tai_duration) {
        assert!(utc_text(at).len() > 20);
        assert!(expose(at).is_err());
    }
}

/// The whole sky, in two halves, of those years: an object 300 km above the vehicle, the Moon and
/// all planets are in it, in their possible range. Reference: geometry, for the object. The Moon is
/// within 5.3 deg of the ecliptic, one degree more from low orbit, 356,000 to 407,000 km from the
/// Earth's centre. Mercury is within 28.4 deg of the Sun, Venus within 47.9; planets are within 9
/// deg of the ecliptic (Venus at its nearest).
// X-Val: J. Meeus, Astronomical Algorithms, 2nd ed., 1998, chapters 36 and 50 (elongations,
// perigees and apogees).
#[test]
fn objects_the_moon_and_planets_of_the_years_1950_to_2100() {
    let optics = "optics.focal_length_mm = 1.6; optics.aperture_mm = 1.0; \
                  optics.projection = { model = \"fisheye\", k = [0.0] }";
    let fisheye = square(512, optics);
    // X-Val: obliquity of J2000.0, 84381.406 arcsec (IAU 2006).
    let (sin, cos) = (84_381.406 / 3600.0f64).to_radians().sin_cos();
    let pole = Vector3::new(0.0, -sin, cos);
    for text in [
        "1950-01-01T00:00:00",
        "1971-12-31T23:59:40",
        "2016-12-31T23:59:60",
        "2050-06-15T12:00:00",
        "2100-01-01T00:00:00",
    ] {
        let bodies = Bodies::at(epoch(text)).unwrap();
        let sun = bodies.sun_geocentric_m.normalize();
        let mut found = BTreeSet::new();
        for up in [pole, -pole] {
            let (r, v) = (up * 7000.0, up.cross(&sun).normalize() * 7.5);
            let mut emulator = emulator(fisheye.clone(), Fidelity::REALTIME, |config| {
                let lights = ["moon", "planets"];
                config.choice.off.retain(|name| !lights.contains(name));
                config.objects = oem("ABOVE", epoch(text), falling(r + up * 300.0, v));
            });
            let mut vehicle = orbiter(&towards(&up), r * 1e3, v * 1e3);
            vehicle.epoch = epoch(text);
            let exposed = emulator.expose(&vehicle, 0).unwrap();
            check_numbers(&exposed, text);
            for object in &exposed.label.objects {
                let seen = fisheye.optics.direction([object.x_px, object.y_px]);
                let seen = vehicle.attitude.inverse().rotate(&seen);
                let off_ecliptic = (90.0 - seen.angle(&pole).to_degrees()).abs();
                let elongation = seen.angle(&sun).to_degrees();
                let is_there = match object.id.as_str() {
                    "ABOVE" => {
                        let rso = object.rso.as_ref().unwrap();
                        (rso.range_km - 300.0).abs() < 1e-6 && seen.angle(&up) < 1e-5
                    }
                    "Moon" => off_ecliptic < 6.3,
                    "Mercury" => off_ecliptic < 9.0 && elongation < 28.4,
                    "Venus" => off_ecliptic < 9.0 && elongation < 47.9,
                    _ => off_ecliptic < 9.0,
                };
                let id = object.id.clone();
                assert!(is_there, "{text}: {id} {off_ecliptic} {elongation}");
                found.insert(id);
            }
        }
        let moon_km = bodies.moon_geocentric_m.norm() / 1e3;
        let range = 356_000.0..407_000.0;
        assert!(range.contains(&moon_km), "{text}: {moon_km}");
        assert_eq!(found.len(), 9, "{text}: {found:?}");
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
        // One unit in the last place below 29, which hifitime truncates to 28.999999999.
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

/// After ten million periods a mission's clock equals the product, to the nanosecond, for periods
/// with and without an exact binary representation. Reference: integers.
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
            assert!(at > last);
            if step % 9973 == 0 || step == 10_000_000 {
                let exact = i128::from(step) * period_ns;
                assert_eq!(
                    (at - noon()).total_nanoseconds(),
                    exact,
                    "{period_s} {step}"
                );
            }
            last = at;
        }
    }
}
