//! Queries of the schema: sizes, wordings, flat lists of fields.

use crate::model::{
    CanFrame, Code, Enum, Field, Kind, Number, Receiver, Record, Rest, Rule, Schema, Signal,
};
use crate::text::join;

impl Number {
    pub const fn bytes(self) -> usize {
        match self {
            Self::Unsigned(bytes) | Self::Float(bytes) => bytes,
            Self::Time => 8,
        }
    }

    /// Its name in Rust and in the ICD.
    pub fn name(self) -> String {
        match self {
            Self::Unsigned(bytes) => format!("u{}", 8 * bytes),
            Self::Float(bytes) => format!("f{}", 8 * bytes),
            Self::Time => "time code".to_owned(),
        }
    }
}

impl Kind {
    /// Name of its structure.
    pub fn structure(&self) -> Option<String> {
        match self {
            Self::Struct(name) => Some(name.clone()),
            _ => None,
        }
    }

    pub const fn is_float(&self) -> bool {
        matches!(
            self,
            Self::One(Number::Float(_)) | Self::Array(Number::Float(_), _)
        )
    }
}

impl Field {
    /// Its bytes, if constant.
    pub fn bytes(&self) -> Option<usize> {
        match self.kind {
            _ if self.counted_by.is_some() => None,
            Kind::One(number) => Some(number.bytes()),
            Kind::Array(number, length) => Some(number.bytes() * length),
            Kind::Ascii(length) => Some(length),
            Kind::Struct(_) | Kind::Rest(_) => None,
        }
    }

    /// Minimum and maximum number of bytes.
    pub fn bytes_range(&self) -> (usize, usize) {
        match (&self.kind, self.bytes()) {
            (_, Some(bytes)) => (bytes, bytes),
            (Kind::Array(number, length), None) => (0, self.most * number.bytes() * length),
            _ => (self.least, self.most),
        }
    }

    /// Its flags with their bits.
    pub fn flags(&self) -> impl Iterator<Item = (u8, &String)> {
        (0..).map(|bit| 1 << bit).zip(&self.bits)
    }

    /// The sum of all flags.
    pub fn all_flags(&self) -> u8 {
        self.flags().map(|(bit, _)| bit).sum()
    }

    /// The largest number of its type.
    pub fn largest(&self) -> f64 {
        match self.kind {
            Kind::One(Number::Unsigned(bytes)) => 256_f64.powi(bytes as i32) - 1.0,
            _ => f64::INFINITY,
        }
    }

    /// The range of its codes, its flags, or `min` and `max`.
    fn bounds(&self, schema: &Schema) -> Option<String> {
        if let Some(codes) = schema.codes(self) {
            let codes: Vec<u8> = codes.values.iter().map(|value| value.code).collect();
            return Some(match codes.as_slice() {
                [first, _, .., last] if usize::from(last - first) + 1 == codes.len() => {
                    format!("{first} to {last}")
                }
                codes => join(codes, ", "),
            });
        }
        match (self.all_flags(), self.min, self.max) {
            (0, None, None) => None,
            (0, min, max) => {
                let (min, max) = (min.unwrap_or(0.0), max.unwrap_or(self.largest()));
                Some(format!("{min} to {max}"))
            }
            (1, ..) => Some("0, 1".to_owned()),
            (all, ..) => Some(format!("0 to {all}")),
        }
    }

    /// The range as part of a sentence.
    pub fn limits(&self, schema: &Schema) -> Option<String> {
        let bounds = self.bounds(schema)?;
        let last = bounds.rsplit_once(", ");
        Some(last.map_or(bounds.clone(), |(before, last)| {
            format!("{before} or {last}")
        }))
    }

    /// The range in the ICD's words.
    pub fn range_text(&self, schema: &Schema) -> String {
        if let Some(range) = &self.range {
            return range.clone();
        }
        match (&self.kind, self.rule) {
            (Kind::Rest(Rest::Bytes | Rest::Utf8 | Rest::Records), _) => {
                format!("{} to {} octets", self.least, self.most)
            }
            (Kind::Rest(_) | Kind::Ascii(_), _) => String::new(),
            (_, Some(Rule::Finite)) => "finite".to_owned(),
            (_, Some(Rule::Positive)) => "above 0".to_owned(),
            (_, None) => self.bounds(schema).unwrap_or("any".to_owned()),
        }
    }
}

impl Record {
    pub fn type_name(&self) -> &str {
        self.type_name.as_deref().unwrap_or(&self.name)
    }

    /// Whether this field is the flag of the optional fields.
    pub fn is_flag(&self, field: &Field) -> bool {
        let optional = self.optional.as_ref();
        optional.is_some_and(|optional| optional.flag == field.name)
    }
}

impl CanFrame {
    /// The signals with the index of their first bit, without the spare bits.
    pub fn placed(&self) -> impl Iterator<Item = (usize, &Signal)> {
        let signals = self.signals.iter().scan(0, |at, signal| {
            let first = *at;
            *at += signal.bits;
            Some((first, signal))
        });
        signals.filter(|(_, signal)| !signal.name.is_empty())
    }
}

impl Signal {
    /// Whether it is the upper half of an f64, which is an f32.
    pub fn is_float(&self) -> bool {
        self.of.starts_with("high ")
    }
}

impl Schema {
    /// The codes of a field.
    pub fn codes(&self, field: &Field) -> Option<&Enum> {
        let name = field.codes.as_ref()?;
        self.enums.iter().find(|codes| codes.name == *name)
    }

    /// The structure of a field's records.
    pub fn record(&self, field: &Field) -> Option<&Record> {
        self.structure(field.record.as_ref()?)
    }

    /// The structure of a field.
    pub fn inner(&self, field: &Field) -> Option<&Record> {
        self.structure(&field.kind.structure()?)
    }

    pub fn structure(&self, name: &str) -> Option<&Record> {
        self.structs.iter().find(|structure| structure.name == name)
    }

    /// # Errors
    /// There is no message of this name.
    pub fn message(&self, name: &str) -> Result<&Record, String> {
        let message = self.messages.iter().find(|message| message.name == name);
        message.ok_or(format!("no message {name}"))
    }

    /// The messages of one direction.
    pub fn to(&self, receiver: Receiver) -> impl Iterator<Item = &Record> {
        let messages = self.messages.iter();
        messages.filter(move |message| message.to == receiver)
    }

    pub fn opcodes(&self) -> impl Iterator<Item = &Code> {
        self.messages.iter().flat_map(|message| &message.opcodes)
    }

    /// Fields, with structures replaced by their fields.
    pub fn flat(&self, fields: &[Field]) -> Vec<Field> {
        let inner = |field: &Field| match self.inner(field) {
            Some(structure) => self.flat(&structure.fields),
            None => vec![field.clone()],
        };
        fields.iter().flat_map(inner).collect()
    }

    /// All fields of a message with its counters, without the fields of opcodes.
    pub fn fields(&self, message: &Record) -> Vec<Field> {
        let counters = self.counters.iter().filter(|_| message.counters);
        let mut fields = self.flat(&message.fields);
        fields.extend(counters.cloned());
        fields
    }

    /// The fields of a command.
    pub fn arguments(&self, opcode: &Code) -> Vec<Field> {
        let structure = opcode.type_name.as_ref();
        match structure.and_then(|name| self.structure(name)) {
            Some(structure) => self.flat(&structure.fields),
            None => opcode.fields.clone(),
        }
    }

    /// The opcode of a payload, if it has one, and the fields after it.
    ///
    /// # Errors
    /// There is no opcode of this name.
    pub fn payload_fields(
        &self,
        message: &Record,
        opcode: Option<&str>,
    ) -> Result<(Option<u8>, Vec<Field>), String> {
        let Some(name) = opcode else {
            return Ok((None, self.fields(message)));
        };
        let known = message.opcodes.iter().find(|known| known.name == name);
        let opcode = known.ok_or(format!("{}: no opcode {name}", message.name))?;
        Ok((Some(opcode.code), self.arguments(opcode)))
    }
}
