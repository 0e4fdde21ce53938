//! `vectors/golden.txt` in both directions: decode(hex) gives the fields, encode(fields) the hex.

use crate::common::{Vector, golden, hex};
use skyloop_protocols::command::Opcode;
use skyloop_protocols::packet::identify;
use skyloop_protocols::pixels::unpack;
use skyloop_protocols::{
    Command, Header, MAX_PACKET, ObjectRecord, PERSONALITIES, Reply, WireTime, apid,
};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

/// The fields of a decoded message with their values, from its `Debug` text.
fn fields(message: &impl Debug) -> BTreeMap<String, Vec<String>> {
    let mut fields: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut name = String::new();
    for line in format!("{message:#?}").lines() {
        let mut value = line.trim().trim_end_matches(',');
        if let Some((field, rest)) = value.split_once(": ") {
            (name, value) = (field.to_owned(), rest);
        }
        let is_bracket = value.ends_with(['{', '[', '(', '}', ']', ')']);
        if !name.is_empty() && (!is_bracket || value.starts_with('"')) {
            let values = fields.entry(name.clone()).or_default();
            values.push(value.to_owned());
        }
    }
    fields
}

/// Fields with codes, and the types of the codes.
const CODED: [(&str, &str); 13] = [
    ("attitude_source", "AttitudeSource"),
    ("direction", "Direction"),
    ("kind", "FaultKind"),
    ("label_level", "LabelLevel"),
    ("labels", "LabelLevel"),
    ("mode", "Mode"),
    ("overrun", "Overrun"),
    ("packing", "Packing"),
    ("pixel_level", "PixelLevel"),
    ("pixels", "PixelLevel"),
    ("reason", "Reason"),
    ("sync", "SyncState"),
    ("withheld", "Withheld"),
];

/// The code of the value `name` of a field.
fn code(field: &str, name: &str) -> Option<&'static str> {
    let (_, kind) = CODED.iter().find(|(known, _)| *known == field)?;
    let codes = include_str!("../src/generated/codes.rs");
    let (_, codes) = codes.split_once(&format!("pub enum {kind}: u8 {{"))?;
    let mut lines = codes.lines().map(|line| line.trim().trim_end_matches(','));
    lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "))
}

/// Compares the fields of a message with those of the vector.
fn compare(v: &Vector, message: &impl Debug) {
    let is_block = ["PixelBlock", "Windows", "Compressed"].contains(&v.text("message"));
    let mut listed = 0;
    for (name, mut found) in fields(message) {
        let key = match name.as_str() {
            "state" => continue,
            // Other tests of this file compare pixels and records.
            "data" if !v.has("data") => {
                assert!(v.has("pixels") || v.has("records"), "{}: {name}", v.name);
                continue;
            }
            "in_time" => {
                found = vec![u8::from(found == ["true"]).to_string()];
                "flags"
            }
            "apid" => "answers_apid",
            "sequence_count" => "answers_sequence_count",
            name => name,
        };
        for value in &mut found {
            if let Some(code) = code(&name, value) {
                *value = code.to_owned();
            }
        }
        let mut expected: Vec<String> = match key {
            "detail" => vec![format!("{:?}", v.text(key))],
            "text" => v.text(key).bytes().map(|byte| byte.to_string()).collect(),
            "data" => hex(v.text(key)).iter().map(u8::to_string).collect(),
            _ if v.text(key).starts_with("0x") => vec![v.integer::<u64>(key).to_string()],
            _ => v.text(key).split_whitespace().map(str::to_owned).collect(),
        };
        if key == "at" {
            expected.resize(found.len(), "0".to_owned());
        }
        assert_eq!(found, expected, "{}: {name}", v.name);
        listed += 1;
    }
    // All vectors have message, sequence_count, time and hex. Other tests compare the rest.
    let elsewhere = ["opcode", "places", "records", "pixel_bits"];
    let mut elsewhere = elsewhere.iter().filter(|key| v.has(key)).count();
    elsewhere += usize::from(is_block && v.has("pixels"));
    assert_eq!(v.keys().count(), 4 + elsewhere + listed, "{}", v.name);
}

#[test]
fn good_vectors_in_both_directions() {
    let native = PERSONALITIES.iter().find(|one| one.name == "native");
    let native = native.expect("native");
    for v in golden().iter().filter(|v| v.has("message")) {
        let kind = apid::ALL
            .iter()
            .find(|(_, name)| *name == v.text("message"));
        let header = Header {
            apid: kind.expect("kind").0,
            sequence_count: v.integer("sequence_count"),
            time: WireTime(v.integer("time")),
        };
        let mut buffer = [0xAA; MAX_PACKET];
        let (count, time) = (header.sequence_count, header.time);
        let (found, length) = if apid::is_telecommand(header.apid) {
            let (found, command) = (native.decode_command)(&v.bytes).expect(&v.name);
            let opcode = command.opcode().map(Opcode::name);
            assert_eq!(
                opcode,
                v.has("opcode").then(|| v.text("opcode")),
                "{}",
                v.name
            );
            compare(v, &command);
            (
                found,
                (native.encode_command)(&command, count, time, &mut buffer),
            )
        } else {
            let (found, reply) = (native.decode_reply)(&v.bytes).expect(&v.name);
            compare(v, &reply);
            (
                found,
                (native.encode_reply)(&reply, count, time, &mut buffer),
            )
        };
        assert_eq!(found, header, "{}", v.name);
        assert_eq!(identify(&v.bytes), Some((header.apid, count)), "{}", v.name);
        assert_eq!(&buffer[..length.expect(&v.name)], v.bytes, "{}", v.name);
    }
}

fn pixels(v: &Vector) -> Vec<u16> {
    let pixels = v.integers("pixels").into_iter();
    pixels
        .map(|pixel| pixel.try_into().expect("pixel"))
        .collect()
}

#[test]
fn pixel_blocks_give_their_pixels() {
    for v in golden()
        .iter()
        .filter(|v| v.name.starts_with("pixel block") && v.has("pixels"))
    {
        let pixels = pixels(v);
        let Ok((_, Reply::PixelBlock(block))) = Reply::decode(&v.bytes) else {
            panic!("{}", v.name)
        };
        let first = block.first_pixel as usize;
        let mut frame = vec![0; first + pixels.len()];
        assert!(block.place(&mut frame), "{}", v.name);
        assert_eq!(frame[first..], pixels, "{}", v.name);
    }
}

#[test]
fn windows_give_their_positions_and_pixels() {
    for v in golden().iter().filter(|v| v.has("places")) {
        let Ok((_, Reply::Windows(block))) = Reply::decode(&v.bytes) else {
            panic!("{}", v.name)
        };
        let (mut positions, mut all) = (Vec::new(), Vec::new());
        for window in block.windows() {
            positions.extend([u64::from(window.column), u64::from(window.row)]);
            let mut pixels = vec![0; usize::from(block.size).pow(2)];
            assert_eq!(
                unpack(block.packing, window.data, &mut pixels),
                pixels.len()
            );
            all.extend(pixels);
        }
        let expected = (v.integers("places"), pixels(v));
        assert_eq!((positions, all), expected, "{}", v.name);
    }
}

#[test]
fn objects_give_their_numbers() {
    let vectors = golden();
    let v = vectors.iter().find(|v| v.name == "objects");
    let v = v.expect("objects");
    let Ok((_, Reply::Objects(part))) = Reply::decode(&v.bytes) else {
        panic!("{}", v.name)
    };
    let objects: Vec<ObjectRecord> = part.objects().collect();
    let [star, rso] = objects[..] else {
        panic!("two objects, not {objects:?}")
    };
    // X-Val: STAR and RSO in vectors.toml.
    let flags = |object: ObjectRecord| [object.is_rso, object.in_frame, object.visible];
    assert_eq!(flags(star), [false, true, true]);
    assert!(star.id.starts_with(b"HIP 80351\0"));
    assert_eq!((star.x_px, star.y_px), (12.5, 250.25));
    assert_eq!((star.dx_px, star.dy_px), (0.5, -0.25));
    assert_eq!((star.mag, star.snr, star.electrons), (4.75, 31.5, 12000.0));
    assert_eq!(flags(rso), [true, true, false]);
    assert!(rso.mag.is_nan());
    let bytes: Vec<u8> = objects.iter().flat_map(ObjectRecord::to_bytes).collect();
    assert_eq!(bytes, part.data);
}

#[test]
fn bad_vectors_are_refused_for_their_reason() {
    let mut seen = BTreeSet::new();
    for v in golden().iter().filter(|v| v.has("error")) {
        let error = match v.text("receiver") {
            "emulator" => Command::decode(&v.bytes).err(),
            "client" => Reply::decode(&v.bytes).err(),
            other => panic!("golden.txt [{}]: receiver {other}", v.name),
        };
        let error = error.unwrap_or_else(|| panic!("{} was accepted", v.name));
        let debug = format!("{error:?}");
        let variant = debug.split(' ').next();
        assert_eq!(variant, Some(v.text("error")), "{}: {error}", v.name);
        assert!(error.to_string().len() <= 200, "{}: {error}", v.name);
        seen.insert(v.text("error").to_owned());
    }
    assert_eq!(seen.len(), 10, "every DecodeError: {seen:?}");
}

#[test]
fn every_kind_and_every_opcode_has_a_vector() {
    let vectors = golden();
    let named = |key: &str, name: &str| vectors.iter().any(|v| v.has(key) && v.text(key) == name);
    for (_, name) in apid::ALL {
        assert!(named("message", name), "{name}");
    }
    for opcode in Opcode::ALL {
        assert!(named("opcode", opcode.name()), "{opcode:?}");
    }
}
