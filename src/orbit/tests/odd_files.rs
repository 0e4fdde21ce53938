//! What files have that their publishers' samples have not: other units, values twice, line breaks in values.

use skyloop_orbit::time::utc_text;
use skyloop_orbit::{Contents, LoadError, parse, parse_contents};

/// A made-up object.
const KVN: &str = "\
OBJECT_NAME = MADE UP
OBJECT_ID = 2026-101A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2026-07-12T03:04:05
MEAN_MOTION = 15.2 [rev/day]
ECCENTRICITY = 0.001
INCLINATION = 97.5 [deg]
RA_OF_ASC_NODE = 120 [deg]
ARG_OF_PERICENTER = 90 [deg]
MEAN_ANOMALY = 270 [deg]
NORAD_CAT_ID = 100001
BSTAR = 0.0001 [1/ER]
MEAN_MOTION_DOT = 1e-5 [rev/day**2]
MEAN_MOTION_DDOT = 0 [rev/day**3]
";

fn read(text: &str) -> Contents {
    parse_contents(text, "odd").unwrap()
}

fn rejections(text: &str) -> Vec<String> {
    let rejected = read(text).rejected;
    rejected.iter().map(ToString::to_string).collect()
}

/// The message as XML, its units as attributes.
fn xml(kvn: &str) -> String {
    let elements = kvn.lines().filter_map(|line| {
        let (keyword, value) = line.split_once(" = ")?;
        Some(match value.trim_end_matches(']').split_once(" [") {
            Some((number, unit)) => format!("<{keyword} units=\"{unit}\">{number}</{keyword}>"),
            None => format!("<{keyword}>{value}</{keyword}>"),
        })
    });
    format!("<ndm><omm>{}</omm></ndm>", elements.collect::<String>())
}

#[test]
fn theories_that_sgp4_flies_are_taken_and_others_refused_by_name() {
    let wanted = read(KVN).records[0].elements;
    for (theory, assumed) in [
        ("SGP4", ""),
        ("sgp4", ""),
        ("SDP4", ""),
        ("SGP/SGP4", ""),
        ("SGP4/SDP4", ""),
        ("SGP", "odd:1: MEAN_ELEMENT_THEORY = SGP: flown by SGP4"),
        ("TLE", "odd:1: MEAN_ELEMENT_THEORY = TLE: taken as SGP4"),
    ] {
        let text = KVN.replace("THEORY = SGP4", &format!("THEORY = {theory}"));
        let contents = read(&text);
        assert_eq!(contents.records[0].elements, wanted, "{theory}");
        let said = contents.assumed.concat();
        assert!(said.starts_with(assumed), "{theory}: {said}");
        assert_eq!(said.is_empty(), assumed.is_empty(), "{theory}: {said}");
    }
    let twice = KVN.replace("THEORY = SGP4", "THEORY = TLE").repeat(2);
    assert!(read(&twice).assumed[0].ends_with("so in 2 records"));
    let of_type = |number: &str| format!("{KVN}EPHEMERIS_TYPE = {number}\n");
    let xp = "elements of SGP4-XP";
    for (text, line, reason) in [
        (KVN.replace("= SGP4", "= SGP4-XP"), 6, xp),
        (KVN.replace("= SGP4", "= sgp4 xp"), 6, xp),
        (KVN.replace("= SGP4", "= SGP8"), 6, "only elements of SGP4"),
        (of_type("4"), 18, xp),
        (of_type("6"), 18, "no elements of SGP4"),
        (of_type("300"), 18, "no elements of SGP4"),
        (format!("{KVN}BTERM = 0.02 [m**2/kg]\n"), 18, xp),
        (format!("{KVN}AGOM = 0.01\n"), 18, xp),
    ] {
        let found = rejections(&text);
        assert!(found.len() == 1 && found[0].contains(reason), "{found:?}");
        assert!(found[0].starts_with(&format!("odd:{line}: ")), "{found:?}");
    }
    let old = read(&of_type("2"));
    assert_eq!(old.records[0].elements, wanted);
    assert!(
        old.assumed[0].starts_with("odd:1: ephemeris type"),
        "{:?}",
        old.assumed
    );
}

/// Space-Track's older classes write the epoch in two fields, and call the designator INTLDES.
#[test]
fn an_epoch_has_its_microseconds_and_an_object_its_old_designator() {
    // X-Val: a record of class tle_latest of 2016, whose TLE_LINE1 has the epoch 16108.51152292: 0.58029 s after 12:16:35.
    let older = KVN
        .replace("2026-07-12T03:04:05", "2016-04-17 12:16:35")
        .replace("OBJECT_ID = 2026-101A\n", "")
        + "EPOCH_MICROSECONDS = 580288\nINTLDES = 06047A\n";
    let record = &parse_contents(&format!("[{}]", json(&older)), "odd")
        .unwrap()
        .records[0];
    assert_eq!(
        utc_text(record.elements.epoch),
        "2016-04-17T12:16:35.580288Z"
    );
    assert_eq!(record.designator, "2006-047A");
    let odd = older.replace("12:16:35", "12:16:35.5");
    let rejected = parse_contents(&format!("[{}]", json(&odd)), "odd")
        .unwrap()
        .rejected;
    assert!(
        rejected[0].reason.contains("the only fraction of a second"),
        "{}",
        rejected[0].reason
    );
}

/// The message as a record in JSON.
fn json(kvn: &str) -> String {
    let pairs = kvn.lines().filter_map(|line| {
        let (keyword, value) = line.split_once(" = ")?;
        let value = value.split(" [").next()?;
        Some(format!("\"{keyword}\":\"{value}\""))
    });
    format!("{{{}}}", pairs.collect::<Vec<_>>().join(","))
}

#[test]
fn an_answer_of_a_server_is_a_loss_in_its_own_words() {
    let json = r#"{"error":"You must be logged in"}"#;
    let page = "<html><body>No GP data found</body></html>";
    for (text, says) in [
        (page, "No GP data found"),
        (json, "You must be logged in"),
        ("No GP data found", "No GP data found"),
    ] {
        let error = parse_contents(text, "odd").unwrap_err();
        assert!(!error.is_foreign(), "{error}");
        let wanted =
            format!("odd: no orbits, but the answer of a server: \"{says}\"; fetch the file again");
        assert_eq!(error.to_string(), wanted);
    }
    let error = parse_contents("Dear reader,\nhello", "odd").unwrap_err();
    assert!(
        error.is_foreign()
            && error
                .to_string()
                .contains("it begins with \"Dear reader, hello\"")
    );
}

#[test]
fn a_value_in_another_unit_is_refused() {
    let plain = &read(KVN).records[0];
    for (unit, other, keyword) in [
        ("rev/day]", "rad/min]", "MEAN_MOTION"),
        ("deg]", "rad]", "INCLINATION"),
        ("1/ER]", "1/km]", "BSTAR"),
        ("rev/day**2]", "rev/day]", "MEAN_MOTION_DOT"),
        ("rev/day**3]", "rev/day**2]", "MEAN_MOTION_DDOT"),
    ] {
        let wanted = unit.trim_end_matches(']');
        let found = other.trim_end_matches(']');
        let reason =
            format!("{keyword} in '{found}'; only {wanted} is read (MADE UP, NORAD_CAT_ID 100001)");
        let spoilt = KVN.replacen(unit, other, 1);
        for text in [spoilt.clone(), xml(&spoilt)] {
            let found = rejections(&text);
            assert!(found.len() == 1 && found[0].contains(&reason), "{found:?}");
        }
        let upper = KVN.replace(unit, &unit.to_uppercase());
        for text in [
            KVN.replace(&format!(" [{unit}"), ""),
            upper.clone(),
            xml(&upper),
        ] {
            assert_eq!(read(&text).records[0].elements, plain.elements, "{text}");
        }
    }
    // Pure numbers have none.
    let text = KVN.replace("ECCENTRICITY = 0.001", "ECCENTRICITY = 0.001 [deg]");
    assert!(
        rejections(&text)[0].contains("ECCENTRICITY '0.001 [deg]' is not a number from 0 to 1")
    );
    assert!(rejections(&xml(&text))[0].contains("ECCENTRICITY in 'deg'; it has no unit"));
}

#[test]
fn a_keyword_twice_is_reported_as_such() {
    let versioned = format!("CCSDS_OMM_VERS = 3.0\n{KVN}");
    let twice = "INCLINATION = 97.5 [deg]\nINCLINATION = 52\n";
    let reason = "INCLINATION twice: '97.5' and '52' (MADE UP, NORAD_CAT_ID 100001)";
    for (text, line) in [(versioned.as_str(), 12), (KVN, 11)] {
        let spoilt = text.replace("INCLINATION = 97.5 [deg]\n", twice);
        let second = text.replace("100001", "100002");
        let contents = read(&format!("{spoilt}{second}"));
        let found = contents.rejected.iter().map(ToString::to_string);
        assert_eq!(
            found.collect::<Vec<_>>(),
            [format!("odd:{line}: record 1: {reason}")]
        );
        assert_eq!(contents.records[0].elements.norad, 100_002);
        assert!(rejections(&xml(&spoilt))[0].ends_with(reason));
    }
    // At the end of a message that says where it begins; one that does not is taken to end there.
    assert!(
        rejections(&format!("{versioned}BSTAR = 1\n"))[0].contains("BSTAR twice: '0.0001' and '1'")
    );
    let headless = KVN.replace("OBJECT_NAME = MADE UP\n", "");
    assert_eq!(read(&format!("{KVN}{headless}{KVN}")).records.len(), 3);
}

#[test]
fn a_csv_value_may_have_line_breaks() {
    const HEAD: &str = "OBJECT_NAME,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR";
    const REST: &str = "2026-07-12T03:04:05,15.2,.001,97.5,120,90,270";
    for end in ["\n", "\r\n"] {
        let text = format!("{HEAD}{end}\"TWO{end}LINES\",{REST},7,0{end}ONE,{REST},8,0{end}");
        let contents = read(&text);
        assert_eq!(contents.rejected, []);
        let found = contents
            .records
            .iter()
            .map(|it| (it.name.as_str(), it.line));
        assert_eq!(found.collect::<Vec<_>>(), [("TWO LINES", 2), ("ONE", 4)]);
    }
    // Half of a value is never taken for the whole.
    for spoilt in [
        format!("\"TWO\nLINES\",{REST},7\n"),
        format!("\"TWO\n{REST},7,0\n"),
        format!("TWO\",{REST},7,0\n"),
    ] {
        let contents = read(&format!("{HEAD}\n{spoilt}ONE,{REST},8,0\n"));
        let names: Vec<&str> = contents.records.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["ONE"], "{spoilt}");
        assert_eq!(
            contents.rejected.len(),
            spoilt.lines().count(),
            "{:?}",
            contents.rejected
        );
        let found = contents.rejected[0].to_string();
        assert!(
            found.starts_with("odd:2: record 1: a quotation mark without"),
            "{found}"
        );
    }
}

#[test]
fn a_refusal_is_one_line_with_the_number_of_its_record() {
    let json = |number: &str, inclination: &str| {
        format!(
            r#"{{"OBJECT_NAME":"SAME DEB","EPOCH":"2026-07-12T03:04:05","MEAN_MOTION":15.2,"ECCENTRICITY":0,"INCLINATION":{inclination},"RA_OF_ASC_NODE":1,"ARG_OF_PERICENTER":2,"MEAN_ANOMALY":3,"NORAD_CAT_ID":{number},"BSTAR":0}}"#
        )
    };
    let (fine, spoilt) = (json("7", "97.5"), json("8", "\"9\\n7\""));
    let text = format!(
        "[{fine},{spoilt},{fine},{}\n<a>\n<b>",
        fine.replace("1,", "1 ")
    );
    let found = rejections(&text);
    assert_eq!(
        found[0],
        "odd:1: record 2: INCLINATION '9\\u000a7' is not a number from 0 to 180 (SAME DEB, NORAD_CAT_ID 8)"
    );
    assert!(
        found[1].starts_with("odd:1: record 4: not JSON"),
        "{found:?}"
    );
    assert!(
        found[2].starts_with("odd:2: '<a>\\u000a<b>' is outside"),
        "{found:?}"
    );
    assert!(found.iter().all(|line| !line.contains('\n')), "{found:?}");
}

/// An ephemeris of so many minutes past three.
fn message(id: &str, minute: u32) -> String {
    named_message("MADE UP", id, minute)
}

fn named_message(name: &str, id: &str, minute: u32) -> String {
    format!(
        "CCSDS_OEM_VERS = 2.0\nORIGINATOR = X\nMETA_START\nOBJECT_NAME = {name}\nOBJECT_ID = {id}\nCENTER_NAME = EARTH\n\
             REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2026-07-12T03:00:00\nSTOP_TIME = 2026-07-12T04:00:00\nMETA_STOP\n\
             2026-07-12T03:{minute}:00 7000 0 0 0 7.5 0\n2026-07-12T03:{}:00 0 7000 0 -7.5 0 0\n",
        minute + 25
    )
}

#[test]
fn ephemerides_of_unknown_objects_stay_apart() {
    for (first, second, ids) in [
        (
            ("A", "UNKNOWN"),
            ("B", "UNKNOWN"),
            &["UNKNOWN A", "UNKNOWN B"][..],
        ),
        (("A", "TBD"), ("B", "tbd"), &["TBD A", "tbd B"]),
        (("A", ""), ("B", ""), &["UNKNOWN A", "UNKNOWN B"]),
        (("A", "0"), ("B", "99999"), &["0 A", "99999 B"]),
        (
            ("A", "YYYY-NNNP"),
            ("B", "YYYY-NNNP"),
            &["YYYY-NNNP A", "YYYY-NNNP B"],
        ),
        (
            ("A", "2026-n/a"),
            ("B", "2026-n/a"),
            &["2026-n/a A", "2026-n/a B"],
        ),
        (("UNKNOWN", "UNKNOWN"), ("", ""), &["UNKNOWN", "UNKNOWN #2"]),
        // One name, and one object in however many segments.
        (("A", "UNKNOWN"), ("a", "N/A"), &["UNKNOWN A"]),
        (("CUBE", "TBD"), ("0 CUBE", "0"), &["TBD CUBE", "0 0 CUBE"]),
        // Names of unidentified objects are no identities (space-track.org).
        (
            ("DEB", "UNKNOWN"),
            ("DEB", "UNKNOWN"),
            &["UNKNOWN DEB", "UNKNOWN DEB #2"],
        ),
        (("0 DEB", "0"), ("0 DEB", "0"), &["0 0 DEB", "0 0 DEB #2"]),
        (("R/B", ""), ("R/B", ""), &["UNKNOWN R/B", "UNKNOWN R/B #2"]),
        (
            ("Object AB", "0"),
            ("Object AB", "0"),
            &["0 Object AB", "0 Object AB #2"],
        ),
        (
            ("OBJECT 12", "0"),
            ("OBJECT 12", "0"),
            &["0 OBJECT 12", "0 OBJECT 12 #2"],
        ),
        (("A", "1998-067-A"), ("B", "1998-067A"), &["1998-067-A"]),
        (("A", "25544"), ("B", "NORAD 025544"), &["25544"]),
        (("A", "SSSS-067A"), ("B", "SSSS-067A"), &["SSSS-067A"]),
        (("A", "OWN-1"), ("B", "own-1"), &["OWN-1"]),
        (("A", "OWN-1"), ("A", "OWN-2"), &["OWN-1", "OWN-2"]),
    ] {
        let text =
            [(first, 10), (second, 20)].map(|((name, id), minute)| named_message(name, id, minute));
        let loaded = parse(&text.concat(), "odd").unwrap();
        assert_eq!(loaded.rejected, []);
        let found: Vec<&str> = loaded.objects.iter().map(|one| one.id.as_str()).collect();
        assert_eq!(found, ids);
    }
}

#[test]
fn an_omm_may_have_no_catalogue_number() {
    let pairs = KVN.lines().filter_map(|line| line.split_once(" = "));
    let pairs = pairs.map(|(key, value)| (key, value.split(" [").next().unwrap()));
    let xml = pairs
        .clone()
        .map(|(key, value)| format!("<{key}>{value}</{key}>"));
    let xml = format!("<omm>{}</omm>", xml.collect::<String>());
    let json = pairs.map(|(key, value)| format!("\"{key}\":\"{value}\""));
    let json = format!("{{{}}}", json.collect::<Vec<_>>().join(","));
    // X-Val: space-track.org, Alpha-5: T5544 is 275544.
    for (text, from, to, number) in [
        (KVN, "NORAD_CAT_ID = 100001\n", "", 0),
        (KVN, "NORAD_CAT_ID = 100001", "NORAD_CAT_ID = UNKNOWN", 0),
        (
            KVN,
            "NORAD_CAT_ID = 100001",
            "NORAD_CAT_ID = A0005",
            100_005,
        ),
        (&xml, "<NORAD_CAT_ID>100001<", "<NORAD_CAT_ID><", 0),
        (
            &json,
            r#""NORAD_CAT_ID":"100001""#,
            r#""NORAD_CAT_ID":null"#,
            0,
        ),
        (
            &json,
            r#""NORAD_CAT_ID":"100001""#,
            r#""NORAD_CAT_ID":"""#,
            0,
        ),
        (
            &json,
            r#""NORAD_CAT_ID":"100001""#,
            r#""NORAD_CAT_ID":"UNKNOWN""#,
            0,
        ),
        (
            &json,
            r#""NORAD_CAT_ID":"100001""#,
            r#""NORAD_CAT_ID":"T5544""#,
            275_544,
        ),
    ] {
        assert!(text.contains(from), "{text}");
        let contents = read(&text.replace(from, to));
        assert_eq!(contents.rejected, [], "{to}");
        assert_eq!(contents.records[0].elements.norad, number, "{to}");
    }
}

#[test]
fn an_oem_behind_another_begins_with_its_version() {
    let loaded = parse(
        &[message("2026-101A", 10), message("2026-101B", 20)].concat(),
        "odd",
    )
    .unwrap();
    assert_eq!(loaded.rejected, []);
    let ids: Vec<&str> = loaded
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    assert_eq!(ids, ["2026-101A", "2026-101B"]);
    // One that lost its states is refused alone.
    let torn = message("2026-101A", 10);
    let torn = torn.split("2026-07-12T03:10").next().unwrap();
    let loaded = parse(&[torn, &message("2026-101B", 20)].concat(), "odd").unwrap();
    assert_eq!((loaded.objects.len(), loaded.rejected.len()), (1, 1));
}

#[test]
fn a_table_of_toml_is_no_json_and_an_empty_file_is_a_loss() {
    for text in [
        "[[objects]]\nfiles = [\"a\"]",
        "# made up\n[ objects ]\n",
        "[1, 2]",
    ] {
        let error = parse_contents(text, "odd").unwrap_err();
        assert!(
            matches!(error, LoadError::NoOrbit { .. }) && error.is_foreign(),
            "{error}"
        );
    }
    // What has lost its records is a file of orbits all the same.
    for text in ["[ ]", "", "\r\n \n"] {
        let error = parse_contents(text, "odd").unwrap_err();
        let nothing = matches!(error, LoadError::NoRecord { .. } | LoadError::Empty { .. });
        assert!(nothing && !error.is_foreign(), "{error}");
    }
}

#[test]
fn a_time_that_there_is_not_is_refused_with_what_is_wrong() {
    for (time, why) in [
        ("2026-07-12T24:00:00", "a day ends at 00:00:00 of the next"),
        ("2026-07-12T03:04:05+02:00", "offsets from UTC are not read"),
        ("2026-06-31T03:04:05", "2026-06 has days 1 to 30"),
    ] {
        let text = KVN.replace("2026-07-12T03:04:05", time);
        let [refused] = &rejections(&text)[..] else {
            panic!("{time}");
        };
        assert!(refused.contains(time) && refused.contains(why), "{refused}");
    }
}

/// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005.
const SET: &str = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
                   2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";

#[test]
fn json_with_the_lines_of_element_sets_is_read() {
    let (first, second) = SET.trim_end().split_once('\n').unwrap();
    for (text, name) in [
        (
            format!(r#"{{"name":"V","date":"x","line1":"{first}","line2":"{second}"}}"#),
            "V",
        ),
        (
            format!(
                r#"[{{"TLE_LINE0":"0 V","TLE_LINE1":"{first}","TLE_LINE2":"{second}","NORAD_CAT_ID":"5"}}]"#
            ),
            "V",
        ),
        (
            format!(r#"{{"member":[{{"line1":"{first}","line2":"{second}"}}]}}"#),
            "",
        ),
    ] {
        let contents = read(&text);
        let set = &contents.records[0];
        assert_eq!(
            (set.elements.norad, &*set.designator, &*set.name),
            (5, "1958-002B", name)
        );
        assert_eq!(set.elements, read(SET).records[0].elements);
    }
    let torn = format!(
        r#"{{"line1":"{first}","line2":"{}"}}"#,
        second.replace("34.2", "35.2")
    );
    let why = &read(&torn).rejected[0].reason;
    assert!(why.contains("checksum"), "{why}");
}
