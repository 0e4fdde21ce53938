//! `include/skyloop.h`: C99, one header, no allocation. What has no rule to be generated from is written by hand in `c/`.

pub mod can;
pub mod codecs;
pub mod vectors;

use crate::NOTE;
use crate::model::{Enum, Field, Kind, Message, Number, Receiver, Schema};

/// The whole header.
///
/// # Errors
/// A part in `c/` that cannot be read.
pub fn header(schema: &Schema) -> Result<String, String> {
    let part = |name: &str| crate::read(format!("schema/c/{name}.h"));
    let mut out = format!(
        "/* {NOTE}\n *\n * The native packets of skyloop, format version {0}: docs/icd.md describes every octet. C99, no allocation, no state.\n\
         \x20*\n * Towards the emulator: skyloop_encode_uplink, skyloop_decode_uplink; from it: skyloop_decode_downlink,\n\
         \x20* skyloop_encode_downlink. On serial lines skyloop_slip_*, on CAN skyloop_can_*. What decoders hand over as a pointer\n\
         \x20* points into the packet.\n */\n#ifndef SKYLOOP_H\n#define SKYLOOP_H\n\n#include <stdbool.h>\n\
         #include <stddef.h>\n#include <stdint.h>\n#include <string.h>\n\n\
         #define SKYLOOP_VERSION {0}U\n#define SKYLOOP_MAX_PACKET {1}U\n#define SKYLOOP_HEADER_LENGTH 15U\n\
         #define SKYLOOP_MAX_PAYLOAD (SKYLOOP_MAX_PACKET - SKYLOOP_HEADER_LENGTH - 2U)\n\n",
        schema.version, schema.max_packet
    );
    out += "/* Kinds of packets. */\n";
    for message in &schema.messages {
        out += &format!(
            "#define SKYLOOP_APID_{} {:#05X}U /* {} */\n",
            upper(&message.name),
            message.apid,
            message.doc
        )
        .replace("0X", "0x");
    }
    out += &("\n".to_owned() + &part("base")?);
    out += "\n/* ---- codes ------------------------------------------------------------------------------------------------------- */\n";
    for codes in &schema.enums {
        out += &enumeration(codes);
    }
    out += &opcodes(schema);
    out += "\n/* ---- messages ---------------------------------------------------------------------------------------------------- */\n";
    for structure in &schema.structs {
        out += &structure_text(
            schema,
            &structure.name,
            &structure.doc,
            &members(&structure.fields),
        );
        let length: Option<usize> = schema
            .flat(&structure.fields)
            .iter()
            .map(Field::octets)
            .sum();
        if let Some(length) = length {
            out += &format!(
                "#define SKYLOOP_{}_LENGTH {length}U\n",
                upper(&structure.name)
            );
        }
    }
    for message in &schema.messages {
        out += &structure_text(
            schema,
            message.type_name(),
            &message.doc,
            &message_members(schema, message),
        );
    }
    out += &links(schema);
    out += &("\n".to_owned() + &part("checks")?);
    out += &codecs::known(schema);
    out += &part("packet")?;
    out += &codecs::write(schema);
    out += &("\n".to_owned() + &part("can")?);
    out += &can::write(schema);
    out += "\n#endif\n";
    Ok(out)
}

/// `FrameHeader` as `frame_header`.
pub fn snake(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

/// `FrameHeader` as `FRAME_HEADER`.
pub fn upper(name: &str) -> String {
    snake(name).to_uppercase()
}

fn enumeration(codes: &Enum) -> String {
    let prefix = upper(&codes.name);
    let mut out = format!("\n/* {} */\n", codes.doc);
    for value in &codes.values {
        out += &format!(
            "#define SKYLOOP_{prefix}_{} {}U /* {} */\n",
            upper(&value.name),
            value.code,
            value.doc
        );
    }
    let known: Vec<String> = codes
        .values
        .iter()
        .map(|value| format!("(code == SKYLOOP_{prefix}_{})", upper(&value.name)))
        .collect();
    out + &format!(
        "\nstatic inline bool skyloop_is_{}(uint8_t code)\n{{\n    return {};\n}}\n",
        snake(&codes.name),
        known.join(" ||\n           ")
    )
}

fn opcodes(schema: &Schema) -> String {
    let mut out = "\n/* What a Command asks for. */\n".to_owned();
    for opcode in schema.messages.iter().flat_map(|message| &message.opcodes) {
        out += &format!(
            "#define SKYLOOP_OPCODE_{} {}U /* {} */\n",
            upper(&opcode.name),
            opcode.code,
            opcode.doc
        );
    }
    out
}

/// Name in C of a number's type.
pub fn number_type(number: Number) -> String {
    match number {
        Number::Unsigned(octets) => format!("uint{}_t", 8 * octets),
        Number::Float(4) => "float".to_owned(),
        Number::Float(_) => "double".to_owned(),
        Number::Time => "uint64_t".to_owned(),
    }
}

/// Declarations of members: type, name, comment.
type Members = Vec<(String, String, String)>;

fn members(fields: &[Field]) -> Members {
    let mut out = Vec::new();
    for field in fields {
        let unit = if field.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", field.unit)
        };
        let doc = format!("{}{unit}", field.doc.trim_end_matches('.'));
        let name = field.name.clone();
        match &field.kind {
            _ if !field.bits.is_empty() => {
                out.extend(
                    field
                        .bits
                        .iter()
                        .map(|bit| ("bool".to_owned(), bit.clone(), doc.clone())),
                );
            }
            Kind::One(number) => out.push((number_type(*number), name, doc)),
            Kind::Array(number, length) => {
                let most = if field.counted_by.is_some() {
                    format!("[{}]", field.most)
                } else {
                    String::new()
                };
                out.push((number_type(*number), format!("{name}{most}[{length}]"), doc));
            }
            Kind::Ascii(length) => {
                out.push(("uint8_t".to_owned(), format!("{name}[{length}]"), doc))
            }
            Kind::Struct(kind) => out.push((format!("skyloop_{}_t", snake(kind)), name, doc)),
            Kind::Rest(_) => {
                out.push(("const uint8_t *".to_owned(), name.clone(), doc));
                out.push((
                    "size_t".to_owned(),
                    format!("{name}_length"),
                    "its octets".to_owned(),
                ));
            }
        }
    }
    out
}

fn message_members(schema: &Schema, message: &Message) -> Members {
    if !message.opcodes.is_empty() {
        let mut union = "union {\n".to_owned();
        for opcode in message
            .opcodes
            .iter()
            .filter(|opcode| !schema.arguments(opcode).is_empty())
        {
            let name = snake(&opcode.name);
            union += &match &opcode.type_name {
                Some(kind) => format!("        skyloop_{}_t {name};\n", snake(kind)),
                None => {
                    let members = members(&opcode.fields);
                    let members = members.iter().map(|(kind, name, doc)| {
                        format!("            {} /* {doc} */\n", declared(kind, name))
                    });
                    format!(
                        "        struct {{\n{}        }} {name};\n",
                        members.collect::<String>()
                    )
                }
            };
        }
        let opcode = (
            "uint8_t".to_owned(),
            "opcode".to_owned(),
            "SKYLOOP_OPCODE_...".to_owned(),
        );
        return vec![
            opcode,
            (
                union + "    }",
                "as".to_owned(),
                "by opcode; those that are not here have no argument".to_owned(),
            ),
        ];
    }
    let mut fields = message.fields.clone();
    let flag = message
        .optional
        .as_ref()
        .map(|optional| optional.flag.clone());
    fields.retain(|field| Some(&field.name) != flag.as_ref());
    let mut out = members(&fields);
    if let Some(optional) = &message.optional {
        let at = fields
            .iter()
            .position(|field| field.optional)
            .unwrap_or(fields.len());
        out.insert(
            at,
            (
                "bool".to_owned(),
                format!("has_{}", optional.name),
                "whether the members below hold anything".to_owned(),
            ),
        );
    }
    if message.counters {
        let counters = schema.counters.iter().map(|counter| {
            (
                "uint32_t".to_owned(),
                counter.name.clone(),
                counter.doc.trim_end_matches('.').to_owned(),
            )
        });
        out.extend(counters);
    }
    out
}

fn declared(kind: &str, name: &str) -> String {
    match kind.strip_suffix('*') {
        Some(_) => format!("{kind}{name};"),
        None => format!("{kind} {name};"),
    }
}

fn structure_text(_schema: &Schema, name: &str, doc: &str, members: &Members) -> String {
    let mut out = format!("\n/* {doc} */\ntypedef struct {{\n");
    for (kind, name, doc) in members {
        out += &format!("    {} /* {doc} */\n", declared(kind, name));
    }
    out + &format!("}} skyloop_{}_t;\n", snake(name))
}

/// The messages of one direction and their union's name.
pub fn directions(schema: &Schema) -> [(&'static str, Vec<&Message>); 2] {
    let to = |receiver| {
        schema
            .messages
            .iter()
            .filter(|message| message.to == receiver)
            .collect()
    };
    [
        ("uplink", to(Receiver::Emulator)),
        ("downlink", to(Receiver::Client)),
    ]
}

fn links(schema: &Schema) -> String {
    let mut out = String::new();
    for (name, messages) in directions(schema) {
        let end = if name == "uplink" { "towards" } else { "from" };
        out += &format!(
            "\n/* Any packet {end} the emulator; header.apid says which. */\ntypedef struct {{\n    skyloop_header_t header;\n    union {{\n"
        );
        for message in messages {
            out += &format!(
                "        skyloop_{}_t {};\n",
                snake(message.type_name()),
                snake(message.type_name())
            );
        }
        out += &format!("    }} as;\n}} skyloop_{name}_t;\n");
    }
    out
}
