//! The messages in Rust: commands, the packets of a frame, answers; and the enums of each
//! direction.

use super::record::{field_range, read_value, rust_type, write_value};
use super::{WRITE, doc};
use crate::model::{Code, Field, Receiver, Record, Schema};
use crate::text::{block, braces, each, join, upper};

/// The packets of a client.
pub(super) fn commands(schema: &Schema) -> String {
    let imports = "use super::codes::{Direction, FaultKind, LabelLevel, Opcode, PixelLevel, apid};\n\
         use crate::error::{DecodeError, EncodeError};\nuse crate::rules::{finite, positive, rule};\n\
         use crate::time::WireTime;\nuse crate::wire::{Reader, Writer};\n";
    let structures = schema.opcodes().filter_map(|opcode| {
        let name = opcode.type_name.as_ref()?;
        schema.structure(name)
    });
    let records = plain(schema).chain(structures);
    format!(
        "{imports}{}{}",
        each(records, |record| record.rust(schema)),
        command(schema)
    )
}

/// The telecommands without opcodes.
fn plain(schema: &Schema) -> impl Iterator<Item = &Record> {
    let messages = schema.to(Receiver::Emulator);
    messages.filter(|message| message.opcodes.is_empty())
}

/// The last packet of a frame, which has a file of its own.
const END: &str = "FrameEnd";

/// The packets of a frame, without the last.
pub(super) fn frames(schema: &Schema) -> String {
    "use super::codes::{LabelLevel, Packing, PixelLevel};\nuse crate::error::{DecodeError, EncodeError};\n\
     use crate::rules::{positive, rule};\nuse crate::time::WireTime;\nuse crate::wire::{Reader, Writer};\n"
        .to_owned()
        + &each(inner_packets(schema), |message| of_frame(schema, message))
}

/// The last packet of a frame.
pub(super) fn ends(schema: &Schema) -> String {
    let end = schema.messages.iter().filter(|message| message.name == END);
    "use super::codes::{AttitudeSource, Overrun, SyncState};\nuse crate::error::{DecodeError, EncodeError};\n\
     use crate::rules::rule;\nuse crate::wire::{Reader, Writer};\n"
        .to_owned()
        + &each(end, |message| of_frame(schema, message))
}

/// A packet of a frame and the structures of its fields.
fn of_frame(schema: &Schema, message: &Record) -> String {
    let fields = message.fields.iter();
    let structures = fields.filter_map(|field| schema.inner(field).or(schema.record(field)));
    each([message].into_iter().chain(structures), |record| {
        record.rust(schema) + &record.length(schema)
    })
}

/// Whether a message is part of a frame: its time is the time of the exposure.
fn is_of_frame(message: &Record) -> bool {
    message.time.contains("exposure") || message.time.contains("FrameHeader")
}

/// The packets of a frame, without the last.
fn inner_packets(schema: &Schema) -> impl Iterator<Item = &Record> {
    let messages = schema.to(Receiver::Client);
    messages.filter(|message| is_of_frame(message) && message.name != END)
}

/// The other packets, and the enum of all packets.
pub(super) fn answers(schema: &Schema) -> String {
    let names = join(inner_packets(schema).map(Record::type_name), ", ");
    let answers = schema
        .to(Receiver::Client)
        .filter(|message| !is_of_frame(message));
    format!(
        "use super::codes::{{Mode, Packing, Reason, SyncState, Withheld, apid}};\nuse super::commands::Output;\n\
         use super::counters::Counters;\nuse super::ends::{{FrameEnd, Timing}};\nuse super::frames::{{{names}}};\n\
         use crate::error::{{DecodeError, EncodeError}};\nuse crate::rules::{{positive, rule}};\n\
         use crate::time::WireTime;\nuse crate::wire::{{Reader, Writer}};\n{}{}",
        each(answers, |message| message.rust(schema)),
        reply(schema)
    )
}

/// A pattern of the names of these fields.
fn pattern<'a>(fields: impl Iterator<Item = &'a Field>, rest: &str) -> String {
    format!(
        " {{ {}{rest} }}",
        join(fields.map(|field| &field.name), ", ")
    )
}

/// The variants of an enum of messages, and the arms of its methods.
#[derive(Default)]
struct Arms {
    variants: String,
    /// Arms with the APID, or the opcode of a command.
    kinds: String,
    reads: String,
    writes: String,
    checks: String,
}

/// The enum of all messages of a client.
fn command(schema: &Schema) -> String {
    let mut arms = Arms::default();
    let mut apids = String::new();
    for message in plain(schema) {
        let (name, kind) = (&message.name, message.type_name());
        apids += &format!("Self::{name}(_) => apid::{},\n", upper(name));
        arms.kinds += &format!("Self::{name}(_) => None,\n");
        arms.add(name, &message.doc, &format!("({kind})"));
        arms.delegate(name);
    }
    for opcode in schema.opcodes() {
        arms.opcode(schema, opcode);
    }
    let read = "let opcode = reader.u8()?;\n\
                let known = Opcode::from_code(opcode).ok_or(DecodeError::UnknownOpcode { opcode })?;\n";
    let has_opcode = "if let Some(opcode) = self.opcode()";
    let mut write = block(has_opcode, "writer.u8(opcode.code())?;\n");
    write += &block("match self", &arms.writes);
    let methods = [
        (
            "/// The APID of its packet.\npub const fn apid(&self) -> u16",
            block("match self", &(apids + "_ => apid::COMMAND,\n")),
        ),
        (
            "/// The opcode of its packet; an attitude has none.\n\
             pub const fn opcode(&self) -> Option<Opcode>",
            block("match self", &arms.kinds),
        ),
        (
            "/// Refuses values that the fields do not allow. Every decoded command has passed this.\n\
             pub fn check(&self) -> Result<(), DecodeError>",
            block("match self", &(arms.checks + "_ => {}\n")) + "Ok(())\n",
        ),
        (
            "pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError>",
            format!("{read}{})\n", braces("Ok(match known", &arms.reads)),
        ),
        (WRITE, write + "Ok(())\n"),
    ];
    "\n/// Everything that a flight computer can say. The header's time of all but `Attitude` is the time of sending.\n"
        .to_owned()
        + &enumeration("Command", "", &arms.variants, methods)
}

fn enumeration<const N: usize>(
    name: &str,
    generics: &str,
    variants: &str,
    methods: [(&str, String); N],
) -> String {
    let methods = methods.map(|(head, body)| block(head, &body));
    let variants = block(&format!("pub enum {name}{generics}"), variants);
    let head = format!("impl{generics} {name}{generics}");
    let methods = block(&head, &methods.join("\n"));
    format!("#[derive(Debug, Clone, Copy, PartialEq)]\n{variants}\n{methods}")
}

impl Arms {
    fn add(&mut self, name: &str, about: &str, content: &str) {
        self.variants += &format!("{}{name}{content},\n", doc(about));
    }

    /// A variant with a type that has methods to write and check.
    fn delegate(&mut self, name: &str) {
        self.writes += &format!("Self::{name}(inner) => inner.write(writer)?,\n");
        self.checks += &format!("Self::{name}(inner) => inner.check()?,\n");
    }

    /// The variant of a command.
    fn opcode(&mut self, schema: &Schema, opcode: &Code) {
        let name = &opcode.name;
        let skipped = match &opcode.type_name {
            Some(kind) => {
                self.add(name, &opcode.doc, &format!("({kind})"));
                self.reads += &format!("Opcode::{name} => Self::{name}({kind}::read(reader)?),\n");
                self.delegate(name);
                "(_)"
            }
            None if opcode.fields.is_empty() => {
                self.add(name, &opcode.doc, "");
                self.reads += &format!("Opcode::{name} => Self::{name},\n");
                self.writes += &format!("Self::{name} => {{}}\n");
                ""
            }
            None => {
                self.members(schema, opcode);
                " { .. }"
            }
        };
        self.kinds += &format!("Self::{name}{skipped} => Some(Opcode::{name}),\n");
    }

    /// A variant with the fields of its command.
    fn members(&mut self, schema: &Schema, opcode: &Code) {
        let (name, fields) = (&opcode.name, &opcode.fields);
        let members = each(fields, |field| {
            format!("{}{}: {},\n", doc(&field.doc), field.name, rust_type(field))
        });
        self.add(name, &opcode.doc, &braces("", &members));
        let read = each(fields, |field| {
            format!("{}: {},\n", field.name, read_value(schema, name, field))
        });
        let read = braces(&format!("Opcode::{name} => Self::{name}"), &read);
        self.reads += &format!("{read},\n");
        let write = each(fields, |field| {
            write_value(field, &format!("*{}", field.name))
        });
        let pattern_of_all = pattern(fields.iter(), "");
        self.writes += &block(&format!("Self::{name}{pattern_of_all} =>"), &write);
        let range = |field: &Field| field_range(schema, name, field, "*");
        let ranged = || fields.iter().filter(|field| !range(field).is_empty());
        let check = each(fields, range);
        if !check.is_empty() {
            let rest = if ranged().count() < fields.len() {
                ", .."
            } else {
                ""
            };
            let check = check.trim().trim_end_matches(';');
            let pattern = pattern(ranged(), rest);
            self.checks += &format!("Self::{name}{pattern} => {check},\n");
        }
    }
}

/// The enum of all messages of the emulator.
fn reply(schema: &Schema) -> String {
    let mut arms = Arms::default();
    for message in schema.to(Receiver::Client) {
        let (name, kind, apid) = (&message.name, message.type_name(), upper(&message.name));
        let lifetime = if message.borrows { "<'a>" } else { "" };
        arms.add(name, &message.doc, &format!("({kind}{lifetime})"));
        arms.kinds += &format!("Self::{name}(_) => apid::{apid},\n");
        arms.reads += &format!("apid::{apid} => Self::{name}({kind}::read(reader)?),\n");
        arms.writes += &format!("Self::{name}(inner) => inner.write(writer),\n");
        arms.checks += &format!("Self::{name}(inner) => inner.check(),\n");
    }
    let reads = arms.reads + "apid => return Err(DecodeError::UnknownApid { apid }),\n";
    let methods = [
        (
            "/// The APID of its packet.\npub const fn apid(&self) -> u16",
            block("match self", &arms.kinds),
        ),
        (
            "/// Refuses values that the fields do not allow. Every decoded reply has passed this.\n\
             pub fn check(&self) -> Result<(), DecodeError>",
            block("match self", &arms.checks),
        ),
        (
            "pub(crate) fn read(apid: u16, reader: &mut Reader<'a>) -> Result<Self, DecodeError>",
            braces("Ok(match apid", &reads) + ")\n",
        ),
        (WRITE, block("match self", &arms.writes)),
    ];
    "\n/// Everything that the emulator can say.\n".to_owned()
        + &enumeration("Reply", "<'a>", &arms.variants, methods)
}
