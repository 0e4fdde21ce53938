//! The golden vectors: packets with their fields, octets that are no packets, frames of serial lines and CAN.

use serde::Deserialize;
use toml::{Table, Value};

use crate::NOTE;
use crate::bytes::{crc32, from_hex, hex};
use crate::encode::{Around, can_frames, compressed, float, numbers, packet, payload, unsigned};
use crate::model::{Field, Kind, Message, Number, Rest, Schema};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    time: String,
    good: Vec<Sample>,
    serial: Vec<Reference>,
    can: Vec<Reference>,
    bad: Vec<Mistake>,
}

/// A packet's fields.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sample {
    name: String,
    message: String,
    opcode: Option<String>,
    #[serde(default)]
    sequence_count: u16,
    time: Option<String>,
    /// The fields of the vector of this name, but for those given here.
    like: Option<String>,
    counters_from: Option<i64>,
    #[serde(default)]
    fields: Table,
}

/// A good packet in another form.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Reference {
    name: String,
    of: String,
    #[serde(default)]
    groups: Vec<String>,
    #[serde(default)]
    counter: u64,
}

/// Octets that are refused: a good packet and what is wrong with it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Mistake {
    name: String,
    receiver: String,
    error: String,
    like: String,
    #[serde(default)]
    fields: Table,
    /// Fields to leave out.
    #[serde(default)]
    without: Vec<String>,
    /// All of the payload.
    payload: Option<String>,
    /// Octets that the payload lacks at its end.
    #[serde(default)]
    cut: usize,
    /// Octets after the payload.
    append: Option<String>,
    version: Option<u8>,
    #[serde(default)]
    octet0: u8,
    flags: Option<u16>,
    #[serde(default)]
    extra: i16,
    apid: Option<u16>,
    #[serde(default)]
    crc: u16,
    /// Only so many octets of the packet.
    keep: Option<usize>,
}

/// A packet with its fields.
#[derive(Debug)]
pub struct Good {
    /// What it shows.
    pub name: String,
    /// The message's name.
    pub message: String,
    /// The command, if it is one.
    pub opcode: Option<String>,
    /// Sequence count.
    pub count: u16,
    /// Time code.
    pub time: u64,
    /// The fields, in order, with what they hold.
    pub fields: Vec<(Field, Value)>,
    /// The packet.
    pub octets: Vec<u8>,
    table: Table,
}

/// Octets that are refused.
#[derive(Debug)]
pub struct Bad {
    /// What is wrong.
    pub name: String,
    /// Which end receives them: `emulator` or `client`.
    pub receiver: String,
    /// The name of the error.
    pub error: String,
    /// The octets.
    pub octets: Vec<u8>,
}

/// One identifier with its data.
pub type CanData = (u16, Vec<u8>);

/// All of them.
#[derive(Debug)]
pub struct Vectors {
    /// Packets.
    pub good: Vec<Good>,
    /// On a serial line: name, packet, frame.
    pub serial: Vec<(String, Vec<u8>, Vec<u8>)>,
    /// As CAN frames: name, name of the packet, frames.
    pub can: Vec<(String, String, Vec<CanData>)>,
    /// Refused.
    pub bad: Vec<Bad>,
}

impl Vectors {
    /// Reads `vectors.toml` and encodes all of it.
    ///
    /// # Errors
    /// What does not fit the schema.
    pub fn parse(schema: &Schema, text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| format!("vectors.toml: {error}"))?;
        let mut good: Vec<Good> = Vec::new();
        for sample in &file.good {
            let vector = sample.encode(schema, &good, &file.time);
            good.push(vector.map_err(|error| format!("vectors.toml: {}: {error}", sample.name))?);
        }
        let find = |name: &str| {
            let vector = good.iter().find(|vector| vector.name == name);
            vector.ok_or(format!("vectors.toml: no vector {name:?}"))
        };
        let mut serial = Vec::new();
        for reference in &file.serial {
            let packet = find(&reference.of)?.octets.clone();
            serial.push((reference.name.clone(), packet.clone(), slip(&packet)));
        }
        let mut can = Vec::new();
        for reference in &file.can {
            let vector = find(&reference.of)?;
            let groups: Vec<&str> = reference.groups.iter().map(String::as_str).collect();
            let frames = can_frames(
                schema,
                &groups,
                &vector.octets,
                &vector.table,
                reference.counter,
            )?;
            can.push((reference.name.clone(), reference.of.clone(), frames));
        }
        let mut bad = Vec::new();
        for mistake in &file.bad {
            let octets = mistake.encode(schema, find(&mistake.like)?);
            bad.push(Bad {
                name: mistake.name.clone(),
                receiver: mistake.receiver.clone(),
                error: mistake.error.clone(),
                octets: octets
                    .map_err(|error| format!("vectors.toml: {}: {error}", mistake.name))?,
            });
        }
        Ok(Self {
            good,
            serial,
            can,
            bad,
        })
    }

    /// `golden.txt`.
    pub fn text(&self) -> String {
        let mut out = format!(
            "# {NOTE}\n\
             # Golden vectors: decode(hex) must give the fields, encode(fields) must give the hex. Octets with `error` are\n\
             # refused. Numbers with 0x are hexadecimal, time is in units of 2^-32 s since 1958-01-01 TAI, bars part\n\
             # primary header, time, version, payload and CRC.\n\n"
        );
        for vector in &self.good {
            out += &format!("[{}]\nmessage = {}\n", vector.name, vector.message);
            out += &format!(
                "sequence_count = {}\ntime = {:#018x}\n",
                vector.count, vector.time
            );
            if let Some(opcode) = &vector.opcode {
                out += &format!("opcode = {opcode}\n");
            }
            for (name, value) in vector
                .fields
                .iter()
                .flat_map(|(field, value)| shown(field, value))
            {
                out += format!("{name} = {value}").trim_end();
                out.push('\n');
            }
            if let Some(records) = vector.records() {
                out += &format!("records = {}\n", hex(records, 2000));
            }
            out += &format!("hex = {}\n\n", spaced(&vector.octets));
        }
        for (name, packet, frame) in &self.serial {
            let inner = frame.get(1..frame.len() - 1).unwrap_or_default();
            out += &format!(
                "[{name}]\npacket = {}\nhex = c0 | {} | c0\n\n",
                hex(packet, 2000),
                hex(inner, 2000)
            );
        }
        for (name, of, frames) in &self.can {
            out += &format!("[{name}]\nof = {of}\nframes =");
            for (id, data) in frames {
                out += &format!("\n    {id:03X}#{}", hex(data, 64).to_uppercase());
            }
            out += "\nhex =\n\n";
        }
        for vector in &self.bad {
            out += &format!(
                "[{}]\nreceiver = {}\nerror = {}\n",
                vector.name, vector.receiver, vector.error
            );
            out += format!("hex = {}", spaced(&vector.octets)).trim_end();
            out += "\n\n";
        }
        out
    }
}

impl Good {
    /// The records at its end.
    fn records(&self) -> Option<&[u8]> {
        let (field, _) = self.fields.last()?;
        let fixed: usize = self
            .fields
            .iter()
            .filter_map(|(field, _)| field.octets())
            .sum();
        let rest = self.octets.get(15 + fixed..self.octets.len() - 2);
        rest.filter(|_| field.kind == Kind::Rest(Rest::Records))
    }
}

impl Sample {
    fn encode(&self, schema: &Schema, before: &[Good], usual: &str) -> Result<Good, String> {
        let message = schema
            .message(&self.message)
            .ok_or(format!("no message {}", self.message))?;
        let mut table = Table::new();
        if let Some(like) = &self.like {
            let other = before
                .iter()
                .find(|vector| vector.name == *like)
                .ok_or(format!("no vector {like}"))?;
            table = other.table.clone();
        }
        table.extend(self.fields.clone());
        if let Some(first) = self.counters_from {
            for (counter, value) in schema.counters.iter().zip(first..) {
                table.insert(counter.name.clone(), Value::Integer(value));
            }
        }
        let octets = payload(schema, message, self.opcode.as_deref(), &table)?;
        let time = unsigned(&Value::String(
            self.time.clone().unwrap_or(usual.to_owned()),
        ))?;
        let fields = listed(schema, message, self.opcode.as_deref());
        let value = |field: Field| table.get(&field.name).map(|value| (field, value.clone()));
        let fields: Vec<(Field, Value)> = fields.into_iter().filter_map(value).collect();
        if let Some(name) = table
            .keys()
            .find(|name| fields.iter().all(|(field, _)| field.name != **name))
        {
            return Err(format!("{} has no field {name}", message.name));
        }
        Ok(Good {
            name: self.name.clone(),
            message: self.message.clone(),
            opcode: self.opcode.clone(),
            count: self.sequence_count,
            time,
            fields,
            octets: packet(
                schema,
                message,
                self.sequence_count,
                time,
                &octets,
                &Around::default(),
            ),
            table,
        })
    }
}

impl Mistake {
    fn encode(&self, schema: &Schema, like: &Good) -> Result<Vec<u8>, String> {
        let message = schema.message(&like.message).ok_or("no message")?;
        let mut table = like.table.clone();
        table.extend(self.fields.clone());
        for name in &self.without {
            table.remove(name);
        }
        let mut octets = match &self.payload {
            Some(digits) => from_hex(digits)?,
            None => payload(schema, message, like.opcode.as_deref(), &table)?,
        };
        octets.truncate(octets.len().saturating_sub(self.cut));
        octets.extend(from_hex(self.append.as_deref().unwrap_or_default())?);
        let around = Around {
            version: self.version,
            octet0: self.octet0,
            flags: self.flags,
            extra: self.extra,
            apid: self.apid,
            crc: self.crc,
        };
        let mut octets = packet(schema, message, like.count, like.time, &octets, &around);
        octets.truncate(self.keep.unwrap_or(octets.len()));
        Ok(octets)
    }
}

fn listed(schema: &Schema, message: &Message, opcode: Option<&str>) -> Vec<Field> {
    let opcode = message
        .opcodes
        .iter()
        .find(|code| Some(code.name.as_str()) == opcode);
    opcode.map_or_else(|| schema.fields(message), |opcode| schema.arguments(opcode))
}

/// RFC 1055 around packet and CRC-32.
fn slip(packet: &[u8]) -> Vec<u8> {
    let inside = packet.iter().copied().chain(crc32(packet).to_be_bytes());
    let escaped = inside.flat_map(|octet| match octet {
        0xC0 => vec![0xDB, 0xDC],
        0xDB => vec![0xDB, 0xDD],
        octet => vec![octet],
    });
    std::iter::once(0xC0)
        .chain(escaped)
        .chain(std::iter::once(0xC0))
        .collect()
}

/// A field as `golden.txt` writes it: names and values.
fn shown(field: &Field, value: &Value) -> Vec<(String, String)> {
    let number = |kind: &Number, value: &Value| match kind {
        Number::Float(_) => format!("{:?}", float(value).unwrap_or(f64::NAN)),
        Number::Time => format!("{:#018x}", unsigned(value).unwrap_or_default()),
        Number::Unsigned(_) => unsigned(value).unwrap_or_default().to_string(),
    };
    let list = |values: &[Value], kind: &Number| {
        let values = values.iter().map(|value| number(kind, value));
        values.collect::<Vec<_>>().join(" ")
    };
    let values = numbers(value).unwrap_or_default();
    let named = |name: &str, value: String| vec![(name.to_owned(), value)];
    match &field.kind {
        Kind::One(kind) => {
            // The header has fields of these names.
            let own = ["apid", "sequence_count"].contains(&field.name.as_str());
            let name = if own {
                format!("answers_{}", field.name)
            } else {
                field.name.clone()
            };
            named(&name, number(kind, value))
        }
        Kind::Array(kind, _) => named(&field.name, list(&values, kind)),
        Kind::Rest(Rest::Pixels) => named("pixels", list(&values, &Number::Unsigned(2))),
        Kind::Rest(Rest::Windows) => {
            let inner = |keys: &[&str]| {
                let windows = values.iter().filter_map(Value::as_table);
                let cells =
                    windows.flat_map(|window| keys.iter().filter_map(|key| window.get(*key)));
                let cells = cells.flat_map(|cell| numbers(cell).unwrap_or(vec![cell.clone()]));
                list(&cells.collect::<Vec<_>>(), &Number::Unsigned(2))
            };
            [
                named("places", inner(&["column", "row"])),
                named("pixels", inner(&["pixels"])),
            ]
            .concat()
        }
        // Records stand in `vectors.toml`, field by field.
        Kind::Rest(Rest::Records) => Vec::new(),
        Kind::Rest(Rest::Octets) if value.is_table() => {
            let (bits, pixels) = compressed(value).unwrap_or_default();
            let data = hex(&crate::rice::encode(&pixels, bits), 2000);
            let pixels: Vec<String> = pixels.iter().map(u64::to_string).collect();
            [
                named(&field.name, data),
                named("pixel_bits", bits.to_string()),
                named("pixels", pixels.join(" ")),
            ]
            .concat()
        }
        _ => {
            let text = value.as_str().unwrap_or_default();
            named(
                &field.name,
                text.strip_prefix("hex:").unwrap_or(text).to_owned(),
            )
        }
    }
}

/// Primary header, time, version, payload, CRC; the payload in lines of 32 octets.
fn spaced(octets: &[u8]) -> String {
    if octets.len() < 17 {
        return hex(octets, 2000);
    }
    let (head, payload) = octets.split_at(15);
    let (payload, crc) = payload.split_at(payload.len() - 2);
    let mut out = format!(
        "{} | {} | {} |",
        hex(&head[..6], 2),
        hex(&head[6..14], 8),
        hex(&head[14..], 1)
    );
    for line in payload.chunks(32) {
        out += &format!("\n      {}", hex(line, 4));
    }
    out + &format!("\n      | {}", hex(crc, 2))
}
