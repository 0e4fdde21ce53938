//! JUnit XML of a run: one test suite with a case for each verdict.
//!
//! Hand-written: a crate for it would add five others for one page of text.

use skyloop_orbit::steers;

/// Header data of a JUnit file.
#[derive(Debug, Clone, Default)]
pub struct Suite {
    /// Name of the suite: the command.
    pub name: &'static str,
    /// Class of its cases, dot-separated.
    pub classname: String,
    /// Duration of the run, s; 0 is written for negative values and NaN.
    pub seconds: f64,
    /// Properties of each case: name and value.
    pub properties: Vec<(String, String)>,
    /// Result table of the run.
    pub table: String,
}

impl Suite {
    /// The document. A case has a name, whether it passed, and its result.
    pub(crate) fn xml(&self, cases: &[(String, bool, &str)]) -> String {
        let failures = cases.iter().filter(|(_, passed, _)| !passed).count();
        // Limited to a century; NaN is not above 0.
        let seconds = Some(self.seconds).filter(|seconds| *seconds > 0.0);
        let seconds = seconds.map_or(0.0, |seconds| seconds.min(3.2e9));
        let time = format!("time=\"{seconds:.3}\"");
        let (suite, class, count) = (escaped(self.name), escaped(&self.classname), cases.len());
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{suite}\" tests=\"{count}\" \
             failures=\"{failures}\" errors=\"0\" skipped=\"0\" {time}>\n"
        );
        for (name, passed, found) in cases {
            let (name, message, found) = (escaped(name), escaped(found), between(found));
            text += &format!("  <testcase name=\"{name}\" classname=\"{class}\" {time}>\n");
            if !self.properties.is_empty() {
                text += "    <properties>\n";
                for (name, value) in &self.properties {
                    let (name, value) = (escaped(name), escaped(value));
                    text += &format!("      <property name=\"{name}\" value=\"{value}\"/>\n");
                }
                text += "    </properties>\n";
            }
            if !passed {
                text += &format!("    <failure message=\"{message}\">{found}</failure>\n");
            }
            let table = between(&self.table);
            text += &format!("    <system-out>{found}\n{table}</system-out>\n  </testcase>\n");
        }
        text + "</testsuite>\n"
    }
}

/// Escapes text between tags; line ends and tabs stay.
fn between(text: &str) -> String {
    escaped(text).replace("&#10;", "\n").replace("&#9;", "\t")
}

/// Escapes text for an attribute; characters that are illegal in XML become `\u{1b}`.
fn escaped(text: &str) -> String {
    let escape = |character: char| match character {
        '&' => "&amp;".into(),
        '<' => "&lt;".into(),
        '>' => "&gt;".into(),
        '"' => "&quot;".into(),
        '\'' => "&apos;".into(),
        // XML readers turn these into spaces in attributes, and \r into a line end anywhere.
        '\t' | '\n' | '\r' => format!("&#{};", u32::from(character)),
        // X-Val: XML 1.0, production 2 (Char). Terminal control characters are escaped too.
        '\u{20}'..='\u{FFFD}' | '\u{10000}'.. if steers(character) => {
            format!("&#{};", u32::from(character))
        }
        '\u{20}'..='\u{FFFD}' | '\u{10000}'.. => character.into(),
        _ => format!("\\u{{{:x}}}", u32::from(character)),
    };
    text.chars().map(escape).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE_FAILED: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<testsuite name="soak of &lt;leo&gt;" tests="1" failures="1" errors="0" skipped="0" time="60.000">
  <testcase name="p99" classname="skyloop.soak" time="60.000">
    <properties>
      <property name="host" value="aba&quot;cus"/>
    </properties>
    <failure message="it&apos;s&#10;above">it&apos;s
above</failure>
    <system-out>it&apos;s
above
a	table
</system-out>
  </testcase>
</testsuite>
"#;

    #[test]
    fn suites_contain_cases_and_count_failures() {
        let mut suite = Suite {
            name: "soak of <leo>",
            classname: "skyloop.soak".into(),
            seconds: 60.0,
            properties: vec![("host".into(), "aba\"cus".into())],
            table: "a\ttable\n".into(),
        };
        let failed = ("p99".into(), false, "it's\nabove");
        assert_eq!(suite.xml(&[failed]), ONE_FAILED);
        assert!(!suite.xml(&[("p99".into(), true, "")]).contains("<failure"));
        for (seconds, time) in [
            (f64::NAN, "\"0.000"),
            (-1.0, "\"0.000"),
            (1e99, "\"3200000000"),
        ] {
            suite.seconds = seconds;
            assert!(suite.xml(&[]).contains(time), "{seconds}");
        }
    }

    #[test]
    fn any_text_is_restored_or_shown_as_code() {
        let named = ["&lt;<", "&gt;>", "&quot;\"", "&apos;'", "&amp;&"];
        let edges = [
            0x200E, 0x202E, 0x2066, 0xD7FF, 0xE000, 0xFFFD, 0xFFFE, 0xFFFF,
        ];
        for code in (0..0x300).chain(edges).chain([0x10000, 0x10FFFF]) {
            let character = char::from_u32(code).unwrap();
            // X-Val: XML 1.0, section 2.2: tab, line feed, carriage return, and from space on all
            // but 0xFFFE and 0xFFFF.
            let is_legal = [9, 10, 13].contains(&code) || code >= 32 && code | 1 != 0xFFFF;
            let text = escaped(&character.to_string());
            let is_raw = text == character.to_string();
            assert!(!is_raw || is_legal && !steers(character), "{code:x}");
            assert!(!is_raw || !"<>&\"'".contains(character), "{code:x}");
            let mut plain = text.replace(&format!("&#{code};"), &character.to_string());
            for (entity, of) in named.map(|named| named.split_at(named.len() - 1)) {
                plain = plain.replace(entity, of);
            }
            let code_text = format!("\\u{{{code:x}}}");
            assert_eq!(plain == code_text, !is_legal, "{code:x}");
            assert!(!is_legal || plain == character.to_string(), "{code:x}");
        }
    }
}
