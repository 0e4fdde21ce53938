//! The messages in Rust: commands, the packets of a frame, answers; and the two enums over them.

use super::doc;
use super::structures::{Structure, field_range, read_number, rust_type, write_value};
use crate::c::upper;
use crate::model::{Field, Kind, Message, Opcode, Receiver, Schema};

/// What a client sends.
pub(super) fn commands(schema: &Schema) -> String {
    let mut out = "use super::codes::{Direction, FaultKind, LabelLevel, Opcode, PixelLevel, apid};\n\
                   use crate::error::{DecodeError, EncodeError};\nuse crate::rules::{finite, positive, rule};\n\
                   use crate::time::WireTime;\nuse crate::wire::{Reader, Writer};\n"
        .to_owned();
    for message in to(schema, Receiver::Emulator).filter(|message| message.opcodes.is_empty()) {
        out += &of_message(message).text(schema);
    }
    let names: Vec<&str> = opcodes(schema)
        .iter()
        .filter_map(|opcode| opcode.type_name.as_deref())
        .collect();
    for name in names {
        out += &of_structure(schema, name);
    }
    out + &command(schema)
}

/// What closes a frame: it has a file of its own.
const END: &str = "FrameEnd";

/// The packets that take credit, but for the last of a frame.
pub(super) fn frames(schema: &Schema) -> String {
    "use super::codes::{LabelLevel, Packing, PixelLevel};\nuse crate::error::{DecodeError, EncodeError};\n\
     use crate::rules::{positive, rule};\nuse crate::time::WireTime;\nuse crate::wire::{Reader, Writer};\n"
        .to_owned()
        + &of_frame(schema, |message| message.name != END)
}

/// The last packet of a frame.
pub(super) fn ends(schema: &Schema) -> String {
    "use super::codes::{AttitudeSource, Overrun, SyncState};\nuse crate::error::{DecodeError, EncodeError};\n\
     use crate::rules::rule;\nuse crate::wire::{Reader, Writer};\n"
        .to_owned()
        + &of_frame(schema, |message| message.name == END)
}

/// The packets of a frame, with the structures that they hold.
fn of_frame(schema: &Schema, which: impl Fn(&Message) -> bool) -> String {
    let mut out = String::new();
    let messages = to(schema, Receiver::Client).filter(|message| is_of_frame(message));
    for message in messages.filter(|message| which(message)) {
        out += &of_message(message).text(schema);
        out += &length(
            schema,
            message.type_name(),
            message.borrows,
            &message.fields,
        );
        let structures = message.fields.iter().filter_map(|field| match &field.kind {
            Kind::Struct(name) => Some(name.as_str()),
            _ => field.record.as_deref(),
        });
        for name in structures {
            out += &of_structure(schema, name);
            if let Some(structure) = schema.structure(name) {
                out += &length(schema, name, false, &structure.fields);
            }
        }
    }
    out
}

/// How long the fields are that are always the same.
fn length(schema: &Schema, name: &str, borrows: bool, fields: &[Field]) -> String {
    let octets: usize = schema.flat(fields).iter().filter_map(Field::octets).sum();
    let lifetime = if borrows { "<'_>" } else { "" };
    format!(
        "\nimpl {name}{lifetime} {{\n    /// Octets of its fields, the rest of variable length aside.\n    pub const FIELDS_LENGTH: usize = {octets};\n}}\n"
    )
}

/// The other packets, and the enum over all.
pub(super) fn answers(schema: &Schema) -> String {
    let names: Vec<&str> = to(schema, Receiver::Client)
        .filter(|message| is_of_frame(message) && message.name != END)
        .map(Message::type_name)
        .collect();
    let mut out = format!(
        "use super::codes::{{Mode, Packing, Reason, SyncState, Withheld, apid}};\nuse super::commands::Output;\nuse super::counters::Counters;\nuse super::ends::{{FrameEnd, Timing}};\nuse super::frames::{{{}}};\n\
         use crate::error::{{DecodeError, EncodeError}};\nuse crate::rules::{{positive, rule}};\nuse crate::time::WireTime;\nuse crate::wire::{{Reader, Writer}};\n",
        names.join(", ")
    );
    for message in to(schema, Receiver::Client).filter(|message| !is_of_frame(message)) {
        out += &of_message(message).text(schema);
    }
    out + &reply(schema)
}

fn to(schema: &Schema, receiver: Receiver) -> impl Iterator<Item = &Message> {
    schema
        .messages
        .iter()
        .filter(move |message| message.to == receiver)
}

fn opcodes(schema: &Schema) -> Vec<&Opcode> {
    schema
        .messages
        .iter()
        .flat_map(|message| &message.opcodes)
        .collect()
}

/// Whether a message is part of a frame: its time is that of the exposure.
fn is_of_frame(message: &Message) -> bool {
    message.time.contains("exposure") || message.time.contains("FrameHeader")
}

fn of_message(message: &Message) -> Structure<'_> {
    Structure {
        name: message.type_name(),
        about: &message.doc,
        fields: &message.fields,
        optional: message.optional.as_ref(),
        borrows: message.borrows,
        counters: message.counters,
        private: false,
        default: false,
        check: message.check,
        encode_check: message.encode_check,
    }
}

fn of_structure(schema: &Schema, name: &str) -> String {
    let text = schema.structure(name).map(|structure| {
        let structure = Structure {
            name,
            about: &structure.doc,
            fields: &structure.fields,
            optional: None,
            borrows: false,
            counters: false,
            private: structure.private,
            default: structure.default,
            check: structure.check,
            encode_check: false,
        };
        structure.text(schema)
    });
    text.unwrap_or_default()
}

/// `{ seconds }`, `(inner)` or nothing.
fn pattern(opcode: &Opcode) -> String {
    match &opcode.type_name {
        Some(_) => "(inner)".to_owned(),
        None if opcode.fields.is_empty() => String::new(),
        None => {
            let names: Vec<&str> = opcode
                .fields
                .iter()
                .map(|field| field.name.as_str())
                .collect();
            format!(" {{ {} }}", names.join(", "))
        }
    }
}

/// The same with the fields that have a range.
fn judged(schema: &Schema, opcode: &Opcode) -> String {
    let has_range = |field: &&Field| !field_range(schema, &opcode.name, field, "*").is_empty();
    let ranged = opcode.fields.iter().filter(has_range);
    let names: Vec<&str> = ranged.map(|field| field.name.as_str()).collect();
    let rest = if names.len() < opcode.fields.len() {
        ", .."
    } else {
        ""
    };
    format!(" {{ {}{rest} }}", names.join(", "))
}

/// The enum of everything that a client can say.
fn command(schema: &Schema) -> String {
    let whole: Vec<&Message> = to(schema, Receiver::Emulator)
        .filter(|message| message.opcodes.is_empty())
        .collect();
    let (mut variants, mut codes, mut reads, mut writes, mut checks) = (
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
    );
    let mut apids = String::new();
    for message in &whole {
        let name = &message.name;
        variants += &(doc(&message.doc, 1) + &format!("    {name}({}),\n", message.type_name()));
        apids += &format!("            Self::{name}(_) => apid::{},\n", upper(name));
        codes += &format!("            Self::{name}(_) => None,\n");
        writes += &format!("            Self::{name}(inner) => inner.write(writer)?,\n");
        checks += &format!("            Self::{name}(inner) => inner.check()?,\n");
    }
    for opcode in opcodes(schema) {
        let name = &opcode.name;
        variants += &doc(&opcode.doc, 1);
        let skipped = match &opcode.type_name {
            Some(kind) => {
                variants += &format!("    {name}({kind}),\n");
                reads += &format!(
                    "            Opcode::{name} => Self::{name}({kind}::read(reader)?),\n"
                );
                writes += &format!("            Self::{name}(inner) => inner.write(writer)?,\n");
                checks += &format!("            Self::{name}(inner) => inner.check()?,\n");
                "(_)"
            }
            None if opcode.fields.is_empty() => {
                variants += &format!("    {name},\n");
                reads += &format!("            Opcode::{name} => Self::{name},\n");
                writes += &format!("            Self::{name} => {{}}\n");
                ""
            }
            None => {
                let members = opcode.fields.iter().map(|field| {
                    doc(&field.doc, 2) + &format!("        {}: {},\n", field.name, rust_type(field))
                });
                variants += &format!("    {name} {{\n{}    }},\n", members.collect::<String>());
                let read = opcode.fields.iter().map(|field| match &field.kind {
                    Kind::One(number) => format!(
                        "                {}: {},\n",
                        field.name,
                        read_number(*number)
                    ),
                    _ => String::new(),
                });
                reads += &format!(
                    "            Opcode::{name} => Self::{name} {{\n{}            }},\n",
                    read.collect::<String>()
                );
                let write = opcode.fields.iter().map(|field| {
                    format!(
                        "                {}?;\n",
                        write_value(field, &format!("*{}", field.name))
                    )
                });
                writes += &format!(
                    "            Self::{name}{} => {{\n{}            }}\n",
                    pattern(opcode),
                    write.collect::<String>()
                );
                let check: String = opcode
                    .fields
                    .iter()
                    .map(|field| field_range(schema, name, field, "*"))
                    .collect();
                if !check.is_empty() {
                    let check = check.trim().trim_end_matches(';').to_owned();
                    let judged = judged(schema, opcode);
                    checks += &format!("            Self::{name}{judged} => {check},\n");
                }
                " { .. }"
            }
        };
        codes += &format!("            Self::{name}{skipped} => Some(Opcode::{name}),\n");
    }
    format!(
        "\n/// Everything that a flight computer can say. The header's time of all but `Attitude` is the time of sending.\n#[derive(Debug, Clone, Copy, PartialEq)]\npub enum Command {{\n{variants}}}\n\nimpl Command {{\n    /// The APID of its packet.\n    pub const fn apid(&self) -> u16 {{\n        match self {{\n{apids}            _ => apid::COMMAND,\n        }}\n    }}\n\n    /// The opcode of its packet; an attitude has none.\n    pub const fn opcode(&self) -> Option<Opcode> {{\n        match self {{\n{codes}        }}\n    }}\n\n    /// Refuses values that the fields do not allow. Every decoded command has passed this.\n    pub fn check(&self) -> Result<(), DecodeError> {{\n        match self {{\n{checks}            _ => {{}}\n        }}\n        Ok(())\n    }}\n\n    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {{\n        let opcode = reader.u8()?;\n        let known = Opcode::from_code(opcode).ok_or(DecodeError::UnknownOpcode {{ opcode }})?;\n        Ok(match known {{\n{reads}        }})\n    }}\n\n    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {{\n        if let Some(opcode) = self.opcode() {{\n            writer.u8(opcode.code())?;\n        }}\n        match self {{\n{writes}        }}\n        Ok(())\n    }}\n}}\n"
    )
}

/// The enum of everything that the emulator can say.
fn reply(schema: &Schema) -> String {
    let (mut variants, mut apids, mut reads, mut writes, mut checks) = (
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
    );
    for message in to(schema, Receiver::Client) {
        let (name, kind) = (&message.name, message.type_name());
        let lifetime = if message.borrows { "<'a>" } else { "" };
        variants += &(doc(&message.doc, 1) + &format!("    {name}({kind}{lifetime}),\n"));
        apids += &format!("            Self::{name}(_) => apid::{},\n", upper(name));
        reads += &format!(
            "            apid::{} => Self::{name}({kind}::read(reader)?),\n",
            upper(name)
        );
        writes += &format!("            Self::{name}(inner) => inner.write(writer),\n");
        checks += &format!("            Self::{name}(inner) => inner.check(),\n");
    }
    format!(
        "\n/// Everything that the emulator can say.\n#[derive(Debug, Clone, Copy, PartialEq)]\npub enum Reply<'a> {{\n{variants}}}\n\nimpl<'a> Reply<'a> {{\n    /// The APID of its packet.\n    pub const fn apid(&self) -> u16 {{\n        match self {{\n{apids}        }}\n    }}\n\n    /// Refuses values that the fields do not allow. Every decoded reply has passed this.\n    pub fn check(&self) -> Result<(), DecodeError> {{\n        match self {{\n{checks}        }}\n    }}\n\n    pub(crate) fn read(apid: u16, reader: &mut Reader<'a>) -> Result<Self, DecodeError> {{\n        Ok(match apid {{\n{reads}            apid => return Err(DecodeError::UnknownApid {{ apid }}),\n        }})\n    }}\n\n    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {{\n        match self {{\n{writes}        }}\n    }}\n}}\n"
    )
}
