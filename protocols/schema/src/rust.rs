//! The Rust codecs: `protocols/src/generated/`. Rules between fields stay in the modules that re-export these types.

mod messages;
mod record;

use crate::NOTE;
use crate::icd::cell;
use crate::model::{Receiver, Schema};
use crate::text::{block, braces, each, indent, join, upper};

/// The files.
pub fn files(schema: &Schema) -> Vec<(String, String)> {
    let inside = ["answers", "codes", "commands", "counters", "ends", "frames"];
    let files = [
        (
            "mod",
            "What `schema/packets.toml` says: codes, messages, how they are read and written.",
            each(inside, |name| format!("pub mod {name};\n")),
        ),
        (
            "codes",
            "Numbers with a name: versions, limits, kinds of packets, codes of fields.",
            codes(schema),
        ),
        (
            "counters",
            "The counters of `Status`, in the order of the wire.",
            counters(schema),
        ),
        (
            "commands",
            "What a client sends.",
            messages::commands(schema),
        ),
        (
            "frames",
            "The packets of a frame.",
            messages::frames(schema),
        ),
        ("ends", "What closes a frame.", messages::ends(schema)),
        (
            "answers",
            "The answers of the emulator, and all of its packets.",
            messages::answers(schema),
        ),
    ];
    let file = |(name, about, text): (&str, &str, String)| {
        let path = format!("src/generated/{name}.rs");
        (path, format!("// {NOTE}\n//! {about}\n\n{text}"))
    };
    files.map(file).into()
}

/// The head of every writer.
const WRITE: &str =
    "pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError>";

/// A doc comment.
fn doc(text: &str) -> String {
    format!("/// {text}\n")
}

fn codes(schema: &Schema) -> String {
    let Schema {
        version,
        max_packet,
        ..
    } = schema;
    let mut out = format!(
        "use crate::wire::wire_enum;\n\n\
         /// Version of these formats, in the secondary header.\npub const VERSION: u8 = {version};\n\
         /// Longest packet in octets, headers and CRC included: fits a UDP datagram on Ethernet unfragmented.\n\
         pub const MAX_PACKET: usize = {max_packet};\n"
    );
    for codes in &schema.enums {
        let values = codes.values.iter();
        let values = values.map(|value| (&value.name, value.code, &value.doc));
        out += &enumeration(&codes.name, &codes.doc, values);
    }
    let opcodes = schema
        .opcodes()
        .map(|opcode| (&opcode.name, opcode.code, &opcode.doc));
    out += &enumeration(
        "Opcode",
        "First payload octet of a `Command` packet.",
        opcodes,
    );
    out += "\n/// Application process identifiers: one a message kind.\n";
    out + &block("pub mod apid", &apids(schema))
}

fn enumeration<'a>(
    name: &str,
    about: &str,
    values: impl Iterator<Item = (&'a String, u8, &'a String)>,
) -> String {
    let values = each(values, |(name, code, about)| {
        format!("{}{name} = {code},\n", doc(about))
    });
    let body = doc(about) + &block(&format!("pub enum {name}: u8"), &values);
    format!("\n{}", block("wire_enum!", &body))
}

fn apids(schema: &Schema) -> String {
    let messages = &schema.messages;
    let constants = each(messages, |message| {
        let direction = match message.to {
            Receiver::Emulator => "Towards the emulator",
            Receiver::Client => "From the emulator",
        };
        let (name, apid) = (upper(&message.name), message.apid);
        let about = doc(&format!("{direction}: {}.", cell(&message.doc)));
        format!("{about}pub const {name}: u16 = {apid:#05x};\n")
    });
    let rows = each(messages, |message| {
        format!("({}, \"{}\"),\n", upper(&message.name), message.name)
    });
    let telecommands = schema.to(Receiver::Emulator);
    let telecommands = join(telecommands.map(|message| upper(&message.name)), " | ");
    let (count, rows) = (messages.len(), indent(&rows, 4));
    format!(
        "{constants}\n\
         /// All of them with their names in the ICD.\n\
         pub const ALL: [(u16, &str); {count}] = [\n{rows}];\n\n\
         /// Whether packets with this APID go towards the emulator (type bit 1).\n{}\n\
         /// The row of [`ALL`] that holds this APID.\n{}",
        block(
            "pub const fn is_telecommand(apid: u16) -> bool",
            &format!("matches!(apid, {telecommands})\n")
        ),
        block(
            "pub fn index(apid: u16) -> Option<usize>",
            "ALL.iter().position(|(known, _)| *known == apid)\n"
        ),
    )
}

fn counters(schema: &Schema) -> String {
    let names = each(&schema.counters, |counter| {
        format!("{}{},\n", doc(&counter.doc), counter.name)
    });
    let reasons = schema.enums.iter().flat_map(|codes| &codes.values);
    let mut arms: Vec<(&str, Vec<String>)> = Vec::new();
    for value in reasons {
        let Some(counter) = &value.counter else {
            continue;
        };
        let reason = format!("Reason::{}", value.name);
        match arms.iter_mut().find(|(known, _)| known == counter) {
            Some((_, reasons)) => reasons.push(reason),
            None => arms.push((counter, vec![reason])),
        }
    }
    let arms = each(arms, |(counter, reasons)| {
        format!("{} => &mut self.{counter},\n", reasons.join(" | "))
    });
    let body =
        braces("let counter = match reason", &arms) + ";\n*counter = counter.wrapping_add(1);\n";
    let refuse = doc("Counts one packet refused for this reason.")
        + &block("pub fn refuse(&mut self, reason: Reason)", &body);
    format!(
        "use super::codes::Reason;\nuse crate::wire::counters;\n\n{}\n{}",
        block("counters!", &names),
        block("impl Counters", &refuse)
    )
}
