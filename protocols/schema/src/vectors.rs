//! The golden vectors: packets with their fields, refused packets, frames of serial lines and CAN.

use serde::Deserialize;
use toml::{Table, Value};

use crate::NOTE;
use crate::bytes::{crc32, from_hex, hex};
use crate::encode::{can_frames, compressed, float, numbers, packet, payload, unsigned};
use crate::mistake::Mistake;
use crate::model::{Field, Kind, Number, Rest, Schema};
use crate::text::{each, join};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    time: String,
    good: Vec<Sample>,
    serial: Vec<Reference>,
    can: Vec<Reference>,
    bad: Vec<Mistake>,
}

/// A packet's fields.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sample {
    name: String,
    message: String,
    opcode: Option<String>,
    #[serde(default)]
    sequence_count: u16,
    time: Option<String>,
    /// Name of a vector with the values of the other fields.
    like: Option<String>,
    counters_from: Option<i64>,
    #[serde(default)]
    fields: Table,
}

/// A good packet in another form: on a serial line or as CAN frames.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    pub name: String,
    pub of: String,
    /// Groups of its CAN frames.
    #[serde(default)]
    groups: Vec<String>,
    /// Counter of its CAN frames.
    #[serde(default)]
    counter: u64,
    #[serde(skip)]
    pub packet: Vec<u8>,
    /// The packet on a serial line.
    #[serde(skip)]
    pub line: Vec<u8>,
    /// Identifiers and data of its CAN frames.
    #[serde(skip)]
    pub frames: Vec<(u16, Vec<u8>)>,
}

/// A packet with its fields.
#[derive(Debug)]
pub struct Good {
    pub name: String,
    pub message: String,
    pub opcode: Option<String>,
    /// Sequence count.
    pub count: u16,
    pub time: u64,
    /// The fields, in order, with their values.
    pub fields: Vec<(Field, Value)>,
    /// The packet.
    pub bytes: Vec<u8>,
    table: Table,
}

/// All golden vectors.
#[derive(Debug)]
pub struct Vectors {
    pub good: Vec<Good>,
    pub serial: Vec<Reference>,
    pub can: Vec<Reference>,
    pub bad: Vec<Mistake>,
}

impl Vectors {
    /// Reads and encodes `vectors.toml`.
    ///
    /// # Errors
    /// A vector does not fit the schema.
    pub fn parse(schema: &Schema, text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| error.to_string())?;
        let (mut good, mut serial, mut can, mut bad) = (vec![], file.serial, file.can, file.bad);
        for sample in file.good {
            let name = sample.name.clone();
            let vector = sample.encode(schema, &good, &file.time);
            good.push(vector.map_err(|error| format!("{name}: {error}"))?);
        }
        for reference in serial.iter_mut().chain(&mut can) {
            let vector = find(&good, &reference.of)?;
            reference.packet.clone_from(&vector.bytes);
            reference.line = slip(&vector.bytes);
            let (groups, counter) = (&reference.groups, reference.counter);
            reference.frames = can_frames(schema, groups, &vector.bytes, &vector.table, counter)?;
        }
        for mistake in &mut bad {
            let bytes = mistake.encode(schema, find(&good, &mistake.like)?);
            mistake.bytes = bytes.map_err(|error| format!("{}: {error}", mistake.name))?;
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
        out += &each(&self.good, Good::text);
        for serial in &self.serial {
            let (name, packet, line) = (&serial.name, &serial.packet, &serial.line);
            let (packet, inner) = (hex(packet), hex(&line[1..line.len() - 1]));
            out += &format!("[{name}]\npacket = {packet}\nhex = c0 | {inner} | c0\n\n");
        }
        for can in &self.can {
            let frames = each(&can.frames, |(id, data)| {
                format!("\n    {id:03X}#{}", hex(data).to_uppercase())
            });
            out += &format!(
                "[{}]\nof = {}\nframes ={frames}\nhex =\n\n",
                can.name, can.of
            );
        }
        for bad in &self.bad {
            let (name, receiver, error) = (&bad.name, &bad.receiver, &bad.error);
            out += &format!("[{name}]\nreceiver = {receiver}\nerror = {error}\n");
            out += format!("hex = {}", spaced(&bad.bytes)).trim_end();
            out += "\n\n";
        }
        out
    }
}

fn find<'a>(good: &'a [Good], name: &str) -> Result<&'a Good, String> {
    let vector = good.iter().find(|vector| vector.name == name);
    vector.ok_or(format!("no vector {name:?}"))
}

impl Good {
    /// The bytes after the fields of fixed length.
    pub fn rest(&self) -> &[u8] {
        let fixed = self.fields.iter().filter_map(|(field, _)| field.bytes());
        let rest = 15 + fixed.sum::<usize>()..self.bytes.len() - 2;
        self.bytes.get(rest).unwrap_or_default()
    }

    fn text(&self) -> String {
        let (count, time) = (self.count, self.time);
        let mut out = format!("[{}]\nmessage = {}\n", self.name, self.message);
        out += &format!("sequence_count = {count}\ntime = {time:#018x}\n");
        if let Some(opcode) = &self.opcode {
            out += &format!("opcode = {opcode}\n");
        }
        for (field, value) in &self.fields {
            for (name, value) in self.values(field, value) {
                out += format!("{name} = {value}").trim_end();
                out.push('\n');
            }
        }
        out + &format!("hex = {}\n\n", spaced(&self.bytes))
    }

    /// Names and values of a field in `golden.txt`.
    fn values<'a>(&self, field: &'a Field, value: &Value) -> Vec<(&'a str, String)> {
        let name = field.name.as_str();
        let values = numbers(value).unwrap_or_default();
        match &field.kind {
            // The header has fields with these names.
            Kind::One(kind) => match name {
                "apid" => vec![("answers_apid", number(*kind, value))],
                "sequence_count" => vec![("answers_sequence_count", number(*kind, value))],
                name => vec![(name, number(*kind, value))],
            },
            Kind::Array(kind, _) => vec![(name, list(*kind, &values))],
            Kind::Rest(Rest::Pixels) => vec![("pixels", list(Number::Unsigned(2), &values))],
            Kind::Rest(Rest::Windows) => {
                let cells = |keys: &[&str]| {
                    let cells = values.iter().flat_map(|window| {
                        let cells = keys.iter().filter_map(|key| window.get(key));
                        cells.flat_map(|cell| numbers(cell).unwrap_or(vec![cell.clone()]))
                    });
                    list(Number::Unsigned(2), &cells.collect::<Vec<_>>())
                };
                let positions = cells(&["column", "row"]);
                vec![("places", positions), ("pixels", cells(&["pixels"]))]
            }
            Kind::Rest(Rest::Records) => vec![("records", hex(self.rest()))],
            Kind::Rest(Rest::Bytes) if value.is_table() => {
                let (bits, pixels) = compressed(value).unwrap_or_default();
                vec![
                    (name, hex(self.rest())),
                    ("pixel_bits", bits.to_string()),
                    ("pixels", join(pixels, " ")),
                ]
            }
            _ => {
                let text = value.as_str().unwrap_or_default();
                vec![(name, text.strip_prefix("hex:").unwrap_or(text).to_owned())]
            }
        }
    }
}

fn number(kind: Number, value: &Value) -> String {
    match kind {
        Number::Float(_) => format!("{:?}", float(value).unwrap_or(f64::NAN)),
        Number::Time => format!("{:#018x}", unsigned(value).unwrap_or_default()),
        Number::Unsigned(_) => unsigned(value).unwrap_or_default().to_string(),
    }
}

fn list(kind: Number, values: &[Value]) -> String {
    join(values.iter().map(|value| number(kind, value)), " ")
}

impl Sample {
    fn encode(self, schema: &Schema, before: &[Good], usual: &str) -> Result<Good, String> {
        let message = schema.message(&self.message)?;
        let mut table = match &self.like {
            Some(like) => find(before, like)?.table.clone(),
            None => Table::new(),
        };
        table.extend(self.fields);
        if let Some(first) = self.counters_from {
            let names = schema.counters.iter().map(|counter| counter.name.clone());
            table.extend(names.zip((first..).map(Value::Integer)));
        }
        let (_, list) = schema.payload_fields(message, self.opcode.as_deref())?;
        let unknown = |name: &&String| list.iter().all(|field| field.name != **name);
        if let Some(name) = table.keys().find(unknown) {
            return Err(format!("{} has no field {name}", message.name));
        }
        let time = Value::String(self.time.unwrap_or(usual.to_owned()));
        let (count, time) = (self.sequence_count, unsigned(&time)?);
        let bytes = payload(schema, message, self.opcode.as_deref(), &table)?;
        let bytes = packet(schema, message, count, time, &bytes, &Mistake::default());
        let value = |field: Field| table.get(&field.name).cloned().map(|value| (field, value));
        let fields = list.into_iter().filter_map(value).collect();
        Ok(Good {
            name: self.name,
            message: self.message,
            opcode: self.opcode,
            count,
            time,
            fields,
            bytes,
            table,
        })
    }
}

impl Mistake {
    fn encode(&self, schema: &Schema, like: &Good) -> Result<Vec<u8>, String> {
        let message = schema.message(&like.message)?;
        let mut table = like.table.clone();
        table.extend(self.fields.clone());
        table.retain(|name, _| self.without.iter().all(|without| without != name));
        let mut bytes = match &self.payload {
            Some(digits) => from_hex(digits)?,
            None => payload(schema, message, like.opcode.as_deref(), &table)?,
        };
        bytes.truncate(bytes.len().saturating_sub(self.cut));
        bytes.extend(from_hex(self.append.as_deref().unwrap_or_default())?);
        let mut bytes = packet(schema, message, like.count, like.time, &bytes, self);
        bytes.truncate(self.keep.unwrap_or(bytes.len()));
        Ok(bytes)
    }
}

/// RFC 1055 around packet and CRC-32.
fn slip(packet: &[u8]) -> Vec<u8> {
    let mut line = vec![0xC0];
    for byte in packet.iter().copied().chain(crc32(packet).to_be_bytes()) {
        match byte {
            0xC0 => line.extend([0xDB, 0xDC]),
            0xDB => line.extend([0xDB, 0xDD]),
            byte => line.push(byte),
        }
    }
    line.push(0xC0);
    line
}

/// Primary header, time, version, payload, CRC; the payload in lines of 32 bytes.
fn spaced(bytes: &[u8]) -> String {
    if bytes.len() < 17 {
        return hex(bytes);
    }
    let groups = |bytes: &[u8], group| join(bytes.chunks(group).map(hex), " ");
    let (head, payload) = bytes.split_at(15);
    let (payload, crc) = payload.split_at(payload.len() - 2);
    let (primary, rest) = head.split_at(6);
    let (time, version) = rest.split_at(8);
    let primary = groups(primary, 2);
    let [time, version, crc] = [time, version, crc].map(hex);
    let lines = payload.chunks(32).map(|line| groups(line, 4));
    let payload = each(lines, |line| format!("\n      {line}"));
    format!("{primary} | {time} | {version} |{payload}\n      | {crc}")
}
