//! TLE and 3LE files: accepted and refused records, and the reasons.

use crate::support::texts::{rows, sealed};
use hifitime::{Epoch, TimeScale, Unit};
use nalgebra::Matrix3;
use proptest::prelude::*;
use skyloop_orbit::elements::PropagationError;
use skyloop_orbit::{Loaded, Object, Orbit, OrbitError, load, parse};

/// Made-up sets, a low orbit and a geostationary one, without checksums.
const LOW_1: &str = "1 90001U 19001A   19166.50000000  .00000100  00000-0  10000-4 0  999";
const LOW_2: &str = "2 90001  97.5000 120.0000 0010000  90.0000 270.0000 15.20000000  100";
const GEO_1: &str = "1 A0007U 16001A   16366.99999999  .00000000  00000-0  00000-0 0  001";
const GEO_2: &str = "2 A0007   0.0500  80.0000 0002000  10.0000  20.0000  1.00270000   10";

fn low() -> String {
    format!("{}\n{}\n", sealed(LOW_1), sealed(LOW_2))
}

fn geo() -> String {
    format!("{}\n{}\n", sealed(GEO_1), sealed(GEO_2))
}

fn read(text: &str) -> Loaded {
    parse(text, "test.tle").unwrap()
}

fn ids(loaded: &Loaded) -> Vec<(&str, Vec<&str>)> {
    (loaded.objects.iter())
        .map(|o| (o.id.as_str(), o.names.iter().map(String::as_str).collect()))
        .collect()
}

fn rejections(loaded: &Loaded) -> Vec<String> {
    loaded.rejected.iter().map(ToString::to_string).collect()
}

fn epoch_of(object: &Object) -> Epoch {
    match &object.orbit {
        Orbit::Elements(elements, _) => elements.epoch,
        Orbit::Ephemeris(_) => panic!("not an element set"),
    }
}

#[test]
fn sets_of_one_object_are_united_and_the_nearest_is_used() {
    // Two days later, at another position in the orbit.
    let later = LOW_1.replace("19166.5", "19168.5");
    let second = format!("{}\n{}\n", sealed(&later), sealed(LOW_2));
    let loaded = read(&format!("FIRST\n{}{}OTHER\n{second}", low(), geo()));
    assert_eq!(
        ids(&loaded),
        [
            ("NORAD 90001", vec!["FIRST", "OTHER"]),
            ("NORAD 100007", vec![])
        ]
    );
    let (both, one, two) = (&loaded.objects[0], read(&low()), read(&second));
    let noon = Epoch::from_gregorian_utc_hms(2019, 6, 16, 12, 0, 0);
    for (hours, nearest) in [(-60, &one), (-1, &one), (1, &two), (60, &two)] {
        let t = noon + Unit::Hour * hours;
        assert_eq!(both.state(t), nearest.objects[0].state(t), "{hours}");
    }
    // A settled object does not change its set at noon.
    let settled = both.with_set_at(noon - Unit::Second * 1);
    let after = noon + Unit::Second * 1;
    assert_eq!(settled.state(after), one.objects[0].state(after));
    assert_ne!(both.state(after), settled.state(after));
}

#[test]
fn of_two_sets_of_one_epoch_the_one_with_a_state_is_used() {
    // X-Val: by hand: at 17.3 revolutions a day the semi-major axis is 6313 km.
    let lost = LOW_2.replace("15.20000000", "17.30000000");
    let lost = format!("{}\n{}\n", sealed(LOW_1), sealed(&lost));
    let (good, bad) = (read(&low()), read(&lost));
    let t = epoch_of(&good.objects[0]);
    assert!(bad.objects[0].state(t).is_err());
    for both in [low() + &lost, lost.clone() + &low()] {
        let both = read(&both);
        assert_eq!(both.objects[0].sets().count(), 2);
        assert_eq!(both.objects[0].state(t), good.objects[0].state(t));
        assert_eq!(both.objects[0].set_index_at(t), 0);
    }
}

#[test]
fn names_line_ends_blank_lines_and_alpha_5() {
    let (low, geo) = (low(), geo());
    let text = format!("# made up\n\n{low}\r\n0 LOW ONE\r\n{low}\nGEO ONE  \n{geo}");
    let loaded = read(&text.replace('\n', "\r\n"));
    assert_eq!(rejections(&loaded), Vec::<String>::new());
    // Alpha-5: A is 10, so A0007 is 100007
    let [first, second] = [
        ("NORAD 90001", vec!["LOW ONE"]),
        ("NORAD 100007", vec!["GEO ONE"]),
    ];
    assert_eq!(ids(&loaded), [first, second]);
    assert_eq!(loaded.objects[1].label(), "NORAD 100007 (GEO ONE)");
}

#[test]
fn names_after_their_sets_are_read() {
    let named = |loaded: &Loaded| {
        let objects = loaded.objects.iter();
        let names = objects.map(|object| object.names.first().cloned().unwrap_or_default());
        names.collect::<Vec<_>>().join(";")
    };
    // The lines of a file, with L and G for the sets; names of the objects; count of refused lines.
    for [lines, names, rejected] in rows(
        r"
        L;LOW;G;GEO                         | LOW;GEO | 0
        ;L;;LOW;;G;GEO;                     | LOW;GEO | 0
        // A 3LE; one without its first line; one without names; one that is cut off after a name.
        LOW;L;GEO;G                         | LOW;GEO | 0
        L;GEO;G                             | ;GEO    | 0
        L;G                                 | ;       | 0
        LOW;L;GEO;G;NEXT                    | LOW;GEO | 1
        // Names with line number 0 after the sets; one set more is a 3LE without its first line.
        L;0 LOW;G;0 GEO                     | LOW;GEO | 0
        L;0 GEO;G;G;0 NEXT                  | ;GEO    | 1
        0;L;0 GEO;G                         | ;GEO    | 0
        // Names after the sets: a set without a name, and one name too many.
        L;LOW;L;G;GEO                       | LOW;GEO | 0
        L;LOW;MORE;G;GEO                    | LOW;GEO | 1
        // Names that begin like element lines.
        2 COSMOS;L;1 KUNS-PF;G              | 2 COSMOS;1 KUNS-PF | 0
        0 2 COSMOS 1408 DEBRIS, LONG;L;1 NAME;G       | 2 COSMOS 1408 DEBRIS, LONG;1 NAME | 0
        LOW;L;1 NAME OF MORE THAN 26 LETTERS;G        | LOW;1 NAME OF MORE THAN 26 LETTERS | 0
        L;2 NAME OF MORE THAN 26 LETTERS;G;GEO        | 2 NAME OF MORE THAN 26 LETTERS;GEO | 0
        // The name after a refused set is dropped.
        DAMAGED;LOW;G;GEO                   | GEO     | 1
        ",
    ) {
        let corrupted = low().replace("120.0000", "120.0001");
        let text = lines.split(';').map(|line| match line {
            "L" => low(),
            "G" => geo(),
            "DAMAGED" => corrupted.clone(),
            line => format!("{line}\n"),
        });
        let loaded = read(&text.collect::<String>());
        assert_eq!(named(&loaded), names, "{lines}");
        assert_eq!(loaded.rejected.len().to_string(), rejected, "{lines}");
    }
}

#[test]
fn objects_without_a_number_are_distinguished_by_name() {
    for number in ["00000", "99999"] {
        let set = |epoch: &str, node: &str| {
            let bare = [LOW_1, LOW_2].map(|line| {
                let line = line.replace("90001", number).replace("19001A", "      ");
                sealed(&line.replace("19166.5", epoch).replace("120.0000", node))
            });
            format!("{}\n{}\n", bare[0], bare[1])
        };
        let [one, other] = ["120.0000", "130.0000"].map(|node| set("19166.5", node));
        let loaded = read(&format!("ONE\n{one}TWO\n{one}ONE\n{one}"));
        let digits = number.trim_start_matches('0');
        let id = format!("NORAD {}", if digits.is_empty() { "0" } else { digits });
        let (first, second) = (format!("{id} ONE"), format!("{id} TWO"));
        assert_eq!(
            ids(&loaded),
            [
                (first.as_str(), vec!["ONE"]),
                (second.as_str(), vec!["TWO"])
            ]
        );
        assert_eq!(loaded.find(Some("two")).unwrap().id, second);
        // Equal names with different orbits are different objects.
        let later = set("19167.5", "119.0000");
        let loaded = read(&format!("ONE\n{one}ONE\n{other}one\n{one}ONE\n{later}"));
        let found: Vec<&str> = loaded.objects.iter().map(|one| one.id.as_str()).collect();
        let further = [2, 3].map(|count| format!("{first} #{count}"));
        assert_eq!(found, [&first, &further[0], &further[1]]);
        // Without a name, or with a placeholder, each orbit is an object.
        for name in ["", "TBA - TO BE ASSIGNED\n"] {
            let loaded = read(&format!("{name}{one}{name}{other}{name}{one}"));
            let second = format!("{id} #2");
            let found: Vec<&str> = loaded.objects.iter().map(|one| one.id.as_str()).collect();
            assert_eq!(found, [id.as_str(), second.as_str()]);
        }
    }
}

#[test]
fn lines_without_checksum_are_read_if_both_have_none() {
    let bare = |line: &str| format!("{line:<68}\n");
    let loaded = read(&format!("{}{}", bare(LOW_1), bare(LOW_2)));
    assert_eq!(ids(&loaded), [("NORAD 90001", vec![])]);
    assert_eq!(
        epoch_of(&loaded.objects[0]),
        epoch_of(&read(&low()).objects[0])
    );
    for text in [
        format!("{}{}", bare(LOW_1), sealed(LOW_2)),
        format!("{}\n{}", sealed(LOW_1), bare(LOW_2)),
        format!("{}\n{}", &LOW_1[..67], &LOW_2[..67]),
    ] {
        let loaded = read(&text);
        assert!(loaded.objects.is_empty(), "{text}");
        assert!(
            rejections(&loaded)[0].contains("69 ASCII characters"),
            "{text}"
        );
    }
}

#[test]
fn indented_lines_old_line_ends_and_other_theories() {
    let text = format!("LOW\n{}", low()).replace('\n', "\r");
    let indented: String = text.split('\r').map(|line| format!("  {line}\r")).collect();
    let loaded = read(&indented);
    assert_eq!(ids(&loaded), [("NORAD 90001", vec!["LOW"])]);
    assert_eq!(loaded.rejected, []);
    // Column 63 of line 1 is the ephemeris type.
    let of_type = |kind: &str| {
        let line1 = sealed(&format!("{}{kind}{}", &LOW_1[..62], &LOW_1[63..]));
        read(&format!("{line1}\n{}", sealed(LOW_2)))
    };
    for (kind, reason) in [("4", "elements of SGP4-XP"), ("6", "no elements of SGP4")] {
        let found = rejections(&of_type(kind));
        let start = format!("test.tle:1: ephemeris type {kind}: {reason}");
        assert!(found[0].starts_with(&start), "{found:?}");
    }
    let old = of_type("2");
    assert_eq!(old.objects.len(), 1);
    assert!(old.assumed[0].starts_with("test.tle:1: ephemeris type"));
    assert!(of_type("0").assumed.is_empty() && of_type(" ").assumed.is_empty());
}

#[test]
fn an_object_takes_at_most_250_bytes() {
    let object = &read(&format!("A NAME OF 24 CHARACTERS.\n{}", low())).objects[0];
    let names = &object.names;
    let heap = object.id.capacity() + names.capacity() * size_of::<String>() + names[0].capacity();
    let bytes = size_of::<Object>() + heap;
    assert!(bytes <= 250, "{bytes}");
}

#[test]
fn alpha_5_leaves_out_i_and_o() {
    for (written, number) in [
        ("A0000", 100_000),
        ("H9999", 179_999),
        ("I0000", 0),
        ("J0000", 180_000),
        ("N0000", 220_000),
        ("O0000", 0),
        ("P0000", 230_000),
        ("Z9999", 339_999),
        ("a0000", 0),
        ("A000 ", 0),
        ("    5", 5),
    ] {
        let set = |line: &str| sealed(&line.replace("A0007", written));
        let loaded = read(&format!("{}\n{}", set(GEO_1), set(GEO_2)));
        let found = loaded
            .objects
            .first()
            .and_then(|object| object.identity.number());
        assert_eq!(found.unwrap_or(0), number, "{written}");
        assert_eq!(loaded.rejected.len(), usize::from(number == 0), "{written}");
    }
}

#[test]
fn a_bad_record_is_reported_and_the_rest_loads() {
    let corrupt = low().replace("120.0000", "120.0001");
    let loaded = read(&format!("BAD\n{corrupt}GOOD\n{}", geo()));
    assert_eq!(ids(&loaded), [("NORAD 100007", vec!["GOOD"])]);
    let found = rejections(&loaded).join("\n");
    let is_named = found.starts_with("test.tle:3: bad checksum in line 2");
    assert!(
        is_named && found.ends_with("(BAD)") && found.lines().count() == 1,
        "{found}"
    );
}

#[test]
fn every_kind_of_damage_is_reported_with_its_line() {
    let set = |line1: &str, line2: &str| format!("{}\n{}\n", sealed(line1), sealed(line2));
    for [old, new, line, reason] in rows(
        r"
        19166.5     | 19400.5     | 1 | bad epoch
        19166.5     | 19x66.5     | 1 | bad epoch
        97.5000     | 97.5x00     | 2 | bad inclination
        2 90001  97 | 2 90001 197 | 2 | bad inclination
        0010000     | 00100x0     | 2 | bad eccentricity
        15.20000000 | 00.00000000 | 2 | SGP4 cannot start
        15.20000000 | 00000000inf | 2 | bad mean motion
        10000-4     | 1000x-4     | 1 | bad drag term
        2 90001     | 2 90002     | 2 | line 1 is of object 90001
        19001A      | 19001é      | 1 | not 69 ASCII characters but 69
        ",
    ) {
        let [line1, line2] = [LOW_1, LOW_2].map(|line| line.replace(&old, &new));
        let found = rejections(&read(&set(&line1, &line2))).concat();
        let start = format!("test.tle:{line}: ");
        assert!(
            found.starts_with(&start) && found.contains(&reason),
            "{new}: {found}"
        );
    }
    let [line1, line2] = [LOW_1, LOW_2].map(|line| sealed(line) + "\n");
    for (text, reason) in [
        (
            line1[..68].to_owned() + "\n" + &line2,
            "69 ASCII characters but 68",
        ),
        (line1.clone(), "without its line 2"),
        (line2.clone(), "without its line 1"),
        (line1 + "NAME\n" + &line2, "without its line 2"),
        (
            format!("A remark\n0 LOW\n{}", low()),
            "'A remark' names no element set",
        ),
    ] {
        let found = rejections(&read(&text)).concat();
        assert!(
            found.starts_with("test.tle:1: ") && found.contains(reason),
            "{reason}: {found}"
        );
    }
}

#[test]
fn epochs_are_exact_and_elapsed_time_counts_leap_seconds() {
    let loaded = read(&geo());
    let object = &loaded.objects[0];
    // Day 366 of 2016 is 31 December; 0.99999999 of a day is 86,399.999136 s.
    let written = Epoch::from_gregorian_utc(2016, 12, 31, 23, 59, 59, 999_136_000);
    assert_eq!(
        epoch_of(object).to_tai_duration(),
        written.to_tai_duration()
    );

    // The leap second 2016-12-31T23:59:60 lies between: one minute of UTC is 61 s.
    let after = Epoch::from_gregorian_utc(2017, 1, 1, 0, 0, 59, 999_136_000);
    let Orbit::Elements(elements, _) = &object.orbit else {
        panic!("not an element set")
    };
    let uniform = elements.state_teme_after(61.0 / 60.0).unwrap();
    let requested = elements.state_teme(after).unwrap();
    assert!((uniform.position_m - requested.position_m).norm() < 1e-6);
    // The time scale of the epoch makes no difference.
    for scale in [TimeScale::TAI, TimeScale::TT, TimeScale::GPST] {
        assert_eq!(
            elements.state_teme(after.to_time_scale(scale)).unwrap(),
            requested
        );
    }
}

#[test]
fn decay_and_far_epochs_are_errors_that_name_the_object() {
    // A low orbit with a drag term ten thousand times larger.
    let sinking = |line: &str| sealed(&line.replace("10000-4", "99999-1").replace("15.2", "16.3"));
    let loaded = read(&format!("SINKING\n{}\n{}", sinking(LOW_1), sinking(LOW_2)));
    let object = &loaded.objects[0];
    let epoch = epoch_of(object);
    let mut refused = None;
    for hours in 0..2000 {
        match object.state_with(epoch + f64::from(hours) * Unit::Hour, &Matrix3::identity()) {
            Ok(state) => assert!(state.is_finite()),
            Err(error) => refused = Some(error),
        }
    }
    let error = refused.expect("it comes down").to_string();
    assert!(
        error.contains("NORAD 90001 (SINKING): no state at 2019-"),
        "{error}"
    );

    let object = &read(&low()).objects[0];
    let far = epoch_of(object) + 40_000.0 * Unit::Day;
    assert!(matches!(
        object.state(far),
        Err(OrbitError::Propagation { reason: PropagationError::TooFar { days }, .. })
            if (days - 40_000.0).abs() < 1e-9
    ));
}

#[test]
fn text_without_orbits_and_missing_files_are_errors() {
    for text in ["hello\nworld", "<odd/>"] {
        let error = parse(text, "nothing.txt").unwrap_err();
        assert!(error.is_foreign());
        assert!(error.to_string().starts_with("nothing.txt: no orbit found"));
    }
    let error = load(std::path::Path::new("no/such/file.tle")).unwrap_err();
    assert!(error.to_string().contains("no/such/file.tle"), "{error}");
}

/// A set with some changed characters and correct checksums.
fn damaged() -> impl Strategy<Value = String> {
    let change = (0usize..68, "[ -~é]");
    let line = |line: &'static str| {
        prop::collection::vec(change.clone(), 0..4).prop_map(move |changes| {
            let mut letters: Vec<String> = line.chars().map(String::from).collect();
            for (column, letter) in changes {
                if let Some(old) = letters.get_mut(column) {
                    *old = letter;
                }
            }
            sealed(&letters.concat())
        })
    };
    (line(LOW_1), line(LOW_2)).prop_map(|(a, b)| format!("{a}\n{b}\n"))
}

proptest! {
    #[test]
    fn any_text_is_read_without_panic(text in "(?s).{0,400}") {
        let _ = parse(&text, "any");
    }

    #[test]
    fn any_lines_that_begin_like_element_lines_are_read_without_panic(
        lines in prop::collection::vec("[012 #A-Z][ ][ -~é\t]{20,80}", 0..6)
    ) {
        let _ = parse(&lines.join("\n"), "any");
    }

    #[test]
    fn damaged_sets_never_give_infinite_numbers_or_nan(text in damaged(), days in -400.0..400.0) {
        let Ok(loaded) = parse(&text, "any") else { return Ok(()) };
        for object in &loaded.objects {
            let t = epoch_of(object) + days * Unit::Day;
            if let Ok(state) = object.state_with(t, &Matrix3::identity()) {
                prop_assert!(state.is_finite());
            }
        }
    }
}
