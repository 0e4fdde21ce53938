//! OMM in the publishers' layouts: KVN, XML, JSON and CSV, whole and damaged.

use crate::support::texts::{rows, sealed};
use proptest::prelude::*;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::{Checksum, Contents, Format, Orbit, parse, parse_contents};

// Made-up objects with the layouts and keywords of the publishers.

/// JSON as from CelesTrak: numbers, no metadata.
const CELESTRAK_JSON: &str = r#"[{"OBJECT_NAME":"MADE UP 1","OBJECT_ID":"2026-101A","EPOCH":"2026-07-12T03:04:05.678912","MEAN_MOTION":15.20000001,"ECCENTRICITY":0.0010001,"INCLINATION":97.5001,"RA_OF_ASC_NODE":120.0002,"ARG_OF_PERICENTER":90.0003,"MEAN_ANOMALY":270.0004,"EPHEMERIS_TYPE":0,"CLASSIFICATION_TYPE":"U","NORAD_CAT_ID":100001,"ELEMENT_SET_NO":999,"REV_AT_EPOCH":123,"BSTAR":0.00010001,"MEAN_MOTION_DOT":1.234e-5,"MEAN_MOTION_DDOT":0},{"OBJECT_NAME":"MADE UP \"2\"","OBJECT_ID":"2026-101B","EPOCH":"1999-12-31T23:59:59.999999","MEAN_MOTION":1.0027,"ECCENTRICITY":0.0002,"INCLINATION":0.05,"RA_OF_ASC_NODE":80,"ARG_OF_PERICENTER":10,"MEAN_ANOMALY":20,"EPHEMERIS_TYPE":0,"CLASSIFICATION_TYPE":"U","NORAD_CAT_ID":123456789,"ELEMENT_SET_NO":1,"REV_AT_EPOCH":1,"BSTAR":0,"MEAN_MOTION_DOT":-2.7e-6,"MEAN_MOTION_DDOT":0}]"#;

/// The first of them in JSON as from Space-Track: text values, more keywords, also the two lines.
const SPACE_TRACK_JSON: &str = r#"[{"CCSDS_OMM_VERS":"3.0","COMMENT":"GENERATED VIA SPACE-TRACK.ORG API","CREATION_DATE":"2026-07-12T06:00:00","ORIGINATOR":"18 SPCS","OBJECT_NAME":"MADE UP 1","OBJECT_ID":"2026-101A","CENTER_NAME":"EARTH","REF_FRAME":"TEME","TIME_SYSTEM":"UTC","MEAN_ELEMENT_THEORY":"SGP4","EPOCH":"2026-07-12T03:04:05.678912","MEAN_MOTION":"15.20000001","ECCENTRICITY":"0.00100010","INCLINATION":"97.5001","RA_OF_ASC_NODE":"120.0002","ARG_OF_PERICENTER":"90.0003","MEAN_ANOMALY":"270.0004","EPHEMERIS_TYPE":"0","CLASSIFICATION_TYPE":"U","NORAD_CAT_ID":"100001","ELEMENT_SET_NO":"999","REV_AT_EPOCH":"123","BSTAR":"0.00010001000000","MEAN_MOTION_DOT":"0.00001234","MEAN_MOTION_DDOT":"0.0000000000000","SEMIMAJOR_AXIS":"6881.000","PERIOD":"94.737","APOAPSIS":"509.747","PERIAPSIS":"495.984","OBJECT_TYPE":"PAYLOAD","RCS_SIZE":null,"COUNTRY_CODE":"ISS","LAUNCH_DATE":"2026-07-01","SITE":"TTMTR","DECAY_DATE":null,"FILE":"4800000","GP_ID":"290000000","TLE_LINE0":"0 MADE UP 1","TLE_LINE1":"1 A0001U","TLE_LINE2":"2 A0001"}]"#;

/// CSV as from CelesTrak.
const CELESTRAK_CSV: &str = "\
OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,EPHEMERIS_TYPE,CLASSIFICATION_TYPE,NORAD_CAT_ID,ELEMENT_SET_NO,REV_AT_EPOCH,BSTAR,MEAN_MOTION_DOT,MEAN_MOTION_DDOT\r
MADE UP 1,2026-101A,2026-07-12T03:04:05.678912,15.20000001,.0010001,97.5001,120.0002,90.0003,270.0004,0,U,100001,999,123,.10001E-3,.1234E-4,0\r
\"MADE UP \"\"2\"\"\",2026-101B,1999-12-31T23:59:59.999999,1.0027,.0002,.0500,80.0000,10.0000,20.0000,0,U,123456789,1,1,0,-.27E-5,0\r
";

/// The first of them in CSV as from Space-Track: every value in quotation marks.
const SPACE_TRACK_CSV: &str = "\
\"CCSDS_OMM_VERS\",\"COMMENT\",\"CREATION_DATE\",\"ORIGINATOR\",\"OBJECT_NAME\",\"OBJECT_ID\",\"CENTER_NAME\",\"REF_FRAME\",\"TIME_SYSTEM\",\"MEAN_ELEMENT_THEORY\",\"EPOCH\",\"MEAN_MOTION\",\"ECCENTRICITY\",\"INCLINATION\",\"RA_OF_ASC_NODE\",\"ARG_OF_PERICENTER\",\"MEAN_ANOMALY\",\"EPHEMERIS_TYPE\",\"CLASSIFICATION_TYPE\",\"NORAD_CAT_ID\",\"ELEMENT_SET_NO\",\"REV_AT_EPOCH\",\"BSTAR\",\"MEAN_MOTION_DOT\",\"MEAN_MOTION_DDOT\",\"SEMIMAJOR_AXIS\",\"DECAY_DATE\"
\"3.0\",\"GENERATED VIA SPACE-TRACK.ORG API, AS TEXT\",\"2026-07-12T06:00:00\",\"18 SPCS\",\"MADE UP 1\",\"2026-101A\",\"EARTH\",\"TEME\",\"UTC\",\"SGP4\",\"2026-07-12T03:04:05.678912\",\"15.20000001\",\"0.00100010\",\"97.5001\",\"120.0002\",\"90.0003\",\"270.0004\",\"0\",\"U\",\"100001\",\"999\",\"123\",\"0.00010001000000\",\"0.00001234\",\"0.0000000000000\",\"6881.000\",\"\"
";

const KVN: &str = "\
CCSDS_OMM_VERS      = 2.0
COMMENT GENERATED VIA SPACE-TRACK.ORG API
CREATION_DATE       = 2026-07-12T06:00:00
ORIGINATOR          = 18 SPCS

OBJECT_NAME         = MADE UP 1
OBJECT_ID           = 2026-101A
CENTER_NAME         = EARTH
REF_FRAME           = TEME
TIME_SYSTEM         = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH               = 2026-07-12T03:04:05.678912
MEAN_MOTION         = 15.20000001 [rev/day]
ECCENTRICITY        = 0.00100010
INCLINATION         = 97.5001 [deg]
RA_OF_ASC_NODE      = 120.0002 [deg]
ARG_OF_PERICENTER   = 90.0003 [deg]
MEAN_ANOMALY        = 270.0004 [deg]
EPHEMERIS_TYPE      = 0
CLASSIFICATION_TYPE = U
NORAD_CAT_ID        = 100001
ELEMENT_SET_NO      = 999
REV_AT_EPOCH        = 123
BSTAR               = 0.00010001 [1/ER]
MEAN_MOTION_DOT     = 0.00001234 [rev/day**2]
MEAN_MOTION_DDOT    = 0.0 [rev/day**3]
USER_DEFINED_TLE_LINE0 = 0 MADE UP 1

";

const XML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ndm xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="https://sanaregistry.org/r/ndmxml/ndmxml-1.0-master.xsd">
<!-- <omm>not this one</omm> -->
<omm id="CCSDS_OMM_VERS" version="2.0">
  <header><COMMENT>GENERATED</COMMENT><CREATION_DATE/><ORIGINATOR/></header>
  <body><segment>
    <metadata><OBJECT_NAME>MADE UP 1</OBJECT_NAME><OBJECT_ID>2026-101A</OBJECT_ID><CENTER_NAME>EARTH</CENTER_NAME><REF_FRAME>TEME</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM><MEAN_ELEMENT_THEORY>SGP4</MEAN_ELEMENT_THEORY></metadata>
    <data>
      <meanElements><EPOCH>2026-07-12T03:04:05.678912</EPOCH>
        <MEAN_MOTION units="rev/day">15.20000001</MEAN_MOTION>
        <ECCENTRICITY>.0010001</ECCENTRICITY><INCLINATION>97.5001</INCLINATION><RA_OF_ASC_NODE>120.0002</RA_OF_ASC_NODE><ARG_OF_PERICENTER>90.0003</ARG_OF_PERICENTER><MEAN_ANOMALY>270.0004</MEAN_ANOMALY></meanElements>
      <tleParameters><EPHEMERIS_TYPE>0</EPHEMERIS_TYPE><CLASSIFICATION_TYPE>U</CLASSIFICATION_TYPE><NORAD_CAT_ID>100001</NORAD_CAT_ID><ELEMENT_SET_NO>999</ELEMENT_SET_NO><REV_AT_EPOCH>123</REV_AT_EPOCH><BSTAR>.10001E-3</BSTAR><MEAN_MOTION_DOT>.1234E-4</MEAN_MOTION_DOT><MEAN_MOTION_DDOT>0</MEAN_MOTION_DDOT></tleParameters>
      <userDefinedParameters><USER_DEFINED parameter="MEAN_MOTION">9</USER_DEFINED></userDefinedParameters>
    </data>
  </segment></body>
</omm>
</ndm>
"#;

/// The first object as a TLE: Alpha-5, and fewer digits.
const TLE: &str = "\
1 A0001U 26101A   26193.12784351  .00001234  00000-0  10001-3 0  9990
2 A0001  97.5001 120.0002 0010001  90.0003 270.0004 15.20000001  1236
";

const ALL: [(&str, Format); 6] = [
    (CELESTRAK_JSON, Format::OmmJson),
    (SPACE_TRACK_JSON, Format::OmmJson),
    (CELESTRAK_CSV, Format::OmmCsv),
    (SPACE_TRACK_CSV, Format::OmmCsv),
    (KVN, Format::OmmKvn),
    (XML, Format::OmmXml),
];

fn read(text: &str) -> Contents {
    let contents = parse_contents(text, "test.omm").unwrap();
    assert_eq!(contents.rejected, [], "{text}");
    contents
}

fn rejections(text: &str) -> Vec<String> {
    let contents = parse_contents(text, "test.omm").unwrap();
    contents.rejected.iter().map(ToString::to_string).collect()
}

fn tle() -> Elements {
    let (line1, line2) = TLE.split_once('\n').unwrap();
    let [line1, line2] = [line1, line2].map(|line| sealed(&line[..68]));
    Elements::parse(&line1, &line2, Checksum::Required).unwrap()
}

#[test]
fn every_notation_gives_the_same_record() {
    let reference = tle();
    for (text, format) in ALL {
        let contents = read(text);
        assert_eq!(contents.format, format);
        let record = &contents.records[0];
        assert_eq!(
            (record.name.as_str(), record.designator.as_str()),
            ("MADE UP 1", "2026-101A")
        );
        assert_eq!(
            (record.element_set, record.revolution, record.classification),
            (999, 123, 'U')
        );
        assert_eq!(
            (record.mean_motion_dot, record.mean_motion_ddot),
            (1.234e-5, 0.0)
        );
        // All digits except the epoch's equal those of the TLE.
        let epoch = record.elements.epoch;
        assert_eq!(record.elements, Elements { epoch, ..reference }, "{format}");
        // X-Val: the TLE's epoch is rounded to 0.864 ms.
        assert!((epoch - reference.epoch).to_seconds().abs() < 0.44e-3);
    }
}

#[test]
fn numbers_of_nine_digits_and_epochs_before_2000_are_read() {
    for text in [CELESTRAK_JSON, CELESTRAK_CSV] {
        let loaded = parse(text, "test.omm").unwrap();
        let object = &loaded.objects[1];
        assert_eq!(object.label(), "NORAD 123456789 (MADE UP \"2\")");
        let Orbit::Elements(set, _) = &object.orbit else {
            panic!("an element set")
        };
        let written = hifitime::Epoch::from_gregorian_utc(1999, 12, 31, 23, 59, 59, 999_999_000);
        assert_eq!(set.epoch.to_tai_duration(), written.to_tai_duration());
        assert_eq!(loaded.find(Some("123456789")).unwrap().id, object.id);
    }
}

#[test]
fn all_forms_of_epochs_are_read() {
    const WRITTEN: &str = "2026-07-12T03:04:05.678912";
    let first = read(KVN).records[0].elements.epoch;
    for epoch in [
        "2026-07-12T03:04:05.678912Z",
        "2026-193T03:04:05.678912",
        "2026-07-12 03:04:05.678912",
    ] {
        let text = KVN.replace(WRITTEN, epoch);
        assert_eq!(read(&text).records[0].elements.epoch, first, "{epoch}");
    }
    let whole = KVN.replace("05.678912", "05");
    assert!((first - read(&whole).records[0].elements.epoch).to_seconds() > 0.678);
    for [wrong, why] in rows(
        "2026-07-12  03:04:05      |
         2026-13-12T03:04:05       | no month 13
         2026-06-31T03:04:05       | 2026-06 has days 1 to 30
         2026-07-12T24:04:05       | a day ends at 00:00:00 of the next
         2026-07-12T03:04:05+02:00 | offsets from UTC are not read
         26193.5                   |
         now                       |",
    ) {
        let found = rejections(&KVN.replace(WRITTEN, &wrong)).join("\n");
        let start = format!("test.omm:12: record 1: EPOCH '{wrong}' is no UTC time");
        let is_named = found.starts_with(&start) && found.contains(&why);
        assert!(is_named && found.lines().count() == 1, "{wrong}: {found}");
    }
}

#[test]
fn line_ends_byte_order_marks_and_comments_change_nothing() {
    for (text, format) in ALL {
        let clean = read(text).records;
        for ends in ["\n", "\r\n", "\r"] {
            let text = text.replace("\r\n", "\n").replace('\n', ends);
            let text = format!("\u{feff}{ends}# a remark{ends}{text}");
            let contents = read(&text);
            assert_eq!(contents.format, format);
            for (a, b) in contents.records.iter().zip(&clean) {
                assert_eq!(a.elements, b.elements);
                assert_eq!(a.line, b.line + 2, "{format}");
            }
        }
    }
}

/// A bad value is reported with its line, in every notation.
#[test]
fn a_bad_value_is_reported() {
    for [old, new, reason] in rows(
        "
        SGP4  | DSST    | MEAN_ELEMENT_THEORY 'DSST': only elements of SGP4 are used: fetch those
        SGP4  | DSST    | or an ephemeris as OEM (MADE UP 1, NORAD_CAT_ID 100001)
        SGP4  | SGP4-XP | MEAN_ELEMENT_THEORY 'SGP4-XP': elements of SGP4-XP
        TEME  | EME2000 | REF_FRAME 'EME2000'; only TEME is read
        UTC   | TAI     | TIME_SYSTEM 'TAI'; only UTC is read
        EARTH | MOON    | CENTER_NAME 'MOON'; only EARTH is read
        15.20000001 | 0          | SGP4 cannot start
        15.20000001 | -15.2      | MEAN_MOTION '-15.2' is not a number from 0 to 100
        15.20000001 | nan        | MEAN_MOTION 'nan' is not a number
        15.20000001 |            | the message has no MEAN_MOTION
        97.5001     | 180.1      | INCLINATION '180.1' is not a number from 0 to 180
        120.0002    | 12O        | RA_OF_ASC_NODE '12O' is not a number
        270.0004    | 1e999      | MEAN_ANOMALY '1e999' is not a number
        100001      | 1000000000 | NORAD_CAT_ID '1000000000' is not a whole number from 0 to 999999999
        100001      | -5         | NORAD_CAT_ID '-5' is not
        ",
    ) {
        for (text, format) in ALL {
            // JSON numbers cannot have these values, and missing metadata cannot be wrong.
            let bare = text == CELESTRAK_JSON || text == CELESTRAK_CSV;
            if !text.contains(&old) || (bare && !new.parse().is_ok_and(f64::is_finite)) {
                continue;
            }
            let found = rejections(&text.replacen(&old, &new, 1));
            assert!(found.len() == 1 && found[0].contains(&reason), "{format}: {reason}: {found:?}");
            let at = text.find(&old).unwrap();
            let line = text[..at].matches('\n').count() + 1;
            let is_of_message = new.is_empty() || new == "0";
            let has_line = found[0].starts_with(&format!("test.omm:{line}: "));
            assert!(has_line || is_of_message, "{found:?}, line {line}");
        }
    }
}

#[test]
fn required_keywords_must_be_present_in_kvn_and_xml() {
    for keyword in [
        "CENTER_NAME",
        "REF_FRAME",
        "TIME_SYSTEM",
        "MEAN_ELEMENT_THEORY",
        "BSTAR",
        "ECCENTRICITY",
    ] {
        let lines = KVN.split_inclusive('\n');
        let kvn: String = lines.filter(|line| !line.starts_with(keyword)).collect();
        let xml = XML.replace(&format!("{keyword}>"), "OTHER>");
        for (text, line) in [(kvn, 1), (xml, 4)] {
            let reason = format!("the message has no {keyword} (MADE UP 1, NORAD_CAT_ID 100001)");
            assert_eq!(
                rejections(&text),
                [format!("test.omm:{line}: record 1: {reason}")]
            );
        }
    }
    let axis = KVN.replace(
        "MEAN_MOTION         = 15.20000001 [rev/day]",
        "SEMI_MAJOR_AXIS = 6881",
    );
    for (text, reason) in [
        (
            format!("{KVN}REF_FRAME_EPOCH = 2000-01-01\n"),
            "SGP4 has TEME",
        ),
        (axis, "omm:13: record 1: SEMI_MAJOR_AXIS in place of"),
    ] {
        let found = rejections(&text);
        assert!(found[0].contains(reason), "{found:?}");
    }
}

#[test]
fn one_bad_record_does_not_affect_others() {
    // Adds a second record to a text with a damaged one.
    let second = |text: &str| {
        text.replace("100001", "100002")
            .replace("MADE UP 1", "MADE UP 3")
    };
    let kvn = |first: &str| first.to_owned() + &second(KVN);
    let xml = |first: &str| {
        let (_, whole) = XML.split_once("-->\n").unwrap();
        first.replace("</ndm>\n", &second(whole))
    };
    let json = |first: &str| {
        let whole = second(SPACE_TRACK_JSON);
        format!(
            "{},\n{}",
            first.trim_end_matches(']'),
            whole.trim_start_matches('[')
        )
    };
    let csv = |first: &str| first.to_owned() + &second(SPACE_TRACK_CSV.lines().nth(1).unwrap());
    for text in [
        kvn(&KVN.replace("EPOCH  ", "EPOCH? ")),
        kvn(&KVN.replace("ECCENTRICITY        =", "ECCENTRICITY")),
        // Cut off in the middle of the message.
        kvn(&KVN[..KVN.find("INCLINATION").unwrap()]),
        xml(&XML.replace("</BSTAR>", "")),
        xml(&XML.replace("</omm>\n</ndm>", "</ndm>")),
        xml(&XML.replace("97.5001", "&deg;")),
        xml(&XML.replace("<INCLINATION>", "<INCLINATION")),
        json(&SPACE_TRACK_JSON.replace("\"EPOCH\":", "\"EPOCH\"")),
        json(&SPACE_TRACK_JSON.replace("MADE UP 1\"", "MADE UP 1")),
        json(&SPACE_TRACK_JSON.replace("}]", "]")),
        json(&SPACE_TRACK_JSON.replace("\"EPOCH\":\"2026-07-12T03:04:05.678912\",", "")),
        csv(&SPACE_TRACK_CSV.replace("\"MADE UP 1\"", "\"MADE UP 1")),
        // A value less than the header has columns, and one more.
        csv(&SPACE_TRACK_CSV.replace(",\"\"\n", "\n")),
        csv(&SPACE_TRACK_CSV.replace("\"U\",", "\"U\",\"U\",")),
    ] {
        let contents = parse_contents(&text, "test.omm").unwrap();
        let numbers: Vec<_> = contents.records.iter().map(|r| r.elements.norad).collect();
        let rejected = contents.rejected;
        assert_eq!(
            (numbers, rejected.len()),
            (vec![100_002], 1),
            "{text}\n{rejected:?}"
        );
    }
}

#[test]
fn text_between_records_and_a_missing_end_are_reported() {
    let cut = CELESTRAK_JSON.trim_end_matches(']').to_owned();
    let headless = format!("{cut},\n{}", &SPACE_TRACK_JSON[2..]);
    for (text, reason) in [
        (cut, "test.omm:1: the array is not closed"),
        (headless, "test.omm:2: '\"CCSDS_OMM_VERS\":\"3.0\""),
        (format!("{CELESTRAK_JSON}\n<br>"), "2: '<br>' is outside"),
        (XML.replace("</ndm>", ""), "<ndm> without its </ndm>"),
    ] {
        let contents = parse_contents(&text, "test.omm").unwrap();
        assert!(!contents.records.is_empty());
        let found = rejections(&text);
        assert!(
            found.len() == 1 && found[0].contains(reason),
            "{reason}: {found:?}"
        );
    }
}

#[test]
fn json_objects_are_read_alone_in_arrays_and_in_lines() {
    let bare = SPACE_TRACK_JSON.trim_matches(['[', ']']);
    assert_eq!(read(bare).records.len(), 1);
    let records = read(&format!("{bare}\n{}\n", bare.replace("100001", "7"))).records;
    assert_eq!(
        (records.len(), records[1].line, records[1].elements.norad),
        (2, 2, 7)
    );
    let pretty = SPACE_TRACK_JSON
        .replace(",\"", ",\n\"")
        .replace("97.5001", "x");
    let line = pretty
        .lines()
        .take_while(|line| !line.contains("INCLINATION"))
        .count()
        + 1;
    let found = rejections(&pretty);
    let start = format!("test.omm:{line}: record 1: INCLINATION 'x'");
    assert!(found[0].starts_with(&start), "{found:?}");
}

#[test]
fn files_without_records_are_reported() {
    for (text, is_foreign, reason) in [
        ("[]", false, "omm-json, and no record in it"),
        ("NORAD_CAT_ID,EPOCH,MEAN_MOTION\n", false, "omm-csv, and"),
        ("<ndm></ndm>", true, "no orbit found"),
        ("<", true, "no orbit found"),
        ("<html><p></html>", true, "no orbit found"),
    ] {
        let error = parse_contents(text, "empty").unwrap_err();
        assert_eq!(error.is_foreign(), is_foreign, "{text}");
        assert!(error.to_string().contains(reason), "{text}: {error}");
    }
    for (text, reason) in [
        ("{", "not closed"),
        ("[", "not closed"),
        ("[{}]", "the message has no"),
        ("{\"a\":{\"b\":1}}", "not closed, or has others inside"),
        ("OBJECT_NAME,EPOCH\nA,B\n", "1: the header has no column"),
    ] {
        let found = rejections(text);
        assert!(found[0].contains(reason), "{text}: {found:?}");
    }
}

/// A text with some characters replaced, removed and repeated.
fn damaged(text: &'static str) -> impl Strategy<Value = String> {
    let change = (any::<prop::sample::Index>(), "[ -~é\n\r]{0,3}", 0usize..40);
    prop::collection::vec(change, 1..6).prop_map(move |changes| {
        let mut letters: Vec<char> = text.chars().collect();
        for (position, new, length) in changes {
            let start = position.index(letters.len());
            let end = (start + length).min(letters.len().max(start));
            letters.splice(start..end, new.chars());
            if letters.is_empty() {
                letters.push('x');
            }
        }
        letters.into_iter().collect()
    })
}

proptest! {
    #[test]
    fn no_damage_stops_a_reader_or_gives_invalid_numbers(
        text in (0..ALL.len()).prop_flat_map(|i| damaged(ALL[i].0)),
    ) {
        if let Ok(contents) = parse_contents(&text, "any") {
            let lines = text.matches(['\n', '\r']).count() + 1;
            for rejected in &contents.rejected {
                prop_assert!((1..=lines).contains(&rejected.line), "{rejected}");
            }
            for record in &contents.records {
                prop_assert!(record.elements.constants().is_ok());
                prop_assert!((1..=lines).contains(&record.line));
            }
        }
    }

    #[test]
    fn any_text_after_any_beginning_is_read_without_panic(
        head in prop::sample::select(vec!["<omm>", "[{", "{\"EPOCH\":", "CCSDS_OMM_VERS = 2.0\n", "EPOCH,MEAN_MOTION,NORAD_CAT_ID\n"]),
        text in "(?s).{0,300}",
    ) {
        let _ = parse_contents(&format!("{head}{text}"), "any");
    }
}
