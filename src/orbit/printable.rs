//! Makes external names and paths printable.

use std::borrow::Cow;
use std::path::Path;

/// Whether a character controls a terminal (C0 and C1) or the direction of text (Unicode Standard
/// Annex 9).
#[must_use]
pub fn steers(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Makes text safe for a terminal. Line ends and tabs stay. Other controls and direction marks
/// become JSON escapes such as `\u001b`, so JSON keeps its meaning.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |character| {
        steers(character) && !matches!(character, '\n' | '\t')
    })
}

/// [`printable`] in one line.
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    escaped(text, steers)
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut text_out = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if is_escaped(character) {
            text_out += &format!("\\u{:04x}", u32::from(character));
        } else {
            text_out.push(character);
        }
    }
    Cow::Owned(text_out)
}

/// A path for messages: one line without terminal controls.
#[must_use]
pub fn path_text(path: &Path) -> String {
    printable_line(&path.display().to_string()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_printed_steers_a_terminal() {
        for (text, shown) in [
            (
                "a plain line\n\tand é 🛰 שלום\n",
                "a plain line\n\tand é 🛰 שלום\n",
            ),
            ("\u{1b}[31mred\u{7}\r", "\\u001b[31mred\\u0007\\u000d"),
            // X-Val: ECMA-48, 8.3.16: CSI is 9B in eight bits.
            ("\u{9b}2J\u{85}\u{7f}", "\\u009b2J\\u0085\\u007f"),
            // X-Val: Unicode Standard Annex 9, table 1: explicit directional formatting characters.
            (
                "\u{202a}\u{202e}\u{2066}\u{2069}\u{200e}\u{200f}\u{61c}",
                "\\u202a\\u202e\\u2066\\u2069\\u200e\\u200f\\u061c",
            ),
        ] {
            assert_eq!(printable(text), shown);
        }
        assert_eq!(printable_line("a\nb"), "a\\u000ab");
        let path = Path::new("a\nb\u{202e}/c");
        assert_eq!(path_text(path), "a\\u000ab\\u202e/c");
        // JSON keeps its meaning.
        let json = serde_json::Value::from("a\u{202e}b\u{9b}c").to_string();
        let read: String = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read, "a\u{202e}b\u{9b}c");
    }
}
