//! What `packets.toml` says, as types.

use serde::Deserialize;

/// All of `packets.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// Format version, octet 14 of every packet.
    pub version: u8,
    /// Longest packet, octets.
    pub max_packet: usize,
    /// Named codes.
    pub enums: Vec<Enum>,
    /// Fields that stand together in more than one place, or in a variant of a command.
    pub structs: Vec<Struct>,
    /// The packets.
    pub messages: Vec<Message>,
    /// The counters of Status, in order.
    pub counters: Vec<Counter>,
    /// The CAN form.
    pub can: Can,
}

/// Named codes of one octet.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enum {
    /// Its name.
    pub name: String,
    /// What the codes say.
    pub doc: String,
    /// The codes.
    pub values: Vec<Value>,
}

/// One code.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Its name.
    pub name: String,
    /// The octet.
    pub code: u8,
    /// What it says.
    pub doc: String,
    /// Of a reason: where it is counted.
    pub counter: Option<String>,
}

/// Fields that stand together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Struct {
    /// Its name.
    pub name: String,
    /// What it is.
    pub doc: String,
    /// Its fields are seen in its crate only.
    #[serde(default)]
    pub private: bool,
    /// There is one whose fields are all 0.
    #[serde(default)]
    pub default: bool,
    /// Some rules between its fields are written by hand.
    #[serde(default)]
    pub check: bool,
    /// The fields, in order.
    pub fields: Vec<Field>,
}

/// One kind of packet.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// Its name in the ICD.
    pub name: String,
    /// Its application process identifier.
    pub apid: u16,
    /// Who receives it.
    pub to: Receiver,
    /// Whose time its header holds.
    pub time: String,
    /// Name of its type in Rust and C, if another.
    #[serde(rename = "struct")]
    pub type_name: Option<String>,
    /// What it is.
    pub doc: String,
    /// Its last field points into the packet.
    #[serde(default)]
    pub borrows: bool,
    /// Some rules between its fields are written by hand.
    #[serde(default)]
    pub check: bool,
    /// Encoders keep these rules as well.
    #[serde(default)]
    pub encode_check: bool,
    /// It ends with the counters.
    #[serde(default)]
    pub counters: bool,
    /// The fields that are there only if a flag is 1.
    pub optional: Option<Optional>,
    /// The ICD's text before the table.
    pub before: Option<String>,
    /// The ICD's text after the table.
    pub after: Option<String>,
    /// The fields, in order.
    pub fields: Vec<Field>,
    /// What can follow instead, by the first octet.
    #[serde(default)]
    pub opcodes: Vec<Opcode>,
}

/// Which end receives a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Receiver {
    /// The emulator: telecommands.
    Emulator,
    /// The flight computer: telemetry.
    Client,
}

/// Fields that may be missing together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optional {
    /// The field that says whether they are there.
    pub flag: String,
    /// Their name together.
    pub name: String,
    /// Their type's name.
    #[serde(rename = "struct")]
    pub type_name: String,
    /// What they are.
    pub doc: String,
}

/// One command.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opcode {
    /// Its name.
    pub name: String,
    /// First octet of its payload.
    pub code: u8,
    /// The structure that holds its fields.
    #[serde(rename = "struct")]
    pub type_name: Option<String>,
    /// What it does.
    pub doc: String,
    /// Its fields, if no structure holds them.
    #[serde(default)]
    pub fields: Vec<Field>,
}

/// One field.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its layout.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// What it says.
    pub doc: String,
    /// Its unit.
    #[serde(default)]
    pub unit: String,
    /// Its codes.
    #[serde(rename = "enum")]
    pub codes: Option<String>,
    /// Its flags, the last bit first.
    #[serde(default)]
    pub bits: Vec<String>,
    /// Least value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// What its numbers must be.
    pub rule: Option<Rule>,
    /// What a number that breaks the rule is called; `BadValue` if nothing else.
    pub error: Option<String>,
    /// The ICD's wording of what it allows.
    pub range: Option<String>,
    /// Names of an array's numbers.
    #[serde(default)]
    pub parts: Vec<String>,
    /// It is there only if the message's flag is 1.
    #[serde(default)]
    pub optional: bool,
    /// There are as many of it as this field says.
    pub counted_by: Option<String>,
    /// The structure of each record.
    pub record: Option<String>,
    /// Fewest octets of the rest of a packet.
    #[serde(default)]
    pub least: usize,
    /// Most octets of the rest of a packet, or most elements.
    #[serde(default)]
    pub most: usize,
}

/// What numbers must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// Neither NaN nor infinite.
    Finite,
    /// Finite and above 0.
    Positive,
}

/// Layout of a field.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Kind {
    /// One number.
    One(Number),
    /// So many numbers.
    Array(Number, usize),
    /// Text in so many octets.
    Ascii(usize),
    /// The fields of a structure.
    Struct(String),
    /// What is left of the packet.
    Rest(Rest),
}

/// Layout of a number; all are big-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// Unsigned, of so many octets.
    Unsigned(usize),
    /// IEEE 754, of so many octets.
    Float(usize),
    /// The 8 octets of a time code.
    Time,
}

/// What the rest of a packet holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rest {
    /// Packed pixels.
    Pixels,
    /// Places and packed pixels.
    Windows,
    /// Structures of fixed length.
    Records,
    /// Octets.
    Octets,
    /// Text.
    Utf8,
}

impl TryFrom<String> for Kind {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let (name, length) = match text.strip_suffix(']').and_then(|text| text.split_once('[')) {
            Some((name, digits)) => {
                let length = digits.parse::<usize>();
                (
                    name,
                    Some(length.map_err(|error| format!("{text}: {error}"))?),
                )
            }
            None => (text.as_str(), None),
        };
        let number = match name {
            "u8" => Number::Unsigned(1),
            "u16" => Number::Unsigned(2),
            "u32" => Number::Unsigned(4),
            "u64" => Number::Unsigned(8),
            "f32" => Number::Float(4),
            "f64" => Number::Float(8),
            "time" => Number::Time,
            _ => {
                return Ok(match (name, length) {
                    ("ascii", Some(length)) => Self::Ascii(length),
                    ("pixels", None) => Self::Rest(Rest::Pixels),
                    ("windows", None) => Self::Rest(Rest::Windows),
                    ("records", None) => Self::Rest(Rest::Records),
                    ("octets", None) => Self::Rest(Rest::Octets),
                    ("utf8", None) => Self::Rest(Rest::Utf8),
                    (name, None) if name.starts_with(char::is_uppercase) => {
                        Self::Struct(name.to_owned())
                    }
                    _ => return Err(format!("no type is called {text:?}")),
                });
            }
        };
        Ok(length.map_or(Self::One(number), |length| Self::Array(number, length)))
    }
}

impl Number {
    /// Its octets.
    pub const fn octets(self) -> usize {
        match self {
            Self::Unsigned(octets) | Self::Float(octets) => octets,
            Self::Time => 8,
        }
    }

    /// Its name in Rust and in the ICD.
    pub fn name(self) -> String {
        match self {
            Self::Unsigned(octets) => format!("u{}", 8 * octets),
            Self::Float(octets) => format!("f{}", 8 * octets),
            Self::Time => "time code".to_owned(),
        }
    }
}

/// One counter.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counter {
    /// Its name.
    pub name: String,
    /// What it counts.
    pub doc: String,
}

/// The CAN form.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Can {
    /// What it is.
    pub doc: String,
    /// The frames.
    pub frames: Vec<CanFrame>,
}

/// One frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanFrame {
    /// Its identifier, 11 bits.
    pub id: u16,
    /// Its name.
    pub name: String,
    /// Who receives it.
    pub to: Receiver,
    /// Octets of data.
    pub octets: usize,
    /// What it is.
    pub doc: String,
    /// `attitude`, `state` (of an attitude that has one), `command`, `ack`, `isotp`.
    pub group: String,
    /// Its signals and gaps, from the first bit on.
    pub signals: Vec<Signal>,
}

/// One signal, or spare bits.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// How many bits.
    pub bits: usize,
    /// Its name; spare bits have none.
    #[serde(default)]
    pub name: String,
    /// What it holds.
    #[serde(default)]
    pub of: String,
    /// Its unit.
    #[serde(default)]
    pub unit: String,
    /// What it says.
    #[serde(default)]
    pub doc: String,
}
