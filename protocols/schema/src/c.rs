//! `include/skyloop.h`: C99, one header, no allocation. The parts in `c/` are written by hand.

mod can;
mod codecs;
pub mod vectors;

use crate::NOTE;
use crate::model::{Enum, Field, Kind, Number, Receiver, Record, Schema};
use crate::text::{block, braces, each, indent, join, snake, upper};

/// The whole header.
///
/// # Errors
/// A part in `c/` that cannot be read.
pub fn header(schema: &Schema) -> Result<String, String> {
    let part = |name: &str| crate::read(format!("schema/c/{name}.h"));
    let (version, max_packet) = (schema.version, schema.max_packet);
    let mut out = format!(
        "/* {NOTE}\n *\n * The native packets of skyloop, format version {version}: docs/icd.md describes every octet. C99, no allocation, no state.\n\
         \x20*\n * Towards the emulator: skyloop_encode_uplink, skyloop_decode_uplink; from it: skyloop_decode_downlink,\n\
         \x20* skyloop_encode_downlink. On serial lines skyloop_slip_*, on CAN skyloop_can_*. What decoders hand over as a pointer\n\
         \x20* points into the packet.\n */\n#ifndef SKYLOOP_H\n#define SKYLOOP_H\n\n#include <stdbool.h>\n\
         #include <stddef.h>\n#include <stdint.h>\n#include <string.h>\n\n\
         #define SKYLOOP_VERSION {version}U\n#define SKYLOOP_MAX_PACKET {max_packet}U\n#define SKYLOOP_HEADER_LENGTH 15U\n\
         #define SKYLOOP_MAX_PAYLOAD (SKYLOOP_MAX_PACKET - SKYLOOP_HEADER_LENGTH - 2U)\n\n"
    );
    out += "/* Kinds of packets. */\n";
    out += &each(&schema.messages, |message| {
        let (name, apid, doc) = (upper(&message.name), message.apid, &message.doc);
        format!("#define SKYLOOP_APID_{name} 0x{apid:03X}U /* {doc} */\n")
    });
    out += &format!("\n{}", part("base")?);
    out += "\n/* ---- codes ------------------------------------------------------------------------------------------------------- */\n";
    out += &each(&schema.enums, enumeration);
    out += "\n/* What a Command asks for. */\n";
    out += &each(schema.opcodes(), |opcode| {
        code("OPCODE", &opcode.name, opcode.code, &opcode.doc)
    });
    out += "\n/* ---- messages ---------------------------------------------------------------------------------------------------- */\n";
    for structure in &schema.structs {
        out += &type_text(structure, &members(&structure.fields));
        let fields = schema.flat(&structure.fields);
        if let Some(length) = fields.iter().map(Field::bytes).sum::<Option<usize>>() {
            let name = upper(&structure.name);
            out += &format!("#define SKYLOOP_{name}_LENGTH {length}U\n");
        }
    }
    for message in &schema.messages {
        out += &type_text(message, &message_members(schema, message));
    }
    out += &each(DIRECTIONS, |direction| link(schema, direction));
    out += &format!("\n{}", part("checks")?);
    out += &codecs::known(schema);
    out += &part("packet")?;
    out += &codecs::write(schema);
    out += &format!("\n{}", part("can")?);
    out += &can::write(schema);
    out += "\n#endif\n";
    Ok(out)
}

/// The two directions and the receivers of their packets.
const DIRECTIONS: [(&str, Receiver); 2] = [
    ("uplink", Receiver::Emulator),
    ("downlink", Receiver::Client),
];

fn code(prefix: &str, name: &str, code: u8, doc: &str) -> String {
    let name = upper(name);
    format!("#define SKYLOOP_{prefix}_{name} {code}U /* {doc} */\n")
}

fn enumeration(codes: &Enum) -> String {
    let (prefix, doc) = (upper(&codes.name), &codes.doc);
    let defines = each(&codes.values, |value| {
        code(&prefix, &value.name, value.code, &value.doc)
    });
    let names = codes.values.iter().map(|value| upper(&value.name));
    let known = names.map(|name| format!("(code == SKYLOOP_{prefix}_{name})"));
    let known = format!("return {};\n", join(known, " ||\n       "));
    let signature = format!("bool skyloop_is_{}(uint8_t code)", snake(&codes.name));
    format!("\n/* {doc} */\n{defines}\n{}", function(&signature, &known))
}

/// A function; its body without indentation.
fn function(signature: &str, body: &str) -> String {
    format!("static inline {signature}\n{{\n{}}}\n", indent(body, 4))
}

/// A `switch` with its cases at the same indentation.
fn switch(on: &str, cases: &str, default: &str) -> String {
    format!("switch ({on}) {{\n{cases}{}}}\n", case("default", default))
}

fn case(label: &str, body: &str) -> String {
    format!("{label}:\n{}    break;\n", indent(body, 4))
}

fn when(condition: &str, body: &str) -> String {
    block(&format!("if ({condition})"), body)
}

/// The loop that gives `n` each value below `length`.
fn count_to(length: usize, body: &str) -> String {
    block(&format!("for (size_t n = 0U; n < {length}U; n++)"), body)
}

fn number_type(number: Number) -> String {
    match number {
        Number::Unsigned(bytes) => format!("uint{}_t", 8 * bytes),
        Number::Float(4) => "float".to_owned(),
        Number::Float(_) => "double".to_owned(),
        Number::Time => "uint64_t".to_owned(),
    }
}

fn type_name(name: &str) -> String {
    format!("skyloop_{}_t", snake(name))
}

/// One member of a type, with its comment.
fn member(kind: &str, name: &str, doc: &str) -> String {
    let blank = if kind.ends_with('*') { "" } else { " " };
    format!("{kind}{blank}{name}; /* {doc} */\n")
}

fn members<'a>(fields: impl IntoIterator<Item = &'a Field>) -> String {
    each(fields, |field| {
        let (name, max) = (field.name.as_str(), field.most);
        let mut doc = field.doc.trim_end_matches('.').to_owned();
        if !field.unit.is_empty() {
            doc += &format!(" [{}]", field.unit);
        }
        let array = |number: &Number, size: String| {
            member(&number_type(*number), &format!("{name}{size}"), &doc)
        };
        match (&field.kind, &field.counted_by) {
            _ if !field.bits.is_empty() => each(&field.bits, |bit| member("bool", bit, &doc)),
            (Kind::One(number), _) => array(number, String::new()),
            (Kind::Array(number, length), None) => array(number, format!("[{length}]")),
            (Kind::Array(number, length), Some(_)) => array(number, format!("[{max}][{length}]")),
            (Kind::Ascii(length), _) => array(&Number::Unsigned(1), format!("[{length}]")),
            (Kind::Struct(kind), _) => member(&type_name(kind), name, &doc),
            (Kind::Rest(_), _) => {
                let length = format!("{name}_length");
                member("const uint8_t *", name, &doc) + &member("size_t", &length, "its octets")
            }
        }
    })
}

fn message_members(schema: &Schema, message: &Record) -> String {
    if !message.opcodes.is_empty() {
        let union = each(&message.opcodes, |opcode| {
            let name = snake(&opcode.name);
            match &opcode.type_name {
                Some(kind) => format!("{} {name};\n", type_name(kind)),
                None if opcode.fields.is_empty() => String::new(),
                None => format!("{} {name};\n", braces("struct", &members(&opcode.fields))),
            }
        });
        let doc = "by opcode; those that are not here have no argument";
        return member("uint8_t", "opcode", "SKYLOOP_OPCODE_...")
            + &member(&braces("union", &union), "as", doc);
    }
    let own = |field: &&Field| !field.optional && !message.is_flag(field);
    let mut out = members(message.fields.iter().filter(own));
    if let Some(optional) = &message.optional {
        let name = format!("has_{}", optional.name);
        out += &member("bool", &name, "whether the members below hold anything");
        out += &members(message.fields.iter().filter(|field| field.optional));
    }
    if message.counters {
        out += &members(&schema.counters);
    }
    out
}

fn type_text(record: &Record, members: &str) -> String {
    let (doc, name) = (&record.doc, type_name(record.type_name()));
    format!(
        "\n/* {doc} */\n{} {name};\n",
        braces("typedef struct", members)
    )
}

/// The type of any packet of one direction.
fn link(schema: &Schema, (name, receiver): (&str, Receiver)) -> String {
    let end = match receiver {
        Receiver::Emulator => "towards",
        Receiver::Client => "from",
    };
    let union = each(schema.to(receiver), |message| {
        let name = message.type_name();
        format!("{} {};\n", type_name(name), snake(name))
    });
    let members = format!(
        "skyloop_header_t header;\n{} as;\n",
        braces("union", &union)
    );
    let link = braces("typedef struct", &members);
    format!(
        "\n/* Any packet {end} the emulator; header.apid says which. */\n{link} skyloop_{name}_t;\n"
    )
}
