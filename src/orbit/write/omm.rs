//! OMM in KVN, XML, JSON and CSV, in the layouts of the publishers.

use crate::omm::Key;
use crate::record::Record;
use crate::time::utc_text;
use crate::units::{DEGREE, REV_PER_DAY, decimal, plain};
use hifitime::Epoch;
use quick_xml::escape::escape;

/// ORIGINATOR of the messages.
const ORIGINATOR: &str = "skyloop";
/// Metadata that all messages share.
const METADATA: [(Key, &str); 4] = [
    (Key::Centre, "EARTH"),
    (Key::Frame, "TEME"),
    (Key::TimeSystem, "UTC"),
    (Key::Theory, "SGP4"),
];

/// The fields of a record: first [`OBJECT`] fields of the object, then [`ELEMENTS`] mean elements,
/// then the fields of the TLE.
type Fields = [(Key, String); 17];
const OBJECT: usize = 2;
const ELEMENTS: usize = 7;

fn fields(record: &Record) -> Fields {
    let set = &record.elements;
    // OBJECT_ID is required: `UNKNOWN` where there is none (CCSDS 502.0-B-3, Table 4-2).
    let id = Some(record.designator.as_str()).filter(|id| !id.is_empty());
    [
        (Key::Name, record.name.clone()),
        (Key::Designator, id.unwrap_or("UNKNOWN").to_owned()),
        (Key::Epoch, bare_utc(set.epoch)),
        (Key::MeanMotion, decimal(set.mean_motion, REV_PER_DAY)),
        (Key::Eccentricity, plain(set.eccentricity)),
        (Key::Inclination, decimal(set.inclination, DEGREE)),
        (Key::Node, decimal(set.node, DEGREE)),
        (Key::Perigee, decimal(set.perigee, DEGREE)),
        (Key::MeanAnomaly, decimal(set.mean_anomaly, DEGREE)),
        (Key::EphemerisType, record.ephemeris_type.to_string()),
        (Key::Classification, record.classification.to_string()),
        (Key::Number, set.norad.to_string()),
        (Key::ElementSet, record.element_set.to_string()),
        (Key::Revolution, record.revolution.to_string()),
        (Key::Drag, plain(set.drag)),
        (Key::MeanMotionDot, plain(record.mean_motion_dot)),
        (Key::MeanMotionDdot, plain(record.mean_motion_ddot)),
    ]
}

/// UTC without the final Z, as from the publishers.
fn bare_utc(epoch: Epoch) -> String {
    utc_text(epoch).trim_end_matches('Z').to_owned()
}

pub(super) fn kvn(records: &[Record], created: Epoch) -> String {
    let created = bare_utc(created);
    let mut text = String::new();
    for record in records {
        let mut line = |key: &str, value: &str| {
            text += format!("{key:<19} = {value}").trim_end();
            text.push('\n');
        };
        line("CCSDS_OMM_VERS", "2.0");
        line("CREATION_DATE", &created);
        line("ORIGINATOR", ORIGINATOR);
        let fields = fields(record);
        let (object, others) = fields.split_at(OBJECT);
        for (key, value) in object {
            line(key.keyword(), value);
        }
        for (key, value) in METADATA {
            line(key.keyword(), value);
        }
        for (key, value) in others {
            line(key.keyword(), value);
        }
        text.push('\n');
    }
    text
}

pub(super) fn xml(records: &[Record], created: Epoch) -> String {
    let element = |key: &str, value: &str| format!("<{key}>{}</{key}>", escape(value));
    let elements = |fields: &[(Key, String)]| -> String {
        let elements = fields
            .iter()
            .map(|(key, value)| element(key.keyword(), value));
        elements.collect()
    };
    let created = bare_utc(created);
    let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ndm>\n".to_owned();
    for record in records {
        let fields = fields(record);
        let (object, others) = fields.split_at(OBJECT);
        let (mean, tle) = others.split_at(ELEMENTS);
        let metadata = METADATA.map(|(key, value)| element(key.keyword(), value));
        text += &format!(
            "<omm id=\"CCSDS_OMM_VERS\" version=\"2.0\">\n<header>{}{}</header>\n\
             <body><segment>\n<metadata>{}{}</metadata>\n<data>\n\
             <meanElements>{}</meanElements>\n<tleParameters>{}</tleParameters>\n\
             </data>\n</segment></body>\n</omm>\n",
            element("CREATION_DATE", &created),
            element("ORIGINATOR", ORIGINATOR),
            elements(object),
            metadata.concat(),
            elements(mean),
            elements(tle),
        );
    }
    text + "</ndm>\n"
}

pub(super) fn json(records: &[Record]) -> String {
    let pair = |(key, value): (Key, String)| {
        let is_text = matches!(
            key,
            Key::Name | Key::Designator | Key::Epoch | Key::Classification
        );
        let value = if is_text {
            serde_json::Value::from(value).to_string()
        } else {
            value
        };
        format!("\"{}\":{value}", key.keyword())
    };
    let object = |record| format!("{{{}}}", fields(record).map(pair).join(","));
    let objects: Vec<String> = records.iter().map(object).collect();
    format!("[{}]\n", objects.join(",\n"))
}

pub(super) fn csv(records: &[Record]) -> String {
    let header = records
        .first()
        .map(|record| fields(record).map(|(key, _)| key.keyword()));
    let mut text = header.map_or(String::new(), |header| header.join(",")) + "\n";
    for record in records {
        let values = fields(record).map(|(_, value)| {
            if value.contains([',', '"']) {
                format!("\"{}\"", value.replace('"', "\"\""))
            } else {
                value
            }
        });
        text += &(values.join(",") + "\n");
    }
    text
}
