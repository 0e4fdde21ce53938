//! Theories whose mean elements SGP4 and SDP4 can propagate, and the assumptions for the others.

use crate::Record;
use std::collections::BTreeMap;

/// Reason for refusing elements of SGP4-XP.
pub(crate) const SGP4_XP: &str = "elements of SGP4-XP (MEAN_ELEMENT_THEORY = SGP4-XP, ephemeris type 4, BTERM, AGOM), which SGP4 cannot \
                                  propagate: fetch those of SGP4, or an ephemeris as OEM";

/// A theory as a file gives it, if SGP4 and SDP4 can propagate its elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theory {
    /// SGP4 or SDP4, which are one theory.
    #[default]
    Sgp4,
    /// SGP, the predecessor.
    Sgp,
    /// `TLE`, a format of elements that some files give as the theory.
    Tle,
    /// General perturbations, the class of theories that SGP4 belongs to.
    Gp,
}

impl Theory {
    /// From the value of MEAN_ELEMENT_THEORY.
    ///
    /// # Errors
    ///
    /// The reason why SGP4 cannot propagate the elements, and the remedy.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let letters = text.chars().filter(char::is_ascii_alphanumeric);
        let letters: String = letters.map(|c| c.to_ascii_uppercase()).collect();
        match letters.as_str() {
            // The standard's own examples have SGP/SGP4.
            "SGP4" | "SDP4" | "SGPSGP4" | "SGP4SDP4" => Ok(Theory::Sgp4),
            "SGP" => Ok(Theory::Sgp),
            "TLE" => Ok(Theory::Tle),
            "GP" => Ok(Theory::Gp),
            "SGP4XP" | "XP" => Err(SGP4_XP.to_owned()),
            _ => Err(
                "only elements of SGP4 are used: fetch those, or an ephemeris as OEM".to_owned(),
            ),
        }
    }

    fn assumed(self) -> Option<&'static str> {
        match self {
            Theory::Sgp4 => None,
            Theory::Sgp => Some("SGP: propagated by SGP4, with the drag that BSTAR gives"),
            Theory::Tle => Some("TLE: taken as SGP4, whose elements a TLE has"),
            Theory::Gp => Some("GP: taken as SGP4, the theory of published GP elements"),
        }
    }
}

/// The ephemeris type of a supported set: 0, or 1 to 3 in old sets.
///
/// # Errors
///
/// The reason why SGP4 cannot propagate the elements, and the remedy.
pub(crate) fn ephemeris_type(number: u32) -> Result<u8, String> {
    match number {
        0..=3 => Ok(number as u8),
        4 => Err(format!("ephemeris type 4: {SGP4_XP}")),
        _ => Err(format!(
            "ephemeris type {number}: no elements of SGP4, which have 0; fetch those of SGP4, or an ephemeris as OEM"
        )),
    }
}

/// Assumptions for records, a line for each kind.
pub(crate) fn assumptions(records: &[Record], source: &str) -> Vec<String> {
    const ODD: &str =
        "1, 2 or 3: taken as 0, with Kozai's mean motion (Brouwer's differs by up to 0.1 %)";
    // For each text the count of records and the first line.
    let mut kinds: BTreeMap<(&str, &str), (usize, usize)> = BTreeMap::new();
    for record in records {
        let theory = record
            .theory
            .assumed()
            .map(|text| ("MEAN_ELEMENT_THEORY = ", text));
        let odd = (record.ephemeris_type > 0).then_some(("ephemeris type ", ODD));
        for kind in theory.into_iter().chain(odd) {
            kinds.entry(kind).or_insert((0, record.line)).0 += 1;
        }
    }
    let lines = kinds
        .iter()
        .map(|((key, kind), (count, line))| match count {
            1 => format!("{source}:{line}: {key}{kind}"),
            _ => format!("{source}:{line}: {key}{kind}; so in {count} records"),
        });
    lines.collect()
}
