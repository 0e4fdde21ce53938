//! Verdicts as JUnit XML, which continuous integration reads: one test suite, a case for each.
//!
//! Written by hand: a crate that writes it would bring five others for one page of text.

use skyloop_orbit::steers;
use std::fmt::Write;

/// One verdict.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Case {
    /// What was judged.
    pub name: String,
    /// What it belongs to, with dots between its parts.
    pub classname: String,
    /// How long that took, s.
    pub seconds: f64,
    /// Why it failed: in a line, and in full; `None` if it passed.
    pub failure: Option<(String, String)>,
    /// Names and values to go with it.
    pub properties: Vec<(String, String)>,
    /// What else there is to say.
    pub system_out: String,
}

/// A document with one test suite. Its cases are of one run: it takes as long as the longest of them.
///
/// Characters that XML cannot hold are written as `\u{1b}`, and times that are no numbers or less than 0 as 0.
#[must_use]
pub fn document(suite: &str, cases: &[Case]) -> String {
    let failures = cases.iter().filter(|case| case.failure.is_some()).count();
    let times = cases.iter().map(|case| time(case.seconds));
    let time = times.fold(0.0, f64::max);
    let head = format!(
        "<testsuite name=\"{}\" tests=\"{}\" failures=\"{failures}\" errors=\"0\" skipped=\"0\" time=\"{time:.3}\">\n",
        escaped(suite),
        cases.len(),
    );
    let mut text = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{head}");
    cases.iter().for_each(|case| text.push_str(&element(case)));
    text.push_str("</testsuite>\n");
    text
}

fn element(case: &Case) -> String {
    let mut inside = String::new();
    // Writing to a string cannot fail.
    if !case.properties.is_empty() {
        inside.push_str("    <properties>\n");
        for (name, value) in &case.properties {
            let (name, value) = (escaped(name), escaped(value));
            let _ = writeln!(
                inside,
                "      <property name=\"{name}\" value=\"{value}\"/>"
            );
        }
        inside.push_str("    </properties>\n");
    }
    if let Some((message, text)) = &case.failure {
        let (message, text) = (escaped(message), between(text));
        let _ = writeln!(
            inside,
            "    <failure message=\"{message}\">{text}</failure>"
        );
    }
    if !case.system_out.is_empty() {
        let _ = writeln!(
            inside,
            "    <system-out>{}</system-out>",
            between(&case.system_out)
        );
    }
    let head = format!(
        "  <testcase name=\"{}\" classname=\"{}\" time=\"{:.3}\"",
        escaped(&case.name),
        escaped(&case.classname),
        time(case.seconds)
    );
    match inside.is_empty() {
        true => format!("{head}/>\n"),
        false => format!("{head}>\n{inside}  </testcase>\n"),
    }
}

/// A time that can be written; a century is more than any.
fn time(seconds: f64) -> f64 {
    // What is no number is not more than 0.
    if seconds > 0.0 {
        seconds.min(3.2e9)
    } else {
        0.0
    }
}

/// Text as it may stand between tags, where ends of lines and tabs stay what they are.
fn between(text: &str) -> String {
    escaped(text).replace("&#10;", "\n").replace("&#9;", "\t")
}

/// Text as it may stand in an attribute.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            // A reader would make spaces of them in an attribute, and of \r an end of line anywhere.
            '\t' | '\n' | '\r' => {
                let _ = write!(escaped, "&#{};", u32::from(character));
            }
            // Legal in XML, but a terminal that shows the file obeys it.
            '\u{20}'.. if steers(character) && !matches!(character, '\u{FFFE}' | '\u{FFFF}') => {
                let _ = write!(escaped, "&#{};", u32::from(character));
            }
            // X-Val: XML 1.0, production 2 (Char).
            '\u{20}'..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'.. => {
                escaped.push(character);
            }
            _ => {
                let _ = write!(escaped, "\\u{{{:x}}}", u32::from(character));
            }
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    //! The document is read back by a reader that takes nothing but what this writer should write.

    use super::*;

    /// A tag with its attributes, what text it holds, and the tags in it.
    #[derive(Debug, PartialEq)]
    struct Element {
        name: String,
        attributes: Vec<(String, String)>,
        text: String,
        inside: Vec<Element>,
    }

    impl Element {
        fn attribute(&self, name: &str) -> &str {
            let mut found = self.attributes.iter().filter(|(key, _)| key == name);
            let (_, value) = found.next().unwrap_or_else(|| panic!("{name} in {self:?}"));
            assert!(found.next().is_none(), "{name} twice in {self:?}");
            value
        }

        fn child(&self, name: &str) -> &Element {
            self.inside.iter().find(|e| e.name == name).unwrap()
        }
    }

    /// What is left to read.
    struct Reader<'a>(&'a str);

    impl<'a> Reader<'a> {
        fn take(&mut self, expected: &str) {
            let rest = self.0.strip_prefix(expected);
            self.0 = rest.unwrap_or_else(|| panic!("{expected:?} before {:?}", self.0));
        }

        fn until(&mut self, end: char) -> &'a str {
            let (piece, rest) = self.0.split_at(self.0.find(end).unwrap());
            self.0 = rest;
            piece
        }

        fn name(&mut self) -> String {
            let end = self
                .0
                .find(|c: char| !c.is_ascii_lowercase() && c != '-')
                .unwrap();
            assert!(end > 0, "a name before {:?}", self.0);
            let (name, rest) = self.0.split_at(end);
            self.0 = rest;
            name.to_string()
        }

        fn element(&mut self) -> Element {
            self.take("<");
            let name = self.name();
            let mut attributes = Vec::new();
            while self.0.starts_with(' ') {
                self.take(" ");
                let key = self.name();
                self.take("=\"");
                attributes.push((key, plain(self.until('"'))));
                self.take("\"");
            }
            let mut element = Element {
                name,
                attributes,
                text: String::new(),
                inside: Vec::new(),
            };
            if self.0.starts_with('/') {
                self.take("/>");
                return element;
            }
            self.take(">");
            loop {
                element.text.push_str(&plain(self.until('<')));
                if self.0.starts_with("</") {
                    break;
                }
                element.inside.push(self.element());
            }
            self.take(&format!("</{}>", element.name));
            element
        }
    }

    /// Text without its escapes; panics at what may not stand in XML.
    fn plain(text: &str) -> String {
        let mut rest = text;
        let mut plain = String::new();
        while let Some(character) = rest.chars().next() {
            assert!(!"<>\"'".contains(character), "{text:?}");
            if character != '&' {
                let code = u32::from(character);
                let legal = matches!(code, 0x9 | 0xA | 0xD | 0x20..=0xD7FF | 0xE000..=0xFFFD | 0x10000..=0x10FFFF);
                assert!(legal, "{code:x} in {text:?}");
                plain.push(character);
                rest = &rest[character.len_utf8()..];
                continue;
            }
            let (entity, after) = rest[1..].split_once(';').unwrap();
            rest = after;
            plain.push(match entity {
                "amp" => '&',
                "lt" => '<',
                "gt" => '>',
                "quot" => '"',
                "apos" => '\'',
                _ => {
                    let code = entity.strip_prefix('#').unwrap().parse().unwrap();
                    let character = char::from_u32(code).unwrap();
                    assert!(steers(character), "{entity}");
                    character
                }
            });
        }
        plain
    }

    /// A document's one element.
    fn read(text: &str) -> Element {
        let mut reader = Reader(text);
        reader.take("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let element = reader.element();
        reader.take("\n");
        assert_eq!(reader.0, "");
        element
    }

    fn case(name: &str) -> Case {
        Case {
            name: name.to_string(),
            classname: "skyloop.soak".to_string(),
            seconds: 60.0,
            ..Case::default()
        }
    }

    #[test]
    fn a_suite_has_its_cases_and_counts_its_failures() {
        let failed = Case {
            failure: Some((
                "p99 is above 12 ms".into(),
                "frame 512\nwas the first".into(),
            )),
            properties: vec![
                ("host".into(), "abacus".into()),
                ("load".into(), "0.5".into()),
            ],
            system_out: "a table\n  of rows\n".into(),
            ..case("p99")
        };
        let suite = read(&document("soak of leo", &[case("deadlines"), failed]));
        assert_eq!(suite.name, "testsuite");
        for (name, value) in [
            ("name", "soak of leo"),
            ("tests", "2"),
            ("failures", "1"),
            ("errors", "0"),
            ("skipped", "0"),
            ("time", "60.000"),
        ] {
            assert_eq!(suite.attribute(name), value);
        }
        let names: Vec<&str> = suite.inside.iter().map(|e| e.attribute("name")).collect();
        assert_eq!(names, ["deadlines", "p99"]);
        let [passed, failed] = &suite.inside[..] else {
            panic!("{suite:?}");
        };
        assert!(passed.inside.is_empty());
        assert_eq!(passed.attribute("classname"), "skyloop.soak");
        assert_eq!(passed.attribute("time"), "60.000");
        let failure = failed.child("failure");
        assert_eq!(failure.attribute("message"), "p99 is above 12 ms");
        assert_eq!(failure.text, "frame 512\nwas the first");
        assert_eq!(failed.child("system-out").text, "a table\n  of rows\n");
        let properties = &failed.child("properties").inside;
        assert_eq!(properties.len(), 2);
        assert_eq!(properties[1].attribute("name"), "load");
        assert_eq!(properties[1].attribute("value"), "0.5");
        assert!(read(&document("none", &[])).inside.is_empty());
    }

    /// Every character below 0x300 and those at the edges of what XML takes, everywhere that text may stand.
    #[test]
    fn any_text_comes_back_or_is_told() {
        let edges = [
            0x200E, 0x202E, 0x2066, 0xD7FF, 0xE000, 0xFFFD, 0xFFFE, 0xFFFF, 0x10000, 0x10FFFF,
        ];
        for code in (0..0x300).chain(edges) {
            let character = char::from_u32(code).unwrap();
            let text = format!("a{character}b ]]> {character}{character}");
            // X-Val: XML 1.0, section 2.2: tab, line feed, carriage return, and from space on all but 0xFFFE and 0xFFFF.
            let legal =
                [9, 10, 13].contains(&code) || (code >= 32 && code != 0xFFFE && code != 0xFFFF);
            let told = format!("\\u{{{code:x}}}");
            let expected = match legal {
                true => text.clone(),
                false => text.replace(character, &told),
            };
            let suite = read(&document(
                &text,
                &[Case {
                    name: text.clone(),
                    classname: text.clone(),
                    seconds: 1.0,
                    failure: Some((text.clone(), text.clone())),
                    properties: vec![(text.clone(), text.clone())],
                    system_out: text.clone(),
                }],
            ));
            let case = &suite.inside[0];
            let is_raw = document(&text, &[]).replace('\n', "").contains(character);
            assert!(!(is_raw && steers(character)), "{code:x}");
            let property = &case.child("properties").inside[0];
            for found in [
                suite.attribute("name"),
                case.attribute("name"),
                case.attribute("classname"),
                case.child("failure").attribute("message"),
                &case.child("failure").text,
                property.attribute("name"),
                property.attribute("value"),
                &case.child("system-out").text,
            ] {
                assert_eq!(found, expected, "{code:x}");
            }
        }
    }

    #[test]
    fn times_are_numbers() {
        for (seconds, written) in [
            (f64::NAN, "0.000"),
            (-1.0, "0.000"),
            (f64::INFINITY, "3200000000.000"),
            (1.23456, "1.235"),
        ] {
            let suite = read(&document(
                "s",
                &[Case {
                    seconds,
                    ..case("c")
                }],
            ));
            assert_eq!(suite.attribute("time"), written);
            assert_eq!(suite.inside[0].attribute("time"), written);
        }
    }
}
