//! The two lines of an element set: fixed columns.

use crate::elements::{Elements, ModelError};
use crate::record::{Record, long_designator};
use crate::time;
use crate::units::{DEGREE, REV_PER_DAY};
use hifitime::Epoch;

/// Why a set of ephemeris type 4 is refused.
pub(crate) const SGP4_XP: &str =
    "ephemeris type 4: elements of SGP4-XP, which SGP4 must not read; fetch those of SGP4";

/// Whether the checksum in column 69 must be present and right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checksum {
    /// Both lines must carry the right checksum.
    Required,
    /// Column 69 is not looked at.
    Ignored,
}

/// Why two lines are not an element set.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ElementsError {
    /// A line is too short, too long or not ASCII.
    #[error(
        "line {line} of the set is not 69 ASCII characters but {found}; restore the fixed columns"
    )]
    Layout {
        /// Which line of the set, 1 or 2.
        line: u8,
        /// Characters found.
        found: usize,
    },
    /// The checksum does not agree with the line.
    #[error(
        "bad checksum in line {line} of the set: the line sums to {computed}, column 69 says \
         '{found}'; fetch the set again"
    )]
    Checksum {
        /// Which line of the set, 1 or 2.
        line: u8,
        /// Sum of the digits, a minus counting one, modulo 10.
        computed: u8,
        /// What column 69 holds.
        found: char,
    },
    /// A field cannot be read or is out of its range.
    #[error("bad {name} '{found}' in line {line} of the set")]
    Field {
        /// Which line of the set, 1 or 2.
        line: u8,
        /// Name of the field.
        name: &'static str,
        /// Its text.
        found: String,
    },
    /// The two lines belong to different objects.
    #[error("line 1 is of object {first}, line 2 of object {second}")]
    TwoObjects {
        /// Number in line 1.
        first: u32,
        /// Number in line 2.
        second: u32,
    },
    /// The elements are those of another theory.
    #[error("{SGP4_XP}")]
    Theory,
    /// SGP4 cannot start from these elements.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl ElementsError {
    /// Which line of the set is at fault, 1 or 2.
    pub fn line(&self) -> u8 {
        match self {
            Self::Layout { line, .. } | Self::Checksum { line, .. } | Self::Field { line, .. } => {
                *line
            }
            Self::Theory => 1,
            Self::TwoObjects { .. } | Self::Model(_) => 2,
        }
    }
}

impl Elements {
    /// Reads the two lines of a set, and of them the elements alone.
    pub fn parse(line1: &str, line2: &str, checksum: Checksum) -> Result<Self, ElementsError> {
        let first = Line::new(1, line1, checksum)?;
        let second = Line::new(2, line2, checksum)?;
        Elements::of(&first, &second)
    }

    fn of(first: &Line, second: &Line) -> Result<Self, ElementsError> {
        let norad = first.catalogue_number()?;
        let again = second.catalogue_number()?;
        if norad != again {
            return Err(ElementsError::TwoObjects {
                first: norad,
                second: again,
            });
        }
        let inclination = second.number("inclination", 9..17)?;
        if !(0.0..=180.0).contains(&inclination) {
            return Err(second.bad("inclination", 9..17));
        }
        let elements = Self {
            norad,
            epoch: first.epoch()?,
            inclination: inclination * DEGREE,
            node: second.number("right ascension of the node", 18..26)? * DEGREE,
            eccentricity: second.implied_decimal("eccentricity", 27..34)?,
            perigee: second.number("argument of perigee", 35..43)? * DEGREE,
            mean_anomaly: second.number("mean anomaly", 44..52)? * DEGREE,
            mean_motion: second.number("mean motion", 53..64)? * REV_PER_DAY,
            drag: first.implied_exponent("drag term B*", 54..62)?,
        };
        elements.orbit()?;
        Ok(elements)
    }
}

impl Record {
    /// Reads the two lines of a set; its name and line are the caller's. What SGP4 has no use for may be blank.
    pub(crate) fn from_lines(
        line1: &str,
        line2: &str,
        checksum: Checksum,
    ) -> Result<Self, ElementsError> {
        let first = Line::new(1, line1, checksum)?;
        let second = Line::new(2, line2, checksum)?;
        let ephemeris_type = first.counter("ephemeris type", 63..64)?;
        if ephemeris_type == 4 {
            return Err(ElementsError::Theory);
        }
        let blank = |columns: Columns| first.text(columns).trim().is_empty();
        Ok(Self {
            line: 0,
            name: String::new(),
            designator: long_designator(first.text(10..18)),
            classification: first.text(8..9).chars().find(|c| *c != ' ').unwrap_or('U'),
            ephemeris_type: ephemeris_type as u8,
            element_set: first.counter("element set number", 65..69)?,
            revolution: second.counter("revolution number", 64..69)?,
            mean_motion_dot: match blank(34..44) {
                true => 0.0,
                false => first.number("first derivative of the mean motion", 34..44)?,
            },
            mean_motion_ddot: match blank(45..53) {
                true => 0.0,
                false => first.implied_exponent("second derivative of the mean motion", 45..53)?,
            },
            elements: Elements::of(&first, &second)?,
        })
    }
}

/// One line of a set: fixed columns, numbered from 1 as the format's description does.
struct Line<'a> {
    number: u8,
    text: &'a str,
}

/// The digits' sum, a minus counting one, modulo 10.
fn checksum_of(columns: &str) -> u8 {
    let values = columns.bytes().map(|byte| match byte {
        b'0'..=b'9' => u32::from(byte - b'0'),
        b'-' => 1,
        _ => 0,
    });
    (values.sum::<u32>() % 10) as u8
}

/// A line of 68 columns with its checksum behind it.
pub(crate) fn seal(line: &str) -> String {
    format!("{line}{}", checksum_of(line))
}

type Columns = std::ops::Range<usize>;

impl<'a> Line<'a> {
    fn new(number: u8, text: &'a str, checksum: Checksum) -> Result<Self, ElementsError> {
        let text = text.trim_end();
        let layout = || ElementsError::Layout {
            line: number,
            found: text.chars().count(),
        };
        if !text.is_ascii() {
            return Err(layout());
        }
        let line = Self { number, text };
        if checksum == Checksum::Ignored {
            return Ok(line);
        }
        // what follows column 69 after a blank is a remark
        if text.len() < 69 || !line.text(70..71).trim().is_empty() {
            return Err(layout());
        }
        let computed = checksum_of(line.text(1..69));
        let found = line.text(69..70).chars().next().unwrap_or(' ');
        if found.to_digit(10) != Some(computed.into()) {
            return Err(ElementsError::Checksum {
                line: number,
                computed,
                found,
            });
        }
        Ok(line)
    }

    /// Columns `from..to`, counted from 1; what the line does not have is empty.
    fn text(&self, columns: Columns) -> &'a str {
        let end = (columns.end - 1).min(self.text.len());
        self.text.get(columns.start - 1..end).unwrap_or("")
    }

    fn bad(&self, name: &'static str, columns: Columns) -> ElementsError {
        ElementsError::Field {
            line: self.number,
            name,
            found: self.text(columns).to_owned(),
        }
    }

    fn catalogue_number(&self) -> Result<u32, ElementsError> {
        let number = alpha_5(self.text(3..8).trim());
        number.ok_or_else(|| self.bad("catalogue number", 3..8))
    }

    fn epoch(&self) -> Result<Epoch, ElementsError> {
        let bad = || self.bad("epoch", 19..33);
        let year = self.text(19..21).trim().parse().map_err(|_| bad())?;
        let (day, fraction) = self.text(21..33).trim().split_once('.').ok_or_else(bad)?;
        let day = day.parse().map_err(|_| bad())?;
        time::from_tle(year, day, fraction).ok_or_else(bad)
    }

    /// A whole number; blank is 0.
    fn counter(&self, name: &'static str, columns: Columns) -> Result<u32, ElementsError> {
        let text = self.text(columns.clone()).trim();
        let digits = text.bytes().all(|b| b.is_ascii_digit());
        match text.parse() {
            _ if text.is_empty() => Ok(0),
            Ok(value) if digits => Ok(value),
            _ => Err(self.bad(name, columns)),
        }
    }

    /// A plain decimal number.
    fn number(&self, name: &'static str, columns: Columns) -> Result<f64, ElementsError> {
        let text = self.text(columns.clone()).trim();
        // no letters: neither `inf` nor `nan` nor exponents belong here
        let plain = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+');
        if !text.bytes().all(plain) {
            return Err(self.bad(name, columns));
        }
        text.parse().map_err(|_| self.bad(name, columns))
    }

    /// Digits behind an understood decimal point: `0001413` is 0.0001413.
    fn implied_decimal(&self, name: &'static str, columns: Columns) -> Result<f64, ElementsError> {
        let text = self.text(columns.clone()).trim();
        let value = exact(text).and_then(|digits| scaled(digits, -(text.len() as i32)));
        value.ok_or_else(|| self.bad(name, columns))
    }

    /// Digits behind an understood decimal point, and a power of ten: `-31515-4` is -0.31515e-4.
    fn implied_exponent(&self, name: &'static str, columns: Columns) -> Result<f64, ElementsError> {
        let text = self.text(columns.clone()).trim();
        let (sign, text) = match text.as_bytes().first() {
            Some(b'-') => (-1.0, &text[1..]),
            Some(b'+') => (1.0, &text[1..]),
            _ => (1.0, text),
        };
        let split = text.rfind(['-', '+']).unwrap_or(text.len());
        let (digits, exponent) = text.split_at(split);
        let value = || {
            let exponent = match exponent.is_empty() {
                true => 0,
                false => exponent.parse().ok()?,
            };
            Some(sign * scaled(exact(digits)?, exponent - digits.len() as i32)?)
        };
        value().ok_or_else(|| self.bad(name, columns))
    }
}

/// The number in so few digits that it is exact.
fn exact(digits: &str) -> Option<f64> {
    let is_exact = digits.len() <= 15 && digits.bytes().all(|b| b.is_ascii_digit());
    let whole: u64 = digits.parse().ok().filter(|_| is_exact)?;
    Some(whole as f64)
}

/// An exact number times a power of ten, to the nearest: no power that a set has is beyond 22, up to which they are exact, too.
fn scaled(exact: f64, power: i32) -> Option<f64> {
    match power {
        -22..0 => Some(exact / 10f64.powi(-power)),
        0..=22 => Some(exact * 10f64.powi(power)),
        _ => {
            let value: f64 = format!("{exact}e{power}").parse().ok()?;
            value.is_finite().then_some(value)
        }
    }
}

/// A number in digits, or Alpha-5: a letter (no I, no O) for the leading two of six, `A` = 10 to `Z` = 33.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// An understood point and exponent give the number that the same text gives with both written out.
        #[test]
        fn understood_points_give_the_nearest_number(
            sign in "[-+ ]", digits in "[0-9]{1,5}", exponent in "([-+][0-9]{1,2})?",
        ) {
            let column = format!("{sign}{digits}{exponent}");
            prop_assume!(column.len() <= 8);
            let line = format!("{:44}{column:8}", "");
            let line = Line { number: 1, text: &line };
            let written = format!("{}0.{digits}e{}", sign.trim(), if exponent.is_empty() { "0" } else { &exponent });
            let exact: f64 = written.parse().unwrap();
            let read = line.implied_exponent("a number", 45..53).unwrap();
            prop_assert_eq!(read.to_bits(), exact.to_bits());

            let line = format!("{:44}{digits}", "");
            let line = Line { number: 1, text: &line };
            let exact: f64 = format!("0.{digits}").parse().unwrap();
            prop_assert_eq!(line.implied_decimal("a number", 45..53).unwrap(), exact);
        }
    }
}
