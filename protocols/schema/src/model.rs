//! The content of `packets.toml` as types, and the check of its references.

use serde::Deserialize;

/// All of `packets.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// Format version, byte 14 of every packet.
    pub version: u8,
    /// Longest packet, bytes.
    pub max_packet: usize,
    pub enums: Vec<Enum>,
    /// Groups of fields in several messages, or of one command.
    pub structs: Vec<Record>,
    /// The kinds of packets.
    pub messages: Vec<Record>,
    /// The counters of Status.
    pub counters: Vec<Field>,
    pub can: Can,
}

/// Named codes of one byte.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enum {
    pub name: String,
    pub doc: String,
    pub values: Vec<Code>,
}

/// A kind of packet, or a structure: fields in their order. Structures have no APID.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Its name in the ICD.
    pub name: String,
    /// Name of its type in Rust and C, if different.
    #[serde(rename = "struct")]
    pub type_name: Option<String>,
    pub doc: String,
    pub fields: Vec<Field>,
    #[serde(default)]
    pub apid: u16,
    #[serde(default)]
    pub to: Receiver,
    /// The ICD's text on the time in its header.
    #[serde(default)]
    pub time: String,
    /// Its fields are private to the crate.
    #[serde(default)]
    pub private: bool,
    /// Its type has a default with all fields 0.
    #[serde(default)]
    pub default: bool,
    /// Its last field points into the packet.
    #[serde(default)]
    pub borrows: bool,
    /// Some rules between its fields are written by hand.
    #[serde(default)]
    pub check: bool,
    /// Encoders check these rules as well.
    #[serde(default)]
    pub encode_check: bool,
    /// It ends with the counters.
    #[serde(default)]
    pub counters: bool,
    /// The fields that are present only if a flag is 1.
    pub optional: Option<Optional>,
    /// The ICD's text before the table.
    pub before: Option<String>,
    /// The ICD's text after the table.
    pub after: Option<String>,
    /// The commands of a packet whose first byte selects one.
    #[serde(default)]
    pub opcodes: Vec<Code>,
}

/// The end that receives a packet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Receiver {
    /// Telecommands.
    Emulator,
    /// Telemetry, to the flight computer.
    #[default]
    Client,
}

/// Optional fields of a message.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optional {
    /// The field that is 1 if they are present.
    pub flag: String,
    /// Name of their group.
    pub name: String,
    /// Name of the group's type.
    #[serde(rename = "struct")]
    pub type_name: String,
    pub doc: String,
}

/// One code: a value of a field, or a command, which has fields.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Code {
    pub name: String,
    pub code: u8,
    pub doc: String,
    /// The counter of a reason.
    pub counter: Option<String>,
    /// The structure that holds a command's fields.
    #[serde(rename = "struct")]
    pub type_name: Option<String>,
    /// A command's fields, if no structure holds them.
    #[serde(default)]
    pub fields: Vec<Field>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: Kind,
    pub doc: String,
    #[serde(default)]
    pub unit: String,
    /// Name of the enum that holds its codes.
    #[serde(rename = "enum")]
    pub codes: Option<String>,
    /// Its flags, from the least significant bit.
    #[serde(default)]
    pub bits: Vec<String>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub rule: Option<Rule>,
    /// The error for a number that breaks the rule; `BadValue` by default.
    pub error: Option<String>,
    /// The ICD's wording of its range.
    pub range: Option<String>,
    /// Names of an array's numbers.
    #[serde(default)]
    pub parts: Vec<String>,
    /// It is present only if the message's flag is 1.
    #[serde(default)]
    pub optional: bool,
    /// The field with the number of its elements.
    pub counted_by: Option<String>,
    /// The structure of each record.
    pub record: Option<String>,
    /// Minimum number of bytes of the rest of a packet.
    #[serde(default)]
    pub least: usize,
    /// Maximum number of bytes of the rest of a packet, or of elements.
    #[serde(default)]
    pub most: usize,
}

/// A rule for numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    Finite,
    /// Finite and above 0.
    Positive,
}

/// Layout of a field.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Kind {
    One(Number),
    Array(Number, usize),
    /// Text of this number of bytes.
    Ascii(usize),
    /// The fields of a structure.
    Struct(String),
    /// All bytes up to the CRC.
    Rest(Rest),
}

/// Layout of a number: its bytes, big-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    Unsigned(usize),
    /// IEEE 754.
    Float(usize),
    /// The 8 bytes of a time code.
    Time,
}

/// Content of the rest of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rest {
    /// Packed pixels.
    Pixels,
    /// Positions and packed pixels.
    Windows,
    /// Structures of fixed length.
    Records,
    Bytes,
    Utf8,
}

impl TryFrom<String> for Kind {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let unknown = || format!("no type is called {text:?}");
        if let Some((name, length)) = text.strip_suffix(']').and_then(|text| text.split_once('[')) {
            let length = length.parse().map_err(|_| unknown())?;
            return match (name, number(name)) {
                ("ascii", _) => Ok(Self::Ascii(length)),
                (_, Some(number)) => Ok(Self::Array(number, length)),
                _ => Err(unknown()),
            };
        }
        Ok(match text.as_str() {
            "pixels" => Self::Rest(Rest::Pixels),
            "windows" => Self::Rest(Rest::Windows),
            "records" => Self::Rest(Rest::Records),
            "octets" => Self::Rest(Rest::Bytes),
            "utf8" => Self::Rest(Rest::Utf8),
            name if name.starts_with(char::is_uppercase) => Self::Struct(name.to_owned()),
            name => Self::One(number(name).ok_or_else(unknown)?),
        })
    }
}

fn number(name: &str) -> Option<Number> {
    Some(match name {
        "u8" => Number::Unsigned(1),
        "u16" => Number::Unsigned(2),
        "u32" => Number::Unsigned(4),
        "u64" => Number::Unsigned(8),
        "f32" => Number::Float(4),
        "f64" => Number::Float(8),
        "time" => Number::Time,
        _ => return None,
    })
}

/// The CAN form.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Can {
    pub doc: String,
    pub frames: Vec<CanFrame>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanFrame {
    /// Its identifier, 11 bits.
    pub id: u16,
    pub name: String,
    pub to: Receiver,
    /// Bytes of data.
    pub octets: usize,
    pub doc: String,
    /// `attitude`, `state` (of an attitude that has one), `command`, `ack`, `isotp`.
    pub group: String,
    /// Its signals and spare bits, from the first bit.
    pub signals: Vec<Signal>,
}

/// One signal, or spare bits without a name.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    pub bits: usize,
    #[serde(default)]
    pub name: String,
    /// Its value: see `packets.toml`.
    #[serde(default)]
    pub of: String,
    #[serde(default)]
    pub unit: String,
    #[serde(default)]
    pub doc: String,
}

impl Schema {
    /// Reads `packets.toml`.
    ///
    /// # Errors
    /// The text does not fit the types above, or a reference is unknown.
    pub fn parse(text: &str) -> Result<Self, String> {
        let schema: Self =
            toml::from_str(text).map_err(|error| format!("packets.toml: {error}"))?;
        schema
            .check()
            .map_err(|error| format!("packets.toml: {error}"))?;
        Ok(schema)
    }

    /// Every reference is known, every message has an APID, every CAN frame is full.
    fn check(&self) -> Result<(), String> {
        let records = self.structs.iter().chain(&self.messages);
        let lists = records.flat_map(|record| {
            let opcodes = record.opcodes.iter().map(|opcode| &opcode.fields);
            opcodes.chain([&record.fields])
        });
        for field in lists.flatten() {
            let names = [&field.codes, &field.record, &field.kind.structure()];
            let found = [
                self.codes(field).is_some(),
                self.record(field).is_some(),
                self.inner(field).is_some(),
            ];
            for (name, found) in names.into_iter().zip(found) {
                if let Some(name) = name.as_ref().filter(|_| !found) {
                    return Err(format!("field {} names {name}", field.name));
                }
            }
        }
        if let Some(message) = self.messages.iter().find(|message| message.apid == 0) {
            return Err(format!("{} has no APID", message.name));
        }
        for frame in &self.can.frames {
            let bits: usize = frame.signals.iter().map(|signal| signal.bits).sum();
            if bits != 8 * frame.octets {
                return Err(format!("{} has {bits} bits of signals", frame.name));
            }
        }
        Ok(())
    }
}
