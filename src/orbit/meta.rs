//! The metadata of a segment in CCSDS ephemeris messages of orbits (OEM) and attitudes (AEM).

use crate::frames::{Axes, FRAMES};
use crate::record::{At, shorten};
use crate::{bounded_name, lines, time};
use hifitime::{Duration, Epoch, TimeScale};
use std::sync::OnceLock;

/// Largest |UT1 - UTC|, s: leap seconds limit it to 0.9 s, so a larger value has another unit.
const LARGEST_UT1_UTC_S: f64 = 1.0;

/// Remedy where UT1 - UTC is missing; no keyword of these messages holds it.
const GIVE_UT1: &str = "give --ut1-utc SECONDS (IERS Bulletin A has it), or COMMENT UT1-UTC = SECONDS in the file's metadata";

/// UT1 - UTC (s) for files without their own value.
static UT1_UTC_S: OnceLock<f64> = OnceLock::new();

/// Sets UT1 - UTC in s, from -1 to 1, for all files without a comment that gives it. Call it before
/// any file is read. False if it was set before.
///
/// # Errors
///
/// The value is out of range.
pub fn set_ut1_utc(seconds: f64) -> Result<bool, String> {
    if seconds.is_nan() || seconds.abs() > LARGEST_UT1_UTC_S {
        return Err(format!("{seconds}: must be -1 to 1 s"));
    }
    Ok(UT1_UTC_S.set(seconds).is_ok())
}

/// A metadata block: its first line, and its keywords with their lines.
pub(crate) struct Meta {
    pub line: usize,
    pairs: Vec<(String, String, usize)>,
}

/// A time system, for times as text.
#[derive(Clone, Copy)]
pub(crate) enum Clock {
    Scale(TimeScale),
    /// UT1, with UT1 - TAI.
    Ut1(Duration),
}

/// UT1 - UTC at an instant. UT1 - UTC steps with the leap seconds, UT1 - TAI does not.
#[derive(Clone, Copy)]
pub(crate) struct Ut1 {
    /// s, from a comment or the command line.
    utc_s: Option<f64>,
    at: Epoch,
}

impl Ut1 {
    /// UT1 - TAI. Without a value UT1 is taken as UTC.
    fn minus_tai(self) -> Duration {
        time::seconds(self.utc_s.unwrap_or(0.0)) - time::tai_minus_utc(self.at)
    }

    /// A remark where leap seconds lie before `stop`.
    fn step(self, stop: Epoch) -> Option<String> {
        let count = time::leap_seconds(self.at, stop);
        let given_s = self.utc_s.unwrap_or(0.0);
        // Rounded to the resolution of Bulletin A.
        let stop_s = ((given_s + f64::from(count)) * 1e7).round() / 1e7;
        let [at, stop] = [self.at, stop].map(time::utc_text);
        (count != 0).then(|| {
            format!(
                "UT1 - UTC is taken as {given_s} s at {at} and, with {count:+} s of leap seconds, as {stop_s} s at {stop}"
            )
        })
    }
}

impl Clock {
    pub fn read(self, text: &str) -> Option<Epoch> {
        match self {
            Clock::Scale(TimeScale::TDB) => {
                let tdb = time::parse_ccsds(text, TimeScale::TT)?;
                // TDB in place of TT as the argument is off by 2 ms: 1 ps in the result.
                Some(tdb - time::seconds(time::tdb_minus_tt_s(tdb)))
            }
            Clock::Scale(scale) => time::parse_ccsds(text, scale),
            Clock::Ut1(ut1_tai) => Some(time::parse_ccsds(text, TimeScale::TAI)? - ut1_tai),
        }
    }
}

/// Whether a line of a message is read: not blank and no comment, except comments in the metadata,
/// which may give UT1 - UTC.
pub(crate) fn is_significant(line: &str, in_metadata: bool) -> bool {
    let is_comment = || line.split_whitespace().next() == Some("COMMENT");
    !lines::is_comment(line) || in_metadata && is_comment()
}

/// Finds segments whose usable times overlap, against the standards (CCSDS 502.0-B-3, Table 5-3,
/// and 504.0-B-2, Table 4-3: "except for a common end"). Returns the line of the second segment and
/// a remark. Spans are start and stop, ns since 1900 TAI, and a line, in the order of the file.
pub(crate) fn overlap(mut spans: Vec<(i128, i128, usize)>) -> Option<(usize, String)> {
    spans.sort_by_key(|(start, _, _)| *start);
    let mut overlaps = Vec::new();
    let mut last: Option<(i128, usize)> = None;
    for (start, stop, line) in spans {
        if let Some((end, other)) = last.filter(|(end, _)| start < *end) {
            overlaps.push((start, end.min(stop), line.min(other), line.max(other)));
        }
        if last.is_none_or(|(end, _)| stop > end) {
            last = Some((stop, line));
        }
    }
    let (start, stop, first, second) = *overlaps.first()?;
    let [start, stop] = [start, stop].map(|ns| time::utc_text(time::from_tai_ns(ns)));
    let more = match overlaps.len() - 1 {
        0 => String::new(),
        count => format!(" ({count} more overlaps)"),
    };
    let remark = format!(
        "the segments of lines {first} and {second} overlap from {start} to {stop}{more}: the earlier in the file is used there; set \
         USEABLE_START_TIME and USEABLE_STOP_TIME"
    );
    Some((second, remark))
}

impl Meta {
    pub fn new(line: usize) -> Self {
        Meta {
            line,
            pairs: Vec::new(),
        }
    }

    /// Adds a line of text: `KEY = VALUE`, or a comment.
    pub fn add(&mut self, number: usize, line: &str) -> At<()> {
        if let Some(comment) = line.strip_prefix("COMMENT") {
            self.comment(comment, number);
            return Ok(());
        }
        let (key, value) = line
            .split_once('=')
            .ok_or_else(|| (number, format!("'{}' is not KEY = VALUE", shorten(line))))?;
        self.set(key.trim(), value.trim(), number);
        Ok(())
    }

    pub fn set(&mut self, key: &str, value: &str, line: usize) {
        self.pairs.push((key.to_owned(), value.to_owned(), line));
    }

    /// Only a comment with UT1 - UTC is read.
    pub fn comment(&mut self, text: &str, line: usize) {
        if let Some((key, value)) = text.split_once('=')
            && key.trim().eq_ignore_ascii_case("UT1-UTC")
        {
            self.set("UT1-UTC", value.trim(), line);
        }
    }

    /// Refuses a keyword with two different values.
    pub fn check_once(&self) -> At<()> {
        for (index, (key, value, line)) in self.pairs.iter().enumerate() {
            let before = self.pairs.iter().take(index);
            let mut before = before.filter(|(known, other, _)| known == key && other != value);
            if let Some((_, other, _)) = before.next() {
                let [other, value] = [other, value].map(|text| shorten(text));
                let reason = format!("{key} twice: '{other}' and '{value}'; keep one");
                return Err((*line, reason));
            }
        }
        Ok(())
    }

    pub fn find(&self, key: &str) -> Option<(&str, usize)> {
        let pair = self.pairs.iter().find(|(k, _, _)| k == key);
        pair.map(|(_, value, line)| (value.as_str(), *line))
    }

    pub fn need(&self, key: &str) -> At<(&str, usize)> {
        let found = self.find(key).filter(|(value, _)| !value.is_empty());
        found.ok_or_else(|| (self.line, format!("the metadata have no {key}")))
    }

    /// A keyword of the object. An empty value counts as unknown.
    pub fn object(&self, key: &str) -> At<String> {
        let missing = || (self.line, format!("the metadata have no {key}"));
        let (text, _) = self.find(key).ok_or_else(missing)?;
        Ok(match bounded_name(text) {
            none if none.is_empty() => "UNKNOWN".to_owned(),
            text => text,
        })
    }

    /// UT1 - UTC in s from a comment.
    fn ut1_utc_s(&self) -> At<Option<f64>> {
        let Some((text, line)) = self.find("UT1-UTC") else {
            return Ok(None);
        };
        let number = text.trim_end_matches("[s]").trim_end_matches('s').trim();
        let value = number.parse().ok();
        let value = value.filter(|value: &f64| value.abs() <= LARGEST_UT1_UTC_S);
        value.map(Some).ok_or_else(|| {
            let text = shorten(text);
            (
                line,
                format!("UT1-UTC '{text}' is not a number of seconds from -1 to 1"),
            )
        })
    }

    /// Whether times or axes depend on UT1.
    fn uses_ut1(&self) -> At<bool> {
        let is_fixed = |key| {
            let axes = self
                .find(key)
                .and_then(|(name, _)| Axes::named(name, Duration::ZERO));
            matches!(axes, Some(Axes::EarthFixed { .. }))
        };
        let mut keys = ["REF_FRAME", "REF_FRAME_A", "REF_FRAME_B"].into_iter();
        Ok(self.scale()?.is_none() || keys.any(is_fixed))
    }

    /// UT1 - UTC for a segment. The value of a comment, or 0, applies at the segment's START_TIME.
    /// That of the command line applies at the START_TIME of the first segment of the file that
    /// uses UT1, which is stored in `first`.
    pub fn ut1(&self, first: &mut Option<Epoch>) -> At<Ut1> {
        // UT1 is read as UTC here: only the side of a leap second on which the start lies matters.
        let scale = self.scale()?.unwrap_or(TimeScale::UTC);
        let start = self.epoch(Clock::Scale(scale), "START_TIME")?;
        let comment_s = self.ut1_utc_s()?;
        if !self.uses_ut1()? {
            return Ok(Ut1 {
                utc_s: None,
                at: start,
            });
        }
        let first = *first.get_or_insert(start);
        let (utc_s, at) = match (comment_s, UT1_UTC_S.get().copied()) {
            (None, Some(option_s)) => (Some(option_s), first),
            (comment_s, _) => (comment_s, start),
        };
        let start_s = utc_s.unwrap_or(0.0) + f64::from(time::leap_seconds(at, start));
        if start_s.abs() > LARGEST_UT1_UTC_S {
            let (_, line) = self.need("START_TIME")?;
            let at = time::utc_text(at);
            let reason = format!(
                "--ut1-utc holds at {at}, the first START_TIME of the file with times or axes of UT1; after the leap seconds since then UT1 - UTC would be {start_s:.1} s here, outside -1 to 1 s; \
                 give COMMENT UT1-UTC = SECONDS in the metadata of this segment"
            );
            return Err((line, reason));
        }
        Ok(Ut1 { utc_s, at })
    }

    /// The scale of TIME_SYSTEM; none for UT1.
    fn scale(&self) -> At<Option<TimeScale>> {
        let (name, line) = self.need("TIME_SYSTEM")?;
        Ok(Some(match name.to_ascii_uppercase().as_str() {
            "UTC" => TimeScale::UTC,
            "TAI" => TimeScale::TAI,
            "TT" => TimeScale::TT,
            "GPS" => TimeScale::GPST,
            "TDB" => TimeScale::TDB,
            "UT1" => return Ok(None),
            _ => {
                let known = "UTC, TAI, TT, GPS, TDB and UT1: give the times in one of them";
                let reason = format!("TIME_SYSTEM '{}'; expected {known}", shorten(name));
                return Err((line, reason));
            }
        }))
    }

    pub fn clock(&self, ut1: Ut1) -> At<Clock> {
        let (_, line) = self.need("TIME_SYSTEM")?;
        Ok(match (self.scale()?, ut1.utc_s) {
            (Some(scale), _) => Clock::Scale(scale),
            (None, Some(_)) => Clock::Ut1(ut1.minus_tai()),
            (None, None) => {
                let reason = "TIME_SYSTEM UT1 needs UT1 - UTC: as UTC it would move a low orbit by up to 7 km";
                let reason = format!("{reason}; {GIVE_UT1}, or give the times in UTC");
                return Err((line, reason));
            }
        })
    }

    fn epoch(&self, clock: Clock, key: &str) -> At<Epoch> {
        let (text, line) = self.need(key)?;
        clock.read(text).ok_or_else(|| {
            let why = time::why_not(text);
            let text = shorten(text);
            (line, format!("{key} '{text}' is not a time{why}"))
        })
    }

    /// USEABLE_START_TIME to USEABLE_STOP_TIME; START_TIME and STOP_TIME where they are missing.
    pub fn span(&self, clock: Clock) -> At<(Epoch, Epoch)> {
        let of = |key: &str, useable: &str| {
            let whole = self.epoch(clock, key)?;
            let part = self.find(useable).map(|_| self.epoch(clock, useable));
            Ok(part.transpose()?.unwrap_or(whole))
        };
        let start = of("START_TIME", "USEABLE_START_TIME")?;
        Ok((start, of("STOP_TIME", "USEABLE_STOP_TIME")?))
    }

    /// A remark on leap seconds up to `stop`, where times or axes depend on UT1.
    pub fn ut1_step(&self, ut1: Ut1, stop: Epoch) -> At<Option<String>> {
        let uses_ut1 = self.uses_ut1()?;
        Ok(ut1.step(stop).filter(|_| uses_ut1))
    }

    /// The axes that a keyword names, and a remark on assumptions.
    pub fn axes(&self, key: &str, ut1: Ut1) -> At<(Axes, Option<String>)> {
        let (name, line) = self.need(key)?;
        let axes = Axes::named(name, ut1.minus_tai()).ok_or_else(|| {
            let remedy = "give the data in one of them, GCRF at best";
            (
                line,
                format!("{key} '{}'; expected {FRAMES}: {remedy}", shorten(name)),
            )
        })?;
        let epoch = self
            .find("REF_FRAME_EPOCH")
            .filter(|(text, _)| !text.is_empty());
        if let Some((epoch, line)) = epoch
            && axes.are_of_date()
        {
            let epoch = shorten(epoch);
            let reason = format!(
                "REF_FRAME_EPOCH '{epoch}' with {key} {name}: axes of a fixed epoch are not read, and axes of date differ from them by tens of \
                 km at 7,000 km; give the data in GCRF, or in {name} of date without REF_FRAME_EPOCH"
            );
            return Err((line, reason));
        }
        let is_assumed = matches!(axes, Axes::EarthFixed { .. }) && ut1.utc_s.is_none();
        let remark = is_assumed.then(|| {
            format!(
                "{key} {name} without Earth-orientation data: UT1 is taken as UTC, which turns it by up to 13.5 arcsec (460 m at 7,000 km \
                 from the Earth's centre, 2.8 km at the geostationary belt), and the pole's motion is left out (0.6 arcsec, 20 m and 120 m); \
                 {GIVE_UT1}, or give the data in GCRF"
            )
        });
        Ok((axes, remark))
    }
}
