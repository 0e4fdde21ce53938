//! The Rust codecs: `protocols/src/generated/`. Rules between fields are in the modules that
//! re-export these types.

mod messages;
mod record;

use crate::NOTE;
use crate::icd::cell;
use crate::model::{Code, Receiver, Schema};
use crate::text::{block, braces, each, indent, join, upper};

/// Path and text of each file.
pub fn files(schema: &Schema) -> Vec<(String, String)> {
    let inside = ["answers", "codes", "commands", "counters", "ends", "frames"];
    let modules = each(inside, |name| format!("pub mod {name};\n"));
    let file = |name: &str, about: &str, text: String| {
        let path = format!("src/generated/{name}.rs");
        (path, format!("// {NOTE}\n//! {about}\n\n{text}"))
    };
    let all = "What `schema/packets.toml` says: codes, messages, how they are read and written.";
    let numbers = "Numbers with a name: versions, limits, kinds of packets, codes of fields.";
    let order = "The counters of `Status`, in the order of the wire.";
    let answers = "The answers of the emulator, and all of its packets.";
    vec![
        file("mod", all, modules),
        file("codes", numbers, codes(schema)),
        file("counters", order, counters(schema)),
        file(
            "commands",
            "What a client sends.",
            messages::commands(schema),
        ),
        file(
            "frames",
            "The packets of a frame.",
            messages::frames(schema),
        ),
        file("ends", "What closes a frame.", messages::ends(schema)),
        file("answers", answers, messages::answers(schema)),
    ]
}

/// The signature of every writer.
const WRITE: &str =
    "pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError>";

fn doc(text: &str) -> String {
    format!("/// {text}\n")
}

fn codes(schema: &Schema) -> String {
    let (version, max_packet) = (schema.version, schema.max_packet);
    let about_version = doc("Version of these formats, in the secondary header.");
    let about_length = doc("Longest packet in octets, headers and CRC included: \
                            fits a UDP datagram on Ethernet unfragmented.");
    let mut out = format!(
        "use crate::table::wire_enum;\n\n\
         {about_version}pub const VERSION: u8 = {version};\n\
         {about_length}pub const MAX_PACKET: usize = {max_packet};\n"
    );
    for codes in &schema.enums {
        out += &enumeration(&codes.name, &codes.doc, &codes.values);
    }
    let opcodes = "First payload octet of a `Command` packet.";
    out += &enumeration("Opcode", opcodes, schema.opcodes());
    out += "\n/// Application process identifiers: one a message kind.\n";
    out + &block("pub mod apid", &apids(schema))
}

fn enumeration<'a>(name: &str, about: &str, values: impl IntoIterator<Item = &'a Code>) -> String {
    let values = each(
        values,
        |Code {
             name, code, doc, ..
         }| { format!("/// {doc}\n{name} = {code},\n") },
    );
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
        let about = cell(&message.doc);
        format!("/// {direction}: {about}.\npub const {name}: u16 = {apid:#05x};\n")
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
         /// Whether packets with this APID go towards the emulator (type bit 1).\n\
         pub const fn is_telecommand(apid: u16) -> bool {{\n\
         \x20   matches!(apid, {telecommands})\n}}\n\n\
         /// The row of [`ALL`] that holds this APID.\n\
         pub fn index(apid: u16) -> Option<usize> {{\n\
         \x20   ALL.iter().position(|(known, _)| *known == apid)\n}}\n"
    )
}

fn counters(schema: &Schema) -> String {
    let names = each(&schema.counters, |counter| {
        format!("{}{},\n", doc(&counter.doc), counter.name)
    });
    let codes = schema.enums.iter().flat_map(|codes| &codes.values);
    let reasons = codes.filter_map(|code| Some((code.counter.as_ref()?, &code.name)));
    let mut arms: Vec<(&String, Vec<String>)> = Vec::new();
    for (counter, name) in reasons {
        let reason = format!("Reason::{name}");
        match arms.iter_mut().find(|(known, _)| *known == counter) {
            Some((_, reasons)) => reasons.push(reason),
            None => arms.push((counter, vec![reason])),
        }
    }
    let arms = each(arms, |(counter, reasons)| {
        format!("{} => &mut self.{counter},\n", reasons.join(" | "))
    });
    let body =
        braces("let counter = match reason", &arms) + ";\n*counter = counter.wrapping_add(1);\n";
    let refuse = "/// Counts one packet refused for this reason.\n\
                  pub fn refuse(&mut self, reason: Reason)";
    let refuse = block("impl Counters", &block(refuse, &body));
    let names = block("counters!", &names);
    format!("use super::codes::Reason;\nuse crate::table::counters;\n\n{names}\n{refuse}")
}
