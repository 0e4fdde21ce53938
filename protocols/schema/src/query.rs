//! What every output asks of the schema: sizes, wordings, flat lists of fields; and that its names lead somewhere.

use crate::model::{
    Counter, Enum, Field, Kind, Message, Number, Opcode, Rest, Rule, Schema, Struct,
};

impl Field {
    /// Its octets, if always the same.
    pub fn octets(&self) -> Option<usize> {
        match self.kind {
            _ if self.counted_by.is_some() => None,
            Kind::One(number) => Some(number.octets()),
            Kind::Array(number, length) => Some(number.octets() * length),
            Kind::Ascii(length) => Some(length),
            Kind::Struct(_) | Kind::Rest(_) => None,
        }
    }

    /// Fewest and most octets.
    pub fn octets_range(&self) -> (usize, usize) {
        match (&self.kind, self.octets()) {
            (_, Some(octets)) => (octets, octets),
            (Kind::Array(number, length), None) => (0, self.most * number.octets() * length),
            _ => (self.least, self.most),
        }
    }

    /// What its limits or codes allow, whatever else does.
    pub fn limits(&self, schema: &Schema) -> Option<String> {
        let bare = Self {
            range: None,
            rule: None,
            ..self.clone()
        };
        let limited = self.min.is_some() || self.max.is_some() || self.codes.is_some();
        let text = bare.range_text(schema);
        let text = match text.rsplit_once(", ") {
            Some((before, last)) => format!("{before} or {last}"),
            None => text,
        };
        (limited || !self.bits.is_empty()).then_some(text)
    }

    /// What it allows, in the ICD's words.
    pub fn range_text(&self, schema: &Schema) -> String {
        if let Some(range) = &self.range {
            return range.clone();
        }
        if let Some(codes) = self.codes.as_deref().and_then(|name| schema.codes(name)) {
            let codes: Vec<u8> = codes.values.iter().map(|value| value.code).collect();
            return match codes.as_slice() {
                [first, .., last]
                    if codes.len() > 2 && usize::from(last - first) + 1 == codes.len() =>
                {
                    format!("{first} to {last}")
                }
                _ => codes
                    .iter()
                    .map(u8::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            };
        }
        if !self.bits.is_empty() {
            return match (1_u32 << self.bits.len()) - 1 {
                1 => "0, 1".to_owned(),
                most => format!("0 to {most}"),
            };
        }
        match (&self.kind, self.rule) {
            (Kind::Rest(Rest::Octets | Rest::Utf8 | Rest::Records), _) => {
                format!("{} to {} octets", self.least, self.most)
            }
            (Kind::Rest(_) | Kind::Ascii(_), _) => String::new(),
            (_, Some(Rule::Finite)) => "finite".to_owned(),
            (_, Some(Rule::Positive)) => "above 0".to_owned(),
            (kind, None) => match (self.min, self.max) {
                (None, None) => "any".to_owned(),
                (min, max) => {
                    let largest = match kind {
                        Kind::One(Number::Unsigned(octets)) => 256_f64.powi(*octets as i32) - 1.0,
                        _ => f64::INFINITY,
                    };
                    format!("{} to {}", min.unwrap_or(0.0), max.unwrap_or(largest))
                }
            },
        }
    }
}

impl Message {
    /// Name of its type.
    pub fn type_name(&self) -> &str {
        self.type_name.as_deref().unwrap_or(&self.name)
    }
}

impl Schema {
    /// The codes of this name.
    pub fn codes(&self, name: &str) -> Option<&Enum> {
        self.enums.iter().find(|codes| codes.name == name)
    }

    /// The structure of this name.
    pub fn structure(&self, name: &str) -> Option<&Struct> {
        self.structs.iter().find(|structure| structure.name == name)
    }

    /// The message of this name.
    pub fn message(&self, name: &str) -> Option<&Message> {
        self.messages.iter().find(|message| message.name == name)
    }

    /// Fields with those of structures in their place.
    pub fn flat(&self, fields: &[Field]) -> Vec<Field> {
        let inner = |field: &Field| match &field.kind {
            Kind::Struct(name) => self
                .structure(name)
                .map(|structure| self.flat(&structure.fields))
                .unwrap_or_default(),
            _ => vec![field.clone()],
        };
        fields.iter().flat_map(inner).collect()
    }

    /// All fields of a message, counters too; without those of opcodes.
    pub fn fields(&self, message: &Message) -> Vec<Field> {
        let mut fields = self.flat(&message.fields);
        if message.counters {
            fields.extend(self.counters.iter().map(counter_field));
        }
        fields
    }

    /// The fields of a command.
    pub fn arguments(&self, opcode: &Opcode) -> Vec<Field> {
        match opcode
            .type_name
            .as_deref()
            .and_then(|name| self.structure(name))
        {
            Some(structure) => self.flat(&structure.fields),
            None => opcode.fields.clone(),
        }
    }

    /// Reads `packets.toml`.
    ///
    /// # Errors
    /// Where the text is not what the types above say, or a name leads nowhere.
    pub fn parse(text: &str) -> Result<Self, String> {
        let schema: Self =
            toml::from_str(text).map_err(|error| format!("packets.toml: {error}"))?;
        schema.check()?;
        Ok(schema)
    }

    /// Every name leads somewhere, every CAN frame is full.
    fn check(&self) -> Result<(), String> {
        let lists = self.structs.iter().map(|structure| &structure.fields);
        let lists = lists.chain(self.messages.iter().map(|message| &message.fields));
        let opcodes = self.messages.iter().flat_map(|message| &message.opcodes);
        for field in lists.chain(opcodes.map(|opcode| &opcode.fields)).flatten() {
            let unknown = |name: &str| format!("packets.toml: field {} names {name}", field.name);
            if let Some(name) = field
                .codes
                .as_deref()
                .filter(|name| self.codes(name).is_none())
            {
                return Err(unknown(name));
            }
            let structure = match &field.kind {
                Kind::Struct(name) => Some(name),
                _ => field.record.as_ref(),
            };
            if let Some(name) = structure.filter(|name| self.structure(name).is_none()) {
                return Err(unknown(name));
            }
        }
        for frame in &self.can.frames {
            let bits: usize = frame.signals.iter().map(|signal| signal.bits).sum();
            if bits != 8 * frame.octets {
                return Err(format!(
                    "packets.toml: {} has {bits} bits of signals",
                    frame.name
                ));
            }
        }
        Ok(())
    }
}

/// A counter as the field that it is on the wire.
fn counter_field(counter: &Counter) -> Field {
    Field {
        name: counter.name.clone(),
        kind: Kind::One(Number::Unsigned(4)),
        doc: counter.doc.clone(),
        unit: String::new(),
        codes: None,
        bits: Vec::new(),
        min: None,
        max: None,
        rule: None,
        error: None,
        range: None,
        parts: Vec::new(),
        optional: false,
        counted_by: None,
        record: None,
        least: 0,
        most: 0,
    }
}
