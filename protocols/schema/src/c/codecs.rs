//! Readers, writers and ranges of the C header.

use super::{DIRECTIONS, case, count_to, function, switch, when};
use crate::model::{Code, Field, Kind, Number, Receiver, Record, Rest, Rule, Schema};
use crate::text::{block, each, join, snake, upper};

/// The functions that classify APIDs.
pub(super) fn known(schema: &Schema) -> String {
    let test = |name: &str, receivers: &[Receiver]| {
        let messages = receivers.iter().flat_map(|receiver| schema.to(*receiver));
        let apids = messages.map(|message| upper(&message.name));
        let terms = apids.map(|apid| format!("(apid == SKYLOOP_APID_{apid})"));
        let body = format!("return {};\n", join(terms, " ||\n       "));
        function(&format!("bool skyloop_is_{name}(uint16_t apid)"), &body)
    };
    let telecommand = test("telecommand", &[Receiver::Emulator]);
    let known = test("known", &[Receiver::Emulator, Receiver::Client]);
    format!(
        "\n/* Whether packets with this APID go towards the emulator. */\n{telecommand}\n{known}\n"
    )
}

/// Readers, writers and range checks of all records, and codecs of the two directions.
pub(super) fn write(schema: &Schema) -> String {
    let records = schema.structs.iter().chain(&schema.messages);
    let records = each(records, |record| {
        if record.opcodes.is_empty() {
            functions(schema, record)
        } else {
            commands(record)
        }
    });
    let directions = each(DIRECTIONS, |(name, receiver)| {
        let messages: Vec<&Record> = schema.to(receiver).collect();
        decoder(name, &messages) + &encoder(name, &messages)
    });
    format!(
        "\n/* ---- codecs ------------------------------------------------------------------------------------------------------ */\n\
         {records}{directions}"
    )
}

/// The three functions of a record with these bodies.
fn three(record: &Record, valid: &str, read: &str, write: &str) -> String {
    let name = snake(record.type_name());
    let kind = format!("skyloop_{name}_t");
    let check = format!("skyloop_error_t skyloop_valid_{name}(const {kind} *in)");
    let decode = format!("void skyloop_read_{name}(skyloop_reader_t *reader, {kind} *out)");
    let encode = format!("void skyloop_write_{name}(skyloop_writer_t *writer, const {kind} *in)");
    let bodies = [(check, valid), (decode, read), (encode, write)];
    each(bodies, |(signature, body)| {
        format!("\n{}", function(&signature, body))
    })
}

/// Reader, writer and range check of one record.
fn functions(schema: &Schema, record: &Record) -> String {
    let name = snake(record.type_name());
    let (mut read, mut write, mut valid) = (String::new(), String::new(), String::new());
    if record.encode_check {
        let is_wrong = format!("skyloop_valid_{name}(in) != SKYLOOP_OK");
        write += &when(
            &is_wrong,
            "writer->error = SKYLOOP_INCONSISTENT;\nreturn;\n",
        );
    }
    let mut has = String::new();
    if let Some(optional) = &record.optional {
        has = format!("has_{}", optional.name);
        read += "(void)memset(out, 0, sizeof *out);\n";
    }
    for field in &record.fields {
        if record.is_flag(field) {
            read += "const uint8_t flags = skyloop_read_u8(reader);\n";
            read += &fail_if("flags > 1U");
            read += &format!("out->{has} = (flags == 1U);\n");
            write += &format!("skyloop_write_u8(writer, in->{has} ? 1U : 0U);\n");
            continue;
        }
        let around = |of: &str, text: String| match (field.optional, text.as_str()) {
            (false, _) | (_, "") => text,
            (true, text) => when(&format!("{of}->{has}"), text),
        };
        let [own_read, own_write] = codec(field);
        read += &around("out", own_read);
        write += &around("in", own_write);
        valid += &around("in", range(field));
    }
    for counter in schema.counters.iter().filter(|_| record.counters) {
        let [own_read, own_write] = codec(counter);
        read += &own_read;
        write += &own_write;
    }
    let last = if record.check {
        format!("return skyloop_check_{name}(in);\n")
    } else {
        "return SKYLOOP_OK;\n".to_owned()
    };
    if valid.is_empty() && !record.check {
        valid += "(void)in;\n";
    }
    three(record, &(valid + &last), &read, &write)
}

/// The statement that makes a reader fail on a condition.
fn fail_if(condition: &str) -> String {
    when(condition, "skyloop_fail(reader, SKYLOOP_BAD_VALUE);\n")
}

/// Suffix of the functions for a number.
fn suffix(number: Number) -> String {
    match number {
        Number::Time => "u64".to_owned(),
        number => number.name(),
    }
}

/// The loops over all numbers of an array of variable length, while `end` has no error.
fn counted(field: &Field, end: &str, of: &str, length: usize, body: &str) -> String {
    let count = field.counted_by.as_deref().unwrap_or_default();
    let inner = block(&format!("for (size_t k = 0U; k < {length}U; k++)"), body);
    let condition = format!("({end}->error == SKYLOOP_OK) && (n < {of}->{count})");
    block(&format!("for (size_t n = 0U; {condition}; n++)"), &inner)
}

/// The statements that read a field, and the statements that write it.
fn codec(field: &Field) -> [String; 2] {
    let (name, max) = (&field.name, field.most);
    match (&field.kind, &field.counted_by) {
        _ if !field.bits.is_empty() => {
            let fail = fail_if(&format!("{name} > {}U", field.all_flags()));
            let flag = |(bit, flag)| format!("out->{flag} = ({name} & {bit}U) != 0U;\n");
            let flags = each(field.flags(), flag);
            let bits = field
                .flags()
                .map(|(bit, flag)| format!("(in->{flag} ? {bit}U : 0U)"));
            let bits = join(bits, " | ");
            [
                format!("const uint8_t {name} = skyloop_read_u8(reader);\n{fail}{flags}"),
                format!("skyloop_write_u8(writer, (uint8_t)({bits}));\n"),
            ]
        }
        (Kind::One(number), _) => {
            let number = suffix(*number);
            let known = each(&field.codes, |codes| {
                fail_if(&format!("!skyloop_is_{}(out->{name})", snake(codes)))
            });
            [
                format!("out->{name} = skyloop_read_{number}(reader);\n{known}"),
                format!("skyloop_write_{number}(writer, in->{name});\n"),
            ]
        }
        (Kind::Array(number, length), None) => {
            let number = suffix(*number);
            let read = format!("out->{name}[n] = skyloop_read_{number}(reader);\n");
            let write = format!("skyloop_write_{number}(writer, in->{name}[n]);\n");
            [read, write].map(|body| count_to(*length, &body))
        }
        (Kind::Array(number, length), Some(count)) => {
            let number = suffix(*number);
            let read = format!("out->{name}[n][k] = skyloop_read_{number}(reader);\n");
            let write = format!("skyloop_write_{number}(writer, in->{name}[n][k]);\n");
            let too_long = "writer->error = SKYLOOP_TOO_LONG;\n";
            [
                fail_if(&format!("out->{count} > {max}U"))
                    + &counted(field, "reader", "out", *length, &read),
                when(&format!("in->{count} > {max}U"), too_long)
                    + &counted(field, "writer", "in", *length, &write),
            ]
        }
        (Kind::Ascii(length), _) => [
            format!("skyloop_read_octets(reader, out->{name}, {length}U);\n"),
            format!("skyloop_write_octets(writer, in->{name}, {length}U);\n"),
        ],
        (Kind::Struct(kind), _) => {
            let kind = snake(kind);
            [
                format!("skyloop_read_{kind}(reader, &out->{name});\n"),
                format!("skyloop_write_{kind}(writer, &in->{name});\n"),
            ]
        }
        (Kind::Rest(_), _) => [
            format!("out->{name} = skyloop_read_rest(reader, &out->{name}_length);\n"),
            format!("skyloop_write_octets(writer, in->{name}, in->{name}_length);\n"),
        ],
    }
}

/// The statements that return an error for a value out of range.
fn range(field: &Field) -> String {
    let (name, min, max) = (&field.name, field.least, field.most);
    let error = match field.error.as_deref() {
        Some("NotFinite") => "SKYLOOP_NOT_FINITE",
        _ => "SKYLOOP_BAD_VALUE",
    };
    let refuse = |condition: String| when(&condition, &format!("return {error};\n"));
    let mut out = String::new();
    if field.kind.is_float() {
        // Written so that a NaN is refused.
        let low = field.min.map(|min| format!("(in->{name} >= {min:?})"));
        let high = field.max.map(|max| format!("(in->{name} <= {max:?})"));
        let terms = join(low.into_iter().chain(high), " && ");
        if !terms.is_empty() {
            out += &refuse(format!("!({terms})"));
        }
    } else {
        let min = field.min.filter(|min| *min > 0.0);
        out += &each(min, |min| refuse(format!("in->{name} < {min}U")));
        let max = field.max.filter(|max| *max < field.largest());
        out += &each(max, |max| refuse(format!("in->{name} > {max}U")));
    }
    let test = field.rule.map(|rule| match rule {
        Rule::Finite => "skyloop_is_finite",
        Rule::Positive => "skyloop_is_positive",
    });
    match (&field.kind, test) {
        (Kind::Array(_, length), Some(test)) => {
            out += &count_to(*length, &refuse(format!("!{test}(in->{name}[n])")));
        }
        (Kind::One(_), Some(test)) => out += &refuse(format!("!{test}(in->{name})")),
        (Kind::Struct(kind), _) => {
            let valid = format!("skyloop_valid_{}(&in->{name})", snake(kind));
            out += &format!("const skyloop_error_t {name} = {valid};\n");
            out += &when(
                &format!("{name} != SKYLOOP_OK"),
                &format!("return {name};\n"),
            );
        }
        (Kind::Rest(rest @ (Rest::Bytes | Rest::Utf8)), _) => {
            if min > 0 {
                out += &refuse(format!("in->{name}_length < {min}U"));
            }
            out += &refuse(format!("in->{name}_length > {max}U"));
            if *rest == Rest::Utf8 {
                out += &refuse(format!("!skyloop_is_utf8(in->{name}, in->{name}_length)"));
            }
        }
        _ => {}
    }
    out
}

/// A message with an opcode in its first byte.
fn commands(message: &Record) -> String {
    let (mut valid, mut read, mut write) = (String::new(), String::new(), String::new());
    for opcode in &message.opcodes {
        let label = format!("case SKYLOOP_OPCODE_{}", upper(&opcode.name));
        let [own_valid, own_read, own_write] = command(opcode);
        if !own_valid.is_empty() {
            valid += &case(&label, &own_valid);
        }
        read += &case(&label, &own_read);
        write += &case(&label, &own_write);
    }
    let unknown = "SKYLOOP_UNKNOWN_OPCODE";
    let read_error = format!("skyloop_fail(reader, {unknown});\n");
    let write_error = format!("writer->error = {unknown};\n");
    let valid = switch("in->opcode", &valid, "");
    let read = switch("out->opcode", &read, &read_error);
    let write = switch("in->opcode", &write, &write_error);
    three(
        message,
        &format!("skyloop_error_t error = SKYLOOP_OK;\n{valid}return error;\n"),
        &format!("out->opcode = skyloop_read_u8(reader);\n{read}"),
        &format!("skyloop_write_u8(writer, in->opcode);\n{write}"),
    )
}

/// The statements that check, read and write a command's fields.
fn command(opcode: &Code) -> [String; 3] {
    let own = snake(&opcode.name);
    if let Some(kind) = &opcode.type_name {
        let kind = snake(kind);
        return [
            format!("error = skyloop_valid_{kind}(&in->as.{own});\n"),
            format!("skyloop_read_{kind}(reader, &out->as.{own});\n"),
            format!("skyloop_write_{kind}(writer, &in->as.{own});\n"),
        ];
    }
    let moved = |text: fn(&Field) -> String, of: &str| {
        let (from, to) = (format!("{of}->"), format!("{of}->as.{own}."));
        each(&opcode.fields, text).replace(&from, &to)
    };
    let [read, write]: [fn(&Field) -> String; 2] = [
        |field| codec(field)[0].clone(),
        |field| codec(field)[1].clone(),
    ];
    [moved(range, "in"), moved(read, "out"), moved(write, "in")]
}

/// One case per message; `inside` gives its statements.
fn cases(messages: &[&Record], inside: fn(&str) -> String) -> String {
    each(messages, |message| {
        let label = format!("case SKYLOOP_APID_{}", upper(&message.name));
        case(&label, &inside(&snake(message.type_name())))
    })
}

/// Decoder of all packets of one direction.
fn decoder(name: &str, messages: &[&Record]) -> String {
    let cases = cases(messages, |kind| {
        let valid = format!("error = skyloop_valid_{kind}(&out->as.{kind});\n");
        let valid = when("error == SKYLOOP_OK", &valid);
        let read = format!("skyloop_read_{kind}(&reader, &out->as.{kind});\n");
        format!("{read}error = skyloop_read_end(&reader);\n{valid}")
    });
    let open = when("error != SKYLOOP_OK", "return error;\n");
    let unknown = "error = SKYLOOP_UNKNOWN_APID;\n";
    let switch = switch("out->header.apid", &cases, unknown);
    let body = format!(
        "skyloop_reader_t reader;\n\
         skyloop_error_t error = skyloop_open(packet, length, &out->header, &reader);\n\
         {open}{switch}return error;\n"
    );
    let signature = format!(
        "skyloop_error_t skyloop_decode_{name}(const uint8_t *packet, size_t length, skyloop_{name}_t *out)"
    );
    format!(
        "\n/* Reads exactly one packet. */\n{}",
        function(&signature, &body)
    )
}

/// Encoder of all packets of one direction.
fn encoder(name: &str, messages: &[&Record]) -> String {
    let cases = cases(messages, |kind| {
        format!("skyloop_write_{kind}(&writer, &in->as.{kind});\n")
    });
    let unknown = "writer.error = SKYLOOP_UNKNOWN_APID;\n";
    let switch = switch("in->header.apid", &cases, unknown);
    let body = format!(
        "skyloop_writer_t writer = {{packet, capacity, 0U, SKYLOOP_OK}};\n\
         skyloop_begin(&writer, &in->header);\n\
         {switch}return skyloop_close(&writer, length);\n"
    );
    let signature = format!(
        "skyloop_error_t skyloop_encode_{name}(const skyloop_{name}_t *in, uint8_t *packet, size_t capacity, size_t *length)"
    );
    let function = function(&signature, &body);
    format!(
        "\n/* Lays out one packet; `*length` is its length. Values are judged where they are received. */\n{function}"
    )
}
