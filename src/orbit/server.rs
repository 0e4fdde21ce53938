//! Detects a server's error message in place of orbits: in JSON, on a page, or in a line of text.

use crate::lines;
use crate::omm::Key;
use crate::omm::json::is_element_line;
use serde_json::{Map, Value};

/// Bytes of an answer that are parsed.
const LONGEST: usize = 1 << 16;
/// Largest number of lines of an answer in plain text.
const MAX_LINES: usize = 4;
/// Characters of an answer that a message quotes.
const QUOTED: usize = 200;
/// JSON keys of an error message.
const KEYS: [&str; 8] = [
    "error",
    "errors",
    "error_description",
    "message",
    "detail",
    "details",
    "reason",
    "title",
];
/// JSON keys that report whether a request succeeded.
const STATES: [&str; 5] = ["status", "success", "code", "ok", "fault"];
/// First words of an answer in plain text.
const BEGINNINGS: [&str; 20] = [
    "no gp data",
    "no sup-gp data",
    "no data",
    "no tle",
    "no results",
    "no records",
    "gp data has not",
    "invalid",
    "error",
    "you ",
    "your ",
    "access denied",
    "rate limit",
    "too many requests",
    "bad request",
    "bad gateway",
    "unauthorized",
    "forbidden",
    "not found",
    "internal server error",
];

/// The message in a server's answer, or none for other texts. An HTML page is an answer, unless
/// `source` is the name of an HTML file.
pub(crate) fn words(text: &str, source: &str) -> Option<String> {
    let text = text.trim();
    let words = match text.as_bytes().first()? {
        b'{' | b'[' if text.len() <= LONGEST => object(&serde_json::from_str(text).ok()?),
        b'H' if text.starts_with("HTTP/") => {
            let line = lines::numbered(text).next().map_or("", |(_, line)| line);
            let code = line.split_whitespace().nth(1).unwrap_or_default();
            if code.starts_with(['4', '5']) {
                line.to_owned()
            } else {
                String::new()
            }
        }
        b'<' if is_page(text, source) => page(text),
        b'<' => return None,
        _ => {
            let start: String = text.chars().take(40).collect();
            let start = start.to_lowercase();
            let is_answer = BEGINNINGS.iter().any(|known| start.starts_with(known));
            if is_answer && text.lines().nth(MAX_LINES).is_none() {
                text.to_owned()
            } else {
                String::new()
            }
        }
    };
    Some(quoted(&words)).filter(|words| !words.is_empty())
}

/// The first characters of a text in one line, without terminal controls.
pub(crate) fn quoted(text: &str) -> String {
    let text: String = text.chars().take(10 * QUOTED).collect();
    let words = text.split(|c: char| c.is_whitespace() || c.is_control());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).take(QUOTED).collect();
    words.join(" ").chars().take(QUOTED).collect()
}

/// Error messages in an object, or in the first of an array; none for an element set.
fn object(value: &Value) -> String {
    let first = match value {
        Value::Array(all) => all.first().unwrap_or(value),
        one => one,
    };
    let Value::Object(pairs) = first else {
        return String::new();
    };
    if pairs
        .keys()
        .any(|key| Key::of(key).is_some() || is_element_line(key))
    {
        return String::new();
    }
    let reasons = reasons(pairs).join(": ");
    let known = STATES.iter().chain(&KEYS[..2]);
    let is_state = |key: &String| known.clone().any(|known| key.eq_ignore_ascii_case(known));
    if reasons.is_empty() && pairs.keys().any(is_state) {
        return first.to_string();
    }
    reasons
}

fn reasons(pairs: &Map<String, Value>) -> Vec<String> {
    let mut found = Vec::new();
    for key in KEYS {
        let given = pairs
            .iter()
            .filter(|(name, _)| name.eq_ignore_ascii_case(key));
        for (_, value) in given {
            match value {
                Value::String(text) => found.push(text.clone()),
                Value::Object(inner) => found.extend(reasons(inner)),
                Value::Array(texts) => {
                    let texts = texts.iter().filter_map(Value::as_str);
                    found.extend(texts.map(str::to_owned));
                }
                _ => {}
            }
        }
    }
    found
}

fn is_page(text: &str, source: &str) -> bool {
    let start = text.get(..LONGEST).unwrap_or(text).to_ascii_lowercase();
    let start = match start.split_once("?>") {
        Some((declaration, rest)) if declaration.starts_with("<?xml") => rest.trim_start(),
        _ => &start,
    };
    let source = source.to_lowercase();
    let is_named = [".html", ".htm", ".xhtml"]
        .iter()
        .any(|end| source.ends_with(end));
    let tags = ["<html", "<!doctype html", "<error"];
    !is_named && tags.iter().any(|tag| start.starts_with(tag))
}

/// The text of a page without its tags, scripts and styles.
fn page(text: &str) -> String {
    let mut words = String::new();
    let mut rest = text.get(..LONGEST).unwrap_or(text);
    while let Some((before, tag)) = rest.split_once('<') {
        words += before;
        words.push(' ');
        let mut names = tag.split(|c: char| !c.is_ascii_alphabetic() && c != '!' && c != '-');
        let end = match names.next().map(str::to_lowercase).as_deref() {
            Some("script") => "</script",
            Some("style") => "</style",
            Some(comment) if comment.starts_with("!--") => "-->",
            _ => "",
        };
        let hidden = match end {
            "" => Some(0),
            end => tag.to_ascii_lowercase().find(end),
        };
        let hidden = hidden.unwrap_or(tag.len());
        rest = tag.get(hidden..).unwrap_or_default();
        rest = rest.split_once('>').map_or("", |(_, rest)| rest);
        if words.len() > 2 * QUOTED {
            break;
        }
    }
    words + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::rows;

    #[test]
    fn a_servers_message_is_quoted() {
        for [text, wanted] in rows(
            r#"
            // Space-Track without a login, and beyond its rate limit.
            {"error":"You must be logged in to continue"} | You must be logged in to continue
            [{"error":"Query rate limit exceeded"}]  | Query rate limit exceeded
            {"Error":{"code":401,"message":"Invalid\tkey \u001b[31m"}} | Invalid key [31m
            {"detail":"Not found.","status":404}     | Not found.
            {"status":"error"}                       | {"status":"error"}
            {"Success":false,"data":[]}              | {"Success":false,"data":[]}
            {"code":404}                             | {"code":404}
            {"error":1}                              | {"error":1}
            {"errors":["one","two"],"message":"three"} | one: two: three
            HTTP/1.1 404 Not Found\nContent-Type: text/html\n\n<html></html> | HTTP/1.1 404 Not Found
            HTTP/2 503\n\n                           | HTTP/2 503
            // CelesTrak.
            No GP data found\n                       | No GP data found
            Invalid query: "CATNR=x" (CATNR=x)       | Invalid query: "CATNR=x" (CATNR=x)
            GP data has not updated.\nIt is updated. | GP data has not updated. It is updated.
            <?xml version="1.0"?><error>No such object</error> | No such object
            "#,
        ) {
            assert_eq!(words(&text, "iss.tle"), Some(wanted), "{text}");
        }
        let page = "<!DOCTYPE html>\n<html><head><title>503 Service Unavailable</title>\
                    <style>p > a {}</style><SCRIPT>if (a < b) {}</SCRIPT></head><body><!-- <p> -->\
                    <p>Try again<br>later</body></html>";
        let quoted = words(page, "iss.tle");
        assert_eq!(
            quoted.as_deref(),
            Some("503 Service Unavailable Try again later")
        );
    }

    #[test]
    fn other_texts_are_not_answers() {
        for text in [
            "",
            "hello\nworld",
            "Your notes\n1\n2\n3\n4",
            "[]",
            "{}",
            "[1]",
            r#"{"EPOCH":"now","error":"of what"}"#,
            "<oem><error>1 m</error></oem>",
            r#"{"line1":"1 ","line2":"2 ","status":"ok"}"#,
            "HTTP/1.1 200 OK\r\n\r\n1 00005U",
            "<html",
        ] {
            assert_eq!(words(text, "iss.tle"), None, "{text}");
        }
        assert_eq!(words("<html>A page</html>", "about.html"), None);
        let long = format!("error {}", "é".repeat(1000));
        assert_eq!(words(&long, "x").unwrap().chars().count(), QUOTED);
        let _ = words(&format!("error {}", "é".repeat(LONGEST)), "x");
    }
}
