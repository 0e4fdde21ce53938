//! Verdicts of a run as JUnit XML: one test suite, a case for each verdict.
//!
//! Written by hand: a crate that writes it would bring five others for one page of text.

use skyloop_orbit::steers;

/// What a JUnit file says of a run beside its verdicts.
#[derive(Debug, Clone, Default)]
pub struct Suite {
    /// The name of the suite: the command.
    pub name: &'static str,
    /// The class of its cases, with dots between its parts.
    pub classname: String,
    /// Duration of the run, s; in the file 0 if it is negative or NaN.
    pub seconds: f64,
    /// Names and values of properties of each case.
    pub properties: Vec<(String, String)>,
    /// The table of the run.
    pub table: String,
}

impl Suite {
    /// The document; each case has a name, whether it passed, and what was found.
    pub(crate) fn xml(&self, cases: &[(String, bool, &str)]) -> String {
        let failures = cases.iter().filter(|(_, passed, _)| !passed).count();
        // A century is longer than any run.
        let time = format!("time=\"{:.3}\"", self.seconds.max(0.0).min(3.2e9));
        let (suite, class) = (escaped(self.name), escaped(&self.classname));
        let mut properties = String::new();
        for (name, value) in &self.properties {
            let (name, value) = (escaped(name), escaped(value));
            properties += &format!("      <property name=\"{name}\" value=\"{value}\"/>\n");
        }
        if !properties.is_empty() {
            properties = format!("    <properties>\n{properties}    </properties>\n");
        }
        let case = |(name, passed, found): &(String, bool, &str)| {
            let (name, message, text) = (escaped(name), escaped(found), between(found));
            let failure = match passed {
                true => String::new(),
                false => format!("    <failure message=\"{message}\">{text}</failure>\n"),
            };
            let table = between(&self.table);
            format!(
                "  <testcase name=\"{name}\" classname=\"{class}\" {time}>\n{properties}{failure}    \
                 <system-out>{text}\n{table}</system-out>\n  </testcase>\n"
            )
        };
        let count = cases.len();
        let cases: String = cases.iter().map(case).collect();
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{suite}\" tests=\"{count}\" \
             failures=\"{failures}\" errors=\"0\" skipped=\"0\" {time}>\n{cases}</testsuite>\n"
        )
    }
}

/// Text as it may stand between tags, where ends of lines and tabs stay what they are.
fn between(text: &str) -> String {
    escaped(text).replace("&#10;", "\n").replace("&#9;", "\t")
}

/// Text as it may stand in an attribute; what XML cannot hold becomes `\u{1b}`.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        let code = u32::from(character);
        match character {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&apos;",
            // A reader would make spaces of them in an attribute, and of \r an end of line anywhere.
            '\t' | '\n' | '\r' => escaped += &format!("&#{code};"),
            // X-Val: XML 1.0, production 2 (Char). A terminal that shows the file obeys control characters.
            '\u{20}'..='\u{FFFD}' | '\u{10000}'.. => match steers(character) {
                true => escaped += &format!("&#{code};"),
                false => escaped.push(character),
            },
            _ => escaped += &format!("\\u{{{code:x}}}"),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suite_has_its_cases_and_counts_its_failures() {
        let mut suite = Suite {
            name: "soak of <leo>",
            classname: "skyloop.soak".into(),
            seconds: 60.0,
            properties: vec![("host".into(), "aba\"cus".into())],
            table: "p99\t12\n".into(),
        };
        let case = |name: &str, inside: &str| {
            format!(
                "  <testcase name=\"{name}\" classname=\"skyloop.soak\" time=\"60.000\">\n    <properties>\n      \
                 <property name=\"host\" value=\"aba&quot;cus\"/>\n    </properties>\n{inside}  </testcase>\n"
            )
        };
        let head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"soak of &lt;leo&gt;\" tests=\"2\" \
                    failures=\"1\" errors=\"0\" skipped=\"0\" time=\"60.000\">\n";
        let passed = "    <system-out>none missed\np99\t12\n</system-out>\n";
        let failed = "    <failure message=\"it&apos;s&#10;above\">it&apos;s\nabove</failure>\n    \
                      <system-out>it&apos;s\nabove\np99\t12\n</system-out>\n";
        let (a, b) = (case("deadlines", passed), case("p99", failed));
        let verdicts = [
            ("deadlines".into(), true, "none missed"),
            ("p99".into(), false, "it's\nabove"),
        ];
        assert_eq!(suite.xml(&verdicts), format!("{head}{a}{b}</testsuite>\n"));
        for (seconds, time) in [
            (f64::NAN, "0.000"),
            (-1.0, "0.000"),
            (f64::INFINITY, "3200000000.000"),
        ] {
            suite.seconds = seconds;
            let text = suite.xml(&[]);
            assert!(text.contains(&format!(" time=\"{time}\"")), "{text}");
        }
    }

    #[test]
    fn any_text_comes_back_or_is_told() {
        let named = [
            ("&lt;", "<"),
            ("&gt;", ">"),
            ("&quot;", "\""),
            ("&apos;", "'"),
            ("&amp;", "&"),
        ];
        let edges = [
            0x200E, 0x202E, 0x2066, 0xD7FF, 0xE000, 0xFFFD, 0xFFFE, 0xFFFF, 0x10000, 0x10FFFF,
        ];
        for code in (0..0x300).chain(edges) {
            let character = char::from_u32(code).unwrap();
            // X-Val: XML 1.0, section 2.2: tab, line feed, carriage return, and from space on all but 0xFFFE and 0xFFFF.
            let is_legal =
                [9, 10, 13].contains(&code) || code >= 32 && code != 0xFFFE && code != 0xFFFF;
            let text = escaped(&format!("a{character}]]>"));
            let is_raw = text.strip_suffix("]]&gt;").unwrap() == format!("a{character}");
            assert!(
                !is_raw || is_legal && !steers(character) && !"<>&\"'".contains(character),
                "{code:x}"
            );
            let mut plain = text.replace(&format!("&#{code};"), &character.to_string());
            for (entity, of) in named {
                plain = plain.replace(entity, of);
            }
            let expected = match is_legal {
                true => format!("a{character}]]>"),
                false => format!("a\\u{{{code:x}}}]]>"),
            };
            assert_eq!(plain, expected, "{code:x}");
        }
    }
}
