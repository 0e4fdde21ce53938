//! Encoder by interpretation of the schema, as the reference for the generated codecs.

use toml::{Table, Value};

use crate::bytes::{Bits, crc16, from_hex};
use crate::mistake::Mistake;
use crate::model::{Field, Kind, Number, Receiver, Record, Rest, Schema};

/// The payload of a message with these fields. Values may be out of range, for refused packets.
///
/// # Errors
/// A field is missing or has another kind.
pub fn payload(
    schema: &Schema,
    message: &Record,
    opcode: Option<&str>,
    fields: &Table,
) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let (code, list) = schema.payload_fields(message, opcode)?;
    out.extend(code);
    for field in &list {
        let context = |error: String| format!("{}.{}: {error}", message.name, field.name);
        match fields.get(&field.name) {
            Some(value) => put(schema, field, value, fields, &mut out).map_err(context)?,
            None if message.is_flag(field) => out.push(has_optional(&list, fields).into()),
            None if field.optional => {}
            None => return Err(context("missing".to_owned())),
        }
    }
    Ok(out)
}

fn has_optional(list: &[Field], fields: &Table) -> bool {
    let mut optional = list.iter().filter(|field| field.optional);
    optional.any(|field| fields.contains_key(&field.name))
}

fn put(
    schema: &Schema,
    field: &Field,
    value: &Value,
    all: &Table,
    out: &mut Vec<u8>,
) -> Result<(), String> {
    match &field.kind {
        Kind::One(number) => number_bytes(*number, value, out)?,
        Kind::Array(number, _) => {
            for value in numbers(value)? {
                number_bytes(*number, &value, out)?;
            }
        }
        Kind::Ascii(length) => {
            let mut bytes = text(value)?.as_bytes().to_vec();
            bytes.resize(*length, 0);
            out.extend(bytes);
        }
        Kind::Struct(name) => return Err(format!("{name} has fields of its own")),
        Kind::Rest(Rest::Pixels) => out.extend(pack(all, value)?),
        Kind::Rest(Rest::Windows) => {
            for window in numbers(value)? {
                for key in ["column", "row"] {
                    number_bytes(Number::Unsigned(2), member(&window, key)?, out)?;
                }
                out.extend(pack(all, member(&window, "pixels")?)?);
            }
        }
        Kind::Rest(Rest::Records) => {
            let record = schema.record(field).ok_or("no record")?;
            for fields in numbers(value)? {
                let fields = fields.as_table().ok_or("a record is a table")?;
                for field in schema.flat(&record.fields) {
                    let value = fields.get(&field.name);
                    let value = value.ok_or(format!("no {}", field.name))?;
                    put(schema, &field, value, fields, out)?;
                }
            }
        }
        Kind::Rest(Rest::Bytes) if value.is_table() => {
            let (bits, pixels) = compressed(value)?;
            out.extend(crate::rice::encode(&pixels, bits));
        }
        Kind::Rest(Rest::Bytes | Rest::Utf8) => {
            let text = text(value)?;
            match text.strip_prefix("hex:") {
                Some(digits) => out.extend(from_hex(digits)?),
                None => out.extend(text.as_bytes()),
            }
        }
    }
    Ok(())
}

fn text(value: &Value) -> Result<&str, String> {
    value.as_str().ok_or(format!("{value} is no text"))
}

fn member<'a>(value: &'a Value, key: &str) -> Result<&'a Value, String> {
    value.get(key).ok_or(format!("{value} has no {key}"))
}

/// Bits of a pixel and the pixels of `{ bits, rice }`.
///
/// # Errors
/// The value has another form.
pub fn compressed(value: &Value) -> Result<(usize, Vec<u64>), String> {
    let pixels = numbers(member(value, "rice")?)?;
    let pixels: Result<Vec<u64>, String> = pixels.iter().map(unsigned).collect();
    Ok((unsigned(member(value, "bits")?)? as usize, pixels?))
}

/// The elements of an array, flattened. `{ step, modulo, count }` is an array of the first `count`
/// multiples of `step`, from 0, each modulo `modulo`.
///
/// # Errors
/// The value has another form.
pub fn numbers(value: &Value) -> Result<Vec<Value>, String> {
    if value.is_table() {
        let [step, modulo, count] = ["step", "modulo", "count"].map(|key| value.get(key));
        let [step, modulo, count] = [step, modulo, count].map(|n| n.and_then(Value::as_integer));
        let (Some(step), Some(modulo), Some(count)) = (step, modulo, count) else {
            return Err("neither an array nor step, modulo, count".to_owned());
        };
        let multiples = (0..count).map(|n| Value::Integer(step * n % modulo));
        return Ok(multiples.collect());
    }
    let elements = value.as_array().ok_or("not an array")?;
    let flat = elements.iter().map(|element| match element {
        Value::Array(inner) => inner.clone(),
        other => vec![other.clone()],
    });
    Ok(flat.flatten().collect())
}

/// An unsigned number; in quotes if it is too large for TOML.
///
/// # Errors
/// The value has another form.
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

/// A floating-point number.
///
/// # Errors
/// The value has another form.
pub fn float(value: &Value) -> Result<f64, String> {
    let integer = value.as_integer().map(|number| number as f64);
    let number = value.as_float().or(integer);
    number.ok_or(format!("{value} is no number"))
}

fn number_bytes(number: Number, value: &Value, out: &mut Vec<u8>) -> Result<(), String> {
    match number {
        Number::Float(4) => out.extend((float(value)? as f32).to_be_bytes()),
        Number::Float(_) => out.extend(float(value)?.to_be_bytes()),
        Number::Unsigned(_) | Number::Time => {
            let bytes = unsigned(value)?.to_be_bytes();
            let (spare, own) = bytes.split_at(8 - number.bytes());
            if spare.iter().any(|byte| *byte != 0) {
                return Err(format!("{value} has more than {} octets", number.bytes()));
            }
            out.extend(own);
        }
    }
    Ok(())
}

/// Pixels with the bits of the field `packing`.
fn pack(fields: &Table, pixels: &Value) -> Result<Vec<u8>, String> {
    let width = unsigned(fields.get("packing").ok_or("no packing")?)?;
    let mut bits = Bits::default();
    for pixel in numbers(pixels)? {
        bits.put(unsigned(&pixel)?, width as usize);
    }
    Ok(bits.bytes())
}

/// The packet around a payload, with the errors in `wrong`.
pub fn packet(
    schema: &Schema,
    message: &Record,
    count: u16,
    time: u64,
    payload: &[u8],
    wrong: &Mistake,
) -> Vec<u8> {
    let kind = u16::from(message.to == Receiver::Emulator) << 12;
    let apid = wrong.apid.unwrap_or(message.apid);
    let first = (kind | 0x0800 | apid) ^ u16::from(wrong.octet0) << 8;
    let flags = wrong.flags.unwrap_or(3) << 14;
    let length = (payload.len() + 10) as i16 + wrong.extra;
    let mut out = Vec::new();
    for field in [first, flags | count, length as u16] {
        out.extend(field.to_be_bytes());
    }
    out.extend(time.to_be_bytes());
    out.push(wrong.version.unwrap_or(schema.version));
    out.extend(payload);
    out.extend((crc16(&out) ^ wrong.crc).to_be_bytes());
    out
}

/// The frames of a packet in the CAN form: identifiers and data.
///
/// # Errors
/// A signal has an unknown value.
pub fn can_frames(
    schema: &Schema,
    groups: &[String],
    packet: &[u8],
    fields: &Table,
    counter: u64,
) -> Result<Vec<(u16, Vec<u8>)>, String> {
    let mut out = Vec::new();
    let frames = schema.can.frames.iter();
    for frame in frames.filter(|frame| groups.contains(&frame.group)) {
        let mut bits = Bits::default();
        for signal in &frame.signals {
            let value = can_value(&signal.of, packet, fields, counter);
            let context = |error: String| format!("{}.{}: {error}", frame.name, signal.name);
            bits.put(value.map_err(context)?, signal.bits);
        }
        out.push((frame.id, bits.bytes()));
    }
    Ok(out)
}

/// The value of a signal: see `of` in `packets.toml`.
fn can_value(of: &str, packet: &[u8], fields: &Table, counter: u64) -> Result<u64, String> {
    let big_endian = |from: usize, to: usize| {
        let bytes = packet.get(from..to).unwrap_or_default().iter();
        bytes.fold(0, |value, byte| value << 8 | u64::from(*byte))
    };
    let field = |name: &str| fields.get(name).ok_or(format!("no {name}"));
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
        [half @ ("high" | "low"), name, index] => {
            let index: usize = index.parse().map_err(|_| format!("no index: {index}"))?;
            let numbers = numbers(field(name)?)?;
            let number = float(numbers.get(index).ok_or("no such number")?)?;
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
        [name] => unsigned(field(name)?)?,
        _ => return Err(format!("{of:?} is nothing known")),
    })
}
