//! One message or structure in Rust: declaration, reader, writer, range checks.

use super::{WRITE, doc};
use crate::model::{Field, Kind, Number, Record, Rest, Rule, Schema};
use crate::text::{block, braces, each, join};

impl Record {
    /// Its declaration and methods.
    pub(super) fn rust(&self, schema: &Schema) -> String {
        let name = self.type_name();
        let mut out = self.declaration(schema, name, &self.doc, &self.members());
        if let Some(optional) = &self.optional {
            let fields = self.fields.iter().filter(|field| field.optional);
            let members = each(fields, |field| self.member(field));
            out += &self.declaration(schema, &optional.type_name, &optional.doc, &members);
        }
        let (generics, reader) = if self.borrows {
            ("<'a>", "Reader<'a>")
        } else {
            ("", "Reader<'_>")
        };
        let read = format!("fn read(reader: &mut {reader}) -> Result<Self, DecodeError>");
        let read = block(&format!("pub(crate) {read}"), &self.read(schema));
        let mut body = read + "\n" + &block(WRITE, &self.write());
        let ranges = each(&self.fields, |field| self.range(schema, field));
        if !self.check || !ranges.is_empty() {
            let check = if self.check {
                "/// What the fields allow, each by itself.\npub(crate) fn check_fields"
            } else {
                "/// Refuses values that the fields do not allow. What was decoded has passed this.\n\
                 pub fn check"
            };
            let check = format!("\n{check}(&self) -> Result<(), DecodeError>");
            body += &block(&check, &(ranges + "Ok(())\n"));
        }
        out + "\n" + &block(&format!("impl{generics} {name}{generics}"), &body)
    }

    /// Total length of its fields of constant length.
    pub(super) fn length(&self, schema: &Schema) -> String {
        let bytes = schema.flat(&self.fields);
        let bytes: usize = bytes.iter().filter_map(Field::bytes).sum();
        let lifetime = if self.borrows { "<'_>" } else { "" };
        let body = format!(
            "/// Octets of its fields, the rest of variable length aside.\n\
             pub const FIELDS_LENGTH: usize = {bytes};\n"
        );
        block(&format!("\nimpl {}{lifetime}", self.type_name()), &body)
    }

    fn declaration(&self, schema: &Schema, name: &str, about: &str, members: &str) -> String {
        let flat = schema.flat(&self.fields);
        let has_float = flat.iter().any(|field| field.kind.is_float());
        let eq = if has_float { "" } else { ", Eq" };
        let default = if self.default { ", Default" } else { "" };
        let lifetime = if self.borrows { "<'a>" } else { "" };
        let derive = format!("#[derive(Debug, Clone, Copy{default}, PartialEq{eq})]\n");
        let body = block(&format!("pub struct {name}{lifetime}"), members);
        format!("\n{}{derive}{body}", doc(about))
    }

    fn members(&self) -> String {
        let own = |field: &&Field| !field.optional && !self.is_flag(field);
        let mut out = each(self.fields.iter().filter(own), |field| self.member(field));
        if let Some(inner) = &self.optional {
            let (name, kind) = (&inner.name, &inner.type_name);
            out += &format!("{}pub {name}: Option<{kind}>,\n", doc(&inner.doc));
        }
        if self.counters {
            out += &doc("Counts since the emulator started.");
            out += "pub counters: Counters,\n";
        }
        out
    }

    fn member(&self, field: &Field) -> String {
        let (name, unit) = (&field.name, &field.unit);
        let mut about = field.doc.clone();
        if !unit.is_empty() {
            about += &format!(" Unit: {unit}.");
        }
        let about = doc(&about);
        let public = if self.private { "pub(crate)" } else { "pub" };
        if field.bits.is_empty() {
            format!("{about}{public} {name}: {},\n", rust_type(field))
        } else {
            each(&field.bits, |bit| format!("{about}{public} {bit}: bool,\n"))
        }
    }

    fn read(&self, schema: &Schema) -> String {
        let owner = self.type_name();
        let (mut out, mut names, mut inner) = (String::new(), String::new(), String::new());
        for field in &self.fields {
            let (name, value) = (&field.name, read_value(schema, owner, field));
            if field.optional {
                inner += &format!("{name}: {value},\n");
                continue;
            }
            out += &match (&field.kind, &field.counted_by) {
                (Kind::Array(number, length), Some(count)) => {
                    let (max, read) = (field.most, read_number(*number));
                    let head = "for number in listed.ok_or(DecodeError::BadValue { field, rule })?.iter_mut().flatten()";
                    format!(
                        "let mut {name} = [[0; {length}]; {max}];\n\
                         let listed = {name}.get_mut(..usize::from({count}));\n\
                         let rule = \"must be {max} or fewer\";\n\
                         let field = \"{owner}.{count}\";\n{}",
                        block(head, &format!("*number = {read};\n"))
                    )
                }
                _ => format!("let {name} = {value};\n"),
            };
            names += &match (self.is_flag(field), field.bits.is_empty()) {
                (true, _) => String::new(),
                (_, true) => format!("{name},\n"),
                (_, false) => each(field.flags(), |(bit, flag)| {
                    format!("{flag}: {name} & {bit} != 0,\n")
                }),
            };
        }
        if let Some(optional) = &self.optional {
            let (flag, name) = (&optional.flag, &optional.name);
            let some = braces(&format!("1 => Some({}", optional.type_name), &inner);
            let arms = format!("{some}),\n_ => None,\n");
            out += &braces(&format!("let {name} = match {flag}"), &arms);
            out += ";\n";
            names += &format!("{name},\n");
        }
        if self.counters {
            let each_counter = "for counter in counters.iter_mut()";
            out += "let mut counters = Counters::default();\n";
            out += &block(each_counter, "*counter = reader.u32()?;\n");
            names += "counters,\n";
        }
        format!("{out}{})\n", braces("Ok(Self", &names))
    }

    fn write(&self) -> String {
        let optional = self.optional.as_ref().map_or("", |optional| &optional.name);
        let mut out = String::new();
        if self.encode_check {
            out += "self.check_layout()?;\n";
        }
        let mut inner = String::new();
        for field in &self.fields {
            let name = &field.name;
            if field.optional {
                inner += &write_value(field, &format!("{optional}.{name}"));
                continue;
            }
            out += &match (&field.kind, &field.counted_by) {
                _ if self.is_flag(field) => {
                    format!("writer.u8(self.{optional}.is_some().into())?;\n")
                }
                _ if !field.bits.is_empty() => {
                    let bits = field.bits.iter().enumerate().map(|(bit, flag)| match bit {
                        0 => format!("u8::from(self.{flag})"),
                        bit => format!("u8::from(self.{flag}) << {bit}"),
                    });
                    format!("writer.u8({})?;\n", join(bits, " | "))
                }
                (Kind::Array(number, _), Some(count)) => {
                    let listed = format!("self.{name}.iter().take(self.{count}.into()).flatten()");
                    let write = format!("writer.{}(*number)?;\n", number.name());
                    block(&format!("for number in {listed}"), &write)
                }
                _ => write_value(field, &format!("self.{name}")),
            };
        }
        if self.optional.is_some() {
            let is_present = format!("if let Some({optional}) = &self.{optional}");
            out += &block(&is_present, &inner);
        }
        if self.counters {
            let each_value = "for (_, value) in self.counters.iter()";
            out += &block(each_value, "writer.u32(value)?;\n");
        }
        out + "Ok(())\n"
    }

    /// The statements that refuse a value out of range.
    fn range(&self, schema: &Schema, field: &Field) -> String {
        match &self.optional {
            _ if field.counted_by.is_some() => String::new(),
            Some(optional) if field.optional => {
                let name = &optional.name;
                let inner = field_range(schema, self.type_name(), field, &format!("{name}."));
                block(&format!("if let Some({name}) = &self.{name}"), &inner)
            }
            _ => field_range(schema, self.type_name(), field, "self."),
        }
    }
}

/// The statements that refuse a value out of range; `of` is the prefix of its name.
pub(super) fn field_range(schema: &Schema, owner: &str, field: &Field, of: &str) -> String {
    let name = format!("\"{owner}.{}\"", field.name);
    let path = format!("{of}{}", field.name);
    let mut out = String::new();
    // Codes are checked by their reader, counts by the reader of their array.
    let limited = field.min.is_some() || field.max.is_some();
    if let Some(text) = field.limits(schema).filter(|_| limited && field.most == 0) {
        let number = |limit: Option<f64>| match (limit, field.kind.is_float()) {
            (Some(limit), true) => format!("{limit:?}"),
            (Some(limit), false) => format!("{limit}"),
            (None, _) => String::new(),
        };
        let equals = if field.max.is_some() { "=" } else { "" };
        let range = format!("({}..{equals}{})", number(field.min), number(field.max));
        // With a dereference as prefix, the name itself is a reference.
        let borrowed = match of {
            "*" => field.name.clone(),
            _ => format!("&{path}"),
        };
        out += &format!("rule({range}.contains({borrowed}), {name}, \"must be {text}\")?;\n");
    }
    out += &match (field.rule, field.error.as_deref()) {
        (Some(Rule::Positive), _) => {
            // The emulator's range, which may be narrower.
            let range = field.range.as_deref().unwrap_or("finite and above 0");
            let text = format!("must be {range} {}", field.unit);
            format!("positive({name}, {path}, {:?})?;\n", text.trim_end())
        }
        (Some(Rule::Finite), Some("NotFinite")) => format!("finite({name}, &{path})?;\n"),
        (Some(Rule::Finite), _) => {
            format!("rule({path}.is_finite(), {name}, \"must be finite\")?;\n")
        }
        (None, _) => String::new(),
    };
    match &field.kind {
        Kind::Struct(_) => out + &format!("{path}.check()?;\n"),
        Kind::Rest(Rest::Bytes) => {
            let (min, max) = (field.least, field.most);
            let holds = format!("({min}..={max}).contains(&{path}.len())");
            out + &format!("rule({holds}, {name}, \"must be {min} to {max} octets\")?;\n")
        }
        _ => out,
    }
}

/// The expression that reads a field.
pub(super) fn read_value(schema: &Schema, owner: &str, field: &Field) -> String {
    let name = format!("\"{owner}.{}\"", field.name);
    let limits = field.limits(schema).unwrap_or_default();
    match (&field.kind, &field.codes) {
        (_, Some(codes)) => {
            format!("reader.code({codes}::from_code, {name}, \"must be {limits}\")?")
        }
        _ if !field.bits.is_empty() => {
            let all = field.all_flags();
            format!("reader.flags({all}, {name}, \"must be {limits}\")?")
        }
        (Kind::One(number), _) => read_number(*number),
        (Kind::Array(number, _), _) => format!("reader.{}s()?", number.name()),
        (Kind::Ascii(_), _) => "reader.array()?".to_owned(),
        (Kind::Struct(kind), _) => format!("{kind}::read(reader)?"),
        (Kind::Rest(Rest::Utf8), _) => {
            let max = field.most;
            format!("reader.text({max}, {name}, \"must be {max} octets or fewer\")?")
        }
        (Kind::Rest(_), _) => "reader.rest()".to_owned(),
    }
}

fn read_number(number: Number) -> String {
    match number {
        Number::Time => "reader.time()?".to_owned(),
        number => format!("reader.{}()?", number.name()),
    }
}

/// The type of a member.
pub(super) fn rust_type(field: &Field) -> String {
    let number = |number: &Number| match number {
        Number::Time => "WireTime".to_owned(),
        number => number.name(),
    };
    match (&field.kind, &field.counted_by) {
        (Kind::One(kind), _) => field.codes.clone().unwrap_or(number(kind)),
        (Kind::Array(kind, length), None) => format!("[{}; {length}]", number(kind)),
        (Kind::Array(kind, length), Some(_)) => {
            format!("[[{}; {length}]; {}]", number(kind), field.most)
        }
        (Kind::Ascii(length), _) => format!("[u8; {length}]"),
        (Kind::Struct(kind), _) => kind.clone(),
        (Kind::Rest(Rest::Utf8), _) => "&'a str".to_owned(),
        (Kind::Rest(_), _) => "&'a [u8]".to_owned(),
    }
}

/// The statement that writes a field.
pub(super) fn write_value(field: &Field, path: &str) -> String {
    let call = match &field.kind {
        _ if field.codes.is_some() => format!("writer.u8({path}.code())"),
        Kind::One(Number::Time) => format!("writer.u64({}.0)", path.trim_start_matches('*')),
        Kind::One(number) => format!("writer.{}({path})", number.name()),
        Kind::Array(number, _) => format!("writer.{}s(&{path})", number.name()),
        Kind::Ascii(_) => format!("writer.bytes(&{path})"),
        Kind::Struct(_) => format!("{path}.write(writer)"),
        Kind::Rest(Rest::Utf8) => format!("writer.bytes({path}.as_bytes())"),
        Kind::Rest(_) => format!("writer.bytes({path})"),
    };
    call + "?;\n"
}
