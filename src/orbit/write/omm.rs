//! OMM in KVN, XML, JSON and CSV, as the publishers of catalogues lay them out.

use crate::omm::{KEYWORDS, Key};
use crate::record::Record;
use crate::time::utc_text;
use crate::units::{DEGREE, REV_PER_DAY, decimal, plain};
use hifitime::Epoch;
use quick_xml::escape::escape;

/// Who made the messages.
const ORIGINATOR: &str = "skyloop";
/// What the messages say of all their elements.
const METADATA: [(Key, &str); 4] = [
    (Key::Centre, "EARTH"),
    (Key::Frame, "TEME"),
    (Key::TimeSystem, "UTC"),
    (Key::Theory, "SGP4"),
];

/// A value as it is written: text may need quotation marks.
enum Value<'a> {
    Text(&'a str),
    Number(String),
}

impl Value<'_> {
    fn bare(&self) -> &str {
        match self {
            Value::Text(text) => text,
            Value::Number(number) => number,
        }
    }
}

/// Keywords and values of a record: the object's first, then elements from its epoch on, then those of its TLE.
struct Values<'a> {
    object: Vec<(Key, Value<'a>)>,
    elements: Vec<(Key, Value<'a>)>,
    tle: Vec<(Key, Value<'a>)>,
}

impl<'a> Values<'a> {
    fn of(record: &'a Record, buffer: &'a mut [u8; 4]) -> Self {
        let set = &record.elements;
        let number = |key, value: String| (key, Value::Number(value));
        let angle = |key, value| (key, Value::Number(decimal(value, DEGREE)));
        Values {
            object: vec![
                (Key::Name, Value::Text(&record.name)),
                (Key::Designator, Value::Text(id_of(record))),
            ],
            elements: vec![
                number(Key::MeanMotion, decimal(set.mean_motion, REV_PER_DAY)),
                number(Key::Eccentricity, plain(set.eccentricity)),
                angle(Key::Inclination, set.inclination),
                angle(Key::Node, set.node),
                angle(Key::Perigee, set.perigee),
                angle(Key::MeanAnomaly, set.mean_anomaly),
            ],
            tle: vec![
                number(Key::EphemerisType, record.ephemeris_type.to_string()),
                (
                    Key::Classification,
                    Value::Text(record.classification.encode_utf8(buffer)),
                ),
                number(Key::Number, set.norad.to_string()),
                number(Key::ElementSet, record.element_set.to_string()),
                number(Key::Revolution, record.revolution.to_string()),
                number(Key::Drag, plain(set.drag)),
                number(Key::MeanMotionDot, plain(record.mean_motion_dot)),
                number(Key::MeanMotionDdot, plain(record.mean_motion_ddot)),
            ],
        }
    }
}

/// OBJECT_ID, which a message needs: `UNKNOWN` where there is none (CCSDS 502.0-B-3, Table 4-2).
fn id_of(record: &Record) -> &str {
    match record.designator.as_str() {
        "" => "UNKNOWN",
        id => id,
    }
}

/// The keyword of a key.
fn word(key: Key) -> &'static str {
    KEYWORDS[key as usize]
}

/// UTC without the closing Z, as the publishers write it.
fn epoch(record: &Record) -> String {
    bare_utc(record.elements.epoch)
}

fn bare_utc(epoch: Epoch) -> String {
    utc_text(epoch).trim_end_matches('Z').to_owned()
}

pub(super) fn kvn(records: &[Record], created: Epoch) -> String {
    let created = bare_utc(created);
    let mut text = String::new();
    for record in records {
        let mut line = |key: &str, value: &str| {
            let line = format!("{key:<19} = {value}");
            text.push_str(line.trim_end());
            text.push('\n');
        };
        let mut buffer = [0; 4];
        let Values {
            object,
            elements,
            tle,
        } = Values::of(record, &mut buffer);
        line("CCSDS_OMM_VERS", "2.0");
        line("CREATION_DATE", &created);
        line("ORIGINATOR", ORIGINATOR);
        for (key, value) in &object {
            line(word(*key), value.bare());
        }
        for (key, value) in METADATA {
            line(word(key), value);
        }
        line(word(Key::Epoch), &epoch(record));
        for (key, value) in elements.iter().chain(&tle) {
            line(word(*key), value.bare());
        }
        text.push('\n');
    }
    text
}

pub(super) fn xml(records: &[Record], created: Epoch) -> String {
    let element = |key: &str, value: &str| format!("<{key}>{}</{key}>", escape(value));
    let elements = |values: &[(Key, Value)]| -> String {
        let texts = values.iter();
        texts
            .map(|(key, value)| element(word(*key), value.bare()))
            .collect()
    };
    let created = bare_utc(created);
    let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ndm>\n".to_owned();
    for record in records {
        let mut buffer = [0; 4];
        let values = Values::of(record, &mut buffer);
        let metadata = METADATA.map(|(key, value)| element(word(key), value));
        text += &format!(
            "<omm id=\"CCSDS_OMM_VERS\" version=\"2.0\">\n<header>{}{}</header>\n\
             <body><segment>\n<metadata>{}{}</metadata>\n<data>\n\
             <meanElements>{}{}</meanElements>\n<tleParameters>{}</tleParameters>\n\
             </data>\n</segment></body>\n</omm>\n",
            element("CREATION_DATE", &created),
            element("ORIGINATOR", ORIGINATOR),
            elements(&values.object),
            metadata.concat(),
            element(word(Key::Epoch), &epoch(record)),
            elements(&values.elements),
            elements(&values.tle),
        );
    }
    text + "</ndm>\n"
}

/// All keywords and values of a record in a table's order, the epoch behind the object's.
fn row(record: &Record, mut put: impl FnMut(&'static str, &Value)) {
    let mut buffer = [0; 4];
    let values = Values::of(record, &mut buffer);
    let epoch = epoch(record);
    let epoch = [(Key::Epoch, Value::Text(&epoch))];
    let all = (values.object.iter()).chain(&epoch);
    for (key, value) in all.chain(&values.elements).chain(&values.tle) {
        put(word(*key), value);
    }
}

pub(super) fn json(records: &[Record]) -> String {
    let objects = records.iter().map(|record| {
        let mut pairs = Vec::new();
        row(record, |key, value| {
            let value = match value {
                Value::Text(text) => serde_json::Value::from(*text).to_string(),
                Value::Number(number) => number.clone(),
            };
            pairs.push(format!("\"{key}\":{value}"));
        });
        format!("{{{}}}", pairs.join(","))
    });
    let objects: Vec<String> = objects.collect();
    format!("[{}]\n", objects.join(",\n"))
}

pub(super) fn csv(records: &[Record]) -> String {
    let mut header = Vec::new();
    if let Some(record) = records.first() {
        row(record, |key, _| header.push(key));
    }
    let mut text = header.join(",") + "\n";
    for record in records {
        let mut values = Vec::new();
        row(record, |_, value| {
            let value = value.bare();
            values.push(match value.contains([',', '"']) {
                true => format!("\"{}\"", value.replace('"', "\"\"")),
                false => value.to_owned(),
            });
        });
        text += &(values.join(",") + "\n");
    }
    text
}
