//! Placeholder texts for an id, a number or a name.

use crate::Designator;
use crate::catalogue_number::{assigned, catalogue_number, unlabelled};
use crate::designator::SEPARATORS;
use crate::missing::{PLACEHOLDERS, is_missing};

/// Words without meaning next to a placeholder, as in `UNKNOWN OBJECT 2` and `NO ID`.
const FILLERS: [&str; 10] = [
    "OBJECT",
    "OBJ",
    "SAT",
    "SATELLITE",
    "ID",
    "NAME",
    "NUMBER",
    "DESIGNATOR",
    "NORAD",
    "COSPAR",
];

/// Marks for unknown digits, as in `2026-???A` and `YYYY-NNNP`.
const MARKS: &str = "XYN?#*_.-\u{2013}\u{2014}";

/// Whether a text is a designator that lacks year, number or piece: the `YYYY-NNNP{PP}` of the
/// standard (CCSDS 502.0-B-3, OBJECT_ID), `XXXX-XXXA`, `20YY-NNNA`, `2026-???A`, `2026-TBDA`,
/// `1998-067?`.
fn is_template(text: &str) -> bool {
    // `##` stands for unknown digits; a single `#` is a label before the whole text.
    let is_marked = text.trim_start().starts_with("##");
    let text = if is_marked {
        text.trim()
    } else {
        unlabelled(text, "COSPAR")
    };
    let text = text.to_ascii_uppercase();
    let text: Vec<char> = text.chars().filter(|c| !"{}[]()<>".contains(*c)).collect();
    [4, 2].into_iter().any(|width| lacks_a_field(&text, width))
}

/// [`is_template`] of capitals, where the year has `width` digits or marks.
fn lacks_a_field(text: &[char], width: usize) -> bool {
    let without_separator = |text: &[char]| match text {
        [first, rest @ ..] if SEPARATORS.contains(first) => rest.to_vec(),
        text => text.to_vec(),
    };
    let Some((year, rest)) = text.split_at_checked(width) else {
        return false;
    };
    let behind = without_separator(rest);
    let Some((number, piece)) = behind.split_at_checked(3) else {
        return false;
    };
    let piece = without_separator(piece);
    let is_mark = |c: &char| MARKS.contains(*c);
    let is_piece = piece.len() <= 3 && piece.iter().all(|c| c.is_ascii_alphabetic() || is_mark(c));
    // `XX001` may be a name.
    let is_divided = behind.len() < rest.len() || !piece.is_empty();
    if !(is_piece && is_divided) {
        return false;
    }
    // `1N123A` may be a name: of a year with two digits both must be unknown.
    let has_some = |field: &[char]| width == 4 || !field.iter().any(char::is_ascii_digit);
    let is_unknown = |field: &[char]| is_unknown(field) && has_some(field);
    let is_given = |field: &[char]| field.iter().all(char::is_ascii_digit);
    let are_equal = width == 4 && year.iter().all(|c| Some(c) == year.first());
    match (is_unknown(year), is_unknown(number)) {
        (year_is_unknown, true) => year_is_unknown || is_given(year) || are_equal,
        (true, false) => is_given(number),
        (false, false) => {
            let is_unknown = !piece.is_empty() && !piece.iter().any(char::is_ascii_alphabetic);
            is_given(year) && is_given(number) && is_unknown
        }
    }
}

/// Whether a field of a designator is a word such as `TBD` or `N/A`, zero, or ends in equal marks.
fn is_unknown(field: &[char]) -> bool {
    let word: String = field.iter().filter(|c| c.is_alphanumeric()).collect();
    let is_long = field.len() > 2;
    let known = field.iter().take_while(|c| c.is_ascii_digit()).count();
    let (_, marks) = field.split_at(known);
    let are_marks = marks
        .first()
        .is_some_and(|first| MARKS.contains(*first) && marks.iter().all(|c| c == first));
    let is_zero = field.iter().all(|c| *c == '0');
    are_marks || (is_long && (is_zero || PLACEHOLDERS.contains(&word.as_str())))
}

/// Whether a text is a placeholder: words such as `UNKNOWN` or `TO BE ASSIGNED`; no letter or
/// digit; a number such as 0, -1 or 99999; an impossible designator such as `0000-000A` or
/// `YYYY-NNNP`.
pub fn is_placeholder(text: &str) -> bool {
    if let Some(number) = catalogue_number(text) {
        return assigned(number).is_none();
    }
    if Designator::parse(text).is_some() {
        return false;
    }
    let number = unlabelled(text, "NORAD").trim().parse();
    let is_negative = number.is_ok_and(|number: f64| number <= 0.0);
    if is_negative || Designator::is_impossible(text) || is_template(text) {
        return true;
    }
    let text = text.to_ascii_uppercase();
    let letters: String = text.chars().filter(|c| c.is_alphanumeric()).collect();
    let first = letters.chars().next().filter(|c| c.is_alphabetic());
    let are_equal = letters.len() >= 4 && letters.chars().all(|c| Some(c) == first);
    if letters.is_empty() || are_equal || is_missing(&letters) {
        return true;
    }
    consists_of_empty_words(&text)
}

/// Whether a text in capitals has only placeholders, numbers and words without meaning.
fn consists_of_empty_words(text: &str) -> bool {
    let words = text.split(|c: char| !c.is_alphanumeric());
    let (mut beginning, mut has_any) = (String::new(), false);
    for word in words {
        if word.bytes().all(|byte| byte.is_ascii_digit()) || FILLERS.contains(&word) {
            continue;
        }
        beginning += word;
        // Each letter of `N/A` and `T.B.D.` is a word.
        let is_begun =
            |whole: &&str| whole.len() > beginning.len() && whole.starts_with(&beginning);
        let is_letter = word.len() == 1 && PLACEHOLDERS.iter().any(is_begun);
        if is_letter || ["NOT", "YET", "TO", "BE"].contains(&word) {
            continue;
        }
        if !is_missing(&beginning) {
            return false;
        }
        (has_any, beginning) = (true, String::new());
    }
    has_any && beginning.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::rows;

    #[test]
    fn placeholders_are_detected() {
        let table = "
            UNKNOWN, unknown, TBD, tba, , -, N/A, n.a., NONE, None, t.b.d., TBD TBD, UNDEF, INVALID
            0, 00000, 0.0, -1, 99999, 999999999, NORAD 0, NORAD 99999, NORAD -1
            TBA - TO BE ASSIGNED, To be announced, UNKNOWN 1, Unknown Object, UNK OBJ, UNIDENTIFIED
            ANALYST SAT, NOT APPLICABLE, NOT KNOWN, NOT YET ASSIGNED, TO BE SUPPLIED, UNCATALOGUED
            NO ID, NO NORAD ID, XXX, XXXX, ----, \u{2013}, \u{2014}\u{2014}
            0000-000A, 1900-000A, 9999-999Z, 1998-000A, 00000A, 0000-000, 0000-001, 2026-000
            // Designators with other characters in place of digits. The first is from CCSDS
            // 502.0-B-3, OBJECT_ID.
            YYYY-NNNP{PP}, YYYY-NNNP, yyyy-nnnppp, YYYY-NNN, YYYY-NNN-A, YYYYNNNA, YYNNNAAA
            YY-NNNA, XXXX-XXXA, XXXX-067A, XXXXXA, 1998-XXXA, 98XXXA, 20YY-NNNA, 2026-1XXA
            ????-???A, 2026-###, ####-###A, AAAA-NNNP, COSPAR YYYY-NNNA, XX001A, XX-001A
            // Words and marks in place of the number, the year or the piece.
            2026-n/a, 2026-N/A-A, 2026-TBD, 2026-TBDA, 2026-T.B.D., 2026-UNK-A, N/A-067A, TBD-067A
            2026 to be assigned, ____-___A, 2026-___A, 2026----A, 2026\u{2013}\u{2014}\u{2014}\u{2014}
            1998-067?, 1998-067-??, 1998-067TBD";
        for [texts] in rows(table) {
            for text in texts.split(", ") {
                assert!(is_placeholder(text), "{text}");
            }
        }
        assert!(is_placeholder("  "));
        let table = "
            5, 9999, 99998, A0005, 1998-067A, 1958-002B, 98067A, 1998-067-A, 1998-67NA, 1998-067XX
            OBJECT 1, OBJECT A, UNKNOWN PLEASURES, NOT A DRILL, TO BE, 5.5, AAA, X, ISS, É
            // Ids in use.
            1998-067, OWN-1, SAT-001A, SAT1-001A, MMS1, AA001, CC-101A, B1234, B1-234A, X1234
            XM-001, 1N123A, NOAA-20, ABCD-EFGH, LLLL-101ABCD, É-001, SSSS-067, SSSS-067A
            AAAA-101A, XX001, NO-101A, NORAD-5, X-37B";
        for [texts] in rows(table) {
            for text in texts.split(", ") {
                assert!(!is_placeholder(text), "{text}");
            }
        }
    }
}
