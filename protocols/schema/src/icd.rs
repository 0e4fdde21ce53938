//! The generated parts of `docs/icd.md`: the messages, the frames of the CAN form, the worked
//! example. The text around them is written by hand.

use crate::NOTE;
use crate::bytes::hex;
use crate::encode::{float, numbers};
use crate::model::{Code, Enum, Field, Kind, Receiver, Record, Rest, Schema};
use crate::text::{each, join};
use crate::vectors::{Good, Vectors};

/// Bytes before the payload, and after it.
const HEADER: usize = 15;
const CRC: usize = 2;

/// Renews the generated parts of `document`.
///
/// # Errors
/// The marks of a part are missing.
pub fn write(schema: &Schema, vectors: &Vectors, document: &str) -> Result<String, String> {
    let mut document = document.to_owned();
    let example = vectors.good.first().ok_or("no vector for the example")?;
    for (name, text) in [
        ("messages", messages(schema)),
        ("frames", frames(schema)),
        ("example", worked(schema, example)?),
    ] {
        let begin = format!("<!-- {name}. {NOTE} -->\n");
        let end = format!("<!-- end of {name} -->\n");
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
        let apid = format!("{:#05x}", message.apid);
        let (to, lengths) = (direction(message.to), lengths(schema, message));
        out += &row(&[&apid, &message.name, to, &message.time, &lengths]);
    }
    out += "\nThe present time of the emulator is that of the last attitude accepted in this exchange, 0 before the first.\n";
    for (number, message) in (1..).zip(&schema.messages) {
        let (name, apid) = (&message.name, message.apid);
        out += &format!("\n### 3.{number} {name} (APID {apid:#05x})\n\n");
        if let Some(text) = &message.before {
            out += &format!("{text}\n\n");
        }
        out += &if message.opcodes.is_empty() {
            table(schema, &schema.fields(message), HEADER)
        } else {
            commands(schema, message)
        };
        let records = message
            .fields
            .iter()
            .filter_map(|field| schema.record(field));
        out += &each(records, |record| {
            let table = table(schema, &schema.flat(&record.fields), 0);
            format!("\nA record:\n\n{table}")
        });
        if let Some(text) = &message.after {
            out += &format!("\n{}\n", text.trim_start());
        }
        out += &each(&message.fields, |field| code_table(schema, field));
    }
    out
}

const fn direction(to: Receiver) -> &'static str {
    match to {
        Receiver::Emulator => "to the emulator",
        Receiver::Client => "from the emulator",
    }
}

/// A row of a table, with blanks around the text of cells.
fn row(cells: &[&str]) -> String {
    let cells = each(cells, |cell| match *cell {
        "" => " |".to_owned(),
        cell => format!(" {cell} |"),
    });
    format!("|{cells}\n")
}

/// The head of a table of fields.
const FIELDS: &str =
    "| offset | size | type | field | unit | range | meaning |\n|---|---|---|---|---|---|---|\n";

/// The table of a list of fields.
fn table(schema: &Schema, fields: &[Field], from: usize) -> String {
    let mut out = FIELDS.to_owned();
    let (mut at, mut open) = (from, "");
    for field in fields {
        let (offset, bytes) = (format!("{at}{open}"), field.bytes());
        let size = bytes.map_or("n".to_owned(), |bytes| bytes.to_string());
        let (kind, range) = (type_text(field), field.range_text(schema));
        let meaning = meaning(schema, field);
        let (name, unit) = (&field.name, &field.unit);
        out += &row(&[&offset, &size, &kind, name, unit, &range, &meaning]);
        match bytes {
            Some(bytes) => at += bytes,
            None => open = " + ...",
        }
    }
    out
}

/// The type of a field; empty for structures and the rest of a packet.
fn type_text(field: &Field) -> String {
    match (&field.kind, &field.counted_by) {
        (Kind::One(number), _) => number.name(),
        (Kind::Array(number, length), None) => format!("{}[{length}]", number.name()),
        (Kind::Array(number, length), Some(count)) => {
            format!("{count} times {}[{length}]", number.name())
        }
        (Kind::Ascii(length), _) => format!("ASCII[{length}]"),
        (Kind::Rest(Rest::Utf8), _) => "UTF-8".to_owned(),
        (Kind::Rest(_) | Kind::Struct(_), _) => String::new(),
    }
}

/// A sentence as a table cell: without full stop, first letter in lower case.
pub fn cell(text: &str) -> String {
    let text = text.strip_suffix('.').unwrap_or(text);
    let mut chars = text.chars();
    match (chars.next(), chars.next()) {
        (Some(first), Some(second)) if second.is_lowercase() || second == ' ' => {
            let rest = text.get(first.len_utf8()..).unwrap_or_default();
            format!("{}{rest}", first.to_lowercase())
        }
        _ => text.to_owned(),
    }
}

/// Codes with more values have a table of their own.
const FEW_CODES: usize = 4;

fn meaning(schema: &Schema, field: &Field) -> String {
    let doc = cell(&field.doc);
    match schema.codes(field) {
        // The code of a packing is its number of bits.
        Some(Enum { name, values, .. }) if values.len() <= FEW_CODES && name != "Packing" => {
            let values = values.iter();
            let named = values.map(|value| format!("{} {}", value.code, value.name));
            format!("{doc}: {}", join(named, ", "))
        }
        _ => doc,
    }
}

/// The table of a field's codes, if they are many.
fn code_table(schema: &Schema, field: &Field) -> String {
    let values = schema.codes(field).map_or(&[][..], |codes| &codes.values);
    if values.len() <= FEW_CODES {
        return String::new();
    }
    let head = if values.iter().any(|value| value.counter.is_some()) {
        "name | counted in | why |\n|---|---|---|---|"
    } else {
        "name | meaning |\n|---|---|---|"
    };
    let rows = each(
        values,
        |Code {
             name,
             code,
             counter,
             doc,
             ..
         }| {
            let (code, doc) = (code.to_string(), cell(doc));
            match counter {
                Some(counter) => row(&[&code, name, counter, &doc]),
                None => row(&[&code, name, &doc]),
            }
        },
    );
    format!("\n| {} | {head}\n{rows}", field.name)
}

/// The table of opcodes, and a table for each opcode with several fields.
fn commands(schema: &Schema, message: &Record) -> String {
    let codes = || message.opcodes.iter().map(|opcode| opcode.code);
    let (first, last) = (codes().min().unwrap_or(0), codes().max().unwrap_or(0));
    let range = format!("{first} to {last}");
    let mut out = FIELDS.to_owned();
    out += &row(&["15", "1", "u8", "opcode", "", &range, "which command"]);
    out += &row(&["16", "n", "", "argument", "", "", "as the opcode says"]);
    out +=
        "\n| opcode | command | argument | unit | range | meaning |\n|---|---|---|---|---|---|\n";
    for opcode in &message.opcodes {
        let (code, meaning) = (opcode.code.to_string(), cell(&opcode.doc));
        out += &match schema.arguments(opcode).as_slice() {
            [] => row(&[&code, &opcode.name, "none", "", "", &meaning]),
            [one] => {
                let argument = format!("{} {}", type_text(one), one.name);
                let range = one.range_text(schema);
                row(&[&code, &opcode.name, &argument, &one.unit, &range, &meaning])
            }
            _ => row(&[&code, &opcode.name, "below", "", "", &meaning]),
        };
    }
    for opcode in &message.opcodes {
        let fields = schema.arguments(opcode);
        if fields.len() > 1 {
            let table = table(schema, &fields, HEADER + 1);
            out += &format!("\n{}:\n\n{table}", opcode.name);
            out += &each(&fields, |field| code_table(schema, field));
        }
    }
    out
}

/// The length of the packets: `21`, `78 or 126`, `26 to 1400`.
fn lengths(schema: &Schema, message: &Record) -> String {
    let span = |fields: &[Field]| {
        let (min, max): (Vec<usize>, Vec<usize>) = fields.iter().map(Field::bytes_range).unzip();
        let around = HEADER + CRC;
        (
            around + min.iter().sum::<usize>(),
            around + max.iter().sum::<usize>(),
        )
    };
    let mut fields = schema.fields(message);
    let (mut min, mut max) = span(&fields);
    if message.optional.is_some() {
        fields.retain(|field| !field.optional);
        return format!("{} or {max}", span(&fields).0);
    }
    if !message.opcodes.is_empty() {
        let spans = message
            .opcodes
            .iter()
            .map(|opcode| span(&schema.arguments(opcode)));
        min = spans.clone().map(|(min, _)| min + 1).min().unwrap_or(min);
        max = spans.map(|(_, max)| max + 1).max().unwrap_or(max);
    }
    if min == max {
        min.to_string()
    } else {
        format!("{min} to {max}")
    }
}

/// The frames of the CAN form.
fn frames(schema: &Schema) -> String {
    let mut out =
        "| id | frame | direction | octets | signals: first bit, bits |\n|---|---|---|---|---|\n"
            .to_owned();
    for frame in &schema.can.frames {
        let signals = frame.placed().map(|(at, signal)| {
            let kind = if signal.is_float() { " (f32)" } else { "" };
            format!("{} {at}, {}{kind}", signal.name, signal.bits)
        });
        let (id, bytes) = (format!("{:#05x}", frame.id), frame.octets.to_string());
        let signals = join(signals, "; ");
        out += &row(&[&id, &frame.name, direction(frame.to), &bytes, &signals]);
    }
    out += "\n| signal | unit | meaning |\n|---|---|---|\n";
    let mut seen = Vec::new();
    for (_, signal) in schema.can.frames.iter().flat_map(|frame| frame.placed()) {
        if !seen.contains(&&signal.name) {
            seen.push(&signal.name);
            out += &row(&[&signal.name, &signal.unit, &cell(&signal.doc)]);
        }
    }
    out
}

/// The first golden vector, byte by byte.
fn worked(schema: &Schema, vector: &Good) -> Result<String, String> {
    let message = schema.message(&vector.message)?;
    let (apid, length) = (message.apid, vector.bytes.len());
    let fraction = match vector.time & 0xFFFF_FFFF {
        0 => "no fraction".to_owned(),
        fraction => format!("{fraction} units of 2^-32 s"),
    };
    let (count, field, seconds) = (vector.count, length - 7, vector.time >> 32);
    let kind = format!("packet version 000, type 1, secondary header 1, APID {apid:#05x}");
    let mut lines = vec![
        (2, kind),
        (2, format!("sequence flags 11, sequence count {count}")),
        (
            2,
            format!("data length {field}: the packet has {length} octets"),
        ),
        (4, format!("{seconds} s since 1958-01-01 TAI")),
        (4, fraction),
        (1, format!("format version {}", schema.version)),
    ];
    for field in schema.fields(message) {
        let (name, unit, parts) = (&field.name, &field.unit, &field.parts);
        let known = vector.fields.iter().find(|(known, _)| known.name == *name);
        match (&field.kind, known) {
            (Kind::Array(number, _), Some((_, value))) => {
                for (part, value) in parts.iter().zip(numbers(value)?) {
                    let text = format!("{name} {part} = {:?} {unit}", float(&value)?);
                    lines.push((number.bytes(), text.trim_end().to_owned()));
                }
            }
            (Kind::One(number), Some((_, value))) => {
                lines.push((number.bytes(), format!("{name} {value}")));
            }
            (_, None) if message.is_flag(&field) => {
                lines.push((1, format!("{name} 1: with a state")));
            }
            _ => {}
        }
    }
    lines.push((CRC, format!("CRC-16 of the {} octets before", length - CRC)));
    let mut at = 0;
    let lines = each(lines, |(size, text)| {
        let digits = hex(vector.bytes.get(at..at + size).unwrap_or_default());
        let line = format!("{at:3}  {digits:<16}  {text}\n");
        at += size;
        line
    });
    Ok(format!("```\n{lines}```\n"))
}
