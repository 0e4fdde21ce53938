//! Packets from fields, read straight off the schema: what the generated codecs are checked against.

use toml::{Table, Value};

use crate::bytes::{Bits, crc16, from_hex};
use crate::model::{CanFrame, Field, Kind, Message, Number, Receiver, Rest, Schema};

/// What can be wrong on purpose around a payload.
#[derive(Debug, Default)]
pub struct Around {
    /// Another format version.
    pub version: Option<u8>,
    /// Bits of the first octet to flip.
    pub octet0: u8,
    /// Other sequence flags.
    pub flags: Option<u16>,
    /// Added to the data length.
    pub extra: i16,
    /// Another APID.
    pub apid: Option<u16>,
    /// Bits of the CRC to flip.
    pub crc: u16,
}

/// The payload of a message with these fields; fields that are missing are an error, others may be anything.
///
/// # Errors
/// A field that is missing or of another kind.
pub fn payload(
    schema: &Schema,
    message: &Message,
    opcode: Option<&str>,
    fields: &Table,
) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let mut list = schema.fields(message);
    if let Some(name) = opcode {
        let opcode = message.opcodes.iter().find(|opcode| opcode.name == name);
        let opcode = opcode.ok_or(format!("{}: no opcode {name}", message.name))?;
        out.push(opcode.code);
        list = schema.arguments(opcode);
    }
    for field in &list {
        let context = |error: String| format!("{}.{}: {error}", message.name, field.name);
        match (fields.get(&field.name), &message.optional) {
            (None, Some(optional)) if field.name == optional.flag => {
                let present = list
                    .iter()
                    .any(|field| field.optional && fields.contains_key(&field.name));
                out.push(present.into());
            }
            (None, _) if field.optional => {}
            (Some(value), _) => put(schema, field, value, fields, &mut out).map_err(context)?,
            (None, _) => return Err(context("missing".to_owned())),
        }
    }
    Ok(out)
}

fn put(
    schema: &Schema,
    field: &Field,
    value: &Value,
    all: &Table,
    out: &mut Vec<u8>,
) -> Result<(), String> {
    match &field.kind {
        Kind::One(number) => number_octets(*number, value, out),
        Kind::Array(number, _) => numbers(value)?
            .iter()
            .try_for_each(|value| number_octets(*number, value, out)),
        Kind::Ascii(length) => {
            let mut octets = value.as_str().ok_or("not a text")?.as_bytes().to_vec();
            octets.resize(*length, 0);
            out.extend(octets);
            Ok(())
        }
        Kind::Struct(name) => Err(format!("{name} has fields of its own")),
        Kind::Rest(Rest::Pixels) => {
            out.extend(pack(all, &numbers(value)?)?);
            Ok(())
        }
        Kind::Rest(Rest::Windows) => {
            for window in numbers(value)? {
                let window = window.as_table().ok_or("a window is a table")?;
                for key in ["column", "row"] {
                    number_octets(Number::Unsigned(2), window.get(key).ok_or("no place")?, out)?;
                }
                out.extend(pack(
                    all,
                    &numbers(window.get("pixels").ok_or("no pixels")?)?,
                )?);
            }
            Ok(())
        }
        Kind::Rest(Rest::Records) => {
            let record = field
                .record
                .as_deref()
                .and_then(|name| schema.structure(name))
                .ok_or("no record")?;
            for fields in numbers(value)? {
                let fields = fields.as_table().ok_or("a record is a table")?;
                for field in schema.flat(&record.fields) {
                    let value = fields
                        .get(&field.name)
                        .ok_or(format!("no {}", field.name))?;
                    put(schema, &field, value, fields, out)?;
                }
            }
            Ok(())
        }
        Kind::Rest(Rest::Octets) if value.is_table() => {
            let (bits, pixels) = compressed(value)?;
            out.extend(crate::rice::encode(&pixels, bits));
            Ok(())
        }
        Kind::Rest(Rest::Octets | Rest::Utf8) => {
            out.extend(text_or_hex(value.as_str().ok_or("not a text")?)?);
            Ok(())
        }
    }
}

/// Bits of a pixel and the pixels of `{ bits, rice }`.
///
/// # Errors
/// Anything else.
pub fn compressed(value: &Value) -> Result<(usize, Vec<u64>), String> {
    let bits = value
        .get("bits")
        .and_then(Value::as_integer)
        .ok_or("no bits")?;
    let pixels = numbers(value.get("rice").ok_or("no rice")?)?;
    let pixels: Result<Vec<u64>, String> = pixels.iter().map(unsigned).collect();
    Ok((bits as usize, pixels?))
}

/// Text, or octets after `hex:`.
///
/// # Errors
/// Digits that are not hexadecimal.
pub fn text_or_hex(text: &str) -> Result<Vec<u8>, String> {
    match text.strip_prefix("hex:") {
        Some(digits) => from_hex(digits),
        None => Ok(text.as_bytes().to_vec()),
    }
}

/// The elements of an array, nested ones in a row; `{ step, modulo, count }` stands for that many multiples.
///
/// # Errors
/// Anything else.
pub fn numbers(value: &Value) -> Result<Vec<Value>, String> {
    if let Some(rule) = value.as_table() {
        let [step, modulo, count] =
            ["step", "modulo", "count"].map(|key| rule.get(key).and_then(Value::as_integer));
        let (Some(step), Some(modulo), Some(count)) = (step, modulo, count) else {
            return Err("neither an array nor step, modulo, count".to_owned());
        };
        return Ok((0..count)
            .map(|n| Value::Integer(step * n % modulo))
            .collect());
    }
    let elements = value.as_array().ok_or("not an array")?;
    let flat = elements.iter().map(|element| match element {
        Value::Array(inner) => inner.clone(),
        other => vec![other.clone()],
    });
    Ok(flat.flatten().collect())
}

/// A number that may be too large for TOML and stands in quotes then.
///
/// # Errors
/// Anything else.
pub fn unsigned(value: &Value) -> Result<u64, String> {
    let parsed = match value {
        Value::Integer(number) => u64::try_from(*number).ok(),
        Value::String(text) => match text.strip_prefix("0x") {
            Some(digits) => u64::from_str_radix(digits, 16).ok(),
            None => text.parse().ok(),
        },
        _ => None,
    };
    parsed.ok_or(format!("{value} is not an unsigned integer"))
}

/// A number with a fraction.
///
/// # Errors
/// Anything else.
pub fn float(value: &Value) -> Result<f64, String> {
    value
        .as_float()
        .or(value.as_integer().map(|number| number as f64))
        .ok_or(format!("{value} is no number"))
}

fn number_octets(number: Number, value: &Value, out: &mut Vec<u8>) -> Result<(), String> {
    match number {
        Number::Float(4) => out.extend((float(value)? as f32).to_be_bytes()),
        Number::Float(_) => out.extend(float(value)?.to_be_bytes()),
        Number::Unsigned(_) | Number::Time => {
            let octets = unsigned(value)?.to_be_bytes();
            let (spare, own) = octets.split_at(8 - number.octets());
            if spare.iter().any(|octet| *octet != 0) {
                return Err(format!("{value} has more than {} octets", number.octets()));
            }
            out.extend(own);
        }
    }
    Ok(())
}

/// Pixels packed as the field `packing` says.
fn pack(fields: &Table, pixels: &[Value]) -> Result<Vec<u8>, String> {
    let width = fields
        .get("packing")
        .and_then(Value::as_integer)
        .ok_or("no packing")?;
    let mut bits = Bits::default();
    for pixel in pixels {
        bits.put(unsigned(pixel)?, width as usize);
    }
    Ok(bits.octets())
}

/// The packet around a payload.
pub fn packet(
    schema: &Schema,
    message: &Message,
    count: u16,
    time: u64,
    payload: &[u8],
    around: &Around,
) -> Vec<u8> {
    let kind = u16::from(message.to == Receiver::Emulator) << 12;
    let first =
        (kind | 0x0800 | around.apid.unwrap_or(message.apid)) ^ u16::from(around.octet0) << 8;
    let flags = around.flags.unwrap_or(3) << 14;
    let length = (payload.len() + 10) as i16 + around.extra;
    let mut out = Vec::new();
    for field in [first, flags | count, length as u16] {
        out.extend(field.to_be_bytes());
    }
    out.extend(time.to_be_bytes());
    out.push(around.version.unwrap_or(schema.version));
    out.extend(payload);
    out.extend((crc16(&out) ^ around.crc).to_be_bytes());
    out
}

/// The frames of the CAN form that carry a packet: identifiers and data.
///
/// # Errors
/// A signal that holds something unknown.
pub fn can_frames(
    schema: &Schema,
    groups: &[&str],
    packet: &[u8],
    fields: &Table,
    counter: u64,
) -> Result<Vec<(u16, Vec<u8>)>, String> {
    let frames = schema
        .can
        .frames
        .iter()
        .filter(|frame| groups.contains(&frame.group.as_str()));
    frames
        .map(|frame| Ok((frame.id, can_data(frame, packet, fields, counter)?)))
        .collect()
}

fn can_data(
    frame: &CanFrame,
    packet: &[u8],
    fields: &Table,
    counter: u64,
) -> Result<Vec<u8>, String> {
    let mut bits = Bits::default();
    for signal in &frame.signals {
        let value = can_value(&signal.of, packet, fields, counter);
        bits.put(
            value.map_err(|error| format!("{}.{}: {error}", frame.name, signal.name))?,
            signal.bits,
        );
    }
    Ok(bits.octets())
}

/// What a signal holds: see `of` in `packets.toml`.
fn can_value(of: &str, packet: &[u8], fields: &Table, counter: u64) -> Result<u64, String> {
    let big_endian = |from: usize, to: usize| {
        let octets = packet.get(from..to).unwrap_or_default();
        octets
            .iter()
            .fold(0, |value, octet| value << 8 | u64::from(*octet))
    };
    let words: Vec<&str> = of.split(' ').collect();
    Ok(match words.as_slice() {
        [""] => 0,
        ["counter"] => counter,
        ["has_state"] => fields.contains_key("position_m").into(),
        ["time.seconds"] => big_endian(6, 10),
        ["time.fraction_high"] => big_endian(10, 14) >> 3,
        ["time.fraction_low"] => big_endian(10, 14) & 7,
        ["header.sequence_count"] => big_endian(2, 4) & 0x3FFF,
        ["crc"] => big_endian(packet.len() - 2, packet.len()),
        ["opcode"] => big_endian(15, 16),
        ["argument"] => big_endian(16, packet.len() - 2),
        [half @ ("high" | "low"), field, index] => {
            let numbers = numbers(fields.get(*field).ok_or(format!("no {field}"))?)?;
            let number = index
                .parse()
                .ok()
                .and_then(|index: usize| numbers.get(index));
            let number = float(number.ok_or("no such number")?)?;
            let bits = number.to_bits();
            match (*half, number == 0.0) {
                ("low", _) => bits & 0x1FFF_FFFF,
                (_, true) => bits >> 32,
                // Sign, 8 bits of exponent instead of 11, 23 of the 52 bits of the mantissa.
                _ => {
                    bits >> 63 << 31
                        | ((bits >> 52 & 0x7FF) + 127 - 1023) << 23
                        | bits >> 29 & 0x7F_FFFF
                }
            }
        }
        [name] => unsigned(fields.get(*name).ok_or(format!("no {name}"))?)?,
        _ => return Err(format!("{of:?} is nothing known")),
    })
}
