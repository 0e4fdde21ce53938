//! CCSDS Orbit Mean-Elements Messages (502.0-B, section 4) in four notations: one set of keywords, a reader each.
//!
//! CelesTrak and Space-Track give the same keywords in KVN, XML, JSON and CSV; the one JSON has numbers, the other text.
//! Their JSON and CSV may leave out centre, frame, time system and theory: these are then the Earth, TEME, UTC and SGP4.

pub(crate) mod csv;
pub(crate) mod json;
pub(crate) mod kvn;
pub(crate) mod xml;

use crate::elements::Elements;
use crate::identity::{assigned, catalogue_number};
use crate::record::{At, Record, check_version, long_designator, shorten};
use crate::theory::{self, Theory};
use crate::two_line::alpha_5;
use crate::units::{DEGREE, REV_PER_DAY};
use crate::{bounded_name, is_placeholder, time};
use hifitime::{Epoch, TimeScale, Unit};
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Largest catalogue number: nine digits.
const LARGEST_NUMBER: u32 = 999_999_999;

/// The keywords that are read; all others are passed over.
#[derive(Clone, Copy)]
pub(crate) enum Key {
    Name,
    Designator,
    Centre,
    Frame,
    TimeSystem,
    Theory,
    Epoch,
    MeanMotion,
    SemiMajorAxis,
    Eccentricity,
    Inclination,
    Node,
    Perigee,
    MeanAnomaly,
    EphemerisType,
    Classification,
    Number,
    ElementSet,
    Revolution,
    Drag,
    MeanMotionDot,
    MeanMotionDdot,
    /// With the next, drag and solar radiation pressure of SGP4-XP.
    BallisticTerm,
    RadiationTerm,
    /// Of Space-Track's older classes: what EPOCH lacks, and OBJECT_ID.
    EpochMicroseconds,
    OldDesignator,
    /// What TEME must not have: SGP4 gives that of date.
    FrameEpoch,
    /// In JSON and CSV; KVN and XML begin with it.
    Version,
}

/// How they are written, in the order of [`Key`].
pub(crate) const KEYWORDS: [&str; 28] = [
    "OBJECT_NAME",
    "OBJECT_ID",
    "CENTER_NAME",
    "REF_FRAME",
    "TIME_SYSTEM",
    "MEAN_ELEMENT_THEORY",
    "EPOCH",
    "MEAN_MOTION",
    "SEMI_MAJOR_AXIS",
    "ECCENTRICITY",
    "INCLINATION",
    "RA_OF_ASC_NODE",
    "ARG_OF_PERICENTER",
    "MEAN_ANOMALY",
    "EPHEMERIS_TYPE",
    "CLASSIFICATION_TYPE",
    "NORAD_CAT_ID",
    "ELEMENT_SET_NO",
    "REV_AT_EPOCH",
    "BSTAR",
    "MEAN_MOTION_DOT",
    "MEAN_MOTION_DDOT",
    "BTERM",
    "AGOM",
    "EPOCH_MICROSECONDS",
    "INTLDES",
    "REF_FRAME_EPOCH",
    "CCSDS_OMM_VERS",
];

/// The place of a keyword in [`KEYWORDS`].
pub(crate) fn index_of(keyword: &str) -> Option<usize> {
    KEYWORDS.iter().position(|known| *known == keyword)
}

/// The values of one message, with the place of each in the text: a line or an offset, as the notation has it.
#[derive(Default)]
pub(crate) struct Fields<'a> {
    values: [Option<(Cow<'a, str>, usize)>; KEYWORDS.len()],
    /// The first thing that is wrong with the message as a text, and its place.
    wrong: Option<(usize, String)>,
}

/// What a message must say of itself.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Metadata {
    /// Everything, as the standard demands.
    Required,
    /// Nothing: what is not said is as published.
    Understood,
}

impl<'a> Fields<'a> {
    /// Gives the keyword with this index a value; an empty one is none. A keyword has one value.
    pub fn set(&mut self, index: usize, value: Cow<'a, str>, place: usize) {
        if value.trim().is_empty() {
            return;
        }
        match (self.values.get_mut(index), KEYWORDS.get(index)) {
            (Some(Some((first, _))), Some(keyword)) => {
                let values = [shorten(first), shorten(&value)].map(|text| text.trim().to_owned());
                let [first, second] = values;
                self.refuse(place, format!("{keyword} twice: '{first}' and '{second}'"));
            }
            (Some(field), _) => *field = Some((value, place)),
            (None, _) => {}
        }
    }

    /// Refuses a unit that is not the one of the keyword with this index.
    pub fn unit(&mut self, index: usize, unit: &str, place: usize) {
        let wanted = unit_of(index);
        if !unit.trim().eq_ignore_ascii_case(wanted) {
            let (keyword, unit) = (KEYWORDS.get(index).unwrap_or(&""), shorten(unit.trim()));
            let reason = match wanted {
                "" => format!("{keyword} in '{unit}'; it has no unit"),
                _ => format!("{keyword} in '{unit}'; only {wanted} is read"),
            };
            self.refuse(place, reason);
        }
    }

    /// Refuses the message; the first reason counts.
    pub fn refuse(&mut self, place: usize, reason: String) {
        self.wrong.get_or_insert((place, reason));
    }

    /// Whether every keyword that a record cannot do without has a value.
    pub fn are_complete(&self) -> bool {
        let needed = [
            Key::Epoch,
            Key::MeanMotion,
            Key::Eccentricity,
            Key::Inclination,
            Key::Node,
            Key::Perigee,
            Key::MeanAnomaly,
            Key::Drag,
        ];
        needed.iter().all(|key| self.has(*key as usize))
    }

    /// Whether any of the elements has a value.
    pub fn has_elements(&self) -> bool {
        let elements = [
            Key::MeanMotion,
            Key::Eccentricity,
            Key::Inclination,
            Key::MeanAnomaly,
        ];
        elements.iter().any(|key| self.has(*key as usize))
    }

    /// Whether the keyword with this index has a value.
    pub fn has(&self, index: usize) -> bool {
        self.values.get(index).is_some_and(Option::is_some)
    }

    /// The record of a message that begins at `start`. Errors have the place of the value, or `start`.
    pub fn record(&self, start: usize, metadata: Metadata) -> At<Record> {
        self.read(start, metadata).map_err(|(place, reason)| {
            let value = |key| self.find(key).map(|(text, _)| shorten(text));
            let number = value(Key::Number).map(|number| format!("NORAD_CAT_ID {number}"));
            let who: Vec<String> = value(Key::Name).into_iter().chain(number).collect();
            match who.is_empty() {
                true => (place, reason),
                false => (place, format!("{reason} ({})", who.join(", "))),
            }
        })
    }

    fn read(&self, start: usize, metadata: Metadata) -> At<Record> {
        if let Some(wrong) = &self.wrong {
            return Err(wrong.clone());
        }
        if let Some((text, place)) = self.find(Key::Version) {
            check_version(KEYWORDS[Key::Version as usize], text).map_err(|why| (place, why))?;
        }
        for (key, wanted) in [
            (Key::Centre, &["EARTH"][..]),
            // The second is the frame's name in the registry of SANA.
            (Key::Frame, &["TEME", "TEMEOFDATE"]),
            (Key::TimeSystem, &["UTC"]),
        ] {
            self.is_one_of(key, wanted, start, metadata)?;
        }
        if let Some((text, place)) = self.find(Key::FrameEpoch) {
            let reason = format!(
                "REF_FRAME_EPOCH '{}': SGP4 has TEME of date; fetch the elements without it",
                shorten(text)
            );
            return Err((place, reason));
        }
        let (theory, ephemeris_type) = self.theory(start, metadata)?;
        let degrees = -360.0..=360.0;
        let angle = |key| self.number(key, degrees.clone(), start);
        let (eccentricity, inclination) = (
            self.number(Key::Eccentricity, 0.0..=1.0, start)?,
            self.number(Key::Inclination, 0.0..=180.0, start)?,
        );
        let elements = Elements {
            norad: self.catalogue_number()?,
            epoch: self.epoch(start)?,
            inclination: inclination * DEGREE,
            node: angle(Key::Node)? * DEGREE,
            eccentricity,
            perigee: angle(Key::Perigee)? * DEGREE,
            mean_anomaly: angle(Key::MeanAnomaly)? * DEGREE,
            mean_motion: self.mean_motion(start)? * REV_PER_DAY,
            drag: self.number(Key::Drag, -1e9..=1e9, start)?,
        };
        elements
            .orbit()
            .map_err(|error| (start, error.to_string()))?;
        let optional = |key| match self.find(key) {
            Some(_) => self.number(key, -1e9..=1e9, start),
            None => Ok(0.0),
        };
        let text = |key| self.find(key).map_or("", |(text, _)| text);
        Ok(Record {
            line: start,
            name: bounded_name(text(Key::Name)),
            designator: long_designator(&bounded_name(match text(Key::Designator) {
                none if is_placeholder(none) => text(Key::OldDesignator),
                given => given,
            })),
            classification: text(Key::Classification).chars().next().unwrap_or('U'),
            ephemeris_type,
            theory,
            element_set: self.counter(Key::ElementSet, u32::MAX)?.unwrap_or(0),
            revolution: self.counter(Key::Revolution, u32::MAX)?.unwrap_or(0),
            mean_motion_dot: optional(Key::MeanMotionDot)?,
            mean_motion_ddot: optional(Key::MeanMotionDdot)?,
            elements,
        })
    }

    fn find(&self, key: Key) -> Option<(&str, usize)> {
        let field = self.values.get(key as usize)?.as_ref();
        field.map(|(text, place)| (text.trim(), *place))
    }

    fn is_one_of(&self, key: Key, wanted: &[&str], start: usize, metadata: Metadata) -> At<()> {
        match self.find(key) {
            Some((text, _)) if wanted.iter().any(|word| word.eq_ignore_ascii_case(text)) => Ok(()),
            Some((text, place)) => {
                let keyword = KEYWORDS[key as usize];
                let reason = format!("{keyword} '{}'; only {} is read", shorten(text), wanted[0]);
                Err((place, reason))
            }
            None if metadata == Metadata::Understood => Ok(()),
            None => Err(missing(key, start)),
        }
    }

    /// The theory of the elements, and their ephemeris type.
    fn theory(&self, start: usize, metadata: Metadata) -> At<(Theory, u8)> {
        for key in [Key::BallisticTerm, Key::RadiationTerm] {
            if let Some((_, place)) = self.find(key) {
                return Err((place, theory::SGP4_XP.to_owned()));
            }
        }
        let theory = match self.find(Key::Theory) {
            Some((text, place)) => Theory::parse(text).map_err(|why| {
                let reason = format!("MEAN_ELEMENT_THEORY '{}': {why}", shorten(text));
                (place, reason)
            })?,
            None if metadata == Metadata::Understood => Theory::default(),
            None => return Err(missing(Key::Theory, start)),
        };
        let number = self.counter(Key::EphemerisType, u32::MAX)?.unwrap_or(0);
        let place = self
            .find(Key::EphemerisType)
            .map_or(start, |(_, place)| place);
        let kind = theory::ephemeris_type(number).map_err(|reason| (place, reason))?;
        Ok((theory, kind))
    }

    fn mean_motion(&self, start: usize) -> At<f64> {
        match (self.find(Key::MeanMotion), self.find(Key::SemiMajorAxis)) {
            (None, Some((_, place))) => {
                let reason = "SEMI_MAJOR_AXIS in place of MEAN_MOTION; SGP4 starts from the mean motion: give that";
                Err((place, reason.to_owned()))
            }
            _ => self.number(Key::MeanMotion, 0.0..=100.0, start),
        }
    }

    fn epoch(&self, start: usize) -> At<Epoch> {
        let (text, place) = self
            .find(Key::Epoch)
            .ok_or_else(|| missing(Key::Epoch, start))?;
        // Space-Track had a blank between date and time.
        let written = text.replacen(' ', "T", 1);
        let epoch = time::parse_ccsds(&written, TimeScale::UTC).ok_or_else(|| {
            let reason = format!(
                "EPOCH '{}' is no UTC time such as 2026-07-11T12:00:00.000000{}",
                shorten(text),
                time::why_not(&written)
            );
            (place, reason)
        })?;
        let Some((more, place)) = self.find(Key::EpochMicroseconds) else {
            return Ok(epoch);
        };
        let microseconds = more.parse().ok().filter(|us: &u32| *us < 1_000_000);
        let has_fraction = text.contains('.');
        let microseconds = microseconds.filter(|us| *us == 0 || !has_fraction);
        let microseconds = microseconds.ok_or_else(|| {
            let reason = format!(
                "EPOCH_MICROSECONDS '{}' with EPOCH '{}': must be 0 to 999999, and the only fraction of a second",
                shorten(more),
                shorten(text)
            );
            (place, reason)
        })?;
        Ok(epoch + Unit::Microsecond * i64::from(microseconds))
    }

    fn number(&self, key: Key, range: RangeInclusive<f64>, start: usize) -> At<f64> {
        let (text, place) = self.find(key).ok_or_else(|| missing(key, start))?;
        let value = decimal(text).filter(|value| range.contains(value));
        value.ok_or_else(|| {
            let (keyword, text) = (KEYWORDS[key as usize], shorten(text));
            let (low, high) = (range.start(), range.end());
            let reason = format!("{keyword} '{text}' is not a number from {low} to {high}");
            (place, reason)
        })
    }

    /// NORAD_CAT_ID, in Alpha-5 too. The keyword is optional (502.0-B-3, Table 4-3): without a number it is that of OBJECT_ID, or 0.
    fn catalogue_number(&self) -> At<u32> {
        let number = self.given_number()?;
        let of_id = || catalogue_number(self.find(Key::Designator)?.0).and_then(assigned);
        let number = assigned(number).or_else(of_id).map_or(number, u32::from);
        Ok(number)
    }

    fn given_number(&self) -> At<u32> {
        let Some((text, _)) = self.find(Key::Number) else {
            return Ok(0);
        };
        match alpha_5(&text.to_ascii_uppercase()) {
            Some(number) if number <= LARGEST_NUMBER => Ok(number),
            None if is_placeholder(text) && !text.parse().is_ok_and(f64::is_finite) => Ok(0),
            _ => Ok(self.counter(Key::Number, LARGEST_NUMBER)?.unwrap_or(0)),
        }
    }

    /// A whole number from 0 to `most`, which `25544.0` is too.
    fn counter(&self, key: Key, most: u32) -> At<Option<u32>> {
        let Some((text, place)) = self.find(key) else {
            return Ok(None);
        };
        let whole = text.strip_suffix(".0").unwrap_or(text);
        let digits = whole.bytes().all(|b| b.is_ascii_digit());
        let value = whole.parse().ok().filter(|value| digits && *value <= most);
        value.map(Some).ok_or_else(|| {
            let (keyword, text) = (KEYWORDS[key as usize], shorten(text));
            let reason = format!("{keyword} '{text}' is not a whole number from 0 to {most}");
            (place, reason)
        })
    }
}

/// The unit that the values of the keyword with this index have (502.0-B, Table 4-3); empty: none.
pub(crate) fn unit_of(index: usize) -> &'static str {
    match KEYWORDS.get(index).copied().unwrap_or_default() {
        "MEAN_MOTION" => "rev/day",
        "SEMI_MAJOR_AXIS" => "km",
        "INCLINATION" | "RA_OF_ASC_NODE" | "ARG_OF_PERICENTER" | "MEAN_ANOMALY" => "deg",
        "BSTAR" => "1/ER",
        "MEAN_MOTION_DOT" => "rev/day**2",
        "MEAN_MOTION_DDOT" => "rev/day**3",
        "BTERM" | "AGOM" => "m**2/kg",
        _ => "",
    }
}

fn missing(key: Key, start: usize) -> (usize, String) {
    (
        start,
        format!("the message has no {}", KEYWORDS[key as usize]),
    )
}

/// A finite number without `inf` and `nan`: `.28098E-4`, `-0.5`, `12`.
fn decimal(text: &str) -> Option<f64> {
    let plain = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E');
    if !text.bytes().all(plain) {
        return None;
    }
    text.parse().ok().filter(|value: &f64| value.is_finite())
}
