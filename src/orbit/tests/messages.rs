//! CCSDS messages beside the OEM in keyword = value notation: OEM in XML, AEM, and formats that are refused by name.

use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Format, aem, frames, parse, parse_contents, unread_format};

const SEGMENT: &str = "<segment><metadata>\n<COMMENT>UT1-UTC = 0.1</COMMENT><OBJECT_NAME>A &amp; &#66;&lt;&gt;&apos;&quot;</OBJECT_NAME>\n<OBJECT_ID>2019-001A</OBJECT_ID>\
<CENTER_NAME>EARTH</CENTER_NAME><REF_FRAME>GCRF</REF_FRAME>\n<TIME_SYSTEM>UTC</TIME_SYSTEM><START_TIME>2019-06-15T00:00:00</START_TIME>\
<STOP_TIME>2019-06-15T00:00:20</STOP_TIME>\n<INTERPOLATION>HERMITE</INTERPOLATION><INTERPOLATION_DEGREE>3</INTERPOLATION_DEGREE></metadata>\n<data>\n";

fn vector(second: u32, x: f64) -> String {
    format!(
        "<stateVector><EPOCH>2019-06-15T00:00:{second:02}</EPOCH><X units=\"km\">{x}</X><Y>0</Y><Z>0</Z>\n<X_DOT units=\"km/s\">1</X_DOT>\
         <Y_DOT>0</Y_DOT><Z_DOT>0</Z_DOT><X_DDOT>0.5</X_DDOT><Y_DDOT>0</Y_DDOT><Z_DDOT>0</Z_DDOT></stateVector>\n"
    )
}

const COVARIANCE: &str =
    "<covarianceMatrix><EPOCH>2019-06-15T00:00:00</EPOCH><CX_X>1</CX_X></covarianceMatrix>";

/// A segment along x at 1 km/s from `x`.
fn segment(x: f64) -> String {
    let states = vector(0, x) + &vector(10, x + 10.0) + &vector(20, x + 20.0);
    format!("{SEGMENT}{states}{COVARIANCE}</data></segment>\n")
}

fn oem(body: &str) -> String {
    format!("<oem id=\"CCSDS_OEM_VERS\" version=\"2.0\"><header/><body>\n{body}</body></oem>\n")
}

const OMM: &str = "<omm><body><segment><metadata><OBJECT_NAME>C</OBJECT_NAME><OBJECT_ID>2020-001A</OBJECT_ID><CENTER_NAME>EARTH</CENTER_NAME>\
<REF_FRAME>TEME</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM><MEAN_ELEMENT_THEORY>SGP4</MEAN_ELEMENT_THEORY></metadata><data><meanElements>\
<EPOCH>2020-01-01T00:00:00</EPOCH><MEAN_MOTION>15</MEAN_MOTION><ECCENTRICITY>0.001</ECCENTRICITY><INCLINATION>51</INCLINATION>\
<RA_OF_ASC_NODE>0</RA_OF_ASC_NODE><ARG_OF_PERICENTER>0</ARG_OF_PERICENTER><MEAN_ANOMALY>0</MEAN_ANOMALY></meanElements><tleParameters>\
<NORAD_CAT_ID>40000</NORAD_CAT_ID><BSTAR>0</BSTAR><MEAN_MOTION_DOT>0</MEAN_MOTION_DOT><MEAN_MOTION_DDOT>0</MEAN_MOTION_DDOT></tleParameters>\
</data></segment></body></omm>\n";

#[test]
fn oem_in_xml_are_read_alone_and_in_an_ndm() {
    let head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- <oem> -->\n";
    let other = segment(9000.0).replace("2019-001A", "2019-002A");
    let later = segment(8000.0).replace("2019-06-15T00:00", "2019-06-15T00:01");
    for (text, format, objects) in [
        (oem(&segment(7000.0)), Format::OemXml, 1),
        (oem(&(segment(7000.0) + &later)), Format::OemXml, 1),
        (
            format!("<ndm>{}{}</ndm>", oem(&segment(7000.0)), oem(&other)),
            Format::OemXml,
            2,
        ),
        (
            format!("<ndm>{}{OMM}{}</ndm>", oem(&segment(7000.0)), oem(&other)),
            Format::OmmXml,
            2,
        ),
    ] {
        let contents = parse_contents(&(head.to_owned() + &text), "t.xml").unwrap();
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
            (object.id.as_str(), object.names[0].as_str()),
            ("2019-001A", "A & B<>'\"")
        );
        let state = |text: &str| object.state(parse_utc(text).unwrap());
        let at = state("2019-06-15T00:00:12.5").unwrap();
        assert!((at.position_m - Vector3::new(7_012_500.0, 0.0, 0.0)).norm() < 1e-6);
        assert_eq!(
            state("2019-06-15T00:01:05").is_ok(),
            text.contains("00:01:")
        );
        assert!(state("2019-06-15T00:00:30").is_err(), "between segments");
    }
}

#[test]
fn damage_in_xml_is_named_and_the_other_segments_load() {
    let whole = segment(9000.0).replace("2019-001A", "2019-002A");
    let of = |from: &str, to: &str| oem(&(segment(7000.0).replacen(from, to, 1) + &whole));
    for (text, line, reason, loaded) in [
        (
            of("<CENTER_NAME>EARTH", "<CENTER_NAME>MOON"),
            4,
            "CENTER_NAME 'MOON'",
            1,
        ),
        (
            of("<X units=\"km\">", "<X units=\"m\">"),
            8,
            "<X> in 'm': the unit is km",
            1,
        ),
        (
            of("<Y>0</Y>", "<Y>zero</Y>"),
            8,
            "not a number in <Y> 'zero'",
            1,
        ),
        (of("<Y>0</Y>", ""), 8, "not 6 values", 1),
        (of("<Y>0</Y>", "<Y>&nothing;</Y>"), 8, "unknown entity", 1),
        (
            of("units=\"km\"", "units=\"&#x6d;\""),
            8,
            "<X> in 'm': the unit is km",
            1,
        ),
        (of("<Y>0</Y>", "<Y>0</Z>"), 8, "not XML", 1),
        (
            of("</segment>", ""),
            2,
            "<segment> without its </segment>",
            1,
        ),
        (
            oem(&(SEGMENT.to_owned() + &vector(0, 7000.0) + "</data></segment>" + &whole)),
            2,
            "a single state",
            1,
        ),
        (
            oem("<segment><data></data></segment>"),
            2,
            "no <metadata>",
            0,
        ),
        (oem("").replace("</oem>", ""), 2, "cut off", 0),
    ] {
        let read = parse(&text, "t.xml").unwrap();
        let shown: Vec<String> = read.rejected.iter().map(ToString::to_string).collect();
        let is_named =
            shown[0].starts_with(&format!("t.xml:{line}: ")) && shown[0].contains(reason);
        assert!(is_named && shown.len() == 1, "{reason}: {shown:?}\n{text}");
        assert_eq!(read.objects.len(), loaded, "{reason}");
    }
    for text in [oem(""), "<oem/>".to_owned()] {
        let error = parse(&text, "t.xml").unwrap_err().to_string();
        assert!(error.contains("an OEM without a segment"), "{error}");
    }
}

#[test]
fn formats_that_are_not_read_are_refused_by_name_with_the_remedy() {
    for (text, what, remedy) in [
        (
            "stk.v.12.0\n\n# WrittenBy\nBEGIN Ephemeris\n",
            "an STK ephemeris (.e)",
            "a CCSDS OEM",
        ),
        (
            "stk.v.4.3\nBEGIN Attitude\n",
            "an STK attitude file (.a)",
            "a CCSDS AEM",
        ),
        (
            "created:2026-04-25 20:06:49 UTC\nephemeris_start:2026-04-25 19:38:42 UTC\n",
            "Starlink's ephemeris text",
            "REF_FRAME = EME2000",
        ),
        (
            "#cP2024  8 17  0  0  0.00000000      96 ORBIT IGS20 HLM  IGS\n",
            "an SP3 orbit file",
            "REF_FRAME = ITRF",
        ),
        ("CCSDS_OPM_VERS = 2.0\n", "a CCSDS OPM", "a CCSDS OEM"),
        (
            "\nCOMMENT x\nCCSDS_AEM_VERS = 1.0\n",
            "a CCSDS AEM",
            "[sequence] attitude_file",
        ),
        (
            "<?xml version=\"1.0\"?>\n<aem id=\"CCSDS_AEM_VERS\">",
            "a CCSDS AEM in XML",
            "keyword = value",
        ),
        ("<ndm><ocm></ocm></ndm>", "a CCSDS OCM", "a CCSDS OEM"),
    ] {
        let error = parse(text, "odd").unwrap_err();
        let shown = error.to_string();
        assert!(
            shown.starts_with("odd: ") && shown.contains(what) && shown.contains(remedy),
            "{shown}"
        );
        let holds_attitudes = what.contains("AEM") || what.contains("attitude");
        assert_eq!(
            error.is_foreign(),
            holds_attitudes,
            "in a folder orbits are named"
        );
    }
    assert_eq!(unread_format("# a list\n2019-06-15T23:35:50 0 0 0 1"), None);
    assert_eq!(unread_format(""), None);
}

/// A message with one segment and two equal attitudes.
fn attitudes(version: &str, meta: &str, numbers: &str) -> String {
    format!(
        "CCSDS_AEM_VERS = {version}\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\nMETA_START\nOBJECT_NAME = A\nOBJECT_ID = 2019-001A\n\
         {meta}TIME_SYSTEM = TAI\nSTART_TIME = 2019-06-15T00:00:37\nSTOP_TIME = 2019-06-15T00:01:37\nMETA_STOP\nDATA_START\n\
         2019-06-15T00:00:37 {numbers}\n2019-166T00:01:37.000 {numbers}\nDATA_STOP\n"
    )
}

const A_TO_B: &str = "REF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\n";
const B_TO_A: &str = "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = ICRF\n";
const QUATERNION: &str = "ATTITUDE_TYPE = QUATERNION\n";

fn matrix(attitude: &aem::TimedAttitude) -> Matrix3<f64> {
    let [x, y, z, w] = attitude.q_icrf_to_body;
    let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    q.to_rotation_matrix().into_inner()
}

/// The frame transformation matrix of 504.0-B-2, annex F2.1, written down from there.
fn annex_f2([q1, q2, q3, qc]: [f64; 4]) -> Matrix3<f64> {
    let square = |x: f64| x * x;
    Matrix3::new(
        square(q1) - square(q2) - square(q3) + square(qc),
        2.0 * (q1 * q2 + q3 * qc),
        2.0 * (q1 * q3 - q2 * qc),
        2.0 * (q1 * q2 - q3 * qc),
        -square(q1) + square(q2) - square(q3) + square(qc),
        2.0 * (q2 * q3 + q1 * qc),
        2.0 * (q1 * q3 + q2 * qc),
        2.0 * (q2 * q3 - q1 * qc),
        -square(q1) - square(q2) + square(q3) + square(qc),
    )
}

#[test]
fn the_standards_own_example_has_the_standards_sense() {
    // X-Val: 504.0-B-2, annex F2.2: body X along ICRF Y; the coordinates [1, 0, 0] become [0, -1, 0]
    let text = attitudes(
        "2.0",
        &format!("{A_TO_B}{QUATERNION}"),
        "0 0 0.70710678 0.70710678",
    );
    let message = aem::parse(&text).unwrap();
    let m = matrix(&message.segments[0].attitudes[0]);
    assert!(
        (m * Vector3::x() - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-8,
        "{m}"
    );
    assert!((m * Vector3::y() - Vector3::x()).norm() < 1e-8, "{m}");
}

#[test]
fn direction_and_order_are_those_of_the_file() {
    // No two components are alike, so that each wrong sense and order is another attitude.
    let q = [0.1, -0.3, 0.5, 0.806_225_774_829_855];
    let (last, first) = (
        "0.1 -0.3 0.5 0.806225774829855",
        "0.806225774829855 0.1 -0.3 0.5",
    );
    // X-Val: scipy 1.17.1, Rotation.from_quat([0.1, -0.3, 0.5, 0.806225774829855]).as_matrix().T
    let scipy = Matrix3::from_row_slice(&[
        0.32,
        0.746_225_774_829_855,
        0.583_735_464_897_913,
        -0.866_225_774_829_855,
        0.48,
        -0.138_754_845_034_029,
        -0.383_735_464_897_913,
        -0.461_245_154_965_971,
        0.8,
    ]);
    let to_body = annex_f2(q);
    assert!((to_body - scipy).norm() < 1e-12, "{to_body}");
    let turned = to_body.transpose();
    for (version, frames, keywords, numbers, expected) in [
        (
            "1.0",
            A_TO_B,
            "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST\n",
            last,
            to_body,
        ),
        (
            "1.0",
            A_TO_B,
            "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = FIRST\n",
            first,
            to_body,
        ),
        (
            "1.0",
            A_TO_B,
            "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = LAST\n",
            last,
            turned,
        ),
        (
            "1.0",
            A_TO_B,
            "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = FIRST\n",
            first,
            turned,
        ),
        (
            "1.0",
            B_TO_A,
            "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST\n",
            last,
            turned,
        ),
        (
            "1.0",
            B_TO_A,
            "ATTITUDE_DIR = b2a\nQUATERNION_TYPE = first\n",
            first,
            to_body,
        ),
        ("2.0", A_TO_B, "", last, to_body),
        ("2.0", B_TO_A, "", last, turned),
        (
            "2.0",
            A_TO_B,
            "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST\n",
            last,
            to_body,
        ),
    ] {
        let text = attitudes(version, &format!("{frames}{keywords}{QUATERNION}"), numbers);
        let message = aem::parse(&text).unwrap();
        let [segment] = &message.segments[..] else {
            panic!("{text}")
        };
        assert!(message.remarks.is_empty());
        assert_eq!(segment.attitudes[0].epoch, utc(0), "TAI is UTC + 37 s");
        assert_eq!((segment.start, segment.stop), (utc(0), utc(60)));
        let error = (matrix(&segment.attitudes[1]) - expected).norm();
        assert!(error < 1e-12, "{version} {frames}{keywords}: {error}");
    }
    // In axes that are not those of ICRF.
    let meta = format!("REF_FRAME_A = TEME\nREF_FRAME_B = SC_BODY\n{QUATERNION}");
    let message = aem::parse(&attitudes("2.0", &meta, last)).unwrap();
    let from_icrf = frames::teme_to_gcrf(utc(0)).transpose();
    let error = (matrix(&message.segments[0].attitudes[0]) - to_body * from_icrf).norm();
    assert!(error < 1e-12, "{error}");
    assert!(
        Rotation3::from_matrix_unchecked(from_icrf).angle() > 1e-3,
        "the axes differ"
    );
}

fn utc(second: i64) -> Epoch {
    parse_utc("2019-06-15T00:00:00").unwrap() + second * Unit::Second
}

#[test]
fn what_an_attitude_file_has_and_is_not_used_is_remarked() {
    for (meta, numbers, remark) in [
        (
            "ATTITUDE_TYPE = QUATERNION/ANGVEL\nANGVEL_FRAME = SC_BODY_1\n",
            "0 0 0 1 0.1 0.2 0.3",
            "rates of the slerp",
        ),
        (
            "ATTITUDE_TYPE = QUATERNION/DERIVATIVE\n",
            "0 0 0 1 0 0 0 0",
            "rates of the slerp",
        ),
        (
            "ATTITUDE_TYPE = QUATERNION\nINTERPOLATION_METHOD = LAGRANGE\n",
            "0 0 0 1",
            "slerped between neighbours instead",
        ),
    ] {
        let message = aem::parse(&attitudes("2.0", &format!("{A_TO_B}{meta}"), numbers)).unwrap();
        let said = &message.remarks[0].1;
        assert!(
            message.remarks.len() == 1 && said.contains(remark),
            "{said}"
        );
    }
}

#[test]
fn attitude_files_that_cannot_be_flown_say_why() {
    let v2 = |meta: &str, numbers: &str| attitudes("2.0", meta, numbers);
    let v1 = |meta: &str, numbers: &str| attitudes("1.0", meta, numbers);
    let plain = |numbers: &str| v2(&format!("{A_TO_B}{QUATERNION}"), numbers);
    for (text, line, reason) in [
        (
            v2(&format!("{A_TO_B}ATTITUDE_TYPE = SPIN\n"), "0 0 0 1"),
            9,
            "ATTITUDE_TYPE 'SPIN'; read are QUATERNION",
        ),
        (
            v1(&format!("{A_TO_B}ATTITUDE_TYPE = EULER_ANGLE\n"), "0 0 0"),
            9,
            "export the attitudes as QUATERNION",
        ),
        (
            v2(
                &format!("{A_TO_B}ATTITUDE_DIR = B2A\n{QUATERNION}"),
                "0 0 0 1",
            ),
            4,
            "if the keyword is right, write CCSDS_AEM_VERS = 1.0",
        ),
        (
            v2(
                &format!("{A_TO_B}QUATERNION_TYPE = FIRST\n{QUATERNION}"),
                "1 0 0 0",
            ),
            4,
            "the scalar last",
        ),
        (
            attitudes("1.0", &format!("{A_TO_B}{QUATERNION}"), "0 0 0 1"),
            4,
            "no ATTITUDE_DIR, which version 1.0 needs",
        ),
        (
            attitudes(
                "1.0",
                &format!("{A_TO_B}ATTITUDE_DIR = A2B\n{QUATERNION}"),
                "0 0 0 1",
            ),
            4,
            "no QUATERNION_TYPE",
        ),
        (
            attitudes("3.0", "", ""),
            1,
            "CCSDS_AEM_VERS '3.0'; read are 1.0, 2.0: ",
        ),
        (
            v2(
                &format!("REF_FRAME_A = LVLH\nREF_FRAME_B = SC_BODY_1\n{QUATERNION}"),
                "0 0 0 1",
            ),
            7,
            "REF_FRAME_A 'LVLH'; read are GCRF",
        ),
        (
            v2(
                &format!("REF_FRAME_A = ICRF\nREF_FRAME_B = STARTRACKER_1\n{QUATERNION}"),
                "0 0 0 1",
            ),
            8,
            "not of an instrument",
        ),
        (plain("0 0 0"), 15, "no quaternion"),
        (plain("0 0 0 1 2"), 15, "5 values, not 4"),
        (plain("0 0 0 nan"), 15, "not a number"),
        (
            plain("0 0 0 1").replace("2019-166T00:01:37.000", "2019-06-15T00:00:37"),
            16,
            "not after the one before",
        ),
        (
            plain("0 0 0 1").replace("2019-166T00:01:37.000 0 0 0 1\n", ""),
            16,
            "1 attitudes in a segment",
        ),
        (
            plain("0 0 0 1").replace("META_START", "META_BEGIN"),
            4,
            "outside of every segment",
        ),
        ("CCSDS_AEM_VERS = 2.0\n".to_owned(), 1, "no attitudes"),
        (
            "CCSDS_AEM_VERS = 2.0\nMETA_START\n".to_owned(),
            2,
            "META_START without META_STOP",
        ),
    ] {
        let (at, why) = aem::parse(&text).unwrap_err();
        assert!(
            at == line && why.contains(reason),
            "{at}: {why} for {line}: {reason}"
        );
    }
}

proptest::proptest! {
    #[test]
    fn any_message_is_read_without_panic(text in "(?s)(<oem>|<ndm><oem>|<segment>|</segment>|<metadata>|<stateVector>|<X>|</X>|<|>|[ -~é]{0,9}){0,20}") {
        let _ = parse(&format!("<oem>{text}</oem>"), "any");
        let _ = aem::parse(&format!("CCSDS_AEM_VERS = 2.0\nMETA_START\n{text}"));
    }

    #[test]
    fn any_lines_behind_the_first_are_read_without_panic(
        lines in proptest::collection::vec("META_START|META_STOP|COVARIANCE_START|COVARIANCE_STOP|[ -~é]{0,40}", 0..12)
    ) {
        let _ = parse(&format!("CCSDS_OEM_VERS = 2.0\n{}", lines.join("\n")), "any");
    }
}
