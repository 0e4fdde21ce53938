//! CCSDS Orbit Mean-Elements Messages (502.0-B, section 4): one set of keywords, and one reader for
//! each of four notations.
//!
//! CelesTrak and Space-Track give the same keywords in KVN, XML, JSON and CSV. Their JSON and CSV
//! may lack centre, frame, time system and theory. The defaults are the Earth, TEME, UTC and SGP4.

pub(crate) mod csv;
pub(crate) mod json;
pub(crate) mod kvn;
pub(crate) mod xml;

use crate::catalogue_number::alpha_5;
use crate::catalogue_number::{assigned, catalogue_number};
use crate::elements::Elements;
use crate::record::{At, Record, check_version, long_designator, shorten};
use crate::theory::{self, Theory};
use crate::units::{DEGREE, REV_PER_DAY};
use crate::{bounded_name, is_placeholder, time};
use hifitime::{Epoch, TimeScale, Unit};
use std::borrow::Cow;
use std::ops::RangeInclusive;

const LARGEST_NUMBER: u32 = 999_999_999;

/// The supported keywords; others are skipped.
#[derive(Clone, Copy, PartialEq)]
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
    /// Drag of SGP4-XP; the next is its solar radiation pressure.
    BallisticTerm,
    RadiationTerm,
    /// Fraction of EPOCH in older API classes of Space-Track; the next is their OBJECT_ID.
    EpochMicroseconds,
    OldDesignator,
    /// Refused with TEME: SGP4 gives TEME of date.
    FrameEpoch,
    /// In JSON and CSV; KVN and XML begin with it.
    Version,
}

/// The keyword of each key and the unit of its values (502.0-B, Table 4-3), in the order of
/// [`Key`].
const KEYWORDS: [(Key, &str, &str); 28] = [
    (Key::Name, "OBJECT_NAME", ""),
    (Key::Designator, "OBJECT_ID", ""),
    (Key::Centre, "CENTER_NAME", ""),
    (Key::Frame, "REF_FRAME", ""),
    (Key::TimeSystem, "TIME_SYSTEM", ""),
    (Key::Theory, "MEAN_ELEMENT_THEORY", ""),
    (Key::Epoch, "EPOCH", ""),
    (Key::MeanMotion, "MEAN_MOTION", "rev/day"),
    (Key::SemiMajorAxis, "SEMI_MAJOR_AXIS", "km"),
    (Key::Eccentricity, "ECCENTRICITY", ""),
    (Key::Inclination, "INCLINATION", "deg"),
    (Key::Node, "RA_OF_ASC_NODE", "deg"),
    (Key::Perigee, "ARG_OF_PERICENTER", "deg"),
    (Key::MeanAnomaly, "MEAN_ANOMALY", "deg"),
    (Key::EphemerisType, "EPHEMERIS_TYPE", ""),
    (Key::Classification, "CLASSIFICATION_TYPE", ""),
    (Key::Number, "NORAD_CAT_ID", ""),
    (Key::ElementSet, "ELEMENT_SET_NO", ""),
    (Key::Revolution, "REV_AT_EPOCH", ""),
    (Key::Drag, "BSTAR", "1/ER"),
    (Key::MeanMotionDot, "MEAN_MOTION_DOT", "rev/day**2"),
    (Key::MeanMotionDdot, "MEAN_MOTION_DDOT", "rev/day**3"),
    (Key::BallisticTerm, "BTERM", "m**2/kg"),
    (Key::RadiationTerm, "AGOM", "m**2/kg"),
    (Key::EpochMicroseconds, "EPOCH_MICROSECONDS", ""),
    (Key::OldDesignator, "INTLDES", ""),
    (Key::FrameEpoch, "REF_FRAME_EPOCH", ""),
    (Key::Version, "CCSDS_OMM_VERS", ""),
];

/// Keys of mean elements. A JSON object without any of them has no elements in keywords.
const ELEMENTS: [Key; 4] = [
    Key::MeanMotion,
    Key::Eccentricity,
    Key::Inclination,
    Key::MeanAnomaly,
];

impl Key {
    pub fn of(keyword: &str) -> Option<Key> {
        let row = KEYWORDS.iter().find(|(_, known, _)| *known == keyword);
        row.map(|(key, ..)| *key)
    }

    pub fn keyword(self) -> &'static str {
        KEYWORDS[self as usize].1
    }

    /// Empty for a key without a unit.
    pub fn unit(self) -> &'static str {
        KEYWORDS[self as usize].2
    }
}

/// The values of one message, each with its location: a line in KVN and CSV, else an offset.
pub(crate) struct Fields<'a> {
    /// Location of the message.
    start: usize,
    /// Whether the metadata are required, as by the standard.
    needs_metadata: bool,
    values: [Option<(Cow<'a, str>, usize)>; KEYWORDS.len()],
    /// The first error in the message, and its location.
    wrong: Option<(usize, String)>,
}

impl<'a> Fields<'a> {
    pub fn new(start: usize, needs_metadata: bool) -> Self {
        Fields {
            start,
            needs_metadata,
            values: Default::default(),
            wrong: None,
        }
    }

    /// Sets a value, once for each key. An empty value counts as missing.
    pub fn set(&mut self, key: Key, value: Cow<'a, str>, location: usize) {
        if value.trim().is_empty() {
            return;
        }
        if let Some((first, _)) = self.find(key) {
            let [first, second] = [first, value.trim()].map(shorten);
            let reason = format!("{} twice: '{first}' and '{second}'", key.keyword());
            return self.refuse(location, reason);
        }
        self.values[key as usize] = Some((value, location));
    }

    /// Refuses a unit other than that of the key.
    pub fn check_unit(&mut self, key: Key, unit: &str, location: usize) {
        let (unit, wanted) = (unit.trim(), key.unit());
        if unit.eq_ignore_ascii_case(wanted) {
            return;
        }
        let known = match wanted {
            "" => "it has no unit".to_owned(),
            _ => format!("only {wanted} is read"),
        };
        let reason = format!("{} in '{}'; {known}", key.keyword(), shorten(unit));
        self.refuse(location, reason);
    }

    /// Refuses the message; the first reason counts.
    pub fn refuse(&mut self, location: usize, reason: String) {
        self.wrong.get_or_insert((location, reason));
    }

    /// Whether every required key has a value.
    pub fn are_complete(&self) -> bool {
        let others = [Key::Epoch, Key::Node, Key::Perigee, Key::Drag];
        ELEMENTS.iter().chain(&others).all(|key| self.has(*key))
    }

    pub fn has_any_element(&self) -> bool {
        ELEMENTS.iter().any(|key| self.has(*key))
    }

    pub fn has(&self, key: Key) -> bool {
        self.values[key as usize].is_some()
    }

    /// The record. Errors have the location of the value, or of the message.
    pub fn record(&self) -> At<Record> {
        self.read().map_err(|(location, reason)| {
            let value = |key| self.find(key).map(|(text, _)| shorten(text));
            let number = value(Key::Number).map(|number| format!("NORAD_CAT_ID {number}"));
            let object: Vec<String> = value(Key::Name).into_iter().chain(number).collect();
            if object.is_empty() {
                (location, reason)
            } else {
                (location, format!("{reason} ({})", object.join(", ")))
            }
        })
    }

    fn read(&self) -> At<Record> {
        if let Some(wrong) = &self.wrong {
            return Err(wrong.clone());
        }
        if let Some((text, location)) = self.find(Key::Version) {
            check_version(Key::Version.keyword(), text).map_err(|why| (location, why))?;
        }
        self.is_one_of(Key::Centre, &["EARTH"])?;
        // TEMEOFDATE is the frame's name in the SANA registry.
        self.is_one_of(Key::Frame, &["TEME", "TEMEOFDATE"])?;
        self.is_one_of(Key::TimeSystem, &["UTC"])?;
        if let Some((text, location)) = self.find(Key::FrameEpoch) {
            let text = shorten(text);
            let remedy = "SGP4 has TEME of date; fetch the elements without it";
            return Err((location, format!("REF_FRAME_EPOCH '{text}': {remedy}")));
        }
        let (theory, ephemeris_type) = self.theory()?;
        let angle = |key| Ok(self.number(key, -360.0..=360.0)? * DEGREE);
        let elements = Elements {
            eccentricity: self.number(Key::Eccentricity, 0.0..=1.0)?,
            inclination: self.number(Key::Inclination, 0.0..=180.0)? * DEGREE,
            norad: self.catalogue_number()?,
            epoch: self.epoch()?,
            node: angle(Key::Node)?,
            perigee: angle(Key::Perigee)?,
            mean_anomaly: angle(Key::MeanAnomaly)?,
            mean_motion: self.mean_motion()? * REV_PER_DAY,
            drag: self.number(Key::Drag, -1e9..=1e9)?,
        };
        elements
            .orbit()
            .map_err(|error| (self.start, error.to_string()))?;
        let optional = |key| {
            if self.has(key) {
                self.number(key, -1e9..=1e9)
            } else {
                Ok(0.0)
            }
        };
        let text = |key| self.find(key).map_or("", |(text, _)| text);
        let designator = match text(Key::Designator) {
            none if is_placeholder(none) => text(Key::OldDesignator),
            given => given,
        };
        Ok(Record {
            line: self.start,
            name: bounded_name(text(Key::Name)),
            designator: long_designator(&bounded_name(designator)),
            classification: text(Key::Classification).chars().next().unwrap_or('U'),
            ephemeris_type,
            theory,
            element_set: self.counter(Key::ElementSet, u32::MAX)?,
            revolution: self.counter(Key::Revolution, u32::MAX)?,
            mean_motion_dot: optional(Key::MeanMotionDot)?,
            mean_motion_ddot: optional(Key::MeanMotionDdot)?,
            elements,
        })
    }

    fn find(&self, key: Key) -> Option<(&str, usize)> {
        let field = self.values[key as usize].as_ref();
        field.map(|(text, location)| (text.trim(), *location))
    }

    fn need(&self, key: Key) -> At<(&str, usize)> {
        let missing = || (self.start, format!("the message has no {}", key.keyword()));
        self.find(key).ok_or_else(missing)
    }

    /// Checks a value of the metadata, where it is given or required.
    fn is_one_of(&self, key: Key, wanted: &[&str]) -> At<()> {
        if !self.has(key) && !self.needs_metadata {
            return Ok(());
        }
        let (text, location) = self.need(key)?;
        if wanted.iter().any(|word| word.eq_ignore_ascii_case(text)) {
            return Ok(());
        }
        let (keyword, text) = (key.keyword(), shorten(text));
        Err((
            location,
            format!("{keyword} '{text}'; only {} is read", wanted[0]),
        ))
    }

    fn theory(&self) -> At<(Theory, u8)> {
        let of_xp = self
            .find(Key::BallisticTerm)
            .or(self.find(Key::RadiationTerm));
        if let Some((_, location)) = of_xp {
            return Err((location, theory::SGP4_XP.to_owned()));
        }
        let mut theory = Theory::default();
        if self.has(Key::Theory) || self.needs_metadata {
            let (text, location) = self.need(Key::Theory)?;
            theory = Theory::parse(text).map_err(|why| {
                (
                    location,
                    format!("MEAN_ELEMENT_THEORY '{}': {why}", shorten(text)),
                )
            })?;
        }
        let number = self.counter(Key::EphemerisType, u32::MAX)?;
        let location = self
            .find(Key::EphemerisType)
            .map_or(self.start, |(_, location)| location);
        let kind = theory::ephemeris_type(number).map_err(|reason| (location, reason))?;
        Ok((theory, kind))
    }

    fn mean_motion(&self) -> At<f64> {
        if let (false, Some((_, location))) =
            (self.has(Key::MeanMotion), self.find(Key::SemiMajorAxis))
        {
            let reason = "SEMI_MAJOR_AXIS in place of MEAN_MOTION; SGP4 starts from the mean motion: \
                          give that";
            return Err((location, reason.to_owned()));
        }
        self.number(Key::MeanMotion, 0.0..=100.0)
    }

    fn epoch(&self) -> At<Epoch> {
        let (text, location) = self.need(Key::Epoch)?;
        // Older files of Space-Track have a blank between date and time.
        let written = text.replacen(' ', "T", 1);
        let epoch = time::parse_ccsds(&written, TimeScale::UTC).ok_or_else(|| {
            let (text, why) = (shorten(text), time::why_not(&written));
            let example = "2026-07-11T12:00:00.000000";
            (
                location,
                format!("EPOCH '{text}' is no UTC time such as {example}{why}"),
            )
        })?;
        let Some((more, location)) = self.find(Key::EpochMicroseconds) else {
            return Ok(epoch);
        };
        let has_fraction = text.contains('.');
        let microseconds = more.parse().ok().filter(|us: &u32| *us < 1_000_000);
        let microseconds = microseconds
            .filter(|us| *us == 0 || !has_fraction)
            .ok_or_else(|| {
                let (more, text) = (shorten(more), shorten(text));
                let rule = "must be 0 to 999999, and the only fraction of a second";
                (
                    location,
                    format!("EPOCH_MICROSECONDS '{more}' with EPOCH '{text}': {rule}"),
                )
            })?;
        Ok(epoch + Unit::Microsecond * i64::from(microseconds))
    }

    fn number(&self, key: Key, range: RangeInclusive<f64>) -> At<f64> {
        let (text, location) = self.need(key)?;
        // `parse` also accepts `inf` and `nan`.
        let plain = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E');
        let value = text.parse().ok().filter(|value| range.contains(value));
        value.filter(|_| text.bytes().all(plain)).ok_or_else(|| {
            let (keyword, text) = (key.keyword(), shorten(text));
            let (low, high) = (range.start(), range.end());
            (
                location,
                format!("{keyword} '{text}' is not a number from {low} to {high}"),
            )
        })
    }

    /// NORAD_CAT_ID, also in Alpha-5. The keyword is optional (502.0-B-3, Table 4-3); without it
    /// the number in OBJECT_ID, or 0.
    fn catalogue_number(&self) -> At<u32> {
        let number = self.given_number()?;
        let of_id = || catalogue_number(self.find(Key::Designator)?.0).and_then(assigned);
        Ok(assigned(number).or_else(of_id).map_or(number, u32::from))
    }

    fn given_number(&self) -> At<u32> {
        let text = self.find(Key::Number).map_or("", |(text, _)| text);
        match alpha_5(&text.to_ascii_uppercase()) {
            Some(number) if number <= LARGEST_NUMBER => Ok(number),
            None if is_placeholder(text) && !text.parse().is_ok_and(f64::is_finite) => Ok(0),
            _ => self.counter(Key::Number, LARGEST_NUMBER),
        }
    }

    /// A whole number from 0 to `max`, or `25544.0`; 0 where it is missing.
    fn counter(&self, key: Key, max: u32) -> At<u32> {
        let Some((text, location)) = self.find(key) else {
            return Ok(0);
        };
        let whole = text.strip_suffix(".0").unwrap_or(text);
        let is_whole = whole.bytes().all(|b| b.is_ascii_digit());
        let value = whole.parse().ok().filter(|value| is_whole && *value <= max);
        value.ok_or_else(|| {
            let (keyword, text) = (key.keyword(), shorten(text));
            (
                location,
                format!("{keyword} '{text}' is not a whole number from 0 to {max}"),
            )
        })
    }
}
