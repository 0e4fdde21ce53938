//! The XTCE file (CCSDS 660.1-G, OMG formal/20180204). Packets of both directions are containers,
//! so that a monitor reads both. Telecommands are also commands for sending; the ground system's
//! post-processor fills in their sequence count, data length and CRC.

use std::collections::BTreeMap;

use crate::NOTE;
use crate::bytes::hex;
use crate::model::{Code, Field, Kind, Number, Receiver, Record, Rest, Schema};
use crate::text::{each, indent};

/// Bytes before the payload and after it.
const AROUND: usize = 17;

/// The primary header with the usual names of its fields.
const HEADER: [(&str, usize, &str); 7] = [
    ("VERSION", 3, "packet version number: 0"),
    ("TYPE", 1, "1: telecommand"),
    ("SEC_HDR_FLG", 1, "secondary header: always 1"),
    ("PKT_APID", 11, "kind of the message"),
    ("SEQ_FLGS", 2, "unsegmented: 3"),
    ("SRC_SEQ_CTR", 14, "count of the packets with this APID"),
    ("PKT_LEN", 16, "octets after this field, minus one"),
];

const ABSTRACT: &str = " abstract=\"true\"";
const TIME: &str = "units of 2^-32 s since 1958-01-01 TAI";

/// The whole file.
pub fn write(schema: &Schema) -> String {
    let mut head = format!("Header version=\"{}\"", schema.version);
    head += " validationStatus=\"Working\"";
    let content = empty(&head) + &telemetry(schema) + &commands(schema);
    let system = "SpaceSystem xmlns=\"http://www.omg.org/spec/XTCE/20180204\" name=\"skyloop\" \
                  shortDescription=\"native packets of skyloop\"";
    format!("<!-- {NOTE} -->\n{}", element(system, &content))
}

/// An element: its tag with attributes, and its content.
fn element(head: &str, inside: &str) -> String {
    let tag = head.split(' ').next().unwrap_or(head);
    format!("<{head}>\n{}</{tag}>\n", indent(inside, 2))
}

/// An element on one line.
fn line(head: &str, inside: &str) -> String {
    let tag = head.split(' ').next().unwrap_or(head);
    format!("<{head}>{inside}</{tag}>\n")
}

/// An element without content.
fn empty(head: &str) -> String {
    format!("<{head}/>\n")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Parameters or arguments, with their types.
struct Declared<'a> {
    schema: &'a Schema,
    /// `Parameter` or `Argument`.
    of: &'static str,
    types: BTreeMap<String, String>,
    list: String,
}

impl<'a> Declared<'a> {
    fn new(schema: &'a Schema, of: &'static str) -> Self {
        Self {
            schema,
            of,
            types: BTreeMap::new(),
            list: String::new(),
        }
    }

    /// Declares a parameter or argument and returns its entry in a container.
    fn add(&mut self, name: &str, kind: &str, doc: &str) -> String {
        let (of, reference, doc) = (self.of, self.of.to_lowercase(), escape(doc));
        self.list += &empty(&format!(
            "{of} name=\"{name}\" {reference}TypeRef=\"{kind}\" shortDescription=\"{doc}\""
        ));
        empty(&format!("{of}RefEntry {reference}Ref=\"{name}\""))
    }

    /// Declares these fields and returns their entries.
    fn fields(&mut self, owner: &str, fields: &[Field]) -> String {
        let prefix = match self.of {
            "Parameter" => format!("{owner}_"),
            _ => String::new(),
        };
        let fixed = fields.iter().filter_map(Field::bytes).sum();
        each(fields, |field| {
            let kind = self.type_of(owner, &prefix, field, fixed);
            let name = format!("{prefix}{}", field.name);
            match (&field.kind, &field.counted_by) {
                (Kind::Array(..), None) => each(&field.parts, |part| {
                    self.add(&format!("{name}_{part}"), &kind, &field.doc)
                }),
                _ => self.add(&name, &kind, &field.doc),
            }
        })
    }

    /// Declares the type of a field, where the other fields have `fixed` bytes; returns its name.
    fn type_of(&mut self, owner: &str, prefix: &str, field: &Field, fixed: usize) -> String {
        let own = format!("{owner}_{}_type", field.name);
        // Converts PKT_LEN in bytes to the bits of the last field.
        let intercept = 8 * (7 - AROUND as isize - fixed as isize);
        let (text, name) = match (&field.kind, &field.counted_by) {
            (Kind::Array(number, length), Some(count)) => {
                let length =
                    self.dynamic(&format!("{prefix}{count}"), 8 * number.bytes() * length, 0);
                (self.binary(&own, &length), own)
            }
            (Kind::Rest(Rest::Utf8), _) => {
                let max = format!("Variable maxSizeInBits=\"{}\"", 8 * field.most);
                let length = element(&max, &self.dynamic("PKT_LEN", 8, intercept));
                let encoding = element("StringDataEncoding encoding=\"UTF-8\"", &length);
                (
                    element(&format!("StringParameterType name=\"{own}\""), &encoding),
                    own,
                )
            }
            (Kind::Rest(_), _) => (
                self.binary(&own, &self.dynamic("PKT_LEN", 8, intercept)),
                own,
            ),
            _ => {
                let (name, text) = self.scalar(field);
                (text, name)
            }
        };
        self.types.entry(name.clone()).or_insert(text);
        name
    }

    /// A length in bits: `slope` times a parameter, plus `intercept`.
    fn dynamic(&self, reference: &str, slope: usize, intercept: isize) -> String {
        let (of, attribute) = (self.of, self.of.to_lowercase());
        let instance = empty(&format!("{of}InstanceRef {attribute}Ref=\"{reference}\""));
        let adjustment = format!("LinearAdjustment slope=\"{slope}\" intercept=\"{intercept}\"");
        element("DynamicValue", &(instance + &empty(&adjustment)))
    }

    /// The type of bytes of this length.
    fn binary(&self, name: &str, length: &str) -> String {
        let encoding = element("BinaryDataEncoding", &element("SizeInBits", length));
        element(&format!("Binary{}Type name=\"{name}\"", self.of), &encoding)
    }

    /// Name and text of the type of a number, a code or a flag.
    fn scalar(&self, field: &Field) -> (String, String) {
        if let Some(codes) = self.schema.codes(field) {
            return (
                codes.name.clone(),
                self.enumerated(&codes.name, &codes.values),
            );
        }
        let number = match field.kind {
            Kind::One(number) | Kind::Array(number, _) => number,
            _ => Number::Unsigned(1),
        };
        match number {
            Number::Time if self.of == "Argument" => self.unsigned(64, ""),
            Number::Time => ("time_code".to_owned(), time_code()),
            Number::Unsigned(bytes) => self.unsigned(8 * bytes, &field.unit),
            Number::Float(bytes) => {
                let (of, bits) = (self.of, 8 * bytes);
                let name = with_unit(&format!("f{bits}"), &field.unit);
                let head = format!("Float{of}Type name=\"{name}\" sizeInBits=\"{bits}\"");
                let encoding =
                    format!("<FloatDataEncoding sizeInBits=\"{bits}\" encoding=\"IEEE754_1985\"/>");
                (name, line(&head, &(units(&field.unit) + &encoding)))
            }
        }
    }

    fn unsigned(&self, bits: usize, unit: &str) -> (String, String) {
        let (of, name) = (self.of, with_unit(&format!("u{bits}"), unit));
        let head =
            format!("Integer{of}Type name=\"{name}\" signed=\"false\" sizeInBits=\"{bits}\"");
        let encoding =
            format!("<IntegerDataEncoding sizeInBits=\"{bits}\" encoding=\"unsigned\"/>");
        (name, line(&head, &(units(unit) + &encoding)))
    }

    fn enumerated(&self, name: &str, codes: &[Code]) -> String {
        let codes = each(codes, |Code { code, name, .. }| {
            empty(&format!("Enumeration value=\"{code}\" label=\"{name}\""))
        });
        let encoding = empty("IntegerDataEncoding sizeInBits=\"8\" encoding=\"unsigned\"");
        let head = format!("Enumerated{}Type name=\"{name}\"", self.of);
        element(&head, &(encoding + &element("EnumerationList", &codes)))
    }

    /// The set of all types.
    fn type_set(&mut self) -> String {
        let types: String = std::mem::take(&mut self.types).into_values().collect();
        element(&format!("{}TypeSet", self.of), &types)
    }
}

fn time_code() -> String {
    let encoding = "<IntegerDataEncoding sizeInBits=\"64\" encoding=\"unsigned\"/>";
    let head = "Encoding units=\"seconds\" scale=\"2.3283064365386962890625E-10\"";
    let content = line(head, encoding) + &line("ReferenceTime", "<Epoch>TAI</Epoch>");
    element("AbsoluteTimeParameterType name=\"time_code\"", &content)
}

fn units(unit: &str) -> String {
    match unit {
        "" => "<UnitSet/>".to_owned(),
        unit => format!("<UnitSet><Unit>{}</Unit></UnitSet>", escape(unit)),
    }
}

/// The name of a number's type with its unit.
fn with_unit(kind: &str, unit: &str) -> String {
    let unit = unit.replace(|c: char| !c.is_alphanumeric(), "_");
    match unit.as_str() {
        "" => kind.to_owned(),
        unit => format!("{kind}_{unit}"),
    }
}

/// All packets as containers.
fn telemetry(schema: &Schema) -> String {
    let mut declared = Declared::new(schema, "Parameter");
    let mut entries = String::new();
    for (name, bits, doc) in HEADER {
        let (kind, text) = declared.unsigned(bits, "");
        entries += &declared.add(name, &kind, doc);
        declared.types.insert(kind, text);
    }
    let (byte, text) = declared.unsigned(8, "");
    declared.types.insert(byte.clone(), text);
    declared.types.insert("time_code".to_owned(), time_code());
    entries += &declared.add("TIME", "time_code", TIME);
    entries += &declared.add("FORMAT_VERSION", &byte, &schema.version.to_string());
    let crc = declared.add("CRC", "u16", "CRC-16 of all octets before it");
    let mut containers = container("CCSDSPacket", ABSTRACT, "", &entries, "every packet");
    for message in &schema.messages {
        containers += &message_containers(&mut declared, message, &crc);
    }
    let content = declared.type_set()
        + &element("ParameterSet", &declared.list)
        + &element("ContainerSet", &containers);
    element("TelemetryMetaData", &content)
}

/// The containers of a message: one, or an abstract one and those that extend it.
fn message_containers(declared: &mut Declared<'_>, message: &Record, crc: &str) -> String {
    let schema = declared.schema;
    let (name, doc) = (&message.name, &message.doc);
    let telecommand = u8::from(message.to == Receiver::Emulator);
    let [apid, kind, version] = [
        message.apid.to_string(),
        telecommand.to_string(),
        schema.version.to_string(),
    ];
    let own = [
        ("PKT_APID", &*apid),
        ("TYPE", &kind),
        ("FORMAT_VERSION", &version),
    ];
    let own = base("CCSDSPacket", &own);
    let mut fixed = schema.fields(message);
    let optional: Vec<Field> = fixed.extract_if(.., |field| field.optional).collect();
    let entries = declared.fields(name, &fixed);
    if let Some(flag) = &message.optional {
        let more = declared.fields(name, &optional);
        let flag_name = format!("{name}_{}", flag.flag);
        let child = |word: &str, value: &str, entries: &str| {
            let base = base(name, &[(&flag_name, value)]);
            let child = format!("{name}_{word}_{}", flag.name);
            container(&child, "", &base, &format!("{entries}{crc}"), doc)
        };
        container(name, ABSTRACT, &own, &entries, doc)
            + &child("without", "0", "")
            + &child("with", "1", &more)
    } else if message.opcodes.is_empty() {
        container(name, "", &own, &(entries + crc), doc)
    } else {
        let opcode = format!("{name}_opcode");
        let text = declared.enumerated("Opcode", &message.opcodes);
        declared.types.insert("Opcode".to_owned(), text);
        let entry = declared.add(&opcode, "Opcode", "which command");
        container(name, ABSTRACT, &own, &entry, doc)
            + &each(&message.opcodes, |code| {
                let child = format!("{name}_{}", code.name);
                let entries = declared.fields(&child, &schema.arguments(code)) + crc;
                let base = base(name, &[(&opcode, &code.name)]);
                container(&child, "", &base, &entries, &code.doc)
            })
    }
}

fn container(name: &str, attribute: &str, base: &str, entries: &str, doc: &str) -> String {
    let doc = escape(doc);
    let head = format!("SequenceContainer name=\"{name}\"{attribute} shortDescription=\"{doc}\"");
    element(&head, &(element("EntryList", entries) + base))
}

/// The container that is extended if these parameters have these values.
fn base(name: &str, conditions: &[(&str, &str)]) -> String {
    let conditions = each(conditions, |(parameter, value)| {
        let reference = format!("parameterRef=\"{parameter}\" comparisonOperator=\"==\"");
        empty(&format!("Comparison {reference} value=\"{value}\""))
    });
    let list = element("ComparisonList", &conditions);
    let criteria = element("RestrictionCriteria", &list);
    element(&format!("BaseContainer containerRef=\"{name}\""), &criteria)
}

/// Telecommands for sending.
fn commands(schema: &Schema) -> String {
    let mut declared = Declared::new(schema, "Argument");
    let (time, text) = declared.unsigned(64, "");
    declared.types.insert(time, text);
    let mut commands = String::new();
    for message in schema.to(Receiver::Emulator) {
        for (word, present) in [("without", 0), ("with", 1)] {
            let Some(optional) = &message.optional else {
                continue;
            };
            let name = format!("{}_{word}_{}", message.name, optional.name);
            let fields = message.fields.iter();
            let fields = fields.filter(|field| present == 1 || !field.optional);
            commands += &command(&mut declared, message, &name, &message.doc, |declared| {
                each(fields, |field| {
                    if message.is_flag(field) {
                        fixed(&[present])
                    } else {
                        declared.fields(&name, std::slice::from_ref(field))
                    }
                })
            });
        }
        for opcode in &message.opcodes {
            let name = format!("{}_{}", message.name, opcode.name);
            commands += &command(&mut declared, message, &name, &opcode.doc, |declared| {
                fixed(&[opcode.code]) + &declared.fields(&name, &schema.arguments(opcode))
            });
        }
    }
    let content = declared.type_set() + &element("MetaCommandSet", &commands);
    element("CommandMetaData", &content)
}

/// Constant bytes.
fn fixed(bytes: &[u8]) -> String {
    let (digits, bits) = (hex(bytes).to_uppercase(), 8 * bytes.len());
    let value = format!("binaryValue=\"{digits}\" sizeInBits=\"{bits}\"");
    empty(&format!("FixedValueEntry {value}"))
}

/// One command; `payload` declares its arguments and returns the entries of its payload.
fn command(
    declared: &mut Declared<'_>,
    message: &Record,
    name: &str,
    doc: &str,
    payload: impl FnOnce(&mut Declared<'_>) -> String,
) -> String {
    let [high, low] = (0x1800 | message.apid).to_be_bytes();
    let time = declared.add("time", "u64", TIME);
    let version = fixed(&[declared.schema.version]);
    let entries = fixed(&[high, low, 0xC0, 0, 0, 0]) + &time + &version + &payload(declared);
    let arguments = element("ArgumentList", &std::mem::take(&mut declared.list));
    let container = format!("CommandContainer name=\"{name}_packet\"");
    let container = element(&container, &element("EntryList", &entries));
    let doc = escape(doc);
    let head = format!("MetaCommand name=\"{name}\" shortDescription=\"{doc}\"");
    element(&head, &(arguments + &container))
}
