//! Telecommands as commands of XTCE. The ground system's post-processor fills in sequence count, data length and CRC.

use std::collections::BTreeMap;

use super::{binary, escape, scalar, unsigned};
use crate::model::{Field, Kind, Message, Receiver, Schema};

/// The commands under way: their arguments' types, and their text.
struct Commands<'a> {
    schema: &'a Schema,
    types: BTreeMap<String, String>,
    text: String,
}

/// The whole `CommandMetaData`.
pub(super) fn write(schema: &Schema) -> String {
    let types = BTreeMap::from([("u64".to_owned(), unsigned("Argument", 64, ""))]);
    let mut commands = Commands {
        schema,
        types,
        text: String::new(),
    };
    for message in schema
        .messages
        .iter()
        .filter(|message| message.to == Receiver::Emulator)
    {
        for present in [0, 1].into_iter().filter(|_| message.optional.is_some()) {
            commands.with_flag(message, present);
        }
        for opcode in &message.opcodes {
            let name = format!("{}_{}", message.name, opcode.name);
            let mut parts = vec![fixed(&[opcode.code])];
            for field in schema.arguments(opcode) {
                parts.push(commands.argument(&name, &field));
            }
            commands.command(message, &name, &opcode.doc, &parts);
        }
    }
    let types: String = commands.types.into_values().collect();
    format!(
        "  <CommandMetaData>\n    <ArgumentTypeSet>\n{types}    </ArgumentTypeSet>\n    <MetaCommandSet>\n{}    </MetaCommandSet>\n  </CommandMetaData>\n",
        commands.text
    )
}

/// A part of a command: how its list of arguments and its container name it.
struct Part {
    argument: String,
    entry: String,
}

fn fixed(octets: &[u8]) -> Part {
    let digits = crate::bytes::hex(octets, octets.len()).to_uppercase();
    let bits = 8 * octets.len();
    Part {
        argument: String::new(),
        entry: format!(
            "            <FixedValueEntry binaryValue=\"{digits}\" sizeInBits=\"{bits}\"/>\n"
        ),
    }
}

fn argument(name: &str, kind: &str, doc: &str) -> Part {
    let doc = escape(doc);
    Part {
        argument: format!(
            "          <Argument name=\"{name}\" argumentTypeRef=\"{kind}\" shortDescription=\"{doc}\"/>\n"
        ),
        entry: format!("            <ArgumentRefEntry argumentRef=\"{name}\"/>\n"),
    }
}

impl Commands<'_> {
    /// A message whose flag is 0 or 1.
    fn with_flag(&mut self, message: &Message, present: u8) {
        let Some(optional) = &message.optional else {
            return;
        };
        let name = format!(
            "{}_{}_{}",
            message.name,
            ["without", "with"][usize::from(present)],
            optional.name
        );
        let fields = message
            .fields
            .iter()
            .filter(|field| present == 1 || !field.optional);
        let mut parts = Vec::new();
        for field in fields {
            parts.push(match field.name == optional.flag {
                true => fixed(&[present]),
                false => self.argument(&name, field),
            });
        }
        self.command(message, &name, &message.doc, &parts);
    }

    /// Declares a field's type, if it is not yet.
    fn argument(&mut self, owner: &str, field: &Field) -> Part {
        if let (Kind::Array(number, length), Some(count)) = (&field.kind, &field.counted_by) {
            let name = format!("{owner}_{}_type", field.name);
            let bits = 8 * number.octets() * length;
            self.types
                .insert(name.clone(), binary("Argument", &name, count, bits, 0));
            return argument(&field.name, &name, &field.doc);
        }
        let (kind, text) = scalar("Argument", self.schema, field);
        self.types.insert(kind.clone(), text);
        let Kind::Array(..) = &field.kind else {
            return argument(&field.name, &kind, &field.doc);
        };
        let parts = field
            .parts
            .iter()
            .map(|part| argument(&format!("{}_{part}", field.name), &kind, &field.doc));
        parts.fold(
            Part {
                argument: String::new(),
                entry: String::new(),
            },
            |all, part| Part {
                argument: all.argument + &part.argument,
                entry: all.entry + &part.entry,
            },
        )
    }

    fn command(&mut self, message: &Message, name: &str, doc: &str, parts: &[Part]) {
        let [high, low] = (0x1800 | message.apid).to_be_bytes();
        let arguments: String = parts.iter().map(|part| part.argument.as_str()).collect();
        let entries: String = parts.iter().map(|part| part.entry.as_str()).collect();
        let time = argument("time", "u64", "units of 2^-32 s since 1958-01-01 TAI");
        self.text += &format!(
            "      <MetaCommand name=\"{name}\" shortDescription=\"{}\">\n        <ArgumentList>\n{}{arguments}        </ArgumentList>\n        <CommandContainer name=\"{name}_packet\">\n          <EntryList>\n{}{}{}{entries}          </EntryList>\n        </CommandContainer>\n      </MetaCommand>\n",
            escape(doc),
            time.argument,
            fixed(&[high, low, 0xC0, 0, 0, 0]).entry,
            time.entry,
            fixed(&[self.schema.version]).entry,
        );
    }
}
