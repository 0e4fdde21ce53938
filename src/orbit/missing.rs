//! Words for an unknown value.

/// Placeholders. `UNKNOWN`, that of the standard (CCSDS 502.0-B-3, OBJECT_ID and OBJECT_NAME), is
/// `UN` before a word of [`MISSING`].
pub(crate) const PLACEHOLDERS: [&str; 14] = [
    "UNK", "UNDEF", "TBD", "TBA", "TBC", "TBS", "NA", "NO", "NONE", "NULL", "NIL", "NAN",
    "INVALID", "ANALYST",
];

/// Words that are a placeholder after `UN`, `NOT`, `NOT YET` or `TO BE`. Space-Track has the name
/// `TBA - TO BE ASSIGNED`.
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

/// Whether a word in capitals is a placeholder: from one of the lists, or `XX`, `XXX` and so on.
pub(crate) fn is_missing(word: &str) -> bool {
    let mut prefixes = ["UN", "NOTYET", "NOT", "TOBE"].into_iter();
    let is_negated = |prefix| {
        let rest = word.strip_prefix(prefix);
        rest.is_some_and(|rest| MISSING.contains(&rest))
    };
    let is_crossed_out = word.len() >= 2 && word.bytes().all(|byte| byte == b'X');
    is_crossed_out || PLACEHOLDERS.contains(&word) || prefixes.any(is_negated)
}
