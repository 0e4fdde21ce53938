//! Readers, writers and ranges of the C header.

use super::{DIRECTIONS, case, count_to, function, switch};
use crate::model::{Field, Kind, Number, Opcode, Receiver, Record, Rest, Rule, Schema};
use crate::text::{block, each, join, snake, upper};

/// Which APIDs there are.
pub(super) fn known(schema: &Schema) -> String {
    let test = |name: &str, messages: &mut dyn Iterator<Item = &Record>| {
        let terms =
            messages.map(|message| format!("(apid == SKYLOOP_APID_{})", upper(&message.name)));
        let body = format!("return {};\n", join(terms, " ||\n       "));
        function(&format!("bool skyloop_is_{name}(uint16_t apid)"), &body)
    };
    let emulator = schema.to(Receiver::Emulator);
    format!(
        "\n/* Whether packets with this APID go towards the emulator. */\n{}\n{}\n",
        test("telecommand", &mut schema.to(Receiver::Emulator)),
        test("known", &mut emulator.chain(schema.to(Receiver::Client)))
    )
}

/// Every reader, writer and range, and the functions of the two directions.
pub(super) fn write(schema: &Schema) -> String {
    let records = schema.structs.iter().chain(&schema.messages);
    let records = each(records, |record| match record.opcodes.is_empty() {
        true => functions(schema, record),
        false => commands(record),
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
    let valid = function(
        &format!("skyloop_error_t skyloop_valid_{name}(const {kind} *in)"),
        valid,
    );
    let read = function(
        &format!("void skyloop_read_{name}(skyloop_reader_t *reader, {kind} *out)"),
        read,
    );
    let write = function(
        &format!("void skyloop_write_{name}(skyloop_writer_t *writer, const {kind} *in)"),
        write,
    );
    format!("\n{valid}\n{read}\n{write}")
}

/// Reader, writer and ranges of one record.
fn functions(schema: &Schema, record: &Record) -> String {
    let name = snake(record.type_name());
    let (mut read, mut write, mut valid) = (String::new(), String::new(), String::new());
    if record.encode_check {
        write += &block(
            &format!("if (skyloop_valid_{name}(in) != SKYLOOP_OK)"),
            "writer->error = SKYLOOP_INCONSISTENT;\nreturn;\n",
        );
    }
    let optional = record
        .optional
        .as_ref()
        .map_or("", |optional| &optional.name);
    if record.optional.is_some() {
        read += "(void)memset(out, 0, sizeof *out);\n";
    }
    for field in &record.fields {
        if record.is_flag(field) {
            read += "const uint8_t flags = skyloop_read_u8(reader);\n";
            read += &fail_if("flags > 1U");
            read += &format!("out->has_{optional} = (flags == 1U);\n");
            write += &format!("skyloop_write_u8(writer, in->has_{optional} ? 1U : 0U);\n");
            continue;
        }
        let around = |of: &str, text: String| match (field.optional, text.as_str()) {
            (false, _) | (_, "") => text,
            (true, text) => block(&format!("if ({of}->has_{optional})"), text),
        };
        read += &around("out", read_field(field));
        write += &around("in", write_field(field));
        valid += &around("in", range(field));
    }
    for counter in schema.counters.iter().filter(|_| record.counters) {
        read += &read_field(counter);
        write += &write_field(counter);
    }
    let last = match record.check {
        true => format!("return skyloop_check_{name}(in);\n"),
        false => "return SKYLOOP_OK;\n".to_owned(),
    };
    if valid.is_empty() && !record.check {
        valid += "(void)in;\n";
    }
    three(record, &(valid + &last), &read, &write)
}

/// Fails a reader.
fn fail_if(condition: &str) -> String {
    block(
        &format!("if ({condition})"),
        "skyloop_fail(reader, SKYLOOP_BAD_VALUE);\n",
    )
}

/// The end of a number's functions' names.
fn suffix(number: Number) -> String {
    match number {
        Number::Time => "u64".to_owned(),
        number => number.name(),
    }
}

/// The loops over all numbers of an array of varying length, while `end` has no error.
fn counted(field: &Field, end: &str, of: &str, length: usize, body: &str) -> String {
    let count = field.counted_by.as_deref().unwrap_or_default();
    let inner = block(&format!("for (size_t k = 0U; k < {length}U; k++)"), body);
    let goes_on = format!("({end}->error == SKYLOOP_OK) && (n < {of}->{count})");
    block(&format!("for (size_t n = 0U; {goes_on}; n++)"), &inner)
}

fn read_field(field: &Field) -> String {
    let Field { name, most, .. } = field;
    match (&field.kind, &field.counted_by) {
        _ if !field.bits.is_empty() => {
            let fail = fail_if(&format!("{name} > {}U", field.all_flags()));
            let flags = each(field.flags(), |(bit, flag)| {
                format!("out->{flag} = ({name} & {bit}U) != 0U;\n")
            });
            format!("const uint8_t {name} = skyloop_read_u8(reader);\n{fail}{flags}")
        }
        (Kind::One(number), _) => {
            let read = format!("out->{name} = skyloop_read_{}(reader);\n", suffix(*number));
            let codes = field.codes.iter();
            read + &each(codes, |codes| {
                fail_if(&format!("!skyloop_is_{}(out->{name})", snake(codes)))
            })
        }
        (Kind::Array(number, length), None) => count_to(
            *length,
            &format!(
                "out->{name}[n] = skyloop_read_{}(reader);\n",
                suffix(*number)
            ),
        ),
        (Kind::Array(number, length), Some(count)) => {
            let read = format!(
                "out->{name}[n][k] = skyloop_read_{}(reader);\n",
                suffix(*number)
            );
            fail_if(&format!("out->{count} > {most}U"))
                + &counted(field, "reader", "out", *length, &read)
        }
        (Kind::Ascii(length), _) => {
            format!("skyloop_read_octets(reader, out->{name}, {length}U);\n")
        }
        (Kind::Struct(kind), _) => format!("skyloop_read_{}(reader, &out->{name});\n", snake(kind)),
        (Kind::Rest(_), _) => {
            format!("out->{name} = skyloop_read_rest(reader, &out->{name}_length);\n")
        }
    }
}

fn write_field(field: &Field) -> String {
    let Field { name, most, .. } = field;
    match (&field.kind, &field.counted_by) {
        _ if !field.bits.is_empty() => {
            let bits = field.flags();
            let bits = join(
                bits.map(|(bit, flag)| format!("(in->{flag} ? {bit}U : 0U)")),
                " | ",
            );
            format!("skyloop_write_u8(writer, (uint8_t)({bits}));\n")
        }
        (Kind::One(number), _) => {
            format!("skyloop_write_{}(writer, in->{name});\n", suffix(*number))
        }
        (Kind::Array(number, length), None) => count_to(
            *length,
            &format!(
                "skyloop_write_{}(writer, in->{name}[n]);\n",
                suffix(*number)
            ),
        ),
        (Kind::Array(number, length), Some(count)) => {
            let write = format!(
                "skyloop_write_{}(writer, in->{name}[n][k]);\n",
                suffix(*number)
            );
            let too_long = "writer->error = SKYLOOP_TOO_LONG;\n";
            block(&format!("if (in->{count} > {most}U)"), too_long)
                + &counted(field, "writer", "in", *length, &write)
        }
        (Kind::Ascii(length), _) => {
            format!("skyloop_write_octets(writer, in->{name}, {length}U);\n")
        }
        (Kind::Struct(kind), _) => format!("skyloop_write_{}(writer, &in->{name});\n", snake(kind)),
        (Kind::Rest(_), _) => {
            format!("skyloop_write_octets(writer, in->{name}, in->{name}_length);\n")
        }
    }
}

/// What a field allows, as statements that return what is wrong.
fn range(field: &Field) -> String {
    let Field {
        name, least, most, ..
    } = field;
    let error = match field.error.as_deref() {
        Some("NotFinite") => "SKYLOOP_NOT_FINITE",
        _ => "SKYLOOP_BAD_VALUE",
    };
    let refuse =
        |condition: String| block(&format!("if ({condition})"), &format!("return {error};\n"));
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
            out += &block(
                &format!("if ({name} != SKYLOOP_OK)"),
                &format!("return {name};\n"),
            );
        }
        (Kind::Rest(rest @ (Rest::Octets | Rest::Utf8)), _) => {
            if *least > 0 {
                out += &refuse(format!("in->{name}_length < {least}U"));
            }
            out += &refuse(format!("in->{name}_length > {most}U"));
            if *rest == Rest::Utf8 {
                out += &refuse(format!("!skyloop_is_utf8(in->{name}, in->{name}_length)"));
            }
        }
        _ => {}
    }
    out
}

/// A message whose first octet says what follows.
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
    let read_error = "skyloop_fail(reader, SKYLOOP_UNKNOWN_OPCODE);\n";
    let write_error = "writer->error = SKYLOOP_UNKNOWN_OPCODE;\n";
    three(
        message,
        &format!(
            "skyloop_error_t error = SKYLOOP_OK;\n{}return error;\n",
            switch("in->opcode", &valid, "")
        ),
        &format!(
            "out->opcode = skyloop_read_u8(reader);\n{}",
            switch("out->opcode", &read, read_error)
        ),
        &format!(
            "skyloop_write_u8(writer, in->opcode);\n{}",
            switch("in->opcode", &write, write_error)
        ),
    )
}

/// How a command's fields are checked, read and written.
fn command(opcode: &Opcode) -> [String; 3] {
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
    [
        moved(range, "in"),
        moved(read_field, "out"),
        moved(write_field, "in"),
    ]
}

/// One case a message; `inside` gives its statements.
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
        format!(
            "skyloop_read_{kind}(&reader, &out->as.{kind});\nerror = skyloop_read_end(&reader);\n{}",
            block("if (error == SKYLOOP_OK)", &valid)
        )
    });
    let body = "skyloop_reader_t reader;\n\
                skyloop_error_t error = skyloop_open(packet, length, &out->header, &reader);\n"
        .to_owned()
        + &block("if (error != SKYLOOP_OK)", "return error;\n")
        + &switch(
            "out->header.apid",
            &cases,
            "error = SKYLOOP_UNKNOWN_APID;\n",
        )
        + "return error;\n";
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
    let body = "skyloop_writer_t writer = {packet, capacity, 0U, SKYLOOP_OK};\n\
                skyloop_begin(&writer, &in->header);\n"
        .to_owned()
        + &switch(
            "in->header.apid",
            &cases,
            "writer.error = SKYLOOP_UNKNOWN_APID;\n",
        )
        + "return skyloop_close(&writer, length);\n";
    let signature = format!(
        "skyloop_error_t skyloop_encode_{name}(const skyloop_{name}_t *in, uint8_t *packet, size_t capacity, size_t *length)"
    );
    format!(
        "\n/* Lays out one packet; `*length` is its length. Values are judged where they are received. */\n{}",
        function(&signature, &body)
    )
}
