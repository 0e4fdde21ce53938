//! `vectors/golden.h`: the golden vectors as C, for `tests/independent/check.c`.

use toml::Value;

use super::{snake, upper};
use crate::NOTE;
use crate::encode::{compressed, float, numbers, unsigned};
use crate::model::{Field, Kind, Number, Receiver, Schema};
use crate::vectors::{Good, Vectors};

/// The whole file.
///
/// # Errors
/// A vector of no message.
pub fn write(schema: &Schema, vectors: &Vectors) -> Result<String, String> {
    let mut out = format!("/* {NOTE} */\n");
    let mut calls = String::new();
    for (number, vector) in vectors.good.iter().enumerate() {
        out += &good(schema, vector, number)?;
        calls += &format!("    good_{number}();\n");
    }
    for (number, vector) in vectors.bad.iter().enumerate() {
        let error = upper(&vector.error);
        let end = if vector.receiver == "emulator" {
            "uplink"
        } else {
            "downlink"
        };
        out += &format!(
            "\nstatic void bad_{number}(void)\n{{\n{}",
            octets("packet", &vector.octets)
        );
        out += &format!(
            "    REFUSED({end}, {:?}, packet, {}U, SKYLOOP_{error});\n}}\n",
            vector.name,
            vector.octets.len()
        );
        calls += &format!("    bad_{number}();\n");
    }
    for (number, (name, packet, frame)) in vectors.serial.iter().enumerate() {
        out += &format!(
            "\nstatic void serial_{number}(void)\n{{\n{}{}",
            octets("packet", packet),
            octets("line", frame)
        );
        out +=
            &format!("    check_serial({name:?}, packet, sizeof packet, line, sizeof line);\n}}\n");
        calls += &format!("    serial_{number}();\n");
    }
    for (number, (name, of, frames)) in vectors.can.iter().enumerate() {
        let vector = vectors
            .good
            .iter()
            .find(|vector| vector.name == *of)
            .ok_or(format!("no vector {of}"))?;
        out += &format!(
            "\nstatic void can_{number}(void)\n{{\n    static const skyloop_can_frame_t frames[] = {{\n"
        );
        for (id, data) in frames {
            let data: Vec<String> = data.iter().map(|octet| format!("0x{octet:02x}")).collect();
            out += &format!(
                "        {{{id:#05x}U, {}U, {{{}}}}},\n",
                data.len(),
                data.join(", ")
            );
        }
        out += &format!("    }};\n{}", octets("packet", &vector.octets));
        let kind = snake(&vector.message);
        out += &format!(
            "    check_can_{kind}({name:?}, packet, sizeof packet, frames, sizeof frames / sizeof frames[0]);\n}}\n"
        );
        calls += &format!("    can_{number}();\n");
    }
    out += &format!("\nstatic void golden(void)\n{{\n{calls}}}\n");
    Ok(out)
}

fn octets(name: &str, octets: &[u8]) -> String {
    let lines: Vec<String> = octets
        .chunks(20)
        .map(|line| {
            line.iter()
                .map(|octet| format!("0x{octet:02x}, "))
                .collect::<String>()
        })
        .map(|line| format!("        {}\n", line.trim_end()))
        .collect();
    let inside = if octets.is_empty() {
        "        0\n".to_owned()
    } else {
        lines.concat()
    };
    format!("    static const uint8_t {name}[] = {{\n{inside}    }};\n")
}

/// Builds the message, encodes it, decodes it, compares both ways.
fn good(schema: &Schema, vector: &Good, number: usize) -> Result<String, String> {
    let message = schema
        .message(&vector.message)
        .ok_or(format!("no message {}", vector.message))?;
    let link = if message.to == Receiver::Emulator {
        "uplink"
    } else {
        "downlink"
    };
    let mut base = format!("as.{}", snake(message.type_name()));
    let (mut set, mut same) = (String::new(), String::new());
    if let Some(opcode) = &vector.opcode {
        set += &format!(
            "    made.{base}.opcode = SKYLOOP_OPCODE_{};\n",
            upper(opcode)
        );
        same += &format!(
            "    SAME(got.{base}.opcode, SKYLOOP_OPCODE_{});\n",
            upper(opcode)
        );
        base += &format!(".as.{}", snake(opcode));
    }
    if let Some(optional) = &message.optional {
        let present = vector.fields.iter().any(|(field, _)| field.optional);
        set += &format!("    made.{base}.has_{} = {present};\n", optional.name);
        same += &format!("    SAME(got.{base}.has_{}, {present});\n", optional.name);
    }
    let nested = |name: &str| {
        let mut inner = message.fields.iter().filter_map(|field| match &field.kind {
            Kind::Struct(kind) => schema.structure(kind).map(|structure| (field, structure)),
            _ => None,
        });
        inner
            .find(|(_, structure)| structure.fields.iter().any(|field| field.name == name))
            .map(|(field, _)| field.name.clone())
    };
    let fixed: usize = vector
        .fields
        .iter()
        .filter_map(|(field, _)| field.octets())
        .sum();
    let rest = vector
        .octets
        .get(15 + fixed..vector.octets.len() - 2)
        .unwrap_or_default();
    for (field, value) in &vector.fields {
        let path = match nested(&field.name) {
            Some(outer) => format!("{base}.{outer}.{}", field.name),
            None => format!("{base}.{}", field.name),
        };
        match &field.kind {
            Kind::Rest(_) => {
                if value.get("rice").is_some() {
                    let (bits, pixels) = compressed(value)?;
                    let pixels: Vec<String> =
                        pixels.iter().map(|pixel| format!("{pixel}U")).collect();
                    let pixels = pixels
                        .chunks(20)
                        .map(|line| format!("        {},\n", line.join(", ")));
                    same += &format!(
                        "    static const uint16_t pixels[] = {{\n{}    }};\n    check_compressed(got.{path}, got.{path}_length, {bits}U, pixels, sizeof pixels / sizeof pixels[0]);\n",
                        pixels.collect::<String>()
                    );
                }
                set += &octets("rest", rest);
                set += &format!(
                    "    made.{path} = rest;\n    made.{path}_length = {}U;\n",
                    rest.len()
                );
                same += &format!(
                    "    SAME(got.{path}_length, {0}U);\n    CHECK(memcmp(got.{path}, rest, {0}U) == 0);\n",
                    rest.len()
                );
            }
            _ => {
                for (path, literal, is_float) in numbers_of(field, value, &path)? {
                    set += &format!("    made.{path} = {literal};\n");
                    same += &match is_float {
                        true => format!(
                            "    SAME(skyloop_f64_bits(got.{path}), skyloop_f64_bits({literal}));\n"
                        ),
                        false => format!("    SAME(got.{path}, {literal});\n"),
                    };
                }
            }
        }
    }
    Ok(format!(
        "\nstatic void good_{number}(void)\n{{\n{}    skyloop_{link}_t made;\n    skyloop_{link}_t got;\n    (void)memset(&made, 0, sizeof made);\n    made.header.apid = SKYLOOP_APID_{};\n    made.header.sequence_count = {}U;\n    made.header.time = {:#x}U;\n{set}    TAKEN({link}, {:?}, packet, made, got);\n{same}    RELEASE();\n}}\n",
        octets("packet", &vector.octets),
        upper(&message.name),
        vector.count,
        vector.time,
        vector.name
    ))
}

/// Place, literal and whether it is a float, of each number of a field.
fn numbers_of(
    field: &Field,
    value: &Value,
    path: &str,
) -> Result<Vec<(String, String, bool)>, String> {
    let literal = |number: Number, value: &Value| -> Result<(String, bool), String> {
        Ok(match number {
            Number::Float(_) => (format!("{:?}", float(value)?), true),
            _ => (format!("{}U", unsigned(value)?), false),
        })
    };
    match &field.kind {
        _ if !field.bits.is_empty() => {
            let flags = unsigned(value)?;
            let outer = path.strip_suffix(&field.name).unwrap_or_default();
            let bits = field.bits.iter().enumerate();
            let flag = |(bit, name): (usize, &String)| {
                (
                    format!("{outer}{name}"),
                    (flags >> bit & 1 == 1).to_string(),
                    false,
                )
            };
            Ok(bits.map(flag).collect())
        }
        Kind::One(number) => {
            let (literal, is_float) = literal(*number, value)?;
            Ok(vec![(path.to_owned(), literal, is_float)])
        }
        Kind::Array(number, length) => {
            let mut out = Vec::new();
            for (n, value) in numbers(value)?.iter().enumerate() {
                let (literal, is_float) = literal(*number, value)?;
                let place = match field.counted_by {
                    Some(_) => format!("{path}[{}][{}]", n / length, n % length),
                    None => format!("{path}[{n}]"),
                };
                out.push((place, literal, is_float));
            }
            Ok(out)
        }
        _ => Ok(Vec::new()),
    }
}
