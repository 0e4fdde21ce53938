//! Deviations from the publishers' samples: other units, repeated values, line breaks in values.

use crate::support::texts::{OMM as KVN, SET, oem, omm_json as json, omm_xml as xml, rows};
use skyloop_orbit::time::utc_text;
use skyloop_orbit::{Contents, parse, parse_contents};

fn read(text: &str) -> Contents {
    parse_contents(text, "odd").unwrap()
}

fn rejections(text: &str) -> Vec<String> {
    let rejected = read(text).rejected;
    rejected.iter().map(ToString::to_string).collect()
}

#[test]
fn theories_of_sgp4_are_accepted_and_others_refused_by_name() {
    let wanted = read(KVN).records[0].elements;
    let of_theory = |theory: &str| KVN.replace("= SGP4", &format!("= {theory}"));
    for theory in ["SGP4", "sgp4", "SDP4", "SGP/SGP4", "SGP4/SDP4"] {
        let contents = read(&of_theory(theory));
        assert_eq!(
            (contents.records[0].elements, contents.assumed.len()),
            (wanted, 0),
            "{theory}"
        );
    }
    let of_type = |number: &str| format!("{KVN}EPHEMERIS_TYPE = {number}\n");
    for (text, assumed) in [
        (of_theory("SGP"), "MEAN_ELEMENT_THEORY = SGP: propagated by"),
        (of_theory("TLE"), "MEAN_ELEMENT_THEORY = TLE: taken as"),
        (of_theory("GP"), "MEAN_ELEMENT_THEORY = GP: taken as"),
        (of_type("2"), "ephemeris type"),
    ] {
        let contents = read(&text);
        assert_eq!(contents.records[0].elements, wanted, "{assumed}");
        let start = format!("odd:1: {assumed}");
        assert!(contents.assumed[0].starts_with(&start), "{assumed}");
        assert!(read(&text.repeat(2)).assumed[0].ends_with("so in 2 records"));
    }
    let xp = "elements of SGP4-XP";
    for (text, line, reason) in [
        (of_theory("SGP4-XP"), 6, xp),
        (of_theory("sgp4 xp"), 6, xp),
        (of_theory("SGP8"), 6, "only elements of SGP4"),
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
}

/// Space-Track's older classes have the epoch in two fields, and the designator as INTLDES.
#[test]
fn older_fields_of_epoch_and_designator_are_read() {
    // X-Val: a record of class tle_latest of 2016, whose TLE_LINE1 has the epoch 16108.51152292:
    // 0.58029 s after 12:16:35.
    let older = KVN
        .replace("2026-07-12T03:04:05", "2016-04-17 12:16:35")
        .replace("OBJECT_ID = 2026-101A\n", "")
        + "EPOCH_MICROSECONDS = 580288\nINTLDES = 06047A\n";
    let record = &read(&json(&older)).records[0];
    assert_eq!(
        utc_text(record.elements.epoch),
        "2016-04-17T12:16:35.580288Z"
    );
    assert_eq!(record.designator, "2006-047A");
    let found = rejections(&json(&older.replace("12:16:35", "12:16:35.5")));
    assert!(
        found[0].contains("the only fraction of a second"),
        "{found:?}"
    );
}

#[test]
fn a_servers_message_is_quoted_in_the_error() {
    for (text, says) in [
        ("<html>No GP data found</html>", "No GP data found"),
        (r#"{"error":"You must log in"}"#, "You must log in"),
        ("No GP data found", "No GP data found"),
    ] {
        let error = parse_contents(text, "odd").unwrap_err();
        assert!(!error.is_foreign(), "{error}");
        let answer = format!("the answer of a server: \"{says}\"; fetch the file again");
        assert_eq!(error.to_string(), format!("odd: no orbits, but {answer}"));
    }
    let error = parse_contents("First line,\nhello", "odd").unwrap_err();
    let begins = error
        .to_string()
        .contains("it begins with \"First line, hello\"");
    assert!(begins && error.is_foreign(), "{error}");
}

#[test]
fn a_value_in_another_unit_is_refused() {
    let elements = read(KVN).records[0].elements;
    for [unit, other, keyword] in rows(
        "rev/day    | rad/min    | MEAN_MOTION
         deg        | rad        | INCLINATION
         1/ER       | 1/km       | BSTAR
         rev/day**2 | rev/day    | MEAN_MOTION_DOT
         rev/day**3 | rev/day**2 | MEAN_MOTION_DDOT",
    ) {
        let unit_in_brackets = format!(" [{unit}]");
        let with = |other: &str| KVN.replacen(&unit_in_brackets, other, 1);
        let reason = format!("{keyword} in '{other}'; only {unit} is read");
        let reason = format!("{reason} (MADE UP, NORAD_CAT_ID 100001)");
        let corrupted = with(&format!(" [{other}]"));
        for text in [&corrupted, &xml(&corrupted)] {
            let found = rejections(text);
            assert!(found.len() == 1 && found[0].contains(&reason), "{found:?}");
        }
        let upper = with(&unit_in_brackets.to_uppercase());
        for text in [with(""), xml(&upper), upper] {
            assert_eq!(read(&text).records[0].elements, elements, "{text}");
        }
    }
    for attribute in ["unit=\"m\"", "UNITS=\"m\""] {
        let found = rejections(&xml(KVN).replace("units=\"rev/day\"", attribute));
        assert!(found[0].contains("MEAN_MOTION in 'm'"), "{found:?}");
    }
    // Dimensionless values have no unit.
    let text = KVN.replace("ECCENTRICITY = 0.001", "ECCENTRICITY = 0.001 [deg]");
    let [kvn, xml] = [rejections(&text), rejections(&xml(&text))].map(|all| all.concat());
    assert!(
        kvn.contains("ECCENTRICITY '0.001 [deg]' is not a number from 0 to 1"),
        "{kvn}"
    );
    assert!(
        xml.contains("ECCENTRICITY in 'deg'; it has no unit"),
        "{xml}"
    );
}

#[test]
fn a_repeated_keyword_is_reported() {
    let versioned = format!("CCSDS_OMM_VERS = 3.0\n{KVN}");
    let twice = "INCLINATION = 97.5 [deg]\nINCLINATION = 52\n";
    let reason = "INCLINATION twice: '97.5' and '52' (MADE UP, NORAD_CAT_ID 100001)";
    for (text, line) in [(versioned.as_str(), 12), (KVN, 11)] {
        let corrupted = text.replace("INCLINATION = 97.5 [deg]\n", twice);
        let both = corrupted.clone() + &text.replace("100001", "100002");
        assert_eq!(
            rejections(&both),
            [format!("odd:{line}: record 1: {reason}")]
        );
        assert_eq!(read(&both).records[0].elements.norad, 100_002);
        assert!(rejections(&xml(&corrupted))[0].ends_with(reason));
    }
    // At the end of a message with its version; one without is taken to end there.
    let found = rejections(&format!("{versioned}BSTAR = 1\n"));
    assert!(
        found[0].contains("BSTAR twice: '0.0001' and '1'"),
        "{found:?}"
    );
    let headless = KVN.replace("OBJECT_NAME = MADE UP\n", "");
    assert_eq!(read(&format!("{KVN}{headless}{KVN}")).records.len(), 3);
}

#[test]
fn a_csv_value_may_have_line_breaks() {
    const HEAD: &str = "OBJECT_NAME,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,\
                        ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR";
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
    // A value is never taken in part.
    for corrupted in [
        format!("\"TWO\nLINES\",{REST},7\n"),
        format!("\"TWO\n{REST},7,0\n"),
        format!("TWO\",{REST},7,0\n"),
    ] {
        let contents = read(&format!("{HEAD}\n{corrupted}ONE,{REST},8,0\n"));
        let names: Vec<&str> = contents.records.iter().map(|it| it.name.as_str()).collect();
        let rejected = contents.rejected;
        assert_eq!(
            (names, rejected.len()),
            (vec!["ONE"], corrupted.lines().count()),
            "{rejected:?}"
        );
        let found = rejected[0].to_string();
        assert!(
            found.starts_with("odd:2: record 1: a quotation mark without"),
            "{found}"
        );
    }
}

#[test]
fn a_refusal_is_one_line_with_the_number_of_the_record() {
    let fine = json(KVN);
    let corrupted = fine.replace("97.5", "9\\n7");
    let torn = fine.replacen("\",", "\" ", 1);
    let found = rejections(&format!("[{fine},{corrupted},{fine},{torn}\n<a>\n<b>"));
    let inclination = "INCLINATION '9\\u000a7' is not a number from 0 to 180";
    for (found, wanted) in found.iter().zip([
        format!("odd:1: record 2: {inclination} (MADE UP, NORAD_CAT_ID 100001)"),
        "odd:1: record 4: not JSON".to_owned(),
        "odd:2: '<a>\\u000a<b>' is outside".to_owned(),
    ]) {
        assert!(
            found.starts_with(&wanted) && !found.contains('\n'),
            "{found}"
        );
    }
    assert!(found.len() >= 3, "{found:?}");
}

/// An OEM with two states, `minute` and `minute + 25` minutes past three.
fn message(name: &str, id: &str, minute: u32) -> String {
    let meta = format!(
        "OBJECT_NAME = {name}\nOBJECT_ID = {id}\nSTART_TIME = 2026-07-12T03:00:00\n\
         STOP_TIME = 2026-07-12T04:00:00\n"
    );
    let states = [
        (minute, "7000 0 0 0 7.5 0"),
        (minute + 25, "0 7000 0 -7.5 0 0"),
    ];
    let states = states.map(|(minute, state)| format!("2026-07-12T03:{minute}:00 {state}"));
    oem(&meta, &states).replacen('\n', "\nORIGINATOR = X\n", 1)
}

#[test]
fn ephemerides_of_unknown_objects_are_not_joined() {
    // Names and ids of two segments, and the ids of the objects.
    for [one, other, ids] in rows(
        "
        A, UNKNOWN    | B, UNKNOWN    | UNKNOWN A, UNKNOWN B
        A, TBD        | B, tbd        | TBD A, tbd B
        A,            | B,            | UNKNOWN A, UNKNOWN B
        A, 0          | B, 99999      | 0 A, 99999 B
        A, YYYY-NNNP  | B, YYYY-NNNP  | YYYY-NNNP A, YYYY-NNNP B
        A, 2026-n/a   | B, 2026-n/a   | 2026-n/a A, 2026-n/a B
        UNKNOWN, UNKNOWN | ,          | UNKNOWN, UNKNOWN #2
        // Segments with one name are one object.
        A, UNKNOWN    | a, N/A        | UNKNOWN A
        CUBE, TBD     | 0 CUBE, 0     | TBD CUBE, 0 0 CUBE
        // Names of unidentified objects do not identify (space-track.org).
        DEB, UNKNOWN  | DEB, UNKNOWN  | UNKNOWN DEB, UNKNOWN DEB #2
        0 DEB, 0      | 0 DEB, 0      | 0 0 DEB, 0 0 DEB #2
        R/B,          | R/B,          | UNKNOWN R/B, UNKNOWN R/B #2
        Object AB, 0  | Object AB, 0  | 0 Object AB, 0 Object AB #2
        OBJECT 12, 0  | OBJECT 12, 0  | 0 OBJECT 12, 0 OBJECT 12 #2
        A, 1998-067-A | B, 1998-067A  | 1998-067-A
        A, 25544      | B, NORAD 025544 | 25544
        A, SSSS-067A  | B, SSSS-067A  | SSSS-067A
        A, OWN-1      | B, own-1      | OWN-1
        A, OWN-1      | A, OWN-2      | OWN-1, OWN-2
        ",
    ) {
        let text = [(one, 10), (other, 20)].map(|(segment, minute)| {
            let (name, id) = segment.split_once(',').unwrap();
            message(name, id.trim(), minute)
        });
        let loaded = parse(&text.concat(), "odd").unwrap();
        assert_eq!(loaded.rejected, []);
        let found: Vec<&str> = loaded.objects.iter().map(|one| one.id.as_str()).collect();
        assert_eq!(found.join(", "), ids);
    }
}

#[test]
fn an_omm_may_have_no_catalogue_number() {
    let (xml, json) = (xml(KVN), json(KVN));
    // X-Val: space-track.org, Alpha-5: T5544 is 275544.
    for (text, from, to, number) in [
        (KVN, "NORAD_CAT_ID = 100001\n", "", 0),
        (KVN, "= 100001", "= UNKNOWN", 0),
        (KVN, "= 100001", "= A0005", 100_005),
        (&xml, ">100001<", "><", 0),
        (&json, "\"100001\"", "null", 0),
        (&json, "\"100001\"", "\"\"", 0),
        (&json, "\"100001\"", "\"UNKNOWN\"", 0),
        (&json, "\"100001\"", "\"T5544\"", 275_544),
    ] {
        assert!(text.contains(from), "{text}");
        let contents = read(&text.replace(from, to));
        assert_eq!(contents.rejected, [], "{to}");
        assert_eq!(contents.records[0].elements.norad, number, "{to}");
    }
}

#[test]
fn an_oem_after_another_begins_with_its_version() {
    let [first, second] =
        [("2026-101A", 10), ("2026-101B", 20)].map(|(id, at)| message("A", id, at));
    let loaded = parse(&(first.clone() + &second), "odd").unwrap();
    assert_eq!(loaded.rejected, []);
    let ids: Vec<&str> = loaded
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    assert_eq!(ids, ["2026-101A", "2026-101B"]);
    // A message without its states is refused alone.
    let torn = first.split("2026-07-12T03:10").next().unwrap();
    let loaded = parse(&(torn.to_owned() + &second), "odd").unwrap();
    assert_eq!((loaded.objects.len(), loaded.rejected.len()), (1, 1));
}

#[test]
fn a_toml_table_is_foreign_and_an_empty_file_is_a_loss() {
    for text in [
        "[[objects]]\nfiles = [\"a\"]",
        "# made up\n[ objects ]\n",
        "[1, 2]",
    ] {
        let error = parse_contents(text, "odd").unwrap_err();
        let is_unknown = error.to_string().contains("no orbit found");
        assert!(is_unknown && error.is_foreign(), "{error}");
    }
    // An orbit file without records is not foreign.
    for text in ["[ ]", "", "\r\n \n"] {
        let error = parse_contents(text, "odd").unwrap_err();
        assert!(!error.is_foreign(), "{error}");
    }
}

#[test]
fn json_with_the_lines_of_element_sets_is_read() {
    let (first, second) = SET.trim_end().split_once('\n').unwrap();
    // Keys and surroundings of the lines, and the name of the object.
    for [text, name] in rows(
        r#"
        {"name":"V","date":"x","line1":"1","line2":"2"}                             | V
        [{"TLE_LINE0":"0 V","TLE_LINE1":"1","TLE_LINE2":"2","NORAD_CAT_ID":"5"}]    | V
        {"member":[{"line1":"1","line2":"2"}]}                                      |
        "#,
    ) {
        let text = text.replace("\"1\"", &format!("\"{first}\""));
        let contents = read(&text.replace("\"2\"", &format!("\"{second}\"")));
        let set = &contents.records[0];
        let found = (set.elements.norad, &*set.designator, &*set.name);
        assert_eq!(found, (5, "1958-002B", &*name));
        assert_eq!(set.elements, read(SET).records[0].elements);
    }
    let second = second.replace("34.2", "35.2");
    let found = rejections(&format!(r#"{{"line1":"{first}","line2":"{second}"}}"#));
    assert!(found[0].contains("checksum"), "{found:?}");
}
