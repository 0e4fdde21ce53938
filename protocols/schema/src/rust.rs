//! The Rust codecs: `protocols/src/generated/`. Rules between fields stay in the modules that re-export these types.

mod messages;
mod structures;

use crate::NOTE;
use crate::model::{Receiver, Schema};

/// The files.
///
/// # Errors
/// None yet.
pub fn files(schema: &Schema) -> Result<Vec<(String, String)>, String> {
    let file = |name: &str, about: &str, text: String| {
        (
            format!("src/generated/{name}.rs"),
            format!("// {NOTE}\n//! {about}\n\n{text}"),
        )
    };
    let inside = ["answers", "codes", "commands", "counters", "ends", "frames"];
    let modules: String = inside
        .iter()
        .map(|name| format!("pub mod {name};\n"))
        .collect();
    Ok(vec![
        file(
            "mod",
            "What `schema/packets.toml` says: codes, messages, how they are read and written.",
            modules,
        ),
        file(
            "codes",
            "Numbers with a name: versions, limits, kinds of packets, codes of fields.",
            codes(schema),
        ),
        file(
            "counters",
            "The counters of `Status`, in the order of the wire.",
            counters(schema),
        ),
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
        file(
            "answers",
            "The answers of the emulator, and all of its packets.",
            messages::answers(schema),
        ),
    ])
}

/// A comment of this depth.
fn doc(text: &str, depth: usize) -> String {
    format!("{}/// {text}\n", "    ".repeat(depth))
}

fn codes(schema: &Schema) -> String {
    let mut out = format!(
        "use crate::wire::wire_enum;\n\n{}pub const VERSION: u8 = {};\n{}pub const MAX_PACKET: usize = {};\n",
        doc("Version of these formats, in the secondary header.", 0),
        schema.version,
        doc(
            "Longest packet in octets, headers and CRC included: fits a UDP datagram on Ethernet unfragmented.",
            0
        ),
        schema.max_packet
    );
    for codes in &schema.enums {
        let values = codes
            .values
            .iter()
            .map(|value| (value.name.as_str(), value.code, value.doc.clone()));
        out += &enumeration(&codes.name, &codes.doc, values);
    }
    let opcodes = schema.messages.iter().flat_map(|message| &message.opcodes);
    let opcodes = opcodes.map(|opcode| (opcode.name.as_str(), opcode.code, opcode.doc.clone()));
    out += &enumeration(
        "Opcode",
        "First payload octet of a `Command` packet.",
        opcodes,
    );
    out += "\n/// Application process identifiers: one a message kind.\npub mod apid {\n";
    for message in &schema.messages {
        let direction = match message.to {
            Receiver::Emulator => "Towards the emulator",
            Receiver::Client => "From the emulator",
        };
        out += &doc(
            &format!("{direction}: {}", crate::icd::cell(&message.doc) + "."),
            1,
        );
        out += &format!(
            "    pub const {}: u16 = {:#05x};\n",
            crate::c::upper(&message.name),
            message.apid
        );
    }
    let rows = schema.messages.iter().map(|message| {
        format!(
            "        ({}, \"{}\"),\n",
            crate::c::upper(&message.name),
            message.name
        )
    });
    let telecommands = schema
        .messages
        .iter()
        .filter(|message| message.to == Receiver::Emulator);
    let telecommands: Vec<String> = telecommands
        .map(|message| crate::c::upper(&message.name))
        .collect();
    out + &format!(
        "\n    /// All of them with their names in the ICD.\n    pub const ALL: [(u16, &str); {}] = [\n{}    ];\n\n    /// Whether packets with this APID go towards the emulator (type bit 1).\n    pub const fn is_telecommand(apid: u16) -> bool {{\n        matches!(apid, {})\n    }}\n\n    /// The row of [`ALL`] that holds this APID.\n    pub fn index(apid: u16) -> Option<usize> {{\n        ALL.iter().position(|(known, _)| *known == apid)\n    }}\n}}\n",
        schema.messages.len(),
        rows.collect::<String>(),
        telecommands.join(" | ")
    )
}

fn enumeration<'a>(
    name: &str,
    about: &str,
    values: impl Iterator<Item = (&'a str, u8, String)>,
) -> String {
    let values =
        values.map(|(name, code, about)| doc(&about, 2) + &format!("        {name} = {code},\n"));
    format!(
        "\nwire_enum! {{\n{}    pub enum {name}: u8 {{\n{}    }}\n}}\n",
        doc(about, 1),
        values.collect::<String>()
    )
}

fn counters(schema: &Schema) -> String {
    let names = schema
        .counters
        .iter()
        .map(|counter| doc(&counter.doc, 1) + &format!("    {},\n", counter.name));
    let names: String = names.collect();
    let reasons = schema
        .codes("Reason")
        .map(|codes| codes.values.as_slice())
        .unwrap_or_default();
    let mut arms: Vec<(&str, Vec<String>)> = Vec::new();
    for value in reasons {
        let counter = value.counter.as_deref().unwrap_or_default();
        let reason = format!("Reason::{}", value.name);
        match arms.iter_mut().find(|(known, _)| *known == counter) {
            Some((_, reasons)) => reasons.push(reason),
            None => arms.push((counter, vec![reason])),
        }
    }
    let arms = arms.iter().map(|(counter, reasons)| {
        format!(
            "            {} => &mut self.{counter},\n",
            reasons.join(" | ")
        )
    });
    format!(
        "use super::codes::Reason;\nuse crate::wire::counters;\n\ncounters! {{\n{names}}}\n\nimpl Counters {{\n    /// Counts one packet refused for this reason.\n    pub fn refuse(&mut self, reason: Reason) {{\n        let counter = match reason {{\n{}        }};\n        *counter = counter.wrapping_add(1);\n    }}\n}}\n",
        arms.collect::<String>()
    )
}
