//! TEME to GCRF against independent libraries; frames and versions of messages.

use crate::support::texts::{OMM, oem, omm_json, omm_xml, rows, xml_elements, xml_state};
use hifitime::{Epoch, TimeScale, Unit};
use nalgebra::Vector3;
use skyloop_orbit::frames::{eme2000_to_gcrf, teme_to_gcrf};
use skyloop_orbit::{aem, parse};

fn numbers(words: &mut dyn Iterator<Item = &str>) -> Vec<f64> {
    words.map(|word| word.parse().unwrap()).collect()
}

fn vector(numbers: &[f64]) -> Vector3<f64> {
    Vector3::from_column_slice(numbers)
}

#[test]
fn teme_to_gcrf_is_within_a_metre_out_to_geostationary() {
    // X-Val: data/teme_to_gcrf.txt, by skyfield (1960 to 2060) and astropy (1975 to 2026).
    let j2000 = Epoch::from_gregorian(2000, 1, 1, 12, 0, 0, 0, TimeScale::TT);
    let (mut skyfield, mut astropy) = (Vec::new(), Vec::new());
    for line in include_str!("data/teme_to_gcrf.txt").lines() {
        if line.starts_with('#') {
            continue;
        }
        let (source, rest) = line.split_once(' ').unwrap();
        let row = numbers(&mut rest.split_whitespace());
        let t = j2000 + row[0] * Unit::Day;
        let error = (teme_to_gcrf(t) * vector(&row[1..4]) - vector(&row[4..7])).norm();
        match source {
            "skyfield" => skyfield.push(error),
            _ => astropy.push(error),
        }
    }
    assert_eq!((skyfield.len(), astropy.len()), (41 * 4, 12 * 4));
    for (source, errors) in [("skyfield", skyfield), ("astropy", astropy)] {
        let worst = errors.iter().fold(0.0_f64, |a, b| a.max(*b));
        println!("TEME to GCRF against {source}: at most {worst:.4} m");
        assert!(worst <= 1.0, "{source}: {worst} m");
    }
}

#[test]
fn rotations_are_orthogonal() {
    let t = Epoch::from_gregorian_utc(2019, 6, 15, 23, 35, 50, 0);
    for rotation in [teme_to_gcrf(t), eme2000_to_gcrf()] {
        let residual = (rotation * rotation.transpose() - nalgebra::Matrix3::identity()).norm();
        assert!(residual < 1e-14, "{residual}");
        assert!((rotation.determinant() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn element_sets_in_gcrf_agree_with_an_independent_library() {
    // X-Val: data/elements_to_gcrf.txt, by skyfield and its SGP4.
    let text = include_str!("data/elements_to_gcrf.txt");
    let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    let (mut worst_m, mut worst_m_s) = (0.0_f64, 0.0_f64);
    for record in lines.chunks(3) {
        let loaded = parse(&record[..2].join("\n"), "reference").unwrap();
        assert!(loaded.rejected.is_empty(), "{:?}", loaded.rejected);
        let mut words = record[2].split_whitespace();
        let t: Epoch = words.next().unwrap().parse().unwrap();
        let row = numbers(&mut words);
        let state = loaded.objects[0].state(t).unwrap();
        let dr = (state.position_m - vector(&row[..3])).norm();
        let dv = (state.velocity_m_s - vector(&row[3..])).norm();
        println!("{}: {dr:.4} m, {dv:.2e} m/s", loaded.objects[0].id);
        worst_m = worst_m.max(dr);
        worst_m_s = worst_m_s.max(dv);
    }
    assert_eq!(lines.len(), 8 * 3);
    assert!(
        worst_m <= 1.0 && worst_m_s <= 1e-3,
        "{worst_m} m, {worst_m_s} m/s"
    );
}

const STATES: [&str; 2] = [
    "2019-06-15T00:00:00 7000 0 0 1 0 0",
    "2019-06-15T00:00:10 7010 0 0 1 0 0",
];

/// The segment of [`STATES`] in XML.
fn oem_in_xml(attributes: &str, meta: &str) -> String {
    let kvn = oem(meta, &STATES);
    let (metadata, _) = kvn.split_once("META_STOP").unwrap();
    let (_, metadata) = metadata.split_once("META_START\n").unwrap();
    let (metadata, states) = (
        xml_elements(metadata),
        [xml_state(0, 7000.0), xml_state(10, 7010.0)],
    );
    let data = states.concat();
    format!(
        "<oem{attributes}><body><segment><metadata>{metadata}</metadata><data>{data}</data>\
         </segment></body></oem>"
    )
}

fn aem_with(version: &str, meta: &str) -> String {
    format!(
        "CCSDS_AEM_VERS = {version}\nMETA_START\nOBJECT_NAME = A\nOBJECT_ID = A\n\
         REF_FRAME_B = SC_BODY_1\nATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST\nTIME_SYSTEM = UTC\n\
         START_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T00:00:10\n\
         ATTITUDE_TYPE = QUATERNION\n{meta}META_STOP\nDATA_START\n\
         2019-06-15T00:00:00 0 0 0 1\n2019-06-15T00:00:10 0 0 0 1\nDATA_STOP\n"
    )
}

/// The reason of a refused message of orbits or attitudes.
fn refusal(text: &str) -> Option<String> {
    if aem::is_message(text) {
        return aem::parse(text).err().map(|(_, reason)| reason);
    }
    let loaded = parse(text, "f").unwrap();
    assert_eq!(
        loaded.objects.is_empty(),
        loaded.rejected.len() == 1,
        "{text}"
    );
    loaded.rejected.first().map(|one| one.reason.clone())
}

#[test]
fn axes_of_a_fixed_epoch_are_refused_where_they_differ() {
    // CCSDS 502.0-B-3, Table 5-3: an epoch only for frames without their own.
    for (frame, is_refused) in [
        ("TOD", true),
        ("MOD", true),
        ("TEME", true),
        ("GCRF", false),
        ("ICRF", false),
        ("EME2000", false),
        ("J2000", false),
        ("ITRF2014", false),
    ] {
        let epoch = "REF_FRAME_EPOCH = 2000-01-01T12:00:00\n";
        let meta = format!("REF_FRAME = {frame}\n{epoch}");
        let aem = aem_with("1.0", &format!("REF_FRAME_A = {frame}\n{epoch}"));
        for text in [oem(&meta, &STATES), oem_in_xml("", &meta), aem] {
            let reason = refusal(&text);
            assert_eq!(reason.is_some(), is_refused, "{frame}: {reason:?}");
            let is_named = |reason: &String| {
                reason.contains("REF_FRAME_EPOCH '2000-01-01T12:00:00' with REF_FRAME")
                    && reason.contains("give the data in GCRF")
            };
            assert!(reason.as_ref().is_none_or(is_named), "{reason:?}");
        }
    }
}

/// Unpublished versions are refused by name, in each notation.
#[test]
fn versions_are_those_of_the_standards() {
    let omm = format!("CCSDS_OMM_VERS = @\n{OMM}");
    let pairs = omm.lines().filter_map(|line| line.split_once(" = "));
    let (keys, values): (Vec<&str>, Vec<&str>) = pairs
        .map(|(key, value)| (key, value.split(" [").next().unwrap()))
        .unzip();
    let csv = format!("{}\n{}\n", keys.join(","), values.join(","));
    let xml = omm_xml(OMM).replacen("<omm", "<omm id=\"CCSDS_OMM_VERS\" version=\"@\"", 1);
    let json = omm_json(&omm);
    let kvn = oem("", &STATES).replacen("2.0", "@", 1);
    let oem_xml = oem_in_xml(" id=\"CCSDS_OEM_VERS\" version=\"@\"", "");
    let aem = aem_with("@", "REF_FRAME_A = GCRF\n");
    // X-Val: CCSDS 502.0-B-1 (OEM 1.0), B-2 (OEM and OMM 2.0), B-3 (3.0); 504.0-B-1 (AEM 1.0),
    // B-2 (2.0).
    let published: [(&str, &[&str], &[&str]); 3] = [
        ("OEM", &["1.0", "2.0", "3.0"], &[&kvn, &oem_xml]),
        ("OMM", &["2.0", "3.0"], &[&omm, &xml, &json, &csv]),
        ("AEM", &["1.0", "2.0"], &[&aem]),
    ];
    let versions = "0.9,1,1.0,1.1,2,2.0,2.00,2.0 COMMENT,2.1,2.5,3.0,3.0x,4.0,x";
    for (kind, published, messages) in published {
        for version in versions.split(',') {
            // Some writers omit zeros.
            let is_published = match version {
                "1" => published.contains(&"1.0"),
                "2" | "2.00" => published.contains(&"2.0"),
                version => published.contains(&version),
            };
            let known = published.join(", ");
            let says = format!("CCSDS_{kind}_VERS '{version}'; expected {known}:");
            for message in messages {
                let text = message.replacen('@', version, 1);
                match refusal(&text) {
                    None => assert!(is_published, "{text}"),
                    Some(reason) => {
                        assert!(!is_published && reason.contains(&says), "{text}: {reason}");
                    }
                }
            }
        }
    }
    assert!(refusal(&kvn.replacen('@', "", 1)).is_some());
}

#[test]
fn versions_are_read_from_any_valid_xml_attributes() {
    // XML 1.0 (W3C, fifth edition), section 3.1: attributes in any order, after blanks, tabs or
    // line breaks, in quotes of both kinds. Sections 2.4, 4.1 and 4.6: `>` in values, character
    // references, and the predefined entities.
    for [attributes, reason] in rows(
        r#"
        id='CCSDS_OEM_VERS' version='9.0'     | _VERS '9.0'; expected
        id="a version"\n version = "9.0"      | _VERS '9.0'; expected
        version="2.0"\nid="version='9.0'"     | no <metadata>
        ndm:version='9.0' version='2.0'       | no <metadata>
        id='a>b' version='9.0'                | _VERS '9.0'; expected
        version='&#50;&#x2e;0'                | no <metadata>
        version='&#57;.0'                     | _VERS '9.0'; expected
        version='&lt;&gt;&amp;&apos;&quot;'   | _VERS '<>&'"'; expected
        version='&two;.0'                     | _VERS '&two;.0'; expected
        "#,
    ) {
        let attributes = attributes.replace("\n ", "\n\t");
        let text = format!("<oem {attributes}><body><segment></segment></body></oem>");
        let found = refusal(&text).unwrap();
        assert!(found.contains(&reason), "{attributes}: {found}");
    }
}
