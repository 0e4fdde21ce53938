//! Fields of the two lines that are padded with blanks, and their written form.

use crate::support::texts::sealed;
use hifitime::Epoch;
use skyloop_orbit::{Format, Record, parse_contents, write};

/// A made-up set without checksums.
const LINES: [&str; 2] = [
    "1 90001U 19001A   19166.50000000  .00000100  00000-0  10000-4 0  999",
    "2 90001  97.5000 120.0000 0010000  90.0000 270.0000 15.20000000  100",
];

/// The set with `text` in a line, 0 or 1, at a column, counted from 1.
fn with(line: usize, column: usize, text: &str) -> String {
    let mut lines = LINES.map(str::to_owned);
    lines[line].replace_range(column - 1..column - 1 + text.len(), text);
    lines.map(|line| sealed(&line) + "\n").concat()
}

/// The record of that set, or the reason of the refusal.
fn read(text: &str) -> Result<Record, String> {
    let contents = parse_contents(text, "test").unwrap();
    match contents.rejected.first() {
        Some(refused) => Err(refused.to_string()),
        None => Ok(contents.records[0].clone()),
    }
}

#[test]
fn a_field_with_an_assumed_point_scales_by_its_columns() {
    let eccentricity = |record: &Record| record.elements.eccentricity;
    let drag = |record: &Record| record.elements.drag;
    let second = |record: &Record| record.mean_motion_ddot;
    type Field = (usize, usize, fn(&Record) -> f64);
    let fields: [Field; 3] = [(1, 27, eccentricity), (0, 54, drag), (0, 45, second)];
    let [eccentricity, drag, second] = fields;
    for ((line, column, value), text, wanted) in [
        // X-Val: python-sgp4 2.27, `Satrec.twoline2rv`; the first and the third also PyEphem 4.2.1.
        (eccentricity, "   6703", Some(0.000_670_3)),
        (eccentricity, "6703   ", Some(0.670_3)),
        (eccentricity, "      1", Some(1e-7)),
        (eccentricity, " 00 003", Some(3e-7)),
        (eccentricity, "0000000", Some(0.0)),
        (eccentricity, "9999999", Some(0.999_999_9)),
        // X-Val: python-sgp4 2.27. Its C++ code reads these for the second derivative, and refuses
        // them for B*.
        (second, "  1234-4", Some(0.012_34e-4)),
        (second, "-  123-4", Some(-0.001_23e-4)),
        (drag, "  1234-4", Some(0.012_34e-4)),
        (drag, "-  123-4", Some(-0.001_23e-4)),
        (drag, "     0-0", Some(0.0)),
        // X-Val: python-sgp4 2.27 and PyEphem 4.2.1.
        (drag, " 1234 -4", Some(0.123_4e-4)),
        (drag, "-12345-4", Some(-0.123_45e-4)),
        (drag, "+12345-4", Some(0.123_45e-4)),
        (drag, " 12345+1", Some(1.234_5)),
        (drag, " 12345 4", Some(1_234.5)),
        (drag, "01234 -4", Some(0.123_4e-4)),
        // No number, or not in its columns.
        (eccentricity, "       ", None),
        (eccentricity, ".000670", None),
        (eccentricity, "-006703", None),
        (drag, "        ", Some(0.0)),
        (drag, " 1234-4 ", None),
        (drag, "-.1234-4", None),
        (drag, " 1234-10", None),
        (drag, "112345-4", None),
        (second, "        ", Some(0.0)),
        (second, " 1234-4 ", None),
    ] {
        let read = read(&with(line, column, text));
        assert_eq!(read.ok().as_ref().map(value), wanted, "{text:?}");
    }
}

#[test]
fn a_field_with_its_point_may_be_padded_anywhere() {
    let epoch = |text: &str| Epoch::from_gregorian_str(text).unwrap();
    let noon = epoch("2019-06-15T12:00:00 UTC");
    // X-Val: python-sgp4 2.27 and PyEphem 4.2.1.
    for (text, wanted) in [
        ("19166.5       ", Some(noon)),
        ("19166.50000   ", Some(noon)),
        ("19 66.50000000", Some(epoch("2019-03-07T12:00:00 UTC"))),
        ("19  6.50000000", Some(epoch("2019-01-06T12:00:00 UTC"))),
        (" 9166.50000000", Some(epoch("2009-06-15T12:00:00 UTC"))),
        ("19166.", Some(noon)),
        ("19166 50000000", None),
        ("+9166.50000000", None),
    ] {
        let read = read(&with(0, 19, text)).ok();
        let read = read.map(|record| record.elements.epoch.to_tai_duration());
        let wanted = wanted.map(|epoch| epoch.to_tai_duration());
        assert_eq!(read, wanted, "{text:?}");
    }
    let inclination = |record: &Record| record.elements.inclination.to_degrees();
    let first = |record: &Record| record.mean_motion_dot;
    let number = |record: &Record| f64::from(record.elements.norad);
    type Field = (usize, usize, fn(&Record) -> f64);
    let fields: [Field; 3] = [(1, 9, inclination), (0, 34, first), (0, 3, number)];
    let [inclination, first, _] = fields;
    for ((line, column, value), text, wanted) in [
        // X-Val: python-sgp4 2.27, C++.
        (inclination, "  7.5000", Some(7.5)),
        (inclination, "  7.5   ", Some(7.5)),
        (inclination, "   .0500", Some(0.05)),
        (inclination, "097.5000", Some(97.5)),
        (first, "    .00001", Some(1e-5)),
        (first, " .1       ", Some(0.1)),
        (first, "+.00000100", Some(1e-6)),
        (first, "-.00000100", Some(-1e-6)),
        (first, "          ", Some(0.0)),
        // Blanks count as zeros; the Python readers refuse these.
        (inclination, " 97. 500", Some(97.05)),
        (first, "- .0000123", Some(-1.23e-5)),
        (first, " .     123", Some(1.23e-6)),
        // Without its point a number has no scale.
        (inclination, "       5", None),
        (first, "  00000100", None),
    ] {
        let read = read(&with(line, column, text)).ok();
        let read = read.as_ref().map(value);
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-15 * b.abs().max(1e-9);
        let same = read.is_some() == wanted.is_some() && read.zip(wanted).is_none_or(near);
        assert!(same, "{text:?}: {read:?}");
    }
}

#[test]
fn short_numbers_may_be_padded_on_either_side() {
    // X-Val: python-sgp4 2.27, Python.
    for text in ["    5", "5    ", "  5  ", "00005", " 0005"] {
        let lines = LINES.map(|line| sealed(&line.replace("90001", text)) + "\n");
        assert_eq!(read(&lines.concat()).unwrap().elements.norad, 5, "{text:?}");
    }
}

#[test]
fn written_sets_are_read_back() {
    type Change = fn(&mut Record);
    let changes: [Change; 12] = [
        |_| (),
        |r| r.elements.drag = -0.999_99,
        |r| r.elements.drag = 1e-14,
        |r| r.elements.drag = -0.99999e9,
        |r| r.elements.eccentricity = 0.0,
        |r| {
            r.elements.eccentricity = 0.999_999_9;
            r.elements.mean_motion = 1e-7;
        },
        |r| r.mean_motion_dot = -0.999_999_99,
        |r| r.mean_motion_dot = 1e-8,
        |r| r.mean_motion_ddot = -1e-14,
        |r| r.elements.norad = 100_000,
        |r| r.elements.norad = 339_999,
        |r| r.designator = String::new(),
    ];
    let base = read(&with(0, 1, "1")).unwrap();
    let created = base.elements.epoch;
    for format in Format::ALL {
        for (number, change) in changes.iter().enumerate() {
            let mut record = base.clone();
            change(&mut record);
            let Some(written) = write(std::slice::from_ref(&record), format, created) else {
                assert!(matches!(format, Format::OemKvn | Format::OemXml));
                continue;
            };
            assert_eq!(written.left_out, Vec::<String>::new(), "{format} {number}");
            let mut back = read(&written.text).unwrap();
            back.line = record.line;
            // Two lines have fewer digits of the lowest mean motion.
            if number == 5 && matches!(format, Format::Tle | Format::ThreeLine) {
                back.elements.mean_motion = record.elements.mean_motion;
            }
            assert_eq!(back, record, "{format} {number}: {}", written.text);
        }
    }
}
