//! International designators (COSPAR), by which an ephemeris is known to be of the object that an element set is of.

use crate::record::long_designator;
use std::num::NonZeroU16;
use std::ops::RangeInclusive;

/// A launch and its piece, `1998-067A`, in 8 octets: catalogues are long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Designator {
    year: NonZeroU16,
    launch: u16,
    /// Capital letters, from the left; 0 where there is none.
    piece: [u8; 3],
}

impl Designator {
    /// From `1998-067A`, with or without the launch's leading zeros, or the `98067A` of a TLE; nothing where the text is none,
    /// such as `UNKNOWN`.
    pub fn parse(text: &str) -> Option<Self> {
        let long = long_designator(text);
        let (year, rest) = long.split_once('-')?;
        let (launch, letters) = rest.split_at(rest.find(|c: char| !c.is_ascii_digit())?);
        let number = |text: &str, digits: RangeInclusive<usize>| -> Option<u16> {
            let all = digits.contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit());
            all.then(|| text.parse().ok())?
        };
        let mut piece = [0; 3];
        let letters = letters.as_bytes();
        if letters.is_empty() || !letters.iter().all(u8::is_ascii_alphabetic) {
            return None;
        }
        piece.get_mut(..letters.len())?.copy_from_slice(letters);
        Some(Designator {
            year: NonZeroU16::new(number(year, 4..=4)?)?,
            launch: number(launch, 1..=3)?,
            piece: piece.map(|letter| letter.to_ascii_uppercase()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ways_of_writing_one_are_the_same() {
        let zarya = Designator::parse("1998-067A");
        assert!(zarya.is_some());
        for text in ["98067A", " 98067A  ", "1998-067a", "1998-67A", "1998-67a"] {
            assert_eq!(Designator::parse(text), zarya, "{text}");
        }
        for other in ["1998-067B", "1998-067AA", "1998-068A", "1999-067A"] {
            let other = Designator::parse(other);
            assert!(other.is_some() && other != zarya);
        }
    }

    #[test]
    fn what_is_none_is_none() {
        for text in [
            "",
            "UNKNOWN",
            "1998-067",
            "1998-A",
            "1998-0067A",
            "1998-067ABCD",
            "1998-067é",
            "25544",
            "0000-000A",
            "98-067A",
            "+998-067A",
            "1998-0+7A",
            "TO BE ASSIGNED",
        ] {
            assert_eq!(Designator::parse(text), None, "{text}");
        }
    }

    #[test]
    fn it_takes_eight_octets() {
        assert_eq!(size_of::<Option<Designator>>(), 8);
    }
}
