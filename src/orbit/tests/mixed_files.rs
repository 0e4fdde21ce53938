//! Files with messages of several kinds, and what of them is refused or reported by name.

use hifitime::Unit;
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Contents, aem, parse, parse_contents};

/// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005.
const SET: &str = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
                   2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
const OMM: &str = "CCSDS_OMM_VERS = 2.0\nOBJECT_NAME = M\nOBJECT_ID = 2020-001A\nCENTER_NAME = EARTH\nREF_FRAME = TEME\nTIME_SYSTEM = UTC\n\
                   MEAN_ELEMENT_THEORY = SGP4\nEPOCH = 2020-01-01T00:00:00\nMEAN_MOTION = 15\nECCENTRICITY = 0.001\nINCLINATION = 51\n\
                   RA_OF_ASC_NODE = 0\nARG_OF_PERICENTER = 0\nMEAN_ANOMALY = 0\nNORAD_CAT_ID = 40000\nBSTAR = 0\n";
const OPM: &str = "CCSDS_OPM_VERS = 2.0\nOBJECT_NAME = P\n";

fn oem(meta: &str, states: &[&str]) -> String {
    format!(
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = E\nOBJECT_ID = 2019-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\n\
         START_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T06:00:00\n{meta}META_STOP\n{}\n",
        states.join("\n")
    )
}

/// Along x at 1 km/s, from a minute on.
fn states(minute: u32) -> [String; 2] {
    let x = 7000 + 60 * minute;
    [
        format!("2019-06-15T00:{minute:02}:00 {x} 0 0 1 0 0"),
        format!("2019-06-15T00:{:02}:00 {} 0 0 1 0 0", minute + 10, x + 600),
    ]
}

fn plain(minute: u32) -> String {
    let states = states(minute);
    oem("", &[&states[0], &states[1]])
}

fn read(text: &str) -> Contents {
    parse_contents(text, "mixed").unwrap()
}

#[test]
fn messages_of_several_kinds_in_one_file_are_all_read_or_named() {
    let e = plain(0);
    let opm = "<opm><body><segment></segment></body></opm>\n";
    let xml = "<oem><body><segment></segment></body></oem>\n";
    let pairs = OMM.lines().filter_map(|line| line.split_once(" = "));
    let json = pairs
        .clone()
        .map(|(key, value)| format!("\"{key}\":\"{value}\""));
    let json = format!("{{{}}}", json.collect::<Vec<_>>().join(","));
    let omm_xml = pairs.map(|(key, value)| format!("<{key}>{value}</{key}>"));
    let omm_xml = format!("<omm>{}</omm>", omm_xml.collect::<String>());
    // Element sets, ephemerides, and what is refused: its line and words.
    for (texts, sets, ephemerides, refused) in [
        (vec![&*e, OMM], 1, 1, vec![]),
        (vec![OMM, &e, OMM], 2, 1, vec![]),
        (vec![SET, &e], 1, 1, vec![]),
        (vec!["A NAME\n", SET, "\n", &e, OMM], 2, 1, vec![]),
        (vec![&e, SET], 1, 1, vec![]),
        (vec![&e, "0 VANGUARD 1\n", SET, OMM, SET], 3, 1, vec![]),
        (
            vec![&e, OPM, OMM, OPM, OPM],
            1,
            1,
            vec![(
                13,
                "3 messages, each a CCSDS OPM, a single state, which is not read: export it as a CCSDS OEM",
            )],
        ),
        (
            vec![OPM, OMM],
            1,
            0,
            vec![(1, "a CCSDS OPM, a single state, which is not read")],
        ),
        (
            vec![OMM, "CCSDS_OEM_VERS = 2.0\n"],
            1,
            0,
            vec![(17, "an OEM without a segment")],
        ),
        (
            vec![&e, OMM.split_once('\n').unwrap().1],
            0,
            0,
            vec![(13, "add that, or split the file here in 'OBJECT_NAME = M'")],
        ),
        (
            vec![&e.replace("7600 0", "7600 x"), OMM],
            1,
            0,
            vec![(12, "not a number")],
        ),
        // Lines, KVN, JSON, XML and tables one behind the other.
        (vec![SET, &json, "\n"], 2, 0, vec![]),
        (vec![SET, &omm_xml, "\n"], 2, 0, vec![]),
        (
            vec![SET, &json, "\n", "0 V\n", SET, &omm_xml, "\n", &e],
            4,
            1,
            vec![],
        ),
        (vec![OMM, &omm_xml, "\n"], 2, 0, vec![]),
        (vec![OMM, &omm_xml.replace('>', ">\n")], 2, 0, vec![]),
        (vec![OMM, &json, "\n"], 2, 0, vec![]),
        (vec![OMM, "[\n", &json, "\n]\n"], 2, 0, vec![]),
        (vec![&e, &omm_xml, "\n"], 1, 1, vec![]),
        (
            vec![&e, "\u{feff}", OMM, "\u{feff}", SET, "\u{feff}", &e],
            2,
            2,
            vec![],
        ),
        (vec![OPM, &omm_xml, "\n"], 1, 0, vec![(1, "a CCSDS OPM")]),
        (
            vec![SET, "<ndm>\n", &omm_xml, opm, "</ndm>\n"],
            2,
            0,
            vec![(4, "a CCSDS OPM")],
        ),
        (
            vec![&omm_xml, "\n", SET],
            1,
            0,
            vec![(2, "split the file at line 2")],
        ),
        (
            vec![&omm_xml, "\n<!-- c -->\n", OMM],
            1,
            0,
            vec![(3, "split the file at line 3")],
        ),
        (
            vec![&omm_xml, "\n", &e, &omm_xml],
            2,
            0,
            vec![(2, "split the file at line 2")],
        ),
        (
            vec![&omm_xml, "\n", &json],
            1,
            0,
            vec![(2, "split the file at line 2")],
        ),
        (
            vec![SET, &omm_xml, "\ngarbage"],
            2,
            0,
            vec![(
                4,
                "'garbage' behind a message in XML: remove it, or split the file at line 4",
            )],
        ),
        (
            vec![&omm_xml, "\n<html>\n", &omm_xml],
            2,
            0,
            vec![(2, "'<html>")],
        ),
        (
            vec![&json, "\n", SET],
            1,
            0,
            vec![(2, "split the file at line 2")],
        ),
        (
            vec![SET, "this is a line, and no name of a satellite\n"],
            1,
            0,
            vec![(3, "names no element set")],
        ),
        (
            vec!["<ndm>\n", opm, xml, opm, "<aem/>\n</ndm>"],
            0,
            0,
            vec![
                (2, "2 messages, each a CCSDS OPM"),
                (3, "the segment has no <metadata>"),
                (5, "a CCSDS AEM in XML, which is not read"),
            ],
        ),
    ] {
        let text = texts.concat();
        let contents = read(&text);
        let counts = (contents.records.len(), contents.ephemerides.len());
        assert_eq!(counts, (sets, ephemerides), "{text}{:?}", contents.rejected);
        let found: Vec<_> = contents
            .rejected
            .iter()
            .map(|one| (one.line, &*one.reason))
            .collect();
        assert_eq!(found.len(), refused.len(), "{found:?}");
        for ((line, reason), (wanted, words)) in found.iter().zip(&refused) {
            assert!(line == wanted && reason.contains(words), "{line}: {reason}");
        }
    }
    // Lines are those of the file, in remarks too.
    let states = states(0);
    let linear = oem(
        "INTERPOLATION = LINEAR\nINTERPOLATION_DEGREE = 5\n",
        &[&states[0], &states[1]],
    );
    let assumed = read(&format!("{OMM}{linear}")).assumed;
    assert!(
        assumed.len() == 1 && assumed[0].starts_with("mixed:26: "),
        "{assumed:?}"
    );
}

#[test]
fn files_that_hold_no_orbit_that_is_read_are_named_with_the_remedy() {
    let rinex = format!(
        "     2.10           N: GPS NAV DATA                         RINEX VERSION / TYPE\n{:60}END OF HEADER\n\
                         1 99  9  2 17 51 44.0-.839701388031D-03-.165982783074D-10 .000000000000D+00\n",
        ""
    );
    let horizons = format!(
        "{}\n Ephemeris / WWW_USER\n$$SOE\n2460000.5, A.D. 2023\n$$EOE\n",
        "*".repeat(80)
    );
    for (text, words) in [
        ("CCSDS_TDM_VERS = 2.0\n", ["a CCSDS TDM", "a CCSDS OEM"]),
        ("CCSDS_RDM_VERS = 1.0\n", ["a CCSDS RDM", "a CCSDS OEM"]),
        (
            "CCSDS_CDM_VERS = 1.0\n",
            ["conjunction message", "a CCSDS OEM"],
        ),
        ("<ndm><tdm></tdm></ndm>", ["a CCSDS TDM", "a CCSDS OEM"]),
        (
            &*horizons,
            ["an answer of JPL Horizons", "TIME_SYSTEM = TDB"],
        ),
        (&rinex, ["a RINEX file", "TIME_SYSTEM = GPS"]),
        (
            "CCSDS_AEM_VERS = 1.0\nX = 1\nCCSDS_OPM_VERS = 2.0\n",
            ["a CCSDS AEM", "; a CCSDS OPM"],
        ),
        (
            "<ndm><opm></opm><tdm></tdm></ndm>",
            ["a CCSDS OPM", "; a CCSDS TDM"],
        ),
        (
            r#"{"status":"error"}"#,
            ["the answer of a server", "fetch the file again"],
        ),
        (
            "HTTP/1.1 404 Not Found\nX: y\n\nno\n",
            ["HTTP/1.1 404 Not Found", "fetch the file again"],
        ),
        (
            &format!("HTTP/1.1 200 OK\nServer: x\n\n{SET}"),
            ["with its HTTP header", "first blank one"],
        ),
        (
            "<oem><body></body></oem>",
            ["an OEM without a segment", "<segment> with <metadata>"],
        ),
        (
            "CCSDS_OEM_VERS = 2.0\n",
            ["an OEM without a segment", "META_START"],
        ),
    ] {
        let error = parse_contents(text, "odd").unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
}

#[test]
fn an_element_twice_or_in_another_unit_is_refused_with_its_line() {
    let state = |second: u32| {
        format!(
            "<stateVector><EPOCH>2019-06-15T00:00:{second:02}</EPOCH><X units=\"km\">{}</X><Y>0</Y><Z>0</Z>\n<X_DOT>1</X_DOT><Y_DOT>0</Y_DOT>\
             <Z_DOT>0</Z_DOT></stateVector>\n",
            7000 + second
        )
    };
    let metadata = "<metadata><OBJECT_NAME>A</OBJECT_NAME><OBJECT_ID>2019-001A</OBJECT_ID><CENTER_NAME>EARTH</CENTER_NAME>\
                    <REF_FRAME>GCRF</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM><START_TIME>2019-06-15T00:00:00</START_TIME>\
                    <STOP_TIME>2019-06-15T00:00:20</STOP_TIME></metadata>\n";
    let oem = format!(
        "<oem><body><segment>{metadata}<data>{}{}</data></segment></body></oem>",
        state(0),
        state(10)
    );
    assert_eq!(
        (read(&oem).ephemerides.len(), read(&oem).rejected.len()),
        (1, 0)
    );
    for (from, to, line, reason) in [
        (
            "<Y>0</Y>",
            "<Y>0</Y>\n<Y>0</Y>",
            3,
            "<Y> twice in a stateVector",
        ),
        ("<EPOCH>", "<EPOCH>x</EPOCH><EPOCH>", 2, "<EPOCH> twice"),
        (
            "<X units=\"km\">",
            "<X unit=\"m\">",
            2,
            "<X> in 'm': the unit is km",
        ),
        (
            "<X units=\"km\">",
            "<X UNITS='m'>",
            2,
            "<X> in 'm': the unit is km",
        ),
        (
            "<X_DOT>",
            "<X_DOT UNIT=\"m/s\">",
            3,
            "<X_DOT> in 'm/s': the unit is km/s",
        ),
        (
            "</metadata>",
            "</metadata><metadata></metadata>",
            1,
            "a second <metadata>",
        ),
        (
            "<OBJECT_ID>",
            "<OBJECT_ID>25544</OBJECT_ID><OBJECT_ID>",
            1,
            "OBJECT_ID twice",
        ),
    ] {
        let contents = read(&oem.replacen(from, to, 1));
        let refused = &contents.rejected;
        let is_named =
            refused.len() == 1 && refused[0].line == line && refused[0].reason.contains(reason);
        assert!(
            is_named && contents.ephemerides.is_empty(),
            "{reason}: {refused:?}"
        );
    }
    let omm = OMM
        .lines()
        .filter_map(|line| line.split_once(" = "))
        .map(|(key, value)| format!("<{key}>{value}</{key}>"));
    let omm = format!("<omm>{}</omm>", omm.collect::<String>());
    assert_eq!(read(&omm).records.len(), 1);
    for unit in ["unit=\"m\"", "UNITS=\"m\""] {
        let contents = read(&omm.replace("<MEAN_MOTION>", &format!("<MEAN_MOTION {unit}>")));
        assert!(
            contents.rejected[0].reason.contains("MEAN_MOTION in 'm'"),
            "{:?}",
            contents.rejected
        );
    }
}

#[test]
fn segments_that_overlap_are_reported_with_the_times() {
    // The first minutes of two segments of ten minutes each.
    for (first, second, times) in [
        (0, 10, None),
        (
            0,
            5,
            Some("from 2019-06-15T00:05:00.000Z to 2019-06-15T00:10:00.000Z"),
        ),
        (
            5,
            0,
            Some("from 2019-06-15T00:05:00.000Z to 2019-06-15T00:10:00.000Z"),
        ),
        (
            0,
            0,
            Some("from 2019-06-15T00:00:00.000Z to 2019-06-15T00:10:00.000Z"),
        ),
    ] {
        let message = |version: &str, meta: &str, data: &dyn Fn(u32) -> String| {
            let segment = |minute: u32| {
                format!(
                    "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2019-001A\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:{minute:02}:00\n\
                     STOP_TIME = 2019-06-15T00:{:02}:00\n{meta}META_STOP\n{}",
                    minute + 10,
                    data(minute)
                )
            };
            format!("{version} = 2.0\n{}{}", segment(first), segment(second))
        };
        let oem = message(
            "CCSDS_OEM_VERS",
            "CENTER_NAME = EARTH\nREF_FRAME = GCRF\n",
            &|minute| states(minute).join("\n") + "\n",
        );
        let meta = "REF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\nATTITUDE_TYPE = QUATERNION\n";
        let aem = message("CCSDS_AEM_VERS", meta, &|minute| {
            let line = |minute: u32| format!("2019-06-15T00:{minute:02}:00 0 0 0 1\n");
            format!(
                "DATA_START\n{}{}DATA_STOP\n",
                line(minute),
                line(minute + 10)
            )
        });
        let aem: Vec<String> = aem::parse(&aem)
            .unwrap()
            .remarks
            .into_iter()
            .map(|(_, remark)| remark)
            .collect();
        for remarks in [&read(&oem).assumed, &aem] {
            let is_reported = |times: &str| {
                remarks.len() == 1
                    && remarks[0].contains("overlap")
                    && remarks[0].contains(times)
                    && remarks[0].contains("USEABLE_START_TIME")
            };
            assert!(
                times.map_or(remarks.is_empty(), is_reported),
                "{first} {second}: {remarks:?}"
            );
        }
    }
}

/// On a circular orbit of 7,000 km, states at uneven times, rounded to 1 m as files have them.
#[test]
fn a_degree_that_does_not_converge_is_lowered_with_a_warning() {
    let rate = (398_600.441_8_f64 / 7000.0_f64.powi(3)).sqrt();
    let at = |second: f64| {
        let (sin, cos) = (rate * second).sin_cos();
        (
            [7000.0 * cos, 7000.0 * sin],
            [-7000.0 * rate * sin, 7000.0 * rate * cos],
        )
    };
    let even = |k: u32| f64::from(k) * 60.0;
    // Five states within 5 s, then a gap of 20 minutes, and again.
    let uneven = |k: u32| f64::from(k / 5) * 1200.0 + f64::from(k % 5);
    let times: [&dyn Fn(u32) -> f64; 2] = [&even, &uneven];
    for (time, name, degree, is_lowered) in [
        (times[0], "HERMITE", 7, false),
        (times[0], "HERMITE", 9, false),
        (times[0], "HERMITE", 15, false),
        (times[0], "LAGRANGE", 9, false),
        (times[1], "HERMITE", 3, false),
        (times[1], "HERMITE", 7, true),
        (times[1], "HERMITE", 9, true),
        (times[1], "HERMITE", 11, true),
        (times[1], "HERMITE", 13, true),
        (times[1], "HERMITE", 15, true),
        (times[1], "LAGRANGE", 15, true),
    ] {
        let lines: Vec<String> = (0..30)
            .map(|k| {
                let second = time(k);
                let ([x, y], [vx, vy]) = at(second);
                let whole = second as u32;
                format!(
                    "2019-06-15T{:02}:{:02}:{:02} {x:.3} {y:.3} 0 {vx:.6} {vy:.6} 0",
                    whole / 3600,
                    whole / 60 % 60,
                    whole % 60
                )
            })
            .collect();
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let meta = format!("INTERPOLATION = {name}\nINTERPOLATION_DEGREE = {degree}\n");
        let loaded = parse(&oem(&meta, &lines), "t.oem").unwrap();
        assert_eq!(loaded.rejected, []);
        let is_warned = loaded
            .assumed
            .iter()
            .any(|line| line.contains("does not converge"));
        let start = parse_utc("2019-06-15T00:00:00").unwrap();
        let mut worst_km: f64 = 0.0;
        for k in 0..29 {
            let middle = f64::midpoint(time(k), time(k + 1));
            let state = loaded.objects[0]
                .state(start + middle * Unit::Second)
                .unwrap();
            let ([x, y], _) = at(middle);
            worst_km =
                worst_km.max((state.position_m.x / 1e3 - x).hypot(state.position_m.y / 1e3 - y));
        }
        assert_eq!(is_warned, is_lowered, "{name} {degree}: {worst_km} km");
        // Over a step h: cubic Hermite h^4/384 of the fourth derivative, 51 km; a line h^2/8 of the acceleration, 1460 km.
        let most_km = match (name, time(5) > 600.0) {
            (_, false) => 0.01,
            ("HERMITE", true) => 60.0,
            _ => 1600.0,
        };
        assert!(worst_km < most_km, "{name} {degree}: {worst_km} km");
    }
}
