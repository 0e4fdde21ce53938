//! Catalogue numbers as text: digits, Alpha-5, and labels such as `NORAD ID`.

use std::num::NonZeroU32;

/// The catalogue number, unless it is a placeholder: 0, or five or more nines.
pub(crate) fn assigned(number: u32) -> Option<NonZeroU32> {
    let nines = [99_999, 999_999, 9_999_999, 99_999_999, 999_999_999];
    NonZeroU32::new(number).filter(|_| !nines.contains(&number))
}

/// The catalogue number in an id or a selector: `NORAD 5`, `norad5`, `NORAD ID 5`, `#5`, `00005`
/// or, in Alpha-5, `A0005`.
pub fn catalogue_number(text: &str) -> Option<u32> {
    alpha_5(&unlabelled(text, "NORAD").to_ascii_uppercase())
}

/// A text without quotes, `#`, and a label such as `NORAD`, `NORAD ID` or `COSPAR`.
pub(crate) fn unlabelled<'a>(text: &'a str, label: &str) -> &'a str {
    let without = |text: &'a str, word: &str| {
        let (head, rest) = text.split_at_checked(word.len())?;
        let bare = rest.trim_start_matches([' ', '_', ':', '#', '-']);
        let (between, _) = rest.split_at_checked(rest.len() - bare.len())?;
        // `NORAD-5` and `NORAD - 5` are 5; `NORAD -5` is a negative number.
        let ends_in_minus = between.ends_with(" -") || between.ends_with(":-");
        let is_negative = ends_in_minus && bare.starts_with(|c: char| c.is_ascii_digit());
        let minus = usize::from(is_negative);
        let (_, rest) = rest.split_at_checked(between.len() - minus)?;
        head.eq_ignore_ascii_case(word).then_some(rest)
    };
    let text = text.trim().trim_matches(['"', '\'']).trim();
    let text = text.trim_start_matches('#').trim_start();
    let Some(mut text) = without(text, label) else {
        return text;
    };
    for word in ["CAT", "ID"] {
        text = without(text, word).unwrap_or(text);
    }
    text
}

/// A decimal number, or Alpha-5: a letter (no I, no O) for the leading two of six digits, `A` = 10
/// to `Z` = 33.
pub(crate) fn alpha_5(text: &str) -> Option<u32> {
    let (letter, rest) = match text.bytes().next()? {
        byte @ b'A'..=b'H' => (u32::from(byte - b'A') + 10, &text[1..]),
        byte @ b'J'..=b'N' => (u32::from(byte - b'J') + 18, &text[1..]),
        byte @ b'P'..=b'Z' => (u32::from(byte - b'P') + 23, &text[1..]),
        _ => (0, text),
    };
    let right_length = letter == 0 || rest.len() == 4;
    if !right_length || !rest.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let rest: u32 = rest.parse().ok()?;
    Some(letter * 10_000 + rest)
}
