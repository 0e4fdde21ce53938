//! The XTCE file (CCSDS 660.1-G, OMG formal/20180204): telemetry and, so that a monitor reads both directions,
//! telecommands as containers; and telecommands once more as commands that can be sent.

use std::collections::BTreeMap;

use crate::NOTE;
use crate::model::{Field, Kind, Message, Number, Receiver, Rest, Schema};

mod commands;

/// Octets before the payload and after it.
const AROUND: usize = 17;

/// The primary header with the names that readers of space packets know.
const HEADER: [(&str, usize, &str); 7] = [
    ("VERSION", 3, "packet version number: 0"),
    ("TYPE", 1, "1: telecommand"),
    ("SEC_HDR_FLG", 1, "secondary header: always 1"),
    ("PKT_APID", 11, "kind of the message"),
    ("SEQ_FLGS", 2, "unsegmented: 3"),
    ("SRC_SEQ_CTR", 14, "count of the packets with this APID"),
    ("PKT_LEN", 16, "octets after this field, minus one"),
];

/// A document under way: types, parameters and containers.
#[derive(Default)]
struct Document {
    types: BTreeMap<String, String>,
    parameters: String,
    containers: String,
}

/// The whole file.
pub fn write(schema: &Schema) -> String {
    let mut document = Document::default();
    document.header(schema);
    for message in &schema.messages {
        document.message(schema, message);
    }
    let types: String = document.types.into_values().collect();
    format!(
        "<!-- {NOTE} -->\n\
         <SpaceSystem xmlns=\"http://www.omg.org/spec/XTCE/20180204\" name=\"skyloop\" \
         shortDescription=\"native packets of skyloop\">\n\
         \x20 <Header version=\"{}\" validationStatus=\"Working\"/>\n\
         \x20 <TelemetryMetaData>\n    <ParameterTypeSet>\n{types}    </ParameterTypeSet>\n\
         \x20   <ParameterSet>\n{}    </ParameterSet>\n\
         \x20   <ContainerSet>\n{}    </ContainerSet>\n  </TelemetryMetaData>\n{}</SpaceSystem>\n",
        schema.version,
        document.parameters,
        document.containers,
        commands::write(schema),
    )
}

impl Document {
    fn header(&mut self, schema: &Schema) {
        let mut entries = Vec::new();
        for (name, bits, doc) in HEADER {
            self.types
                .entry(format!("u{bits}"))
                .or_insert_with(|| unsigned("Parameter", bits, ""));
            self.parameter(name, &format!("u{bits}"), doc);
            entries.push(name.to_owned());
        }
        self.types.insert(
            "time_code".to_owned(),
            "      <AbsoluteTimeParameterType name=\"time_code\">\n\
             \x20       <Encoding units=\"seconds\" scale=\"2.3283064365386962890625E-10\">\
             <IntegerDataEncoding sizeInBits=\"64\" encoding=\"unsigned\"/></Encoding>\n\
             \x20       <ReferenceTime><Epoch>TAI</Epoch></ReferenceTime>\n\
             \x20     </AbsoluteTimeParameterType>\n"
                .to_owned(),
        );
        self.types
            .entry("u8".to_owned())
            .or_insert_with(|| unsigned("Parameter", 8, ""));
        self.parameter("TIME", "time_code", "units of 2^-32 s since 1958-01-01 TAI");
        self.parameter("FORMAT_VERSION", "u8", &format!("{}", schema.version));
        self.parameter("CRC", "u16", "CRC-16 of all octets before it");
        entries.extend(["TIME".to_owned(), "FORMAT_VERSION".to_owned()]);
        self.container("CCSDSPacket", true, None, &[], &entries, "every packet");
    }

    fn message(&mut self, schema: &Schema, message: &Message) {
        let telecommand = u8::from(message.to == Receiver::Emulator);
        let own = [
            ("PKT_APID", message.apid.to_string()),
            ("TYPE", telecommand.to_string()),
            ("FORMAT_VERSION", schema.version.to_string()),
        ];
        let (name, doc) = (&message.name, &message.doc);
        let all = schema.fields(message);
        let (optional, fixed): (Vec<Field>, Vec<Field>) =
            all.into_iter().partition(|field| field.optional);
        let mut entries = self.fields(schema, name, &fixed);
        let last = ["CRC".to_owned()];
        if let Some(flag) = &message.optional {
            self.container(name, true, Some("CCSDSPacket"), &own, &entries, doc);
            let more = self.fields(schema, name, &optional);
            let flag_name = format!("{name}_{}", flag.flag);
            for (suffix, value, entries) in [("without", 0, &[][..]), ("with", 1, &more)] {
                let child = format!("{name}_{suffix}_{}", flag.name);
                let entries = [entries, &last].concat();
                self.container(
                    &child,
                    false,
                    Some(name),
                    &[(&flag_name, value.to_string())],
                    &entries,
                    doc,
                );
            }
        } else if message.opcodes.is_empty() {
            entries.extend(last);
            self.container(name, false, Some("CCSDSPacket"), &own, &entries, doc);
        } else {
            let opcode = format!("{name}_opcode");
            let codes = message
                .opcodes
                .iter()
                .map(|code| (code.code, code.name.as_str()));
            self.types.insert(
                "Opcode".to_owned(),
                enumerated("Parameter", "Opcode", codes),
            );
            self.parameter(&opcode, "Opcode", "which command");
            self.container(
                name,
                true,
                Some("CCSDSPacket"),
                &own,
                std::slice::from_ref(&opcode),
                doc,
            );
            for code in &message.opcodes {
                let child = format!("{name}_{}", code.name);
                let mut entries = self.fields(schema, &child, &schema.arguments(code));
                entries.extend(last.clone());
                self.container(
                    &child,
                    false,
                    Some(name),
                    &[(&opcode, code.name.clone())],
                    &entries,
                    &code.doc,
                );
            }
        }
    }

    /// Declares the parameters of these fields; their names.
    fn fields(&mut self, schema: &Schema, owner: &str, fields: &[Field]) -> Vec<String> {
        let mut names = Vec::new();
        let fixed: usize = fields.iter().filter_map(Field::octets).sum();
        for field in fields {
            let name = format!("{owner}_{}", field.name);
            let kind = self.type_of(schema, owner, field, fixed);
            match &field.kind {
                Kind::Array(..) if field.counted_by.is_none() => {
                    for part in &field.parts {
                        let name = format!("{name}_{part}");
                        self.parameter(&name, &kind, &field.doc);
                        names.push(name);
                    }
                }
                _ => {
                    self.parameter(&name, &kind, &field.doc);
                    names.push(name);
                }
            }
        }
        names
    }

    /// Declares the type of a field, if it is not yet; its name.
    fn type_of(&mut self, schema: &Schema, owner: &str, field: &Field, fixed: usize) -> String {
        let (name, text) = match (&field.kind, &field.counted_by) {
            (Kind::Array(number, length), Some(count)) => {
                let name = format!("{owner}_{}_type", field.name);
                let bits = 8 * number.octets() * length;
                let text = binary("Parameter", &name, &format!("{owner}_{count}"), bits, 0);
                (name, text)
            }
            (Kind::Rest(Rest::Utf8), _) => {
                let name = format!("{owner}_{}_type", field.name);
                let text = text_type(&name, 8 * field.most, fixed);
                (name, text)
            }
            (Kind::Rest(_), _) => {
                let name = format!("{owner}_{}_type", field.name);
                let text = binary("Parameter", &name, "PKT_LEN", 8, intercept(fixed));
                (name, text)
            }
            _ => scalar("Parameter", schema, field),
        };
        self.types.entry(name.clone()).or_insert(text);
        name
    }

    fn parameter(&mut self, name: &str, kind: &str, doc: &str) {
        let doc = escape(doc);
        self.parameters += &format!(
            "      <Parameter name=\"{name}\" parameterTypeRef=\"{kind}\" shortDescription=\"{doc}\"/>\n"
        );
    }

    fn container(
        &mut self,
        name: &str,
        is_abstract: bool,
        base: Option<&str>,
        conditions: &[(&str, String)],
        entries: &[String],
        doc: &str,
    ) {
        let is_abstract = if is_abstract {
            " abstract=\"true\""
        } else {
            ""
        };
        self.containers += &format!(
            "      <SequenceContainer name=\"{name}\"{is_abstract} shortDescription=\"{}\">\n        <EntryList>\n",
            escape(doc)
        );
        for entry in entries {
            self.containers +=
                &format!("          <ParameterRefEntry parameterRef=\"{entry}\"/>\n");
        }
        self.containers += "        </EntryList>\n";
        if let Some(base) = base {
            self.containers += &format!(
                "        <BaseContainer containerRef=\"{base}\">\n          <RestrictionCriteria>\n            <ComparisonList>\n"
            );
            for (parameter, value) in conditions {
                self.containers += &format!(
                    "              <Comparison parameterRef=\"{parameter}\" comparisonOperator=\"==\" value=\"{value}\"/>\n"
                );
            }
            self.containers += "            </ComparisonList>\n          </RestrictionCriteria>\n        </BaseContainer>\n";
        }
        self.containers += "      </SequenceContainer>\n";
    }
}

/// From PKT_LEN in octets to the bits of the last field, behind `fixed` octets of others.
fn intercept(fixed: usize) -> isize {
    8 * (7 - AROUND as isize - fixed as isize)
}

/// The type of a number, a code or a flag: name and text. `of` is Parameter or Argument.
fn scalar(of: &str, schema: &Schema, field: &Field) -> (String, String) {
    if let Some(codes) = field.codes.as_deref().and_then(|name| schema.codes(name)) {
        let values = codes
            .values
            .iter()
            .map(|value| (value.code, value.name.as_str()));
        return (codes.name.clone(), enumerated(of, &codes.name, values));
    }
    let number = match field.kind {
        Kind::One(number) | Kind::Array(number, _) => number,
        _ => Number::Unsigned(1),
    };
    match number {
        Number::Time if of == "Argument" => ("u64".to_owned(), unsigned(of, 64, "")),
        Number::Time => ("time_code".to_owned(), String::new()),
        Number::Unsigned(octets) => {
            let text = unsigned(of, 8 * octets, &field.unit);
            (named(&format!("u{}", 8 * octets), &field.unit), text)
        }
        Number::Float(octets) => {
            let name = named(&format!("f{}", 8 * octets), &field.unit);
            let text = format!(
                "      <Float{of}Type name=\"{name}\" sizeInBits=\"{0}\">{1}<FloatDataEncoding sizeInBits=\"{0}\" \
                 encoding=\"IEEE754_1985\"/></Float{of}Type>\n",
                8 * octets,
                units(&field.unit)
            );
            (name, text)
        }
    }
}

fn unsigned(of: &str, bits: usize, unit: &str) -> String {
    format!(
        "      <Integer{of}Type name=\"{}\" signed=\"false\" sizeInBits=\"{bits}\">{}\
         <IntegerDataEncoding sizeInBits=\"{bits}\" encoding=\"unsigned\"/></Integer{of}Type>\n",
        named(&format!("u{bits}"), unit),
        units(unit)
    )
}

fn enumerated<'a>(of: &str, name: &str, codes: impl Iterator<Item = (u8, &'a str)>) -> String {
    let codes: String = codes
        .map(|(code, label)| {
            format!("          <Enumeration value=\"{code}\" label=\"{label}\"/>\n")
        })
        .collect();
    format!(
        "      <Enumerated{of}Type name=\"{name}\">\n\
         \x20       <IntegerDataEncoding sizeInBits=\"8\" encoding=\"unsigned\"/>\n\
         \x20       <EnumerationList>\n{codes}        </EnumerationList>\n      </Enumerated{of}Type>\n"
    )
}

/// Octets whose number of bits is `slope` times a parameter, plus `intercept`.
fn binary(of: &str, name: &str, reference: &str, slope: usize, intercept: isize) -> String {
    let instance = if of == "Argument" {
        "ArgumentInstanceRef argumentRef"
    } else {
        "ParameterInstanceRef parameterRef"
    };
    format!(
        "      <Binary{of}Type name=\"{name}\">\n        <BinaryDataEncoding>\n          <SizeInBits>\n\
         \x20           <DynamicValue>\n              <{instance}=\"{reference}\"/>\n\
         \x20             <LinearAdjustment slope=\"{slope}\" intercept=\"{intercept}\"/>\n\
         \x20           </DynamicValue>\n          </SizeInBits>\n        </BinaryDataEncoding>\n      </Binary{of}Type>\n"
    )
}

/// UTF-8 up to the CRC.
fn text_type(name: &str, most_bits: usize, fixed: usize) -> String {
    format!(
        "      <StringParameterType name=\"{name}\">\n        <StringDataEncoding encoding=\"UTF-8\">\n\
         \x20         <Variable maxSizeInBits=\"{most_bits}\">\n            <DynamicValue>\n\
         \x20             <ParameterInstanceRef parameterRef=\"PKT_LEN\"/>\n\
         \x20             <LinearAdjustment slope=\"8\" intercept=\"{}\"/>\n\
         \x20           </DynamicValue>\n          </Variable>\n        </StringDataEncoding>\n      </StringParameterType>\n",
        intercept(fixed)
    )
}

fn units(unit: &str) -> String {
    match unit {
        "" => "<UnitSet/>".to_owned(),
        unit => format!("<UnitSet><Unit>{}</Unit></UnitSet>", escape(unit)),
    }
}

/// The name of a number's type with its unit in it.
fn named(kind: &str, unit: &str) -> String {
    let unit: String = unit
        .chars()
        .map(|c| if c.is_alphanumeric() { c } else { '_' })
        .collect();
    match unit.as_str() {
        "" => kind.to_owned(),
        unit => format!("{kind}_{unit}"),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
