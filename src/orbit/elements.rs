//! One two-line element set and its SGP4/SDP4 propagation.
//!
//! The model is the one of Vallado et al., AIAA 2006-6753, with the constants
//! of WGS72 from which the published elements are made. Against that paper's
//! vectors: at most 4.3 mm and 1.9e-6 m/s (`tests/sgp4_verification.rs`).

use crate::{StateVector, frames, time};
use hifitime::Epoch;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Farthest from its epoch that a set is propagated, days. SGP4 has no meaning
/// there; the bound keeps the deep-space integrator's work bounded.
pub const MAX_ELAPSED_DAYS: f64 = 50.0 * 365.25;

/// Radius of the Earth in the model, m (WGS72).
const EARTH_RADIUS_M: f64 = 6_378_135.0;

/// A mean element set, ready to propagate.
#[derive(Clone, Debug)]
pub struct Elements {
    /// Catalogue number; Alpha-5 numbers are decoded (`A0000` is 100000).
    pub norad: u32,
    /// Epoch of the elements.
    pub epoch: Epoch,
    // boxed: the deep-space constants are large, and catalogues are long
    constants: Box<sgp4::Constants>,
}

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
    /// SGP4 cannot start from these elements.
    #[error("SGP4 cannot start from these elements: {0}")]
    Model(String),
}

impl ElementsError {
    /// Which line of the set is at fault, 1 or 2.
    pub fn line(&self) -> u8 {
        match self {
            Self::Layout { line, .. } | Self::Checksum { line, .. } | Self::Field { line, .. } => {
                *line
            }
            Self::TwoObjects { .. } | Self::Model(_) => 2,
        }
    }
}

/// Why SGP4 has no state at an epoch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PropagationError {
    /// The mean elements left their range.
    #[error("{0}")]
    Model(String),
    /// The position is inside the Earth.
    #[error("the object has decayed: SGP4 puts it {depth_km:.1} km inside the Earth")]
    Decayed {
        /// Depth below the equatorial radius, km.
        depth_km: f64,
    },
    /// The model gave numbers that are not finite.
    #[error("SGP4 gave numbers that are not finite")]
    NotFinite,
    /// The epoch is farther from the elements than [`MAX_ELAPSED_DAYS`].
    #[error("it is {days:.0} days from the epoch of the elements, more than {MAX_ELAPSED_DAYS:.0}")]
    TooFar {
        /// Days from the epoch of the elements.
        days: f64,
    },
}

impl Elements {
    /// Reads the two lines of a set.
    pub fn parse(line1: &str, line2: &str, checksum: Checksum) -> Result<Self, ElementsError> {
        let first = Line::new(1, line1, checksum)?;
        let second = Line::new(2, line2, checksum)?;

        let norad = first.catalogue_number()?;
        let again = second.catalogue_number()?;
        if norad != again {
            return Err(ElementsError::TwoObjects {
                first: norad,
                second: again,
            });
        }
        let epoch = first.epoch()?;
        let radians = |degrees: f64| degrees * (PI / 180.0);
        let inclination = second.number("inclination", 9..17)?;
        if !(0.0..=180.0).contains(&inclination) {
            return Err(second.bad("inclination", 9..17));
        }

        let orbit = sgp4::Orbit::from_kozai_elements(
            &sgp4::WGS72,
            radians(inclination),
            radians(second.number("right ascension of the node", 18..26)?),
            second.implied_decimal("eccentricity", 27..34)?,
            radians(second.number("argument of perigee", 35..43)?),
            radians(second.number("mean anomaly", 44..52)?),
            // rev/day to rad/min
            second.number("mean motion", 53..64)? * (PI / 720.0),
        )
        .map_err(|error| ElementsError::Model(error.to_string()))?;
        let constants = sgp4::Constants::new(
            sgp4::WGS72,
            sgp4::iau_epoch_to_sidereal_time,
            julian_years_since_j2000(epoch),
            first.implied_exponent("drag term B*", 54..62)?,
            orbit,
        )
        .map_err(|error| ElementsError::Model(error.to_string()))?;

        Ok(Self {
            norad,
            epoch,
            constants: Box::new(constants),
        })
    }

    /// The state at `t` in TEME of date, m and m/s.
    pub fn state_teme(&self, t: Epoch) -> Result<StateVector, PropagationError> {
        // elapsed time is uniform: TAI differences count the leap seconds
        let elapsed = t.to_tai_duration() - self.epoch.to_tai_duration();
        let minutes = elapsed.total_nanoseconds() as f64 / 60e9;
        self.state_teme_after(minutes)
    }

    /// The state a number of minutes after the epoch of the elements, in TEME of date, m and m/s.
    pub fn state_teme_after(&self, minutes: f64) -> Result<StateVector, PropagationError> {
        let days = minutes.abs() / 1440.0;
        if days.is_nan() || days > MAX_ELAPSED_DAYS {
            return Err(PropagationError::TooFar { days });
        }
        let prediction = self
            .constants
            .propagate(sgp4::MinutesSinceEpoch(minutes))
            .map_err(|error| PropagationError::Model(error.to_string()))?;
        let state = StateVector {
            position_m: Vector3::from(prediction.position) * 1e3,
            velocity_m_s: Vector3::from(prediction.velocity) * 1e3,
        };
        if !state.is_finite() {
            return Err(PropagationError::NotFinite);
        }
        let depth_m = EARTH_RADIUS_M - state.position_m.norm();
        if depth_m > 0.0 {
            return Err(PropagationError::Decayed {
                depth_km: depth_m / 1e3,
            });
        }
        Ok(state)
    }
}

/// UTC years of 365.25 days since 2000-01-01T12:00, as the model's sidereal time takes them.
fn julian_years_since_j2000(epoch: Epoch) -> f64 {
    let ns = epoch.to_utc_duration().total_nanoseconds() - frames::J2000_NS;
    ns as f64 / frames::DAY_NS as f64 / 365.25
}

/// One line of a set: fixed columns, numbered from 1 as the format's description does.
struct Line<'a> {
    number: u8,
    text: &'a str,
}

type Columns = std::ops::Range<usize>;

impl<'a> Line<'a> {
    fn new(number: u8, text: &'a str, checksum: Checksum) -> Result<Self, ElementsError> {
        let text = text.trim_end();
        let layout = ElementsError::Layout {
            line: number,
            found: text.chars().count(),
        };
        if !text.is_ascii() {
            return Err(layout);
        }
        let line = Self { number, text };
        if checksum == Checksum::Ignored {
            return Ok(line);
        }
        // what follows column 69 after a blank is a remark
        if text.len() < 69 || !line.text(70..71).trim().is_empty() {
            return Err(layout);
        }
        let computed = (line.text(1..69).bytes())
            .map(|byte| match byte {
                b'0'..=b'9' => u32::from(byte - b'0'),
                b'-' => 1,
                _ => 0,
            })
            .sum::<u32>()
            % 10;
        let found = line.text(69..70).chars().next().unwrap_or(' ');
        if found.to_digit(10) != Some(computed) {
            return Err(ElementsError::Checksum {
                line: number,
                computed: computed as u8,
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

    /// Five digits, or Alpha-5: a letter (no I, no O) for the leading two, `A` = 10 to `Z` = 33.
    fn catalogue_number(&self) -> Result<u32, ElementsError> {
        let bad = || self.bad("catalogue number", 3..8);
        let text = self.text(3..8).trim();
        let (letter, rest) = match text.bytes().next().ok_or_else(bad)? {
            byte @ b'A'..=b'H' => (u32::from(byte - b'A') + 10, &text[1..]),
            byte @ b'J'..=b'N' => (u32::from(byte - b'J') + 18, &text[1..]),
            byte @ b'P'..=b'Z' => (u32::from(byte - b'P') + 23, &text[1..]),
            _ => (0, text),
        };
        let right_length = letter == 0 || rest.len() == 4;
        if !right_length || !rest.bytes().all(|b| b.is_ascii_digit()) {
            return Err(bad());
        }
        let rest: u32 = rest.parse().map_err(|_| bad())?;
        Ok(letter * 10_000 + rest)
    }

    fn epoch(&self) -> Result<Epoch, ElementsError> {
        let bad = || self.bad("epoch", 19..33);
        let year = self.text(19..21).trim().parse().map_err(|_| bad())?;
        let (day, fraction) = self.text(21..33).trim().split_once('.').ok_or_else(bad)?;
        let day = day.parse().map_err(|_| bad())?;
        time::from_tle(year, day, fraction).ok_or_else(bad)
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
        let digits = text.bytes().all(|b| b.is_ascii_digit()) && !text.is_empty();
        let value = format!("0.{text}").parse();
        match value {
            Ok(value) if digits => Ok(value),
            _ => Err(self.bad(name, columns)),
        }
    }

    /// Digits behind an understood decimal point, and a power of ten: `-31515-4` is -0.31515e-4.
    fn implied_exponent(&self, name: &'static str, columns: Columns) -> Result<f64, ElementsError> {
        let text = self.text(columns.clone()).trim();
        let (sign, text) = match text.as_bytes().first() {
            Some(b'-') => ("-", &text[1..]),
            Some(b'+') => ("", &text[1..]),
            _ => ("", text),
        };
        let split = text.rfind(['-', '+']).unwrap_or(text.len());
        let (digits, exponent) = text.split_at(split);
        let exponent = if exponent.is_empty() { "0" } else { exponent };
        let plain = digits.bytes().all(|b| b.is_ascii_digit()) && !digits.is_empty();
        match format!("{sign}0.{digits}e{exponent}").parse::<f64>() {
            Ok(value) if plain && value.is_finite() => Ok(value),
            _ => Err(self.bad(name, columns)),
        }
    }
}
