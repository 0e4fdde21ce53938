//! One structure in Rust: its declaration, its reader, its writer, what its fields allow one by one.

use super::doc;
use crate::model::{Field, Kind, Number, Optional, Rest, Rule, Schema};

/// A structure to write.
pub(super) struct Structure<'a> {
    pub name: &'a str,
    pub about: &'a str,
    pub fields: &'a [Field],
    pub optional: Option<&'a Optional>,
    /// It points into the packet.
    pub borrows: bool,
    /// It ends with the counters.
    pub counters: bool,
    /// Its fields are for its crate only.
    pub private: bool,
    /// All its fields may be 0.
    pub default: bool,
    /// Rules between its fields are written by hand.
    pub check: bool,
    /// Encoders keep such rules.
    pub encode_check: bool,
}

impl Structure<'_> {
    /// Everything of it.
    pub(super) fn text(&self, schema: &Schema) -> String {
        let mut out = self.declaration(schema, self.name, self.about, &self.members(false));
        if let Some(optional) = self.optional {
            out += &self.declaration(
                schema,
                &optional.type_name,
                &optional.doc,
                &self.members(true),
            );
        }
        let (generics, reader) = if self.borrows {
            ("<'a>", "Reader<'a>")
        } else {
            ("", "Reader<'_>")
        };
        out += &format!("\nimpl{generics} {}{generics} {{\n", self.name);
        out += &format!(
            "    pub(crate) fn read(reader: &mut {reader}) -> Result<Self, DecodeError> {{\n{}    }}\n\n",
            self.read(schema)
        );
        out += &format!(
            "    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {{\n{}    }}\n",
            self.write()
        );
        let ranges: String = self
            .fields
            .iter()
            .map(|field| self.range(schema, field))
            .collect();
        if self.check && !ranges.is_empty() {
            out += "\n    /// What the fields allow, each by itself.\n";
            out += &format!(
                "    pub(crate) fn check_fields(&self) -> Result<(), DecodeError> {{\n{ranges}        Ok(())\n    }}\n"
            );
        } else if !self.check {
            out += "\n    /// Refuses values that the fields do not allow. What was decoded has passed this.\n";
            out += &format!(
                "    pub fn check(&self) -> Result<(), DecodeError> {{\n{ranges}        Ok(())\n    }}\n"
            );
        }
        out + "}\n"
    }

    fn is_flag(&self, field: &Field) -> bool {
        self.optional
            .is_some_and(|optional| optional.flag == field.name)
    }

    /// Names, types and comments of the members.
    fn members(&self, optional: bool) -> Vec<(String, String, String)> {
        let mut out = Vec::new();
        for field in self
            .fields
            .iter()
            .filter(|field| field.optional == optional && !self.is_flag(field))
        {
            let unit = if field.unit.is_empty() {
                String::new()
            } else {
                format!(" Unit: {}.", field.unit)
            };
            let about = format!("{}{unit}", field.doc);
            if field.bits.is_empty() {
                out.push((field.name.clone(), rust_type(field), about));
            } else {
                out.extend(
                    field
                        .bits
                        .iter()
                        .map(|bit| (bit.clone(), "bool".to_owned(), about.clone())),
                );
            }
        }
        if let Some(inner) = self.optional.filter(|_| !optional) {
            out.push((
                inner.name.clone(),
                format!("Option<{}>", inner.type_name),
                inner.doc.clone(),
            ));
        }
        if self.counters {
            out.push((
                "counters".to_owned(),
                "Counters".to_owned(),
                "Counts since the emulator started.".to_owned(),
            ));
        }
        out
    }

    fn declaration(
        &self,
        schema: &Schema,
        name: &str,
        about: &str,
        members: &[(String, String, String)],
    ) -> String {
        let flat = schema.flat(self.fields);
        let is_float = |field: &Field| {
            matches!(
                field.kind,
                Kind::One(Number::Float(_)) | Kind::Array(Number::Float(_), _)
            )
        };
        let eq = if flat.iter().any(is_float) {
            ""
        } else {
            ", Eq"
        };
        let default = if self.default { ", Default" } else { "" };
        let lifetime = if self.borrows { "<'a>" } else { "" };
        let seen = if self.private { "pub(crate)" } else { "pub" };
        let members = members
            .iter()
            .map(|(name, kind, about)| doc(about, 1) + &format!("    {seen} {name}: {kind},\n"));
        format!(
            "\n{}#[derive(Debug, Clone, Copy{default}, PartialEq{eq})]\npub struct {name}{lifetime} {{\n{}}}\n",
            doc(about, 0),
            members.collect::<String>()
        )
    }

    fn read(&self, schema: &Schema) -> String {
        let mut out = String::new();
        let mut names = Vec::new();
        let mut inner = String::new();
        for field in self.fields {
            let name = &field.name;
            if field.optional {
                inner += &format!(
                    "                {name}: {},\n",
                    self.read_value(schema, field)
                );
                continue;
            }
            if self.is_flag(field) {
                out += &format!(
                    "        let {name} = reader.flags(1, \"{}.{name}\", \"must be 0 or 1\")?;\n",
                    self.name
                );
                continue;
            }
            if !field.bits.is_empty() {
                let (most, text) = (
                    (1 << field.bits.len()) - 1,
                    field.limits(schema).unwrap_or_default(),
                );
                out += &format!(
                    "        let {name} = reader.flags({most}, \"{}.{name}\", \"must be {text}\")?;\n",
                    self.name
                );
                names.extend(
                    field
                        .bits
                        .iter()
                        .enumerate()
                        .map(|(bit, flag)| format!("{flag}: {name} & {} != 0", 1 << bit)),
                );
                continue;
            }
            if let (Kind::Array(number, length), Some(count)) = (&field.kind, &field.counted_by) {
                out += &format!(
                    "        let mut {name} = [[0; {length}]; {}];\n",
                    field.most
                );
                out += &format!("        let listed = {name}.get_mut(..usize::from({count}));\n");
                out += &format!("        let rule = \"must be {} or fewer\";\n", field.most);
                out += &format!("        let field = \"{}.{count}\";\n", self.name);
                out += "        for number in listed.ok_or(DecodeError::BadValue { field, rule })?.iter_mut().flatten() {\n";
                out += &format!(
                    "            *number = reader.{}()?;\n        }}\n",
                    number.name()
                );
            } else {
                out += &format!("        let {name} = {};\n", self.read_value(schema, field));
            }
            names.push(name.clone());
        }
        if let Some(optional) = self.optional {
            out += &format!(
                "        let {} = match {} {{\n            1 => Some({} {{\n{inner}            }}),\n            _ => None,\n        }};\n",
                optional.name, optional.flag, optional.type_name
            );
            names.push(optional.name.clone());
        }
        if self.counters {
            out += "        let mut counters = Counters::default();\n        for counter in counters.iter_mut() {\n            *counter = reader.u32()?;\n        }\n";
            names.push("counters".to_owned());
        }
        let names: String = names
            .iter()
            .map(|name| format!("            {name},\n"))
            .collect();
        out + &format!("        Ok(Self {{\n{names}        }})\n")
    }

    /// The expression that reads a field.
    fn read_value(&self, schema: &Schema, field: &Field) -> String {
        let name = format!("\"{}.{}\"", self.name, field.name);
        match &field.kind {
            _ if field.codes.is_some() => {
                let codes = field.codes.as_deref().unwrap_or_default();
                let text = field.limits(schema).unwrap_or_default();
                format!("reader.code({codes}::from_code, {name}, \"must be {text}\")?")
            }
            Kind::One(number) => read_number(*number),
            Kind::Array(number, _) => format!("reader.{}s()?", number.name()),
            Kind::Ascii(_) => "reader.array()?".to_owned(),
            Kind::Struct(kind) => format!("{kind}::read(reader)?"),
            Kind::Rest(Rest::Utf8) => format!(
                "reader.text({0}, {name}, \"must be {0} octets or fewer\")?",
                field.most
            ),
            Kind::Rest(_) => "reader.rest()".to_owned(),
        }
    }

    fn write(&self) -> String {
        let mut out = String::new();
        if self.encode_check {
            out += "        self.check_layout()?;\n";
        }
        let mut inner = String::new();
        for field in self.fields {
            let name = &field.name;
            if self.is_flag(field) {
                let optional = self
                    .optional
                    .map(|optional| optional.name.as_str())
                    .unwrap_or_default();
                out += &format!("        writer.u8(self.{optional}.is_some().into())?;\n");
            } else if field.optional {
                let optional = self
                    .optional
                    .map(|optional| optional.name.as_str())
                    .unwrap_or_default();
                inner += &format!(
                    "            {}?;\n",
                    write_value(field, &format!("{optional}.{name}"))
                );
            } else if !field.bits.is_empty() {
                let bits = field.bits.iter().enumerate().map(|(bit, flag)| match bit {
                    0 => format!("u8::from(self.{flag})"),
                    bit => format!("u8::from(self.{flag}) << {bit}"),
                });
                out += &format!(
                    "        writer.u8({})?;\n",
                    bits.collect::<Vec<_>>().join(" | ")
                );
            } else if let (Kind::Array(number, _), Some(count)) = (&field.kind, &field.counted_by) {
                out += &format!(
                    "        for number in self.{name}.iter().take(self.{count}.into()).flatten() {{\n            writer.{}(*number)?;\n        }}\n",
                    number.name()
                );
            } else {
                out += &format!(
                    "        {}?;\n",
                    write_value(field, &format!("self.{name}"))
                );
            }
        }
        if let Some(optional) = self.optional {
            out += &format!(
                "        if let Some({0}) = &self.{0} {{\n{inner}        }}\n",
                optional.name
            );
        }
        if self.counters {
            out += "        for (_, value) in self.counters.iter() {\n            writer.u32(value)?;\n        }\n";
        }
        out + "        Ok(())\n"
    }

    /// Statements that refuse what a field does not allow.
    fn range(&self, schema: &Schema, field: &Field) -> String {
        if self.is_flag(field) || field.counted_by.is_some() {
            return String::new();
        }
        match self.optional.filter(|_| field.optional) {
            Some(optional) => {
                let inner = field_range(schema, self.name, field, &format!("{}.", optional.name));
                let inner: String = inner.lines().map(|line| format!("    {line}\n")).collect();
                format!(
                    "        if let Some({0}) = &self.{0} {{\n{inner}        }}\n",
                    optional.name
                )
            }
            None => field_range(schema, self.name, field, "self."),
        }
    }
}

/// Statements that refuse what a field does not allow; `of` stands before its name.
pub(super) fn field_range(schema: &Schema, owner: &str, field: &Field, of: &str) -> String {
    let (name, place) = (
        format!("\"{owner}.{}\"", field.name),
        format!("{of}{}", field.name),
    );
    // What stands behind a reference is one already.
    let borrowed = match of {
        "*" => field.name.clone(),
        _ => format!("&{place}"),
    };
    let mut out = String::new();
    // Codes are checked as they are read, counts with what they count.
    let limits = field
        .limits(schema)
        .filter(|_| field.min.is_some() || field.max.is_some());
    if let Some(text) = limits.filter(|_| field.most == 0) {
        let is_float = matches!(field.kind, Kind::One(Number::Float(_)));
        let number = |limit: f64| {
            if is_float {
                format!("{limit:?}")
            } else {
                format!("{limit}")
            }
        };
        let range = match (field.min, field.max) {
            (Some(min), Some(max)) => format!("({}..={})", number(min), number(max)),
            (Some(min), None) => format!("({}..)", number(min)),
            (_, max) => format!("(..={})", max.map(number).unwrap_or_default()),
        };
        out +=
            &format!("        rule({range}.contains({borrowed}), {name}, \"must be {text}\")?;\n");
    }
    match (field.rule, field.error.as_deref()) {
        (Some(Rule::Positive), _) => {
            // What the emulator accepts of it.
            let range = field.range.as_deref().unwrap_or("finite and above 0");
            let text = format!("must be {range} {}", field.unit);
            out += &format!(
                "        positive({name}, {place}, {:?})?;\n",
                text.trim_end()
            );
        }
        (Some(Rule::Finite), Some("NotFinite")) => {
            out += &format!("        finite({name}, &{place})?;\n")
        }
        (Some(Rule::Finite), _) => {
            out += &format!("        rule({place}.is_finite(), {name}, \"must be finite\")?;\n")
        }
        (None, _) => {}
    }
    match &field.kind {
        Kind::Struct(_) => out += &format!("        {place}.check()?;\n"),
        Kind::Rest(Rest::Octets) => {
            out += &format!(
                "        rule(({}..={}).contains(&{place}.len()), {name}, \"must be {0} to {1} octets\")?;\n",
                field.least, field.most
            );
        }
        _ => {}
    }
    out
}

/// The expression that reads a number.
pub(super) fn read_number(number: Number) -> String {
    match number {
        Number::Time => "reader.time()?".to_owned(),
        number => format!("reader.{}()?", number.name()),
    }
}

/// Its type.
pub(super) fn rust_type(field: &Field) -> String {
    let number = |number: Number| match number {
        Number::Time => "WireTime".to_owned(),
        number => number.name(),
    };
    match &field.kind {
        Kind::One(kind) => field.codes.clone().unwrap_or(number(*kind)),
        Kind::Array(kind, length) => match field.counted_by {
            Some(_) => format!("[[{}; {length}]; {}]", number(*kind), field.most),
            None => format!("[{}; {length}]", number(*kind)),
        },
        Kind::Ascii(length) => format!("[u8; {length}]"),
        Kind::Struct(kind) => kind.clone(),
        Kind::Rest(Rest::Utf8) => "&'a str".to_owned(),
        Kind::Rest(_) => "&'a [u8]".to_owned(),
    }
}

/// The call that writes a field, without its `?`.
pub(super) fn write_value(field: &Field, place: &str) -> String {
    match &field.kind {
        _ if field.codes.is_some() => format!("writer.u8({place}.code())"),
        Kind::One(Number::Time) => format!("writer.u64({}.0)", place.trim_start_matches('*')),
        Kind::One(number) => format!("writer.{}({place})", number.name()),
        Kind::Array(number, _) => format!("writer.{}s(&{place})", number.name()),
        Kind::Ascii(_) => format!("writer.bytes(&{place})"),
        Kind::Struct(_) => format!("{place}.write(writer)"),
        Kind::Rest(Rest::Utf8) => format!("writer.bytes({place}.as_bytes())"),
        Kind::Rest(_) => format!("writer.bytes({place})"),
    }
}
