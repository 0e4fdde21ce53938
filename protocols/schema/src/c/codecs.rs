//! Readers, writers and ranges of the C header.

use super::{directions, snake, upper};
use crate::model::{Field, Kind, Message, Number, Receiver, Rest, Rule, Schema};

/// Which APIDs there are.
pub(super) fn known(schema: &Schema) -> String {
    let list = |receivers: &[Receiver]| {
        let messages = schema
            .messages
            .iter()
            .filter(|message| receivers.contains(&message.to));
        let terms =
            messages.map(|message| format!("(apid == SKYLOOP_APID_{})", upper(&message.name)));
        terms.collect::<Vec<_>>().join(" ||\n           ")
    };
    format!(
        "\n/* Whether packets with this APID go towards the emulator. */\nstatic inline bool skyloop_is_telecommand(uint16_t apid)\n{{\n    return {};\n}}\n\nstatic inline bool skyloop_is_known(uint16_t apid)\n{{\n    return {};\n}}\n\n",
        list(&[Receiver::Emulator]),
        list(&[Receiver::Emulator, Receiver::Client])
    )
}

/// Every reader, writer and range, and the functions of the two directions.
pub(super) fn write(schema: &Schema) -> String {
    let mut out = String::from(
        "\n/* ---- codecs ------------------------------------------------------------------------------------------------------ */\n",
    );
    for structure in &schema.structs {
        out += &functions(
            &structure.name,
            &structure.fields,
            None,
            &[],
            structure.check,
            false,
        );
    }
    for message in &schema.messages {
        if message.opcodes.is_empty() {
            let counters: Vec<&str> = match message.counters {
                true => schema
                    .counters
                    .iter()
                    .map(|counter| counter.name.as_str())
                    .collect(),
                false => Vec::new(),
            };
            let flag = message
                .optional
                .as_ref()
                .map(|optional| (optional.flag.as_str(), optional.name.as_str()));
            out += &functions(
                message.type_name(),
                &message.fields,
                flag,
                &counters,
                message.check,
                message.encode_check,
            );
        } else {
            out += &commands(schema, message);
        }
    }
    for (name, messages) in directions(schema) {
        out += &direction(name, &messages);
    }
    out
}

/// Reader, writer and ranges of one structure.
fn functions(
    name: &str,
    fields: &[Field],
    flag: Option<(&str, &str)>,
    counters: &[&str],
    check: bool,
    encode_check: bool,
) -> String {
    let name = snake(name);
    let (mut read, mut write, mut ranges) = (String::new(), String::new(), String::new());
    if encode_check {
        write += &format!(
            "    if (skyloop_valid_{name}(in) != SKYLOOP_OK) {{\n        writer->error = SKYLOOP_INCONSISTENT;\n        return;\n    }}\n"
        );
    }
    if flag.is_some() {
        read += "    const skyloop_reader_t begin = *reader;\n    (void)memset(out, 0, sizeof *out);\n    *reader = begin;\n";
        read = "    (void)memset(out, 0, sizeof *out);\n".to_owned();
    }
    for field in fields {
        let is_flag = flag.filter(|(flag, _)| *flag == field.name);
        let (mut one_read, mut one_write, mut one_range) = match is_flag {
            Some((_, optional)) => flag_field(optional),
            None => (read_field(field), write_field(field), range(field)),
        };
        if let (true, Some((_, optional))) = (field.optional, flag) {
            let inside = |text: &str| {
                text.lines()
                    .map(|line| format!("    {line}\n"))
                    .collect::<String>()
            };
            let around = |of: &str, text: &str| match text {
                "" => String::new(),
                text => format!("    if ({of}->has_{optional}) {{\n{}    }}\n", inside(text)),
            };
            one_read = around("out", &one_read);
            one_write = around("in", &one_write);
            one_range = around("in", &one_range);
        }
        read += &one_read;
        write += &one_write;
        ranges += &one_range;
    }
    for counter in counters {
        read += &format!("    out->{counter} = skyloop_read_u32(reader);\n");
        write += &format!("    skyloop_write_u32(writer, in->{counter});\n");
    }
    let last = if check {
        format!("skyloop_check_{name}(in)")
    } else {
        "SKYLOOP_OK".to_owned()
    };
    let unused = if ranges.is_empty() && !check {
        "    (void)in;\n"
    } else {
        ""
    };
    format!(
        "\nstatic inline skyloop_error_t skyloop_valid_{name}(const skyloop_{name}_t *in)\n{{\n{unused}{ranges}    return {last};\n}}\n\n\
         static inline void skyloop_read_{name}(skyloop_reader_t *reader, skyloop_{name}_t *out)\n{{\n{read}}}\n\n\
         static inline void skyloop_write_{name}(skyloop_writer_t *writer, const skyloop_{name}_t *in)\n{{\n{write}}}\n"
    )
}

fn flag_field(optional: &str) -> (String, String, String) {
    (
        format!(
            "    const uint8_t flags = skyloop_read_u8(reader);\n    if (flags > 1U) {{\n        skyloop_fail(reader, SKYLOOP_BAD_VALUE);\n    }}\n    out->has_{optional} = (flags == 1U);\n"
        ),
        format!("    skyloop_write_u8(writer, in->has_{optional} ? 1U : 0U);\n"),
        String::new(),
    )
}

/// `u8` of a number: the end of a function's name.
fn suffix(number: Number) -> &'static str {
    match number {
        Number::Unsigned(1) => "u8",
        Number::Unsigned(2) => "u16",
        Number::Unsigned(4) => "u32",
        Number::Unsigned(_) | Number::Time => "u64",
        Number::Float(4) => "f32",
        Number::Float(_) => "f64",
    }
}

fn read_field(field: &Field) -> String {
    let name = &field.name;
    let fail = "        skyloop_fail(reader, SKYLOOP_BAD_VALUE);\n    }\n";
    match &field.kind {
        _ if !field.bits.is_empty() => {
            let most = (1_u32 << field.bits.len()) - 1;
            let mut out = format!(
                "    const uint8_t {name} = skyloop_read_u8(reader);\n    if ({name} > {most}U) {{\n{fail}"
            );
            for (bit, flag) in field.bits.iter().enumerate() {
                out += &format!("    out->{flag} = ({name} & {}U) != 0U;\n", 1 << bit);
            }
            out
        }
        Kind::One(number) => {
            let mut out = format!(
                "    out->{name} = skyloop_read_{}(reader);\n",
                suffix(*number)
            );
            if let Some(codes) = &field.codes {
                out += &format!(
                    "    if (!skyloop_is_{}(out->{name})) {{\n{fail}",
                    snake(codes)
                );
            }
            out
        }
        Kind::Array(number, length) => {
            let read = format!("skyloop_read_{}(reader)", suffix(*number));
            match &field.counted_by {
                None => format!(
                    "    for (size_t n = 0U; n < {length}U; n++) {{\n        out->{name}[n] = {read};\n    }}\n"
                ),
                Some(count) => format!(
                    "    if (out->{count} > {most}U) {{\n{fail}    for (size_t n = 0U; (reader->error == SKYLOOP_OK) && (n < out->{count}); n++) {{\n        for (size_t k = 0U; k < {length}U; k++) {{\n            out->{name}[n][k] = {read};\n        }}\n    }}\n",
                    most = field.most
                ),
            }
        }
        Kind::Ascii(length) => {
            format!("    skyloop_read_octets(reader, out->{name}, {length}U);\n")
        }
        Kind::Struct(kind) => format!("    skyloop_read_{}(reader, &out->{name});\n", snake(kind)),
        Kind::Rest(_) => {
            format!("    out->{name} = skyloop_read_rest(reader, &out->{name}_length);\n")
        }
    }
}

fn write_field(field: &Field) -> String {
    let name = &field.name;
    match &field.kind {
        _ if !field.bits.is_empty() => {
            let bits = field
                .bits
                .iter()
                .enumerate()
                .map(|(bit, flag)| format!("(in->{flag} ? {}U : 0U)", 1 << bit));
            format!(
                "    skyloop_write_u8(writer, (uint8_t)({}));\n",
                bits.collect::<Vec<_>>().join(" | ")
            )
        }
        Kind::One(number) => format!(
            "    skyloop_write_{}(writer, in->{name});\n",
            suffix(*number)
        ),
        Kind::Array(number, length) => {
            let write = format!("skyloop_write_{}", suffix(*number));
            match &field.counted_by {
                None => format!(
                    "    for (size_t n = 0U; n < {length}U; n++) {{\n        {write}(writer, in->{name}[n]);\n    }}\n"
                ),
                Some(count) => format!(
                    "    if (in->{count} > {most}U) {{\n        writer->error = SKYLOOP_TOO_LONG;\n    }}\n    for (size_t n = 0U; (writer->error == SKYLOOP_OK) && (n < in->{count}); n++) {{\n        for (size_t k = 0U; k < {length}U; k++) {{\n            {write}(writer, in->{name}[n][k]);\n        }}\n    }}\n",
                    most = field.most
                ),
            }
        }
        Kind::Ascii(length) => {
            format!("    skyloop_write_octets(writer, in->{name}, {length}U);\n")
        }
        Kind::Struct(kind) => format!("    skyloop_write_{}(writer, &in->{name});\n", snake(kind)),
        Kind::Rest(_) => {
            format!("    skyloop_write_octets(writer, in->{name}, in->{name}_length);\n")
        }
    }
}

/// What a field allows, as statements that return what is wrong.
fn range(field: &Field) -> String {
    let name = &field.name;
    let error = match field.error.as_deref() {
        Some("NotFinite") => "SKYLOOP_NOT_FINITE",
        _ => "SKYLOOP_BAD_VALUE",
    };
    let refuse =
        |condition: String| format!("    if ({condition}) {{\n        return {error};\n    }}\n");
    let mut out = String::new();
    let (is_float, largest) = match &field.kind {
        Kind::One(Number::Float(_)) => (true, f64::INFINITY),
        Kind::One(Number::Unsigned(octets)) => (false, 256_f64.powi(*octets as i32) - 1.0),
        _ => (false, f64::INFINITY),
    };
    let literal = |limit: f64| {
        if is_float {
            format!("{limit:?}")
        } else {
            format!("{limit}U")
        }
    };
    match (field.min, field.max) {
        // Written so that a NaN is refused.
        (min, max) if is_float && (min.is_some() || max.is_some()) => {
            let low = min.map(|min| format!("(in->{name} >= {})", literal(min)));
            let high = max.map(|max| format!("(in->{name} <= {})", literal(max)));
            let terms: Vec<String> = low.into_iter().chain(high).collect();
            out += &refuse(format!("!({})", terms.join(" && ")));
        }
        (min, max) => {
            if let Some(min) = min.filter(|min| *min > 0.0) {
                out += &refuse(format!("in->{name} < {}", literal(min)));
            }
            if let Some(max) = max.filter(|max| *max < largest) {
                out += &refuse(format!("in->{name} > {}", literal(max)));
            }
        }
    }
    let test = match field.rule {
        Some(Rule::Finite) => "skyloop_is_finite",
        Some(Rule::Positive) => "skyloop_is_positive",
        None => "",
    };
    match &field.kind {
        Kind::Array(_, length) if !test.is_empty() => {
            let inner = refuse(format!("!{test}(in->{name}[n])"));
            let inner: String = inner.lines().map(|line| format!("    {line}\n")).collect();
            out += &format!("    for (size_t n = 0U; n < {length}U; n++) {{\n{inner}    }}\n");
        }
        Kind::One(_) if !test.is_empty() => out += &refuse(format!("!{test}(in->{name})")),
        Kind::Struct(kind) => {
            out += &format!(
                "    const skyloop_error_t {name} = skyloop_valid_{}(&in->{name});\n    if ({name} != SKYLOOP_OK) {{\n        return {name};\n    }}\n",
                snake(kind)
            );
        }
        Kind::Rest(rest @ (Rest::Octets | Rest::Utf8)) => {
            if field.least > 0 {
                out += &refuse(format!("in->{name}_length < {}U", field.least));
            }
            out += &refuse(format!("in->{name}_length > {}U", field.most));
            if *rest == Rest::Utf8 {
                out += &refuse(format!("!skyloop_is_utf8(in->{name}, in->{name}_length)"));
            }
        }
        _ => {}
    }
    out
}

/// A message whose first octet says what follows.
fn commands(schema: &Schema, message: &Message) -> String {
    let name = snake(message.type_name());
    let (mut valid, mut read, mut write) = (String::new(), String::new(), String::new());
    for opcode in &message.opcodes {
        let case = format!("    case SKYLOOP_OPCODE_{}:\n", upper(&opcode.name));
        let own = snake(&opcode.name);
        let (mut v, mut r, mut w) = (String::new(), String::new(), String::new());
        match &opcode.type_name {
            Some(kind) => {
                let kind = snake(kind);
                v = format!("        error = skyloop_valid_{kind}(&in->as.{own});\n");
                r = format!("        skyloop_read_{kind}(reader, &out->as.{own});\n");
                w = format!("        skyloop_write_{kind}(writer, &in->as.{own});\n");
            }
            None => {
                for field in &opcode.fields {
                    let moved = |text: String, of: &str| {
                        let text = text.replace(&format!("{of}->"), &format!("{of}->as.{own}."));
                        text.lines()
                            .map(|line| format!("    {line}\n"))
                            .collect::<String>()
                    };
                    r += &moved(read_field(field), "out");
                    w += &moved(write_field(field), "in");
                    v += &moved(range(field), "in");
                }
            }
        }
        if !v.is_empty() {
            valid += &format!("{case}{v}        break;\n");
        }
        read += &format!("{case}{r}        break;\n");
        write += &format!("{case}{w}        break;\n");
    }
    let _ = schema;
    format!(
        "\nstatic inline skyloop_error_t skyloop_valid_{name}(const skyloop_{name}_t *in)\n{{\n    skyloop_error_t error = SKYLOOP_OK;\n    switch (in->opcode) {{\n{valid}    default:\n        break;\n    }}\n    return error;\n}}\n\n\
         static inline void skyloop_read_{name}(skyloop_reader_t *reader, skyloop_{name}_t *out)\n{{\n    out->opcode = skyloop_read_u8(reader);\n    switch (out->opcode) {{\n{read}    default:\n        skyloop_fail(reader, SKYLOOP_UNKNOWN_OPCODE);\n        break;\n    }}\n}}\n\n\
         static inline void skyloop_write_{name}(skyloop_writer_t *writer, const skyloop_{name}_t *in)\n{{\n    skyloop_write_u8(writer, in->opcode);\n    switch (in->opcode) {{\n{write}    default:\n        writer->error = SKYLOOP_UNKNOWN_OPCODE;\n        break;\n    }}\n}}\n"
    )
}

/// Decoder and encoder of all packets of one direction.
fn direction(name: &str, messages: &[&Message]) -> String {
    let cases = |inside: &dyn Fn(&str) -> String| {
        let case = |message: &&Message| {
            let inside = inside(&snake(message.type_name()));
            format!(
                "    case SKYLOOP_APID_{}:\n{inside}        break;\n",
                upper(&message.name)
            )
        };
        messages.iter().map(case).collect::<String>()
    };
    let read = cases(&|kind| {
        format!(
            "        skyloop_read_{kind}(&reader, &out->as.{kind});\n        error = skyloop_read_end(&reader);\n        if (error == SKYLOOP_OK) {{\n            error = skyloop_valid_{kind}(&out->as.{kind});\n        }}\n"
        )
    });
    let write = cases(&|kind| format!("        skyloop_write_{kind}(&writer, &in->as.{kind});\n"));
    format!(
        "\n/* Reads exactly one packet. */\nstatic inline skyloop_error_t skyloop_decode_{name}(const uint8_t *packet, size_t length, skyloop_{name}_t *out)\n{{\n    skyloop_reader_t reader;\n    skyloop_error_t error = skyloop_open(packet, length, &out->header, &reader);\n    if (error != SKYLOOP_OK) {{\n        return error;\n    }}\n    switch (out->header.apid) {{\n{read}    default:\n        error = SKYLOOP_UNKNOWN_APID;\n        break;\n    }}\n    return error;\n}}\n\n\
         /* Lays out one packet; `*length` is its length. Values are judged where they are received. */\nstatic inline skyloop_error_t skyloop_encode_{name}(const skyloop_{name}_t *in, uint8_t *packet, size_t capacity, size_t *length)\n{{\n    skyloop_writer_t writer = {{packet, capacity, 0U, SKYLOOP_OK}};\n    skyloop_begin(&writer, &in->header);\n    switch (in->header.apid) {{\n{write}    default:\n        writer.error = SKYLOOP_UNKNOWN_APID;\n        break;\n    }}\n    return skyloop_close(&writer, length);\n}}\n"
    )
}
