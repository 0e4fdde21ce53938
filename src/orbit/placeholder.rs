//! Texts that stand for no value where an id, a number or a name is expected.

use crate::Designator;
use crate::identity::{assigned, catalogue_number, unlabelled};

/// Placeholders. `UNKNOWN`, one of [`MISSING`], is that of the standard (CCSDS 502.0-B-3, OBJECT_ID and OBJECT_NAME).
const PLACEHOLDERS: [&str; 14] = [
    "UNK", "UNDEF", "TBD", "TBA", "TBC", "TBS", "NA", "NO", "NONE", "NULL", "NIL", "NAN",
    "INVALID", "ANALYST",
];

/// Words that are a placeholder behind `UN`, `NOT`, `NOT YET` or `TO BE`. `TBA - TO BE ASSIGNED` is a name of Space-Track's.
const MISSING: [&str; 20] = [
    "KNOWN",
    "ASSIGNED",
    "DEFINED",
    "SPECIFIED",
    "IDENTIFIED",
    "NAMED",
    "CATALOGUED",
    "CATALOGED",
    "REGISTERED",
    "AVAILABLE",
    "APPLICABLE",
    "ANNOUNCED",
    "DETERMINED",
    "DECIDED",
    "CONFIRMED",
    "SUPPLIED",
    "PROVIDED",
    "ISSUED",
    "GIVEN",
    "SET",
];

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

/// Whether a word in capitals is a placeholder by itself: one of the lists, `XX`, or four equal letters or more.
fn is_empty_word(word: &str) -> bool {
    let mut prefixes = ["UN", "NOTYET", "NOT", "TOBE"].into_iter();
    let is_missing = |prefix| {
        let rest = word.strip_prefix(prefix);
        rest.is_some_and(|rest| MISSING.contains(&rest))
    };
    let mut letters = word.bytes();
    let first = letters.next().filter(|first| !matches!(first, b'1'..=b'9'));
    let least = if first == Some(b'X') { 2 } else { 4 };
    let are_equal = word.len() >= least && first.is_some() && letters.all(|one| Some(one) == first);
    are_equal || PLACEHOLDERS.contains(&word) || prefixes.any(is_missing)
}

/// Whether a text is a placeholder: words such as `UNKNOWN` or `TO BE ASSIGNED`, no letter or digit at all, a number such as 0, -1 or 99999,
/// or a designator of a launch that cannot be, such as `0000-000A` and `YYYY-NNNP`.
pub fn is_placeholder(text: &str) -> bool {
    if let Some(number) = catalogue_number(text) {
        return assigned(number).is_none();
    }
    let number = unlabelled(text, "NORAD").trim().parse();
    let is_negative = number.is_ok_and(|number: f64| number <= 0.0);
    if is_negative || Designator::is_impossible(text) {
        return true;
    }
    let letters = text.chars().filter(|c| c.is_alphanumeric());
    let letters: String = letters.map(|c| c.to_ascii_uppercase()).collect();
    if letters.is_empty() || is_empty_word(&letters) {
        return true;
    }
    let text = text.to_ascii_uppercase();
    let words = text.split(|c: char| !c.is_alphanumeric());
    let (mut beginning, mut has_any) = (String::new(), false);
    for word in words {
        if word.bytes().all(|byte| byte.is_ascii_digit()) || FILLERS.contains(&word) {
            continue;
        }
        beginning += word;
        if ["NOT", "YET", "TO", "BE"].contains(&word) {
            continue;
        }
        if !is_empty_word(&beginning) {
            return false;
        }
        (has_any, beginning) = (true, String::new());
    }
    has_any && beginning.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_are_no_identities() {
        for text in [
            "UNKNOWN",
            "NORAD -1",
            "unknown",
            "TBD",
            "tba",
            "",
            "  ",
            "-",
            "N/A",
            "n.a.",
            "NONE",
            "None",
            "0",
            "00000",
            "99999",
            "999999999",
            "NORAD 0",
            "NORAD 99999",
            "TBA - TO BE ASSIGNED",
            "To be announced",
            "UNKNOWN 1",
            "Unknown Object",
            "UNK OBJ",
            "UNIDENTIFIED",
            "ANALYST SAT",
            "0000-000A",
            "1900-000A",
            "9999-999Z",
            "1998-000A",
            "00000A",
            "0000-000",
            "0.0",
            "-1",
            "NOT APPLICABLE",
            "NOT KNOWN",
            "NOT YET ASSIGNED",
            "TO BE SUPPLIED",
            "NO ID",
            "NO NORAD ID",
            "UNDEF",
            "INVALID",
            "UNCATALOGUED",
            "XXX",
            "XXXX",
            "TBD TBD",
            // Designators with other characters in place of digits. The first is that of CCSDS 502.0-B-3, OBJECT_ID.
            "YYYY-NNNP{PP}",
            "YYYY-NNNP",
            "yyyy-nnnppp",
            "YYYY-NNN",
            "YYYY-NNN-A",
            "YYYYNNNA",
            "YYNNNAAA",
            "YY-NNNA",
            "XXXX-XXXA",
            "XXXX-067A",
            "XXXXXA",
            "1998-XXXA",
            "98XXXA",
            "20YY-NNNA",
            "2026-1XXA",
            "????-???A",
            "2026-###",
            "####-###A",
            "AAAA-NNNP",
            "COSPAR YYYY-NNNA",
            "0000-001",
            "2026-000",
        ] {
            assert!(is_placeholder(text), "{text}");
        }
        for text in [
            "5",
            "9999",
            "99998",
            "A0005",
            "1998-067A",
            "OBJECT 1",
            "OBJECT A",
            "UNKNOWN PLEASURES",
            "NOT A DRILL",
            "TO BE",
            "5.5",
            "AAA",
            "X",
            "1958-002B",
            "98067A",
            "ISS",
            "É",
            // Such ids are in use.
            "1998-067",
            "OWN-1",
            "SAT-001A",
            "SAT1-001A",
            "MMS1",
            "AA001",
            "CC-101A",
            "B1234",
            "B1-234A",
            "X1234",
            "XM-001",
            "1N123A",
            "NOAA-20",
            "ABCD-EFGH",
            "LLLL-101ABCD",
            "É-001",
        ] {
            assert!(!is_placeholder(text), "{text}");
        }
    }
}
