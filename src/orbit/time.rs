//! Epochs as orbit files write them, exact to the nanosecond.

use crate::frames::DAY_NS;
use hifitime::{Duration, Epoch, TimeScale, Unit};

/// Reads a CCSDS ASCII time, code A `YYYY-MM-DDThh:mm:ss[.d..]` or code B
/// `YYYY-DDDThh:mm:ss[.d..]`, with or without a closing `Z` (CCSDS 301.0-B,
/// section 3.5). Digits past the nanosecond are dropped.
pub(crate) fn parse_ccsds(text: &str, scale: TimeScale) -> Option<Epoch> {
    let text = text.strip_suffix('Z').unwrap_or(text);
    let (date, clock) = text.split_once('T')?;
    let (year, day) = date.split_once('-')?;
    let year: i32 = digits(year, 4)?;
    let (month, day) = match day.split_once('-') {
        Some((month, day)) => (digits(month, 2)?, digits(day, 2)?),
        None => month_and_day(year, digits(day, 3)?)?,
    };

    let mut clock = clock.splitn(3, ':');
    let hour: u8 = digits(clock.next()?, 2)?;
    let minute: u8 = digits(clock.next()?, 2)?;
    let seconds = clock.next()?;
    let (second, fraction) = seconds.split_once('.').unwrap_or((seconds, ""));
    let second: u8 = digits(second, 2)?;
    let nanoseconds = u32::try_from(scaled_fraction(fraction, 1_000_000_000)?).ok()?;
    if hour > 23 {
        return None;
    }

    let epoch =
        Epoch::maybe_from_gregorian(year, month, day, hour, minute, second, nanoseconds, scale)
            .ok()?
            .to_time_scale(TimeScale::TAI);
    // hifitime gives 23:59:60 the instant of 23:59:59
    let leap = if second == 60 { 1 } else { 0 };
    Some(epoch + leap * Unit::Second)
}

/// The UTC epoch of a TLE: two-digit year (57 to 99 are 19xx) and day of the
/// year, 1.0 being 1 January 00:00, with its fraction as decimal digits.
pub(crate) fn from_tle(year: u8, day: u16, fraction: &str) -> Option<Epoch> {
    let year = i32::from(year) + if year < 57 { 2000 } else { 1900 };
    let (month, day) = month_and_day(year, day)?;
    let midnight = Epoch::maybe_from_gregorian_utc(year, month, day, 0, 0, 0, 0).ok()?;
    let of_day = scaled_fraction(fraction, DAY_NS)?;
    Some(midnight.to_time_scale(TimeScale::TAI) + Duration::from_total_nanoseconds(of_day))
}

/// The epoch a number of nanoseconds after 1900-01-01T00:00 TAI.
pub(crate) fn from_tai_ns(ns: i128) -> Epoch {
    Epoch::from_tai_duration(Duration::from_total_nanoseconds(ns))
}

/// `0.fraction * unit`, rounded down; the fraction is a string of decimal digits.
fn scaled_fraction(fraction: &str, unit: i128) -> Option<i128> {
    if !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    // 15 digits of a day are 86 ps
    let kept = &fraction[..fraction.len().min(15)];
    let value: i128 = if kept.is_empty() {
        0
    } else {
        kept.parse().ok()?
    };
    Some(value * unit / 10_i128.pow(kept.len() as u32))
}

fn month_and_day(year: i32, day_of_year: u16) -> Option<(u8, u8)> {
    let leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let february = if leap { 29 } else { 28 };
    let mut left = day_of_year.checked_sub(1)?;
    for (month, length) in (1..).zip([31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31]) {
        if left < length {
            return Some((month, left as u8 + 1));
        }
        left -= length;
    }
    None
}

/// An unsigned number written with exactly `count` digits.
fn digits<T: std::str::FromStr>(text: &str, count: usize) -> Option<T> {
    let all_digits = text.len() == count && text.bytes().all(|b| b.is_ascii_digit());
    if all_digits { text.parse().ok() } else { None }
}
