//! Element sets written and read again are the same, or the loss is reported.

use crate::support::texts::sealed;
use hifitime::{Epoch, Unit};
use proptest::prelude::*;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Format, Record, Written, parse_contents, write};
use std::f64::consts::{PI, TAU};

const OMM: [Format; 4] = [
    Format::OmmKvn,
    Format::OmmXml,
    Format::OmmJson,
    Format::OmmCsv,
];

/// Made-up sets with unusual names and numbers; `sets` fills column 69.
const SETS: &str = "\
0 MADE UP, 1 [+]
1 90001U 19001A   19166.50000000  .00000100  00000-0  10000-4 0  9993
2 90001  97.5000 120.0000 0010000  90.0000 270.0000 15.20000000  1002
0 <A> & \"B\"
1 A0007U 57001ABC 57365.99999999 -.00000217  12345-9 -31515-4 0    15
2 A0007   0.0500 359.9999 0002000  10.0000  20.0000  1.00270000   107
0
1 Z9999C          56001.00000000  .00000000  00000-0  00000-0 0    00
2 Z9999 180.0000   0.0000 7000001   0.0001 359.9999  2.00561234    04
";

/// The sets with their checksums.
fn sets() -> String {
    let line = |line: &str| match line.len() {
        60.. => sealed(&line[..68]) + "\n",
        _ => format!("{line}\n"),
    };
    SETS.lines().map(line).collect()
}

fn read(text: &str) -> Vec<Record> {
    let contents = parse_contents(text, "test").unwrap();
    assert_eq!(contents.rejected, [], "{text}");
    // Compare records without their line numbers.
    let records = contents.records.into_iter();
    records.map(|record| Record { line: 0, ..record }).collect()
}

fn written(records: &[Record], format: Format) -> Written {
    let created = Epoch::from_gregorian_utc_at_midnight(2026, 7, 12);
    write(records, format, created).unwrap()
}

#[test]
fn a_3le_is_restored_byte_for_byte_from_every_notation() {
    let original = sets();
    let records = read(&original);
    assert_eq!(records[1].name, "<A> & \"B\"");
    let format_of = |text: &str| parse_contents(text, "test").unwrap().format;
    for format in OMM {
        let text = written(&records, format).text;
        assert_eq!(format_of(&text), format);
        let back = read(&text);
        assert_eq!(back, records, "{text}");
        let lines = written(&back, Format::ThreeLine);
        assert_eq!(lines.text, original);
        assert!(lines.left_out.is_empty());
    }
    let without = written(&records, Format::Tle).text;
    assert_eq!(format_of(&without), Format::Tle);
    let elements = |records: &[Record]| records.iter().map(|r| r.elements).collect::<Vec<_>>();
    assert_eq!(elements(&read(&without)), elements(&records));
}

/// A TLE counts 86,400 s in each day, also before a leap second: 23:59:40 is day 0.99976852.
#[test]
fn epochs_before_a_leap_second_are_written_as_such() {
    for (utc, columns) in [
        ("2016-12-31T23:59:10Z", " 16366.99942130 "),
        ("2016-12-31T23:59:40Z", " 16366.99976852 "),
        // The day's last tick, 0.864 ms before its end, is nearer than the next day.
        ("2016-12-31T23:59:59.9994Z", " 16366.99999999 "),
        ("2016-12-31T23:59:59.9996Z", " 16366.99999999 "),
        ("2016-12-31T23:59:59.999999999Z", " 16366.99999999 "),
        ("2015-12-31T23:59:59.9996Z", " 16001.00000000 "),
        ("2015-06-30T23:59:40Z", " 15181.99976852 "),
        ("2017-01-01T00:00:00Z", " 17001.00000000 "),
    ] {
        let mut record = read(&sets())[0].clone();
        record.elements.epoch = parse_utc(utc).unwrap();
        let lines = written(&[record], Format::Tle).text;
        assert!(lines.contains(columns), "{utc}: {lines}");
    }
}

type Case = (fn(&mut Record), &'static str);

/// The first set with a change, as a 3LE.
fn altered(change: fn(&mut Record)) -> Written {
    let mut record = read(&sets())[0].clone();
    change(&mut record);
    written(&[record], Format::ThreeLine)
}

#[test]
fn values_that_two_lines_cannot_hold_are_reported() {
    let cases: [Case; 9] = [
        (|r| r.elements.norad = 340_000, "numbers up to 339999"),
        (|r| r.elements.epoch += 20_000.0 * Unit::Day, "1957 to 2056"),
        (|r| r.elements.epoch = leap_second(), "leap second"),
        (|r| r.elements.eccentricity = 0.999_999_99, "rounds to 1"),
        (|r| r.elements.mean_motion = 0.5, "below 100 rev/day"),
        (|r| r.elements.drag = 1e10, "the drag term B* is beyond"),
        (|r| r.mean_motion_dot = -1.0, "first derivatives below 1"),
        (|r| r.mean_motion_ddot = 1e300, "second derivative"),
        // Its last digit alone would be the type of another theory.
        (|r| r.ephemeris_type = 14, "ephemeris type"),
    ];
    for (change, reason) in cases {
        let Written { text, left_out, .. } = altered(change);
        assert_eq!(text, "", "{reason}");
        assert!(
            left_out.len() == 1 && left_out[0].contains(reason),
            "{left_out:?}"
        );
    }
}

#[test]
fn values_longer_than_their_columns_are_cut() {
    let records = read(&sets());
    let cases: [Case; 5] = [
        (
            |r| r.name = "A NAME OF TWENTY-FIVE LTRS".into(),
            "0 A NAME OF TWENTY-FIVE LT\n",
        ),
        (
            |r| r.designator = "2057-001A".into(),
            "1 90001U          19",
        ),
        (|r| r.designator = "X-37B".into(), "1 90001U          19"),
        (|r| r.element_set = 10_012, " 0   12"),
        (|r| r.revolution = 123_456, "15.2000000023456"),
    ];
    for (change, columns) in cases {
        let Written { text, left_out } = altered(change);
        assert!(
            text.contains(columns) && left_out.is_empty(),
            "{columns}: {text}"
        );
        assert_eq!(read(&text)[0].elements, records[0].elements, "{columns}");
    }
    assert!(write(&records, Format::OemKvn, records[0].elements.epoch).is_none());
}

fn leap_second() -> Epoch {
    parse_utc("2016-12-31T23:59:60.5Z").unwrap()
}

/// Whether elements agree within the resolution of the columns, rad, rad/min, 1, s.
fn within_columns(a: &Elements, b: &Elements) -> bool {
    let turned = |x: f64, y: f64| {
        let apart = (x - y).rem_euclid(TAU);
        apart.min(TAU - apart) < 0.501e-4_f64.to_radians()
    };
    (a.epoch - b.epoch).to_seconds().abs() < 0.4321e-3
        && turned(a.inclination, b.inclination)
        && turned(a.node, b.node)
        && turned(a.perigee, b.perigee)
        && turned(a.mean_anomaly, b.mean_anomaly)
        && (a.eccentricity - b.eccentricity).abs() < 0.501e-7
        && (a.mean_motion - b.mean_motion).abs() < 0.501e-8 * TAU / 1440.0
        && (a.drag - b.drag).abs() <= (a.drag.abs() * 0.501e-4).max(0.501e-14)
}

proptest! {
    #[test]
    fn any_elements_are_restored(
        (norad, days, inclination, node, eccentricity) in
            (0u32..340_000, -15_000.0..19_000.0, 0.0..PI, -TAU..TAU, 0.0..0.9),
        (perigee, mean_anomaly, mean_motion, drag, power) in
            (-TAU..TAU, -TAU..TAU, 0.004..0.007, -1.0..1.0, -14..2),
        name in "[ -~]{0,24}",
    ) {
        let epoch: Epoch = Epoch::from_gregorian_utc_at_midnight(2000, 1, 1) + days * Unit::Day;
        let elements = Elements {
            norad,
            epoch: epoch.to_time_scale(hifitime::TimeScale::TAI),
            inclination,
            node,
            eccentricity,
            perigee,
            mean_anomaly,
            mean_motion: mean_motion * (1.0 - eccentricity),
            drag: drag * 10_f64.powi(power),
        };
        prop_assume!(elements.constants().is_ok());
        let record = Record {
            name: name.trim().to_owned(),
            elements,
            ..read(&sets())[0].clone()
        };
        let records = [record.clone()];
        for format in OMM {
            let text = written(&records, format).text;
            let back = read(&text).remove(0);
            prop_assert_eq!(&back.name, &record.name);
            let same = back.elements;
            prop_assert_eq!((same.norad, same.epoch, same.eccentricity, same.drag),
                (norad, elements.epoch, eccentricity, elements.drag));
            for (a, b) in [
                (same.inclination, inclination),
                (same.node, node),
                (same.perigee, perigee),
                (same.mean_anomaly, mean_anomaly),
                (same.mean_motion, elements.mean_motion),
            ] {
                prop_assert!((a - b).abs() <= b.abs() * f64::EPSILON);
            }
        }
        let lines = written(&records, Format::ThreeLine);
        prop_assert_eq!(&lines.left_out, &Vec::<String>::new());
        for line in lines.text.lines().skip(1) {
            prop_assert_eq!(line.len(), 69, "{}", line);
        }
        let back = read(&lines.text).remove(0);
        prop_assert!(within_columns(&back.elements, &elements), "{:?} {:?}", back.elements, elements);
        // Values with the resolution of the columns do not change.
        let again = written(&[back], Format::ThreeLine);
        prop_assert_eq!(again.text, lines.text);
    }
}
