//! Reads the two lines of an element set: fixed columns.

use crate::catalogue_number::alpha_5;
use crate::elements::Elements;
use crate::record::{Record, long_designator};
use crate::theory::{self, Theory};
use crate::time;
use crate::units::{DEGREE, REV_PER_DAY};
use hifitime::Epoch;
use std::borrow::Cow;

/// Whether the checksum in column 69 is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checksum {
    /// Both lines must carry the right checksum.
    Required,
    /// Column 69 is ignored.
    Ignored,
}

/// The fault of two lines that are not an element set.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct ElementsError {
    /// The faulty line of the set, 1 or 2.
    pub line: u8,
    /// The fault.
    pub reason: String,
}

impl Elements {
    /// Reads the elements from the two lines of a set.
    pub fn parse(line1: &str, line2: &str, checksum: Checksum) -> Result<Self, ElementsError> {
        let first = Line::new(1, line1, checksum)?;
        let second = Line::new(2, line2, checksum)?;
        Elements::of(&first, &second)
    }

    fn of(first: &Line, second: &Line) -> Result<Self, ElementsError> {
        first.ephemeris_type()?;
        let (norad, again) = (first.catalogue_number()?, second.catalogue_number()?);
        if norad != again {
            let reason = format!("line 1 is of object {norad}, line 2 of object {again}");
            return Err(second.error(reason));
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
            eccentricity: second.assumed_point("eccentricity", 27..34)?,
            perigee: second.number("argument of perigee", 35..43)? * DEGREE,
            mean_anomaly: second.number("mean anomaly", 44..52)? * DEGREE,
            mean_motion: second.number("mean motion", 53..64)? * REV_PER_DAY,
            drag: first.assumed_point_and_power("drag term B*", 54..62)?,
        };
        match elements.orbit() {
            Ok(_) => Ok(elements),
            Err(error) => Err(second.error(error.to_string())),
        }
    }
}

impl Record {
    /// Reads the two lines of a set; the caller sets name and line. Fields that SGP4 does not use
    /// may be blank.
    pub(crate) fn from_lines(
        line1: &str,
        line2: &str,
        checksum: Checksum,
    ) -> Result<Self, ElementsError> {
        let first = Line::new(1, line1, checksum)?;
        let second = Line::new(2, line2, checksum)?;
        let blank = |columns: Columns| first.text(columns).trim().is_empty();
        Ok(Self {
            line: 0,
            name: String::new(),
            designator: long_designator(first.text(10..18)),
            classification: first.text(8..9).chars().find(|c| *c != ' ').unwrap_or('U'),
            ephemeris_type: first.ephemeris_type()?,
            theory: Theory::default(),
            element_set: first.counter("element set number", 65..69)?,
            revolution: second.counter("revolution number", 64..69)?,
            mean_motion_dot: if blank(34..44) {
                0.0
            } else {
                first.number("first derivative of the mean motion", 34..44)?
            },
            mean_motion_ddot: first
                .assumed_point_and_power("second derivative of the mean motion", 45..53)?,
            elements: Elements::of(&first, &second)?,
        })
    }
}

/// One line of a set. Columns are counted from 1, as in the format's description.
struct Line<'a> {
    number: u8,
    text: &'a str,
}

/// The sum of the digits, a minus as one, modulo 10.
fn checksum_of(columns: &str) -> u8 {
    let values = columns.bytes().map(|byte| match byte {
        b'0'..=b'9' => u32::from(byte - b'0'),
        b'-' => 1,
        _ => 0,
    });
    (values.sum::<u32>() % 10) as u8
}

/// Adds the checksum to a line of 68 columns.
pub(crate) fn seal(line: &str) -> String {
    format!("{line}{}", checksum_of(line))
}

type Columns = std::ops::Range<usize>;

impl<'a> Line<'a> {
    fn new(number: u8, text: &'a str, checksum: Checksum) -> Result<Self, ElementsError> {
        let line = Self {
            number,
            text: text.trim_end(),
        };
        let layout = || {
            let found = line.text.chars().count();
            line.error(format!(
                "line {number} of the set is not 69 ASCII characters but {found}; restore the \
                 fixed columns"
            ))
        };
        if !line.text.is_ascii() {
            return Err(layout());
        }
        if checksum == Checksum::Ignored {
            return Ok(line);
        }
        // A remark may follow column 69 after a blank.
        if line.text.len() < 69 || !line.text(70..71).trim().is_empty() {
            return Err(layout());
        }
        let computed = checksum_of(line.text(1..69)).to_string();
        let found = line.text(69..70);
        if found != computed {
            return Err(line.error(format!(
                "bad checksum in line {number} of the set: the line sums to {computed}, column 69 \
                 says '{found}'; fetch the set again"
            )));
        }
        Ok(line)
    }

    fn error(&self, reason: String) -> ElementsError {
        let line = self.number;
        ElementsError { line, reason }
    }

    /// Columns `from..to`, counted from 1; empty beyond the end of the line.
    fn text(&self, columns: Columns) -> &'a str {
        let end = (columns.end - 1).min(self.text.len());
        self.text.get(columns.start - 1..end).unwrap_or("")
    }

    fn bad(&self, name: &str, columns: Columns) -> ElementsError {
        let (found, line) = (self.text(columns), self.number);
        self.error(format!("bad {name} '{found}' in line {line} of the set"))
    }

    fn catalogue_number(&self) -> Result<u32, ElementsError> {
        let number = alpha_5(self.text(3..8).trim());
        number.ok_or_else(|| self.bad("catalogue number", 3..8))
    }

    fn ephemeris_type(&self) -> Result<u8, ElementsError> {
        let number = self.counter("ephemeris type", 63..64)?;
        theory::ephemeris_type(number).map_err(|reason| self.error(reason))
    }

    /// Columns `from..to` as bytes; blank beyond the end of the line.
    fn columns(&self, columns: Columns) -> impl Iterator<Item = u8> {
        let bytes = self.text.as_bytes();
        columns.map(|column| bytes.get(column - 1).copied().unwrap_or(b' '))
    }

    /// The columns as one whole number. A blank is a zero, as in FORTRAN and in the checksum.
    fn digits(&self, columns: Columns) -> Option<u64> {
        self.columns(columns)
            .try_fold(0, |number, byte| match byte {
                b' ' => Some(10 * number),
                b'0'..=b'9' => Some(10 * number + u64::from(byte - b'0')),
                _ => None,
            })
    }

    fn epoch(&self) -> Result<Epoch, ElementsError> {
        let bad = || self.bad("epoch", 19..33);
        let year = self.digits(19..21).ok_or_else(bad)? as u8;
        let text = self.zero_filled(21..33);
        let (day, fraction) = text.split_once('.').ok_or_else(bad)?;
        let day = day.parse().map_err(|_| bad())?;
        time::from_tle(year, day, fraction).ok_or_else(bad)
    }

    /// The text of a number with zeros for the blanks between and after its digits.
    fn zero_filled(&self, columns: Columns) -> Cow<'a, str> {
        match self.text(columns).trim_start() {
            text if text.contains(' ') => text.replace(' ', "0").into(),
            text => text.into(),
        }
    }

    /// A whole number; blank is 0.
    fn counter(&self, name: &str, columns: Columns) -> Result<u32, ElementsError> {
        let text = self.text(columns.clone()).trim();
        let is_whole = text.bytes().all(|b| b.is_ascii_digit());
        match text.parse() {
            _ if text.is_empty() => Ok(0),
            Ok(value) if is_whole => Ok(value),
            _ => Err(self.bad(name, columns)),
        }
    }

    /// A decimal number with its point.
    fn number(&self, name: &str, columns: Columns) -> Result<f64, ElementsError> {
        let text = self.zero_filled(columns.clone());
        // No letters: `parse` accepts `inf`, `nan` and exponents. A number without a point has no
        // scale.
        let plain = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+');
        if !text.bytes().all(plain) || !text.contains('.') {
            return Err(self.bad(name, columns));
        }
        text.parse().map_err(|_| self.bad(name, columns))
    }

    /// Digits with an assumed decimal point before the first column: `0001413` and `   1413` are
    /// 0.0001413.
    fn assumed_point(&self, name: &str, columns: Columns) -> Result<f64, ElementsError> {
        let width = columns.len() as i32;
        let is_blank = self.text(columns.clone()).trim().is_empty();
        let digits = self.digits(columns.clone()).filter(|_| !is_blank);
        let value = digits.and_then(|digits| scaled(digits as f64, -width));
        value.ok_or_else(|| self.bad(name, columns))
    }

    /// A sign, five digits after an assumed decimal point, and a power of ten with its sign:
    /// `-31515-4` is -0.31515e-4, `  1234-4` is 0.01234e-4, blanks are 0.
    fn assumed_point_and_power(&self, name: &str, columns: Columns) -> Result<f64, ElementsError> {
        let first = columns.start;
        let sign = |column: usize| match self.columns(column..column + 1).next() {
            Some(b'-') => Some(-1),
            // Some writers have a zero in place of the sign.
            Some(b'+' | b' ' | b'0') => Some(1),
            _ => None,
        };
        let value = || {
            let digits = self.digits(first + 1..first + 6)?;
            let power = sign(first + 6)? * self.digits(first + 7..first + 8)? as i32;
            Some(f64::from(sign(first)?) * scaled(digits as f64, power - 5)?)
        };
        value().ok_or_else(|| self.bad(name, columns))
    }
}

/// A whole number of up to 15 digits times a power of ten, to the nearest. Powers up to 22 are
/// exact, and a set has none beyond.
fn scaled(whole: f64, power: i32) -> Option<f64> {
    match power {
        -22..0 => Some(whole / 10f64.powi(-power)),
        0..=22 => Some(whole * 10f64.powi(power)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// An assumed point and a power give the same number as written digits, with blanks as
        /// zeros.
        #[test]
        fn assumed_points_give_the_nearest_number(
            sign in "[-+ ]", digits in "[0-9 ]{5}", power in "[-+ ][0-9]", tail in "[0-9 ]{0,2}",
        ) {
            let line = format!("{:44}{sign}{digits}{power}", "");
            let line = Line { number: 1, text: &line };
            let zeros = digits.replace(' ', "0");
            let written = format!("{}0.{zeros}e{}", sign.trim(), power.trim());
            let exact: f64 = written.parse().unwrap();
            let read = line.assumed_point_and_power("a number", 45..53).unwrap();
            prop_assert_eq!(read.to_bits(), exact.to_bits());

            prop_assume!(!digits.trim().is_empty());
            let line = format!("{:44}{digits}{tail}", "");
            let line = Line { number: 1, text: &line };
            let exact: f64 = format!("0.{zeros}{}", tail.replace(' ', "0")).parse().unwrap();
            prop_assert_eq!(line.assumed_point("a number", 45..52).unwrap(), exact);
        }
    }
}
