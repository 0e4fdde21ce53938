//! International designators (COSPAR): year, number and piece of a launch, in all common spellings.

use crate::catalogue_number::unlabelled;
use crate::missing::is_missing;
use std::fmt;
use std::num::NonZeroU16;

/// A launch and its piece, `1998-067A`, in 8 bytes to keep large catalogues small.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Designator {
    year: NonZeroU16,
    launch: u16,
    /// Capital letters, from the left; 0 where there is none.
    piece: [u8; 3],
}

/// A designator that no launch can have.
struct Impossible;

/// Separators of year, launch and piece: web pages use hyphens and dashes other than U+002D.
pub(crate) const SEPARATORS: [char; 9] = [
    '-', ' ', '_', '/', '\u{2010}', '\u{2011}', '\u{2013}', '\u{2014}', '\u{2212}',
];

impl Designator {
    /// Reads `1998-067A`, the `98067A` of a TLE, `1998067A`, or NASA's `1998-067-A`, in upper or
    /// lower case. Leading zeros after a separator may be missing. Quotes, and the labels `COSPAR`
    /// and `COSPAR ID`, are skipped.
    pub fn parse(text: &str) -> Option<Self> {
        Self::read(text)?.ok()
    }

    /// Whether a text has the form of a designator that no launch can have: number 0, a year before
    /// 1957 or after 2099, or a piece such as `TBD`.
    pub(crate) fn is_impossible(text: &str) -> bool {
        matches!(Self::read(text), Some(Err(Impossible)))
    }

    /// Decodes a text with the form of a designator.
    fn read(text: &str) -> Option<Result<Self, Impossible>> {
        let (first, rest) = digits(unlabelled(text, "COSPAR"))?;
        let (year, launch, rest) = match first.len() {
            2 | 4 => {
                let (launch, rest) = digits(rest.strip_prefix(SEPARATORS)?)?;
                (first, launch, rest)
            }
            5 | 7 => {
                let (year, launch) = first.split_at(first.len() - 3);
                (year, launch, rest)
            }
            _ => return None,
        };
        let letters = rest.strip_prefix(SEPARATORS).unwrap_or(rest).as_bytes();
        if letters.is_empty() || !letters.iter().all(u8::is_ascii_alphabetic) {
            return None;
        }
        let mut piece = [0; 3];
        piece.get_mut(..letters.len())?.copy_from_slice(letters);
        let launch: u16 = (launch.len() <= 3).then(|| launch.parse().ok())??;
        let number: u16 = year.parse().ok()?;
        let year = match (year.len(), number) {
            (2, ..57) => number + 2000,
            (2, _) => number + 1900,
            _ => number,
        };
        let Some(year) = NonZeroU16::new(year).filter(|year| (1957..2100).contains(&year.get()))
        else {
            return Some(Err(Impossible));
        };
        let piece = piece.map(|letter| letter.to_ascii_uppercase());
        if launch == 0 || is_unknown_piece(piece) {
            return Some(Err(Impossible));
        }
        Some(Ok(Designator {
            year,
            launch,
            piece,
        }))
    }

    /// As in the columns of a TLE, `98067A`; none for a year from 2057 on.
    pub(crate) fn short(&self) -> Option<String> {
        let text = self.to_string();
        let (year, rest) = text.split_once('-')?;
        (self.year.get() < 2057).then(|| format!("{}{rest}", &year[2..]))
    }
}

impl fmt::Display for Designator {
    /// The long form, `1998-067A`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{:03}", self.year, self.launch)?;
        let letters = self.piece.iter().filter(|letter| **letter > 0);
        letters
            .map(|letter| char::from(*letter))
            .try_for_each(|letter| write!(f, "{letter}"))
    }
}

/// Whether the piece of a designator is a placeholder such as `TBA` or `XXA`. Pieces have three
/// letters from number 601 on. Real numbers are below 9,000, those of `TBA` and `XXA` above 10,000.
fn is_unknown_piece(piece: [u8; 3]) -> bool {
    let is_word = std::str::from_utf8(&piece).is_ok_and(is_missing);
    is_word || (piece.starts_with(b"XX") && piece[2] > 0)
}

/// Splits a text behind its leading digits.
fn digits(text: &str) -> Option<(&str, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit())?;
    (end > 0).then(|| text.split_at(end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_spellings_give_one_designator() {
        // The first is that of the standard (CCSDS 502.0-B-3, OBJECT_ID), the third that of NASA's
        // ephemerides of the ISS; the last have U+2011 and U+2013 in place of hyphens.
        let texts = "1998-067A,1998-067a,1998-067-A,1998-067-a,1998-67A,1998-67a,1998 067A,\
                     1998_067_A,1998067A,1998067-A,98067A,98067A  , 98067a,98-067A,98 67A  ,\
                     1998\u{2011}067A,1998\u{2013}067\u{2013}A";
        for text in texts.split(',') {
            let read = Designator::parse(text).unwrap();
            assert_eq!(read.to_string(), "1998-067A", "{text}");
            assert_eq!(read.short().unwrap(), "98067A", "{text}");
        }
        for (text, long) in [
            ("58002B", "1958-002B"),
            ("1998-67NA", "1998-067NA"),
            ("1998-067XX", "1998-067XX"),
            ("19029BC", "2019-029BC"),
            ("1999025DQA", "1999-025DQA"),
            ("56001A", "2056-001A"),
            ("57001A", "1957-001A"),
            ("2057-1a", "2057-001A"),
        ] {
            assert_eq!(Designator::parse(text).unwrap().to_string(), long);
        }
        assert_eq!(Designator::parse("2057-001A").unwrap().short(), None);
    }

    #[test]
    fn invalid_designators_are_refused() {
        let texts = ",UNKNOWN,1998-067,1998-A,1998-0067A,1998-067ABCD,1998-067é,1998-067--A,\
                     1998--067A,1998-067 A B,25544,980067A,19980067A,0000-000A,1998-000A,\
                     1956-001A,9999-999A,1998-067TBD,2026-1XXA,+998-067A,1998-0+7A,TO BE ASSIGNED";
        for text in texts.split(',') {
            assert_eq!(Designator::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_designator_takes_eight_bytes() {
        assert_eq!(size_of::<Option<Designator>>(), 8);
    }
}
