//! CCSDS AEM in keyword = value notation, and any text as a message.

use crate::support::texts::rows;
use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{aem, frames, parse};

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

/// The frame transformation matrix of 504.0-B-2, annex F2.1.
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
fn the_standards_example_has_the_standards_direction() {
    // X-Val: 504.0-B-2, annex F2.2: body X along ICRF Y: [1, 0, 0] becomes [0, -1, 0].
    let meta = format!("{A_TO_B}{QUATERNION}");
    let message = aem::parse(&attitudes("2.0", &meta, "0 0 0.70710678 0.70710678")).unwrap();
    let m = matrix(&message.segments[0].attitudes[0]);
    assert!((m * Vector3::x() + Vector3::y()).norm() < 1e-8, "{m}");
    assert!((m * Vector3::y() - Vector3::x()).norm() < 1e-8, "{m}");
}

/// Version, REF_FRAME_A, direction, order of components, and direction of the quaternion.
const DIRECTIONS: &str = "
        1.0 | ICRF      | A2B | LAST  | to body
        1.0 | ICRF      | A2B | FIRST | to body
        1.0 | ICRF      | B2A | LAST  | from body
        1.0 | ICRF      | B2A | FIRST | from body
        1.0 | SC_BODY_1 | A2B | LAST  | from body
        1.0 | SC_BODY_1 | b2a | first | to body
        2.0 | ICRF      |     |       | to body
        2.0 | SC_BODY_1 |     |       | from body
        2.0 | ICRF      | A2B | LAST  | to body
        ";

#[test]
fn direction_and_order_are_those_of_the_file() {
    // Four different components distinguish each wrong direction and order.
    let q = [0.1, -0.3, 0.5, 0.806_225_774_829_855];
    // X-Val: scipy 1.17.1, Rotation.from_quat([0.1, -0.3, 0.5, 0.806225774829855]).as_matrix().T.
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
    let last = "0.1 -0.3 0.5 0.806225774829855";
    for [version, a, direction, order, expected] in rows(DIRECTIONS) {
        let frames = if a == "ICRF" { A_TO_B } else { B_TO_A };
        let keywords = match &*direction {
            "" => String::new(),
            _ => format!("ATTITUDE_DIR = {direction}\nQUATERNION_TYPE = {order}\n"),
        };
        let numbers = match &*order.to_uppercase() {
            "FIRST" => "0.806225774829855 0.1 -0.3 0.5",
            _ => last,
        };
        let text = attitudes(
            &version,
            &format!("{frames}{keywords}{QUATERNION}"),
            numbers,
        );
        let message = aem::parse(&text).unwrap();
        assert!(
            message.remarks.is_empty() && message.segments.len() == 1,
            "{text}"
        );
        let segment = &message.segments[0];
        assert_eq!(segment.attitudes[0].epoch, utc(0), "TAI is UTC + 37 s");
        assert_eq!((segment.start, segment.stop), (utc(0), utc(60)));
        let expected = match &*expected {
            "to body" => to_body,
            _ => to_body.transpose(),
        };
        let error = (matrix(&segment.attitudes[1]) - expected).norm();
        assert!(error < 1e-12, "{version} {frames}{keywords}: {error}");
    }
    // A frame with axes other than ICRF.
    let meta = format!("REF_FRAME_A = TEME\nREF_FRAME_B = SC_BODY\n{QUATERNION}");
    let message = aem::parse(&attitudes("2.0", &meta, last)).unwrap();
    let from_icrf = frames::teme_to_gcrf(utc(0)).transpose();
    let error = (matrix(&message.segments[0].attitudes[0]) - to_body * from_icrf).norm();
    assert!(error < 1e-12, "{error}");
    let angle = Rotation3::from_matrix_unchecked(from_icrf).angle();
    assert!(angle > 1e-3, "the axes differ");
}

fn utc(second: i64) -> Epoch {
    parse_utc("2019-06-15T00:00:00").unwrap() + second * Unit::Second
}

#[test]
fn unused_attitude_data_are_remarked() {
    for [meta, numbers, remark] in rows(
        r"
        QUATERNION/ANGVEL\nANGVEL_FRAME = SC_BODY_1 | 0 0 0 1 0.1 0.2 0.3 | rates of the slerp
        QUATERNION/DERIVATIVE                       | 0 0 0 1 0 0 0 0     | rates of the slerp
        QUATERNION\nINTERPOLATION_METHOD = LAGRANGE | 0 0 0 1 | slerped between neighbours instead
        ",
    ) {
        let meta = format!("{A_TO_B}ATTITUDE_TYPE = {meta}\n");
        let remarks = aem::parse(&attitudes("2.0", &meta, &numbers))
            .unwrap()
            .remarks;
        assert!(
            remarks.len() == 1 && remarks[0].1.contains(&remark),
            "{meta}: {remarks:?}"
        );
    }
}

#[test]
fn unsupported_attitude_files_are_refused_with_a_reason() {
    // Version, both frames, type, further metadata, numbers; line and reason of the refusal.
    for [version, frames, kind, more, numbers, line, reason] in rows(
        r"
        2.0 | ICRF SC_BODY_1 | SPIN        |  | 0 0 0 1   | 9  | 'SPIN'; expected QUATERNION
        1.0 | ICRF SC_BODY_1 | EULER_ANGLE |  | 0 0 0     | 9  | export the attitudes as QUATERNION
        2.0 | ICRF SC_BODY_1 | QUATERNION | ATTITUDE_DIR = B2A\n    | 0 0 0 1 | 4 | CCSDS_AEM_VERS = 1.0
        2.0 | ICRF SC_BODY_1 | QUATERNION | QUATERNION_TYPE = FIRST\n | 1 0 0 0 | 4 | the scalar last
        1.0 | ICRF SC_BODY_1 | QUATERNION |   | 0 0 0 1   | 4  | no ATTITUDE_DIR, which version 1.0
        1.0 | ICRF SC_BODY_1 | QUATERNION | ATTITUDE_DIR = A2B\n    | 0 0 0 1 | 4 | no QUATERNION_TYPE
        3.0 | ICRF SC_BODY_1 | QUATERNION |   | 0 0 0 1   | 1  | '3.0'; expected 1.0, 2.0:
        2.0 | LVLH SC_BODY_1 | QUATERNION |   | 0 0 0 1   | 7  | REF_FRAME_A 'LVLH'; expected GCRF
        2.0 | ICRF STARTRACKER_1 | QUATERNION | | 0 0 0 1 | 8  | not of an instrument
        2.0 | ICRF SC_BODY_1 | QUATERNION |   | 0 0 0     | 15 | no quaternion
        2.0 | ICRF SC_BODY_1 | QUATERNION |   | 0 0 0 1 2 | 15 | 5 values, not 4
        2.0 | ICRF SC_BODY_1 | QUATERNION |   | 0 0 0 nan | 15 | not a number
        ",
    ) {
        let (a, b) = frames.split_once(' ').unwrap();
        let meta = format!("REF_FRAME_A = {a}\nREF_FRAME_B = {b}\nATTITUDE_TYPE = {kind}\n{more}");
        let (at, why) = aem::parse(&attitudes(&version, &meta, &numbers)).unwrap_err();
        assert!(
            at.to_string() == line && why.contains(&reason),
            "{reason}: {at}: {why}"
        );
    }
    let plain = attitudes("2.0", &format!("{A_TO_B}{QUATERNION}"), "0 0 0 1");
    for (text, line, reason) in [
        (
            plain.replace("166T00:01:37", "166T00:00:37"),
            16,
            "not after the one before",
        ),
        (
            plain.replace("2019-166T00:01:37.000 0 0 0 1\n", ""),
            16,
            "1 attitudes in a segment",
        ),
        (
            plain.replace("META_START", "META_BEGIN"),
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
    fn any_lines_after_the_first_are_read_without_panic(
        lines in proptest::collection::vec("META_START|META_STOP|COVARIANCE_START|COVARIANCE_STOP|[ -~é]{0,40}", 0..12)
    ) {
        let _ = parse(&format!("CCSDS_OEM_VERS = 2.0\n{}", lines.join("\n")), "any");
    }
}
