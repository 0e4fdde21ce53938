//! Files with messages of several kinds; what is unsupported is refused or reported by name.

use crate::support::texts::{OMM, SET, oem, omm_json, omm_xml, rows, xml_elements, xml_state};
use hifitime::Unit;
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Contents, Format, aem, parse, parse_contents, unread_format};

/// A time span of some hours.
const SPAN: &str = "START_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T06:00:00\n";

/// States along x at 1 km/s, starting at a minute.
fn states(minute: u32) -> [String; 2] {
    [minute, minute + 10].map(|minute| {
        let x = 7000 + 60 * minute;
        format!("2019-06-15T00:{minute:02}:00 {x} 0 0 1 0 0")
    })
}

fn read(text: &str) -> Contents {
    parse_contents(text, "mixed").unwrap()
}

/// Parts of a text; counts of element sets and ephemerides; refusals: line and words.
const MIXED: &str = "
        oem omm                     | 1 | 1 |
        omm oem omm                 | 2 | 1 |
        set oem                     | 1 | 1 |
        A_NAME set oem omm          | 2 | 1 |
        oem set                     | 1 | 1 |
        oem 0_VANGUARD_1 set omm set | 3 | 1 |
        oem opm omm opm opm | 1 | 1 | 13: 3 messages, each a CCSDS OPM, a single state, which is not read
        opm omm             | 1 | 0 | 1: a CCSDS OPM, a single state, which is not read: export it as
        omm empty-oem       | 1 | 0 | 19: an OEM without a segment
        oem headless-omm    | 0 | 0 | 13: add that, or split the file here in 'OBJECT_NAME = MADE UP'
        torn-oem omm        | 1 | 0 | 12: not a number
        // Lines, KVN, JSON, XML and tables in sequence.
        set json            | 2 | 0 |
        set xml             | 2 | 0 |
        set json 0_V set xml oem | 4 | 1 |
        omm xml             | 2 | 0 |
        omm long-xml        | 2 | 0 |
        omm json            | 2 | 0 |
        omm array           | 2 | 0 |
        oem xml             | 1 | 1 |
        oem mark omm mark set mark oem | 2 | 2 |
        opm xml             | 1 | 0 | 1: a CCSDS OPM
        set ndm             | 2 | 0 | 4: a CCSDS OPM
        xml set             | 1 | 0 | 2: split the file at line 2
        xml <!--_c_--> omm  | 1 | 0 | 3: split the file at line 3
        xml oem xml         | 2 | 0 | 2: split the file at line 2
        xml json            | 1 | 0 | 2: split the file at line 2
        set xml garbage     | 2 | 0 | 4: behind a message in XML: remove it, or split the file at line 4
        xml <html> xml      | 2 | 0 | 2: '<html>
        json set            | 1 | 0 | 2: split the file at line 2
        set this_is_a_line,_and_no_name_of_a_satellite | 1 | 0 | 3: names no element set
        odd-ndm | 0 | 0 | 2: 2 messages, each a CCSDS OPM; 3: has no <metadata>; 5: a CCSDS AEM in XML, which
        ";

#[test]
fn messages_of_several_kinds_in_one_file_are_read_or_named() {
    let oem_text = oem(SPAN, &states(0));
    let omm = format!("CCSDS_OMM_VERS = 2.0\n{OMM}");
    let opm_xml = "<opm><body><segment></segment></body></opm>\n";
    let [xml, json] = [omm_xml(OMM), omm_json(OMM)].map(|text| text + "\n");
    let piece = |name: &str| match name {
        "set" => SET.to_owned(),
        "oem" => oem_text.clone(),
        "torn-oem" => oem_text.replace("7600 0", "7600 x"),
        "empty-oem" => "CCSDS_OEM_VERS = 2.0\n".to_owned(),
        "omm" => omm.clone(),
        "headless-omm" => OMM.to_owned(),
        "opm" => "CCSDS_OPM_VERS = 2.0\nOBJECT_NAME = P\n".to_owned(),
        "xml" => xml.clone(),
        "long-xml" => xml.replace('>', ">\n"),
        "ndm" => format!("<ndm>\n{}{opm_xml}</ndm>\n", xml.trim_end()),
        "odd-ndm" => format!(
            "<ndm>\n{opm_xml}<oem><body><segment></segment></body></oem>\n{opm_xml}<aem/>\n</ndm>"
        ),
        "json" => json.clone(),
        "array" => format!("[\n{json}]\n"),
        "mark" => "\u{feff}".to_owned(),
        text => text.replace('_', " ") + "\n",
    };
    for [pieces, sets, ephemerides, refused] in rows(MIXED) {
        let text: String = pieces.split_whitespace().map(piece).collect();
        let contents = read(&text);
        let counts = [contents.records.len(), contents.ephemerides.len()];
        assert_eq!(
            counts.map(|n| n.to_string()),
            [sets, ephemerides],
            "{pieces}: {contents:?}"
        );
        let wanted = refused.split("; ").filter_map(|one| one.split_once(": "));
        let wanted: Vec<(&str, &str)> = wanted.collect();
        let found = &contents.rejected;
        let is_named = found.len() == wanted.len()
            && found.iter().zip(&wanted).all(|(one, (line, words))| {
                one.line.to_string() == *line && one.reason.contains(words)
            });
        assert!(is_named, "{pieces}: {found:?}");
    }
    // Line numbers of remarks are those of the file.
    let meta = format!("{SPAN}INTERPOLATION = LINEAR\nINTERPOLATION_DEGREE = 5\n");
    let assumed = read(&(omm + &oem(&meta, &states(0)))).assumed;
    assert!(
        assumed.len() == 1 && assumed[0].starts_with("mixed:23: "),
        "{assumed:?}"
    );
}

#[test]
fn unsupported_formats_are_refused_by_name_with_the_remedy() {
    let rinex = "     2.10           N: GPS NAV DATA                         RINEX VERSION / TYPE";
    let http = format!("HTTP/1.1 200 OK\nServer: x\n\n{SET}");
    let stars = "*".repeat(80);
    // A text, its name, the remedy, and whether it is foreign to a folder of orbits.
    for [text, what, remedy, kind] in rows(
        r#"
        CCSDS_TDM_VERS = 2.0\n   | a CCSDS TDM          | a CCSDS OEM | foreign
        CCSDS_RDM_VERS = 1.0\n   | a CCSDS RDM          | a CCSDS OEM | foreign
        CCSDS_CDM_VERS = 1.0\n   | conjunction message  | a CCSDS OEM | orbits
        CCSDS_OPM_VERS = 2.0\n   | a CCSDS OPM          | a CCSDS OEM | orbits
        \nCOMMENT x\nCCSDS_AEM_VERS = 1.0\n | a CCSDS AEM | [sequence] attitude_file | foreign
        CCSDS_AEM_VERS = 1.0\nX = 1\nCCSDS_OPM_VERS = 2.0\n | a CCSDS AEM | ; a CCSDS OPM | orbits
        <?xml version="1.0"?>\n<aem id="CCSDS_AEM_VERS"> | a CCSDS AEM in XML | keyword = value | foreign
        <ndm><tdm></tdm></ndm>   | a CCSDS TDM          | a CCSDS OEM | foreign
        <ndm><ocm></ocm></ndm>   | a CCSDS OCM          | a CCSDS OEM | orbits
        <ndm><opm></opm><tdm></tdm></ndm> | a CCSDS OPM | ; a CCSDS TDM | orbits
        stk.v.12.0\n\n# WrittenBy\nBEGIN Ephemeris\n | an STK ephemeris (.e) | a CCSDS OEM | orbits
        stk.v.4.3\nBEGIN Attitude\n | an STK attitude file (.a) | a CCSDS AEM | foreign
        created:2026-04-25 20:06:49 UTC\n | Starlink's ephemeris text | REF_FRAME = EME2000 | orbits
        #cP2024  8 17  0  0  0.00000000   96 ORBIT IGS20 | an SP3 orbit file | REF_FRAME = ITRF | orbits
        STARS\n Ephemeris / WWW_USER\n$$SOE\n2460000.5\n | of JPL Horizons | TIME_SYSTEM = TDB | orbits
        RINEX\nEND OF HEADER\n   | a RINEX file         | TIME_SYSTEM = GPS | orbits
        {"status":"error"}       | the answer of a server | fetch the file again | orbits
        HTTP/1.1 404 Not Found\nX: y\n\nno\n | HTTP/1.1 404 Not Found | fetch the file again | orbits
        HTTP                     | with its HTTP header | first blank one | orbits
        <oem><body></body></oem> | an OEM without a segment | <segment> with <metadata> | orbits
        CCSDS_OEM_VERS = 2.0\n   | an OEM without a segment | META_START | orbits
        "#,
    ) {
        let text = match text.as_str() {
            "HTTP" => http.clone(),
            text => text.replace("RINEX", rinex).replace("STARS", &stars),
        };
        let error = parse_contents(&text, "odd").unwrap_err();
        let message = error.to_string();
        let is_named = message.starts_with("odd: ") && message.contains(&what);
        assert!(is_named && message.contains(&remedy), "{what}: {message}");
        assert_eq!(error.is_foreign(), kind == "foreign", "{what}");
    }
    for text in ["# a list\n2019-06-15T23:35:50 0 0 0 1", ""] {
        assert_eq!(unread_format(text), None);
    }
}

/// OEM in XML with two segments; the first has object 2019-001A, an acceleration and a covariance.
fn two_segments(change: impl Fn(&str) -> String) -> String {
    let meta = "OBJECT_NAME = A &amp; &#66;&lt;&gt;&apos;&quot;\nOBJECT_ID = 2019-001A\n\
                CENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\n\
                START_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T00:00:20\n\
                INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 3\n";
    let metadata = format!(
        "<segment><metadata>\n<COMMENT>UT1-UTC = 0.1</COMMENT>{}</metadata>\n<data>\n",
        xml_elements(meta)
    );
    let states = [0, 10, 20].map(|second| xml_state(second, 7000.0 + f64::from(second)));
    let states = states.concat().replacen(
        "<Z_DOT>0</Z_DOT>",
        "<Z_DOT>0</Z_DOT><X_DDOT>0.5</X_DDOT><Y_DDOT>0</Y_DDOT><Z_DDOT>0</Z_DDOT>",
        1,
    );
    let covariance = "<covarianceMatrix><EPOCH>x</EPOCH><CX_X>1</CX_X></covarianceMatrix>";
    let first = format!("{metadata}{states}{covariance}</data></segment>\n");
    let second = first.replace("2019-001A", "2019-002A");
    format!(
        "<oem id=\"CCSDS_OEM_VERS\" version=\"2.0\"><header/><body>\n{}{second}</body></oem>\n",
        change(&first)
    )
}

#[test]
fn oem_in_xml_are_read_alone_and_in_an_ndm() {
    let head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- <oem> -->\n";
    let two = two_segments(str::to_owned);
    let (first, second) = two.rsplit_once("<segment>").unwrap();
    let second = second.replace("2019-002A", "2019-001A");
    let second = second.replace("2019-06-15T00:00", "2019-06-15T00:01");
    let later = format!("{first}<segment>{second}");
    let others = two.replace("2019-00", "2020-00");
    let ndm = format!("<ndm>{two}{}{others}</ndm>", omm_xml(OMM));
    for (text, format, objects) in [
        (&two, Format::OemXml, 2),
        (&later, Format::OemXml, 1),
        (&ndm, Format::OmmXml, 4),
    ] {
        let contents = read(&(head.to_owned() + text));
        assert_eq!(contents.rejected, [], "{text}");
        assert_eq!(
            (contents.format, contents.ephemerides.len()),
            (format, objects)
        );
        assert_eq!(
            contents.records.len(),
            usize::from(format == Format::OmmXml)
        );
        let object = &contents.ephemerides[0];
        assert_eq!(
            (&*object.id, &*object.names[0]),
            ("2019-001A", "A & B<>'\"")
        );
        let state = |text: &str| object.state(parse_utc(text).unwrap());
        let at = state("2019-06-15T00:00:12.5").unwrap().position_m;
        assert!((at.x - 7_012_500.0).hypot(at.y).hypot(at.z) < 1e-6);
        assert_eq!(state("2019-06-15T00:01:05").is_ok(), objects == 1);
        assert!(state("2019-06-15T00:00:30").is_err(), "between segments");
    }
}

#[test]
fn damage_in_xml_is_reported_with_its_line_and_the_other_segments_load() {
    // A text in the first segment, its replacement, line and reason of the refusal.
    for [from, to, line, reason] in rows(
        r#"
        <CENTER_NAME>EARTH | <CENTER_NAME>MOON  | 3 | CENTER_NAME 'MOON'
        <OBJECT_ID>        | <OBJECT_ID>25544</OBJECT_ID><OBJECT_ID> | 3 | OBJECT_ID twice
        </metadata>        | </metadata><metadata></metadata> | 3 | a second <metadata>
        <X units="km">     | <X unit="m">       | 5 | <X> in 'm': the unit is km
        <X units="km">     | <X UNITS='m'>      | 5 | <X> in 'm': the unit is km
        units="km"         | units="&#x6d;"     | 5 | <X> in 'm': the unit is km
        X_DOT units="km/s" | X_DOT UNIT="m/s"   | 6 | <X_DOT> in 'm/s': the unit is km/s
        <Y>0</Y>           | <Y>0</Y>\n<Y>0</Y> | 6 | <Y> twice in a stateVector
        <EPOCH>            | <EPOCH>x</EPOCH><EPOCH> | 5 | <EPOCH> twice
        <Y>0</Y>           | <Y>zero</Y>        | 5 | not a number in <Y> 'zero'
        <Y>0</Y>           |                    | 5 | not 6 values
        <Y>0</Y>           | <Y>&nothing;</Y>   | 5 | unknown entity
        <Y>0</Y>           | <Y>0</Z>           | 5 | not XML
        </segment>         |                    | 2 | <segment> without its </segment>
        "#,
    ) {
        let text = two_segments(|first| first.replacen(&from, &to, 1));
        let contents = read(&text);
        let refused = &contents.rejected;
        let is_named = refused.len() == 1 && refused[0].reason.contains(&reason);
        assert!(is_named, "{from} {to}: {refused:?}");
        assert_eq!(refused[0].line.to_string(), line, "{refused:?}");
        let ids: Vec<&str> = contents.ephemerides.iter().map(|one| &*one.id).collect();
        assert_eq!(ids, ["2019-002A"], "{from} {to}");
    }
    let single = two_segments(|first| {
        let start = first.find("<stateVector>").unwrap();
        first[..start].to_owned() + &xml_state(0, 7000.0) + "</data></segment>"
    });
    for (text, line, reason) in [
        (&*single, 2, "a single state"),
        ("<oem>\n<segment></segment></oem>", 2, "no <metadata>"),
        ("<oem><body>\n</body>", 2, "cut off"),
    ] {
        let refused = read(text).rejected;
        let is_named = refused.len() == 1 && refused[0].reason.contains(reason);
        assert!(is_named && refused[0].line == line, "{reason}: {refused:?}");
    }
    for text in ["<oem><body>\n</body></oem>", "<oem/>"] {
        let error = parse(text, "t.xml").unwrap_err().to_string();
        assert!(error.contains("an OEM without a segment"), "{error}");
    }
}

#[test]
fn segments_that_overlap_are_reported_with_the_times() {
    // Start minutes of two segments of ten minutes each, and the minutes of the overlap.
    for (first, second, overlap) in [
        (0, 10, None),
        (0, 5, Some((5, 10))),
        (5, 0, Some((5, 10))),
        (0, 0, Some((0, 10))),
    ] {
        let utc = |minute: u32| format!("2019-06-15T00:{minute:02}:00");
        let message = |version: &str, meta: &str, data: &dyn Fn(u32) -> String| {
            let segments = [first, second].map(|minute| {
                format!(
                    "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2019-001A\nTIME_SYSTEM = UTC\n\
                     START_TIME = {}\nSTOP_TIME = {}\n{meta}META_STOP\n{}",
                    utc(minute),
                    utc(minute + 10),
                    data(minute)
                )
            });
            format!("{version} = 2.0\n{}", segments.concat())
        };
        let meta = "CENTER_NAME = EARTH\nREF_FRAME = GCRF\n";
        let oem = message("CCSDS_OEM_VERS", meta, &|minute| {
            states(minute).join("\n") + "\n"
        });
        let meta = "REF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\nATTITUDE_TYPE = QUATERNION\n";
        let aem = message("CCSDS_AEM_VERS", meta, &|minute| {
            let lines = [minute, minute + 10].map(|minute| utc(minute) + " 0 0 0 1\n");
            format!("DATA_START\n{}DATA_STOP\n", lines.concat())
        });
        let aem = aem::parse(&aem).unwrap().remarks.into_iter();
        let aem: Vec<String> = aem.map(|(_, remark)| remark).collect();
        for remarks in [read(&oem).assumed, aem] {
            let wanted = overlap
                .map(|(from, to)| format!("overlap from {}.000Z to {}.000Z", utc(from), utc(to)));
            assert_eq!(
                remarks.len(),
                wanted.iter().len(),
                "{first} {second}: {remarks:?}"
            );
            let is_reported = |wanted: String| {
                remarks[0].contains(&wanted) && remarks[0].contains("USEABLE_START_TIME")
            };
            assert!(
                wanted.is_none_or(is_reported),
                "{first} {second}: {remarks:?}"
            );
        }
    }
}

/// A circular orbit of 7,000 km with states at uneven times, rounded to 1 m.
#[test]
fn a_degree_that_does_not_converge_is_lowered_with_a_warning() {
    let rate = (398_600.441_8_f64 / 7000.0_f64.powi(3)).sqrt();
    let position = |second: f64| {
        let (sin, cos) = (rate * second).sin_cos();
        [7000.0 * cos, 7000.0 * sin]
    };
    let even = |k: u32| f64::from(k) * 60.0;
    // Five states within 5 s, then a gap of 20 minutes, repeated.
    let uneven = |k: u32| f64::from(k / 5) * 1200.0 + f64::from(k % 5);
    let times: [&dyn Fn(u32) -> f64; 2] = [&even, &uneven];
    // Errors over a step h: cubic Hermite h^4/384 of the fourth derivative, 51 km; linear h^2/8 of
    // the acceleration, 1460 km.
    for (time, name, degrees, is_lowered, max_km) in [
        (times[0], "HERMITE", &[7, 9, 15][..], false, 0.01),
        (times[0], "LAGRANGE", &[9], false, 0.01),
        (times[1], "HERMITE", &[3], false, 60.0),
        (times[1], "HERMITE", &[7, 9, 11, 13, 15], true, 60.0),
        (times[1], "LAGRANGE", &[15], true, 1600.0),
    ] {
        let start = parse_utc("2019-06-15T00:00:00").unwrap();
        let states = (0..30).map(|k| {
            let [x, y] = position(time(k));
            let (vx, vy, whole) = (-rate * y, rate * x, time(k) as u32);
            let (hour, minute, second) = (whole / 3600, whole / 60 % 60, whole % 60);
            format!(
                "2019-06-15T{hour:02}:{minute:02}:{second:02} {x:.3} {y:.3} 0 {vx:.6} {vy:.6} 0"
            )
        });
        let states: Vec<String> = states.collect();
        for degree in degrees {
            let meta = format!("{SPAN}INTERPOLATION = {name}\nINTERPOLATION_DEGREE = {degree}\n");
            let loaded = parse(&oem(&meta, &states), "t.oem").unwrap();
            assert_eq!(loaded.rejected, []);
            let is_warned = loaded.assumed.concat().contains("does not converge");
            assert_eq!(is_warned, is_lowered, "{name} {degree}");
            for k in 0..29 {
                let middle = f64::midpoint(time(k), time(k + 1));
                let state = loaded.objects[0].state(start + middle * Unit::Second);
                let (found, [x, y]) = (state.unwrap().position_m / 1e3, position(middle));
                let off_km = (found.x - x).hypot(found.y - y);
                assert!(off_km < max_km, "{name} {degree}: {off_km} km");
            }
        }
    }
}
