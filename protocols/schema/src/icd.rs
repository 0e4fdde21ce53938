//! The generated parts of `docs/icd.md`: the messages, the frames of the CAN form, the worked example. The text around them
//! is written by hand.

use crate::NOTE;
use crate::bytes::hex;
use crate::encode::{float, numbers};
use crate::model::{Enum, Field, Kind, Opcode, Receiver, Record, Rest, Schema, Signal};
use crate::text::{each, join};
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
    let mut out = head(&[
        "APID",
        "message",
        "direction",
        "time in its header",
        "octets",
    ]);
    for message in &schema.messages {
        let apid = format!("{:#05x}", message.apid);
        let (to, lengths) = (direction(message.to), lengths(schema, message));
        out += &row(&[&apid, &message.name, to, &message.time, &lengths]);
    }
    out += "\nThe present time of the emulator is that of the last attitude accepted in this exchange, 0 before the first.\n";
    for (number, message) in (1..).zip(&schema.messages) {
        let Record { name, apid, .. } = message;
        out += &format!("\n### 3.{number} {name} (APID {apid:#05x})\n\n");
        if let Some(text) = &message.before {
            out += &format!("{text}\n\n");
        }
        out += &match message.opcodes.is_empty() {
            true => table(schema, &schema.fields(message), HEADER),
            false => commands(schema, message),
        };
        for record in message
            .fields
            .iter()
            .filter_map(|field| schema.record(field))
        {
            let table = table(schema, &schema.flat(&record.fields), 0);
            out += &format!("\nA record:\n\n{table}");
        }
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

/// The head of a table.
fn head(columns: &[&str]) -> String {
    format!("{}|{}\n", row(columns), "---|".repeat(columns.len()))
}

/// Table cells with single blanks around what they hold.
fn row(cells: &[&str]) -> String {
    let cells = each(cells, |cell| match *cell {
        "" => " |".to_owned(),
        cell => format!(" {cell} |"),
    });
    format!("|{cells}\n")
}

/// The head of a table of fields.
fn field_head() -> String {
    head(&[
        "offset", "size", "type", "field", "unit", "range", "meaning",
    ])
}

/// The table of a list of fields.
fn table(schema: &Schema, fields: &[Field], from: usize) -> String {
    let mut out = field_head();
    let (mut at, mut open) = (from, "");
    for field in fields {
        let (offset, octets) = (format!("{at}{open}"), field.octets());
        let size = octets.map_or("n".to_owned(), |octets| octets.to_string());
        let (kind, range) = (type_text(field), field.range_text(schema));
        let meaning = meaning(schema, field);
        let (name, unit) = (&field.name, &field.unit);
        out += &row(&[&offset, &size, &kind, name, unit, &range, &meaning]);
        match octets {
            Some(octets) => at += octets,
            None => open = " + ...",
        }
    }
    out
}

/// The rest of a packet has no type that a number could have.
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

/// A sentence as a table cell.
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

/// Codes of more than this many values have a table of their own.
const FEW_CODES: usize = 4;

fn meaning(schema: &Schema, field: &Field) -> String {
    let doc = cell(&field.doc);
    match schema.codes(field) {
        // The code of a packing is what it means.
        Some(Enum { name, values, .. }) if values.len() <= FEW_CODES && name != "Packing" => {
            let named = values
                .iter()
                .map(|value| format!("{} {}", value.code, value.name));
            format!("{doc}: {}", join(named, ", "))
        }
        _ => doc,
    }
}

/// The table of a field's codes, if they are many.
fn code_table(schema: &Schema, field: &Field) -> String {
    let codes = schema
        .codes(field)
        .filter(|codes| codes.values.len() > FEW_CODES);
    let Some(codes) = codes else {
        return String::new();
    };
    let counted = codes.values.iter().any(|value| value.counter.is_some());
    let head = match counted {
        true => head(&[&field.name, "name", "counted in", "why"]),
        false => head(&[&field.name, "name", "meaning"]),
    };
    let rows = each(&codes.values, |value| {
        let (code, doc) = (value.code.to_string(), cell(&value.doc));
        match &value.counter {
            Some(counter) => row(&[&code, &value.name, counter, &doc]),
            None => row(&[&code, &value.name, &doc]),
        }
    });
    format!("\n{head}{rows}")
}

/// The table of opcodes, and one for each that has several fields.
fn commands(schema: &Schema, message: &Record) -> String {
    let codes = || message.opcodes.iter().map(|opcode| opcode.code);
    let (first, last) = (codes().min().unwrap_or(0), codes().max().unwrap_or(0));
    let range = format!("{first} to {last}");
    let mut out = field_head();
    out += &row(&["15", "1", "u8", "opcode", "", &range, "which command"]);
    out += &row(&["16", "n", "", "argument", "", "", "as the opcode says"]);
    out += "\n";
    out += &head(&["opcode", "command", "argument", "unit", "range", "meaning"]);
    for opcode in &message.opcodes {
        let (code, meaning) = (opcode.code.to_string(), cell(&opcode.doc));
        let (argument, unit, range) = match schema.arguments(opcode).as_slice() {
            [] => ("none".to_owned(), String::new(), String::new()),
            [one] => {
                let argument = format!("{} {}", type_text(one), one.name);
                (argument, one.unit.clone(), one.range_text(schema))
            }
            _ => ("below".to_owned(), String::new(), String::new()),
        };
        out += &row(&[&code, &opcode.name, &argument, &unit, &range, &meaning]);
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

/// How long the packets are: `21`, `78 or 126`, `26 to 1400`.
fn lengths(schema: &Schema, message: &Record) -> String {
    let fields = schema.fields(message);
    let span = |fields: &[Field]| {
        let ranges = fields.iter().map(Field::octets_range);
        ranges.fold((HEADER + CRC, HEADER + CRC), |sum, range| {
            (sum.0 + range.0, sum.1 + range.1)
        })
    };
    if message.optional.is_some() {
        let (_, fixed): (Vec<Field>, Vec<Field>) =
            fields.iter().cloned().partition(|field| field.optional);
        return format!("{} or {}", span(&fixed).0, span(&fields).0);
    }
    let of_opcode = |opcode: &Opcode| {
        let (least, most) = span(&schema.arguments(opcode));
        (least + 1, most + 1)
    };
    let mut spans: Vec<(usize, usize)> = message.opcodes.iter().map(of_opcode).collect();
    if spans.is_empty() {
        spans.push(span(&fields));
    }
    let least = spans.iter().map(|span| span.0).min().unwrap_or(0);
    let most = spans.iter().map(|span| span.1).max().unwrap_or(0);
    match least == most {
        true => least.to_string(),
        false => format!("{least} to {most}"),
    }
}

/// The frames of the CAN form.
fn frames(schema: &Schema) -> String {
    let mut out = head(&[
        "id",
        "frame",
        "direction",
        "octets",
        "signals: first bit, bits",
    ]);
    for frame in &schema.can.frames {
        let signals = frame.placed().map(|(at, signal)| {
            let kind = if signal.is_float() { " (f32)" } else { "" };
            format!("{} {at}, {}{kind}", signal.name, signal.bits)
        });
        let (id, octets) = (format!("{:#05x}", frame.id), frame.octets.to_string());
        let signals = join(signals, "; ");
        out += &row(&[&id, &frame.name, direction(frame.to), &octets, &signals]);
    }
    out += "\n";
    out += &head(&["signal", "unit", "meaning"]);
    let mut seen = Vec::new();
    for (
        _,
        Signal {
            name, unit, doc, ..
        },
    ) in schema.can.frames.iter().flat_map(|frame| frame.placed())
    {
        if !seen.contains(&name) {
            seen.push(name);
            out += &row(&[name, unit, &cell(doc)]);
        }
    }
    out
}

/// The first golden vector, octet by octet.
fn worked(schema: &Schema, vector: &Good) -> Result<String, String> {
    let message = schema.message(&vector.message)?;
    let (apid, length) = (message.apid, vector.octets.len());
    let fraction = match vector.time & 0xFFFF_FFFF {
        0 => "no fraction".to_owned(),
        fraction => format!("{fraction} units of 2^-32 s"),
    };
    let mut lines = vec![
        (
            2,
            format!("packet version 000, type 1, secondary header 1, APID {apid:#05x}"),
        ),
        (
            2,
            format!("sequence flags 11, sequence count {}", vector.count),
        ),
        (
            2,
            format!("data length {}: the packet has {length} octets", length - 7),
        ),
        (4, format!("{} s since 1958-01-01 TAI", vector.time >> 32)),
        (4, fraction),
        (1, format!("format version {}", schema.version)),
    ];
    for field in schema.fields(message) {
        let Field {
            name, unit, parts, ..
        } = &field;
        let known = vector.fields.iter().find(|(known, _)| known.name == *name);
        match (&field.kind, known) {
            (Kind::Array(number, _), Some((_, value))) => {
                for (part, value) in parts.iter().zip(numbers(value)?) {
                    let text = format!("{name} {part} = {:?} {unit}", float(&value)?);
                    lines.push((number.octets(), text.trim_end().to_owned()));
                }
            }
            (Kind::One(number), Some((_, value))) => {
                lines.push((number.octets(), format!("{name} {value}")));
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
        let digits = hex(vector.octets.get(at..at + size).unwrap_or_default());
        let line = format!("{at:3}  {digits:<16}  {text}\n");
        at += size;
        line
    });
    Ok(format!("```\n{lines}```\n"))
}
