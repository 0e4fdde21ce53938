//! The generated parts of `docs/icd.md`: the messages, the frames of the CAN form, the worked example. The text around them
//! is written by hand.

use crate::NOTE;
use crate::bytes::hex;
use crate::encode::{float, numbers};
use crate::model::{Enum, Field, Kind, Message, Number, Opcode, Receiver, Rest, Schema};
use crate::vectors::{Good, Vectors};

/// Octets before the payload, and after it.
const HEADER: usize = 15;
const CRC: usize = 2;

/// `document` with its generated parts made anew.
///
/// # Errors
/// A part without its marks.
pub fn write(schema: &Schema, vectors: &Vectors, document: &str) -> Result<String, String> {
    let mut document = document.to_owned();
    let example = vectors.good.first().ok_or("no vector for the example")?;
    for (name, text) in [
        ("messages", messages(schema)),
        ("frames", frames(schema)),
        ("example", worked(schema, example)),
    ] {
        let (begin, end) = (
            format!("<!-- {name}. {NOTE} -->\n"),
            format!("<!-- end of {name} -->\n"),
        );
        let parts = document.split_once(&begin).and_then(|(before, rest)| {
            let (_, after) = rest.split_once(&end)?;
            Some(format!("{before}{begin}\n{text}\n{end}{after}"))
        });
        document = parts.ok_or(format!("docs/icd.md: no lines\n{begin}{end}"))?;
    }
    Ok(document)
}

/// Section 3.
fn messages(schema: &Schema) -> String {
    let mut out =
        "| APID | message | direction | time in its header | octets |\n|---|---|---|---|---|\n"
            .to_owned();
    for message in &schema.messages {
        let direction = match message.to {
            Receiver::Emulator => "to the emulator",
            Receiver::Client => "from the emulator",
        };
        let (apid, name, time) = (message.apid, &message.name, &message.time);
        out += &format!(
            "| {apid:#05x} | {name} | {direction} | {time} | {} |\n",
            lengths(schema, message)
        );
    }
    out += "\nThe present time of the emulator is that of the last attitude accepted in this exchange, 0 before the first.\n";
    for (number, message) in (1..).zip(&schema.messages) {
        out += &format!(
            "\n### 3.{number} {} (APID {:#05x})\n\n",
            message.name, message.apid
        );
        if let Some(text) = &message.before {
            out += &format!("{text}\n\n");
        }
        if message.opcodes.is_empty() {
            out += &table(schema, &schema.fields(message), HEADER);
        } else {
            out += &commands(schema, message);
        }
        for field in &message.fields {
            let record = field
                .record
                .as_deref()
                .and_then(|name| schema.structure(name));
            if let Some(record) = record {
                out += &format!(
                    "\nA record:\n\n{}",
                    table(schema, &schema.flat(&record.fields), 0)
                );
            }
        }
        if let Some(text) = &message.after {
            out += &format!("\n{}\n", text.trim_start());
        }
        for field in &message.fields {
            if let Some(codes) = long_codes(schema, field) {
                out += &code_table(&field.name, codes);
            }
        }
    }
    out
}

const HEAD: &str =
    "| offset | size | type | field | unit | range | meaning |\n|---|---|---|---|---|---|---|\n";

/// The table of a list of fields.
fn table(schema: &Schema, fields: &[Field], from: usize) -> String {
    let mut out = HEAD.to_owned();
    let (mut at, mut open) = (from, false);
    for field in fields {
        let size = field
            .octets()
            .map_or("n".to_owned(), |octets| octets.to_string());
        let offset = if open {
            format!("{at} + ...")
        } else {
            at.to_string()
        };
        let range = field.range_text(schema);
        out += &row(&[
            &offset,
            &size,
            &type_text(field),
            &field.name,
            &field.unit,
            &range,
            &meaning(schema, field),
        ]);
        at += field.octets().unwrap_or_default();
        open |= field.octets().is_none();
    }
    out
}

/// The rest of a packet has no type that a number could have.
fn type_text(field: &Field) -> String {
    match &field.kind {
        Kind::One(number) => number.name(),
        Kind::Array(number, length) => {
            let each = format!("{}[{length}]", number.name());
            field
                .counted_by
                .as_ref()
                .map_or(each.clone(), |count| format!("{count} times {each}"))
        }
        Kind::Ascii(length) => format!("ASCII[{length}]"),
        Kind::Rest(Rest::Utf8) => "UTF-8".to_owned(),
        Kind::Rest(_) | Kind::Struct(_) => String::new(),
    }
}

/// Table cells with single blanks around what they hold.
fn row(cells: &[&str]) -> String {
    let cells: String = cells
        .iter()
        .map(|cell| {
            if cell.is_empty() {
                " |".to_owned()
            } else {
                format!(" {cell} |")
            }
        })
        .collect();
    format!("|{cells}\n")
}

/// A sentence as a table cell.
pub fn cell(text: &str) -> String {
    let text = text.strip_suffix('.').unwrap_or(text);
    let mut chars = text.chars();
    match (chars.next(), chars.next()) {
        (Some(first), Some(second)) if second.is_lowercase() || second == ' ' => {
            format!(
                "{}{}",
                first.to_lowercase(),
                text.get(first.len_utf8()..).unwrap_or_default()
            )
        }
        _ => text.to_owned(),
    }
}

fn meaning(schema: &Schema, field: &Field) -> String {
    let doc = cell(&field.doc);
    let codes = field.codes.as_deref().and_then(|name| schema.codes(name));
    match codes {
        // The code of a packing is what it means.
        Some(codes) if codes.values.len() <= 4 && codes.name != "Packing" => {
            let named: Vec<String> = codes
                .values
                .iter()
                .map(|value| format!("{} {}", value.code, value.name))
                .collect();
            format!("{doc}: {}", named.join(", "))
        }
        _ => doc,
    }
}

/// Codes that need a table of their own.
fn long_codes<'a>(schema: &'a Schema, field: &Field) -> Option<&'a Enum> {
    let codes = field.codes.as_deref().and_then(|name| schema.codes(name));
    codes.filter(|codes| codes.values.len() > 4)
}

fn code_table(column: &str, codes: &Enum) -> String {
    let counted = codes.values.iter().any(|value| value.counter.is_some());
    let mut out = match counted {
        true => format!("\n| {column} | name | counted in | why |\n|---|---|---|---|\n"),
        false => format!("\n| {column} | name | meaning |\n|---|---|---|\n"),
    };
    for value in &codes.values {
        let (code, doc) = (value.code.to_string(), cell(&value.doc));
        out += &match &value.counter {
            Some(counter) => row(&[&code, &value.name, counter, &doc]),
            None => row(&[&code, &value.name, &doc]),
        };
    }
    out
}

/// The table of opcodes, and one for each that has several fields.
fn commands(schema: &Schema, message: &Message) -> String {
    let codes = message.opcodes.iter().map(|opcode| opcode.code);
    let range = format!(
        "{} to {}",
        codes.clone().min().unwrap_or_default(),
        codes.max().unwrap_or_default()
    );
    let mut out = HEAD.to_owned();
    out += &row(&["15", "1", "u8", "opcode", "", &range, "which command"]);
    out += &row(&["16", "n", "", "argument", "", "", "as the opcode says"]);
    out +=
        "\n| opcode | command | argument | unit | range | meaning |\n|---|---|---|---|---|---|\n";
    for opcode in &message.opcodes {
        let fields = schema.arguments(opcode);
        let (argument, unit, range) = match fields.as_slice() {
            [] => ("none".to_owned(), String::new(), String::new()),
            [one] => (
                format!("{} {}", type_text(one), one.name),
                one.unit.clone(),
                one.range_text(schema),
            ),
            _ => ("below".to_owned(), String::new(), String::new()),
        };
        out += &row(&[
            &opcode.code.to_string(),
            &opcode.name,
            &argument,
            &unit,
            &range,
            &cell(&opcode.doc),
        ]);
    }
    for opcode in message
        .opcodes
        .iter()
        .filter(|opcode| schema.arguments(opcode).len() > 1)
    {
        out += &format!(
            "\n{}:\n\n{}",
            opcode.name,
            table(schema, &schema.arguments(opcode), HEADER + 1)
        );
        for field in &schema.arguments(opcode) {
            if let Some(codes) = long_codes(schema, field) {
                out += &code_table(&field.name, codes);
            }
        }
    }
    out
}

/// How long the packets are: `21`, `78 or 126`, `26 to 1400`.
fn lengths(schema: &Schema, message: &Message) -> String {
    let span = |fields: &[Field]| {
        let ranges = fields.iter().map(Field::octets_range);
        ranges.fold(
            (HEADER + CRC, HEADER + CRC),
            |(least, most), (low, high)| (least + low, most + high),
        )
    };
    let fields = schema.fields(message);
    if message.optional.is_some() {
        let fixed: Vec<Field> = fields
            .iter()
            .filter(|field| !field.optional)
            .cloned()
            .collect();
        return format!("{} or {}", span(&fixed).0, span(&fields).0);
    }
    let mut spans = vec![span(&fields)];
    if !message.opcodes.is_empty() {
        let span = |opcode: &Opcode| span(&schema.arguments(opcode));
        spans = message
            .opcodes
            .iter()
            .map(span)
            .map(|(least, most)| (least + 1, most + 1))
            .collect();
    }
    let least = spans
        .iter()
        .map(|(least, _)| *least)
        .min()
        .unwrap_or_default();
    let most = spans
        .iter()
        .map(|(_, most)| *most)
        .max()
        .unwrap_or_default();
    if least == most {
        least.to_string()
    } else {
        format!("{least} to {most}")
    }
}

/// The frames of the CAN form.
fn frames(schema: &Schema) -> String {
    let mut out =
        "| id | frame | direction | octets | signals: first bit, bits |\n|---|---|---|---|---|\n"
            .to_owned();
    for frame in &schema.can.frames {
        let direction = match frame.to {
            Receiver::Emulator => "to the emulator",
            Receiver::Client => "from the emulator",
        };
        let signals: Vec<String> = crate::dbc::placed(frame)
            .map(|(at, signal)| {
                let kind = if crate::dbc::is_float(signal) {
                    " (f32)"
                } else {
                    ""
                };
                format!("{} {at}, {}{kind}", signal.name, signal.bits)
            })
            .collect();
        let (id, octets) = (format!("{:#05x}", frame.id), frame.octets.to_string());
        out += &row(&[&id, &frame.name, direction, &octets, &signals.join("; ")]);
    }
    out += "\n| signal | unit | meaning |\n|---|---|---|\n";
    let mut seen = Vec::new();
    for (_, signal) in schema.can.frames.iter().flat_map(crate::dbc::placed) {
        if !seen.contains(&&signal.name) {
            seen.push(&signal.name);
            out += &row(&[&signal.name, &signal.unit, &cell(&signal.doc)]);
        }
    }
    out
}

/// The first golden vector, octet by octet.
fn worked(schema: &Schema, vector: &Good) -> String {
    let octets = &vector.octets;
    let mut lines = vec![
        (
            2,
            format!(
                "packet version 000, type 1, secondary header 1, APID {}",
                apid(schema, vector)
            ),
        ),
        (
            2,
            format!("sequence flags 11, sequence count {}", vector.count),
        ),
        (
            2,
            format!(
                "data length {}: the packet has {} octets",
                octets.len() - 7,
                octets.len()
            ),
        ),
        (4, format!("{} s since 1958-01-01 TAI", vector.time >> 32)),
        (
            4,
            match vector.time & 0xFFFF_FFFF {
                0 => "no fraction".to_owned(),
                fraction => format!("{fraction} units of 2^-32 s"),
            },
        ),
        (1, format!("format version {}", schema.version)),
    ];
    let message = schema.message(&vector.message);
    for field in message
        .map(|message| schema.fields(message))
        .unwrap_or_default()
    {
        let value = vector
            .fields
            .iter()
            .find(|(known, _)| known.name == field.name)
            .map(|(_, value)| value);
        match (&field.kind, value) {
            (Kind::Array(number, _), Some(value)) => {
                let values = numbers(value).unwrap_or_default();
                for (part, value) in field.parts.iter().zip(values) {
                    let value = float(&value).unwrap_or(f64::NAN);
                    let text = format!("{} {part} = {value:?} {}", field.name, field.unit);
                    lines.push((number.octets(), text.trim_end().to_owned()));
                }
            }
            (Kind::One(number), Some(value)) => {
                lines.push((number.octets(), format!("{} {value}", field.name)))
            }
            (Kind::One(Number::Unsigned(1)), None) => {
                lines.push((1, format!("{} 1: with a state", field.name)))
            }
            _ => {}
        }
    }
    lines.push((
        CRC,
        format!("CRC-16 of the {} octets before", octets.len() - CRC),
    ));
    let mut out = "```\n".to_owned();
    let mut at = 0;
    for (size, text) in lines {
        let digits = hex(octets.get(at..at + size).unwrap_or_default(), size);
        out += &format!("{at:3}  {digits:<16}  {text}\n");
        at += size;
    }
    out + "```\n"
}

fn apid(schema: &Schema, vector: &Good) -> String {
    schema
        .message(&vector.message)
        .map(|message| format!("{:#05x}", message.apid))
        .unwrap_or_default()
}
