//! `vectors/golden.h`: the golden vectors as C, for `tests/independent/check.c`.

use toml::Value;

use crate::NOTE;
use crate::encode::{compressed, float, numbers, unsigned};
use crate::model::{Field, Kind, Number, Receiver, Schema};
use crate::text::{braces, each, indent, join, snake, upper};
use crate::vectors::{Good, Vectors};

/// The whole file.
///
/// # Errors
/// A vector without a known message.
pub fn write(schema: &Schema, vectors: &Vectors) -> Result<String, String> {
    let mut checks: Vec<(&str, Vec<String>)> = Vec::new();
    let good = vectors.good.iter().map(|vector| good(schema, vector));
    checks.push(("good", good.collect::<Result<_, _>>()?));
    let bad = vectors.bad.iter().map(|vector| {
        let (name, error, length) = (&vector.name, upper(&vector.error), vector.bytes.len());
        let link = match vector.receiver.as_str() {
            "emulator" => "uplink",
            _ => "downlink",
        };
        let packet = bytes("packet", &vector.bytes);
        format!("{packet}REFUSED({link}, {name:?}, packet, {length}U, SKYLOOP_{error});\n")
    });
    checks.push(("bad", bad.collect()));
    let serial = vectors.serial.iter().map(|vector| {
        let arrays = bytes("packet", &vector.packet) + &bytes("line", &vector.line);
        let name = &vector.name;
        format!("{arrays}check_serial({name:?}, packet, sizeof packet, line, sizeof line);\n")
    });
    checks.push(("serial", serial.collect()));
    let can = vectors.can.iter().map(|vector| {
        let frames = each(&vector.frames, |(id, data)| {
            let bytes = join(data.iter().map(|byte| format!("0x{byte:02x}")), ", ");
            format!("{{{id:#05x}U, {}U, {{{bytes}}}}},\n", data.len())
        });
        let frames = array("skyloop_can_frame_t", "frames", &frames);
        let packet = bytes("packet", &vector.packet);
        let good = vectors.good.iter().find(|good| good.name == vector.of);
        let kind = good.map_or(String::new(), |good| snake(&good.message));
        let arguments = "packet, sizeof packet, frames, sizeof frames / sizeof frames[0]";
        let name = &vector.name;
        format!("{frames}{packet}check_can_{kind}({name:?}, {arguments});\n")
    });
    checks.push(("can", can.collect()));
    let (mut out, mut calls) = (format!("/* {NOTE} */\n"), String::new());
    for (kind, bodies) in checks {
        for (number, body) in bodies.iter().enumerate() {
            out += &function(&format!("{kind}_{number}"), body);
            calls += &format!("{kind}_{number}();\n");
        }
    }
    Ok(out + &function("golden", &calls))
}

fn function(name: &str, body: &str) -> String {
    format!("\nstatic void {name}(void)\n{{\n{}}}\n", indent(body, 4))
}

fn array(kind: &str, name: &str, lines: &str) -> String {
    let array = braces(&format!("static const {kind} {name}[] ="), lines);
    format!("{array};\n")
}

fn bytes(name: &str, bytes: &[u8]) -> String {
    let lines = each(bytes.chunks(20), |line| {
        let bytes = join(line.iter().map(|byte| format!("0x{byte:02x}")), ", ");
        format!("{bytes},\n")
    });
    let lines = if lines.is_empty() { "0\n" } else { &lines };
    array("uint8_t", name, lines)
}

/// Builds a message, encodes and decodes it, and compares both results with the vector.
fn good(schema: &Schema, vector: &Good) -> Result<String, String> {
    let message = schema.message(&vector.message)?;
    let link = match message.to {
        Receiver::Emulator => "uplink",
        Receiver::Client => "downlink",
    };
    let mut base = format!("as.{}", snake(message.type_name()));
    let (mut set, mut same) = (String::new(), String::new());
    if let Some(opcode) = &vector.opcode {
        let code = format!("SKYLOOP_OPCODE_{}", upper(opcode));
        set += &format!("made.{base}.opcode = {code};\n");
        same += &format!("SAME(got.{base}.opcode, {code});\n");
        base += &format!(".as.{}", snake(opcode));
    }
    if let Some(optional) = &message.optional {
        let present = vector.fields.iter().any(|(field, _)| field.optional);
        let name = &optional.name;
        set += &format!("made.{base}.has_{name} = {present};\n");
        same += &format!("SAME(got.{base}.has_{name}, {present});\n");
    }
    for (field, value) in &vector.fields {
        // Fields of a structure are reached through the field that holds it.
        let mut outer = message.fields.iter().filter(|outer| {
            let structure = schema.inner(outer);
            structure.is_some_and(|structure| {
                structure
                    .fields
                    .iter()
                    .any(|inner| inner.name == field.name)
            })
        });
        let path = match outer.next() {
            Some(outer) => format!("{base}.{}.{}", outer.name, field.name),
            None => format!("{base}.{}", field.name),
        };
        if let Kind::Rest(_) = &field.kind {
            if value.get("rice").is_some() {
                same += &check_compressed(value, &path)?;
            }
            let (rest, length) = (bytes("rest", vector.rest()), vector.rest().len());
            set += &format!("{rest}made.{path} = rest;\nmade.{path}_length = {length}U;\n");
            same += &format!("SAME(got.{path}_length, {length}U);\n");
            same += &format!("CHECK(memcmp(got.{path}, rest, {length}U) == 0);\n");
            continue;
        }
        for (path, literal) in numbers_of(field, value, &path)? {
            set += &format!("made.{path} = {literal};\n");
            same += &if field.kind.is_float() {
                format!("SAME(skyloop_f64_bits(got.{path}), skyloop_f64_bits({literal}));\n")
            } else {
                format!("SAME(got.{path}, {literal});\n")
            };
        }
    }
    let Good {
        name, count, time, ..
    } = vector;
    let (packet, apid) = (bytes("packet", &vector.bytes), upper(&message.name));
    Ok(format!(
        "{packet}skyloop_{link}_t made;\nskyloop_{link}_t got;\n(void)memset(&made, 0, sizeof made);\n\
         made.header.apid = SKYLOOP_APID_{apid};\nmade.header.sequence_count = {count}U;\n\
         made.header.time = {time:#x}U;\n{set}TAKEN({link}, {name:?}, packet, made, got);\n{same}RELEASE();\n"
    ))
}

fn check_compressed(value: &Value, path: &str) -> Result<String, String> {
    let (bits, pixels) = compressed(value)?;
    let lines = each(pixels.chunks(20), |line| {
        let pixels = join(line.iter().map(|pixel| format!("{pixel}U")), ", ");
        format!("{pixels},\n")
    });
    let pixels = array("uint16_t", "pixels", &lines);
    let count = "sizeof pixels / sizeof pixels[0]";
    Ok(format!(
        "{pixels}check_compressed(got.{path}, got.{path}_length, {bits}U, pixels, {count});\n"
    ))
}

/// Path and literal of each number of a field.
fn numbers_of(field: &Field, value: &Value, path: &str) -> Result<Vec<(String, String)>, String> {
    let literal = |number: Number, value: &Value| -> Result<String, String> {
        Ok(match number {
            Number::Float(_) => format!("{:?}", float(value)?),
            _ => format!("{}U", unsigned(value)?),
        })
    };
    match &field.kind {
        _ if !field.bits.is_empty() => {
            let flags = unsigned(value)?;
            let outer = path.strip_suffix(&field.name).unwrap_or_default();
            let flag = |(bit, name): (u8, &String)| {
                let is_set = flags & u64::from(bit) != 0;
                (format!("{outer}{name}"), is_set.to_string())
            };
            Ok(field.flags().map(flag).collect())
        }
        Kind::One(number) => Ok(vec![(path.to_owned(), literal(*number, value)?)]),
        Kind::Array(number, length) => {
            let numbers = numbers(value)?.into_iter().enumerate();
            let element = |n| match field.counted_by {
                Some(_) => format!("{path}[{}][{}]", n / length, n % length),
                None => format!("{path}[{n}]"),
            };
            numbers
                .map(|(n, value)| Ok((element(n), literal(*number, &value)?)))
                .collect()
        }
        _ => Ok(Vec::new()),
    }
}
