//! Epochs as text, exact to the nanosecond.

use hifitime::{Duration, Epoch, TimeScale, Unit};

/// Nanoseconds from hifitime's origin 1900-01-01T00:00 to 2000-01-01T12:00.
pub(crate) const J2000_NS: i128 = 36_524 * DAY_NS + DAY_NS / 2;
/// Nanoseconds in a day of 86,400 s.
pub(crate) const DAY_NS: i128 = 86_400_000_000_000;
/// Nanoseconds of a second.
const SECOND_NS: i128 = 1_000_000_000;

/// `s` seconds to the nearest nanosecond (hifitime truncates); 0 for NaN, saturating.
pub fn seconds(s: f64) -> Duration {
    let whole = (s.trunc() as i128).saturating_mul(SECOND_NS);
    let rest = (s.fract() * SECOND_NS as f64).round() as i128;
    Duration::from_total_nanoseconds(whole.saturating_add(rest))
}

/// TAI - UTC; a leap second has the value of the second before it.
pub(crate) fn tai_minus_utc(epoch: Epoch) -> Duration {
    let utc = utc_duration(in_whole_seconds(epoch).0);
    Epoch::from_utc_duration(utc).to_tai_duration() - utc
}

/// Leap seconds between two instants: the increase of TAI - UTC.
pub fn leap_seconds(from: Epoch, to: Epoch) -> i32 {
    (tai_minus_utc(to) - tai_minus_utc(from))
        .to_seconds()
        .round() as i32
}

/// TDB - TT at the Earth's centre, s, within 10 us from 1900 to 2100 (USNO Circular 179, Eq. 2.6;
/// hifitime's is off by up to 36 us): `sum of a sin(w T + p) + 1e-5 T sin(628.3076 T + 4.2490)`, T
/// Julian centuries of TT since J2000.0.
pub(crate) fn tdb_minus_tt_s(tt: Epoch) -> f64 {
    /// a (s), w (rad/century), p (rad).
    const TERMS: [[f64; 3]; 6] = [
        [1.657e-3, 628.3076, 6.2401],
        [2.2e-5, 575.3385, 4.2970],
        [1.4e-5, 1256.6152, 6.1969],
        [5e-6, 606.9777, 4.0212],
        [5e-6, 52.9691, 0.4444],
        [2e-6, 21.3299, 5.5431],
    ];
    let ns = tt.to_tt_duration().total_nanoseconds() - J2000_NS;
    let t = ns as f64 / (36_525.0 * DAY_NS as f64);
    let terms = TERMS.iter().map(|[a, w, p]| a * libm::sin(w * t + p));
    terms.sum::<f64>() + 1e-5 * t * libm::sin(628.3076 * t + 4.2490)
}

/// Reads a CCSDS ASCII time, code A `YYYY-MM-DDThh:mm:ss[.d..]` or code B
/// `YYYY-DDDThh:mm:ss[.d..]`, with or without a final `Z` (CCSDS 301.0-B, section 3.5). Digits
/// after the nanosecond are dropped.
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
    let nanoseconds = scaled_fraction(fraction, SECOND_NS)?;
    if hour > 23 {
        return None;
    }

    // hifitime finds leap seconds by rounded seconds, which are exact without a fraction.
    let epoch = Epoch::maybe_from_gregorian(year, month, day, hour, minute, second, 0, scale)
        .ok()?
        .to_time_scale(TimeScale::TAI);
    // hifitime gives 23:59:60 the instant of 23:59:59.
    let leap = i64::from(second == 60);
    Some(epoch + leap * Unit::Second + Duration::from_total_nanoseconds(nanoseconds))
}

/// Reads a UTC time such as `2019-06-15T23:35:50.500Z`, also in a leap second.
///
/// # Errors
///
/// The expected form, and the fault where it is known.
pub fn parse_utc(text: &str) -> Result<Epoch, String> {
    parse_ccsds(text.trim(), TimeScale::UTC).ok_or_else(|| {
        let why = why_not(text);
        format!("{text:?} is no UTC time such as 2019-06-15T23:35:50.500Z{why}")
    })
}

/// The fault of an unreadable time, after a colon; empty where it is unknown.
pub(crate) fn why_not(text: &str) -> String {
    let text = text.trim();
    let why = match text.split_once('T') {
        None => Some("a T stands between date and time".to_owned()),
        Some((_, clock)) if clock.contains(['+', '-']) => {
            Some("offsets from UTC are not read: take it off, and write the time in UTC".to_owned())
        }
        Some((_, clock)) => no_such_day(text).or_else(|| no_such_time(clock).map(str::to_owned)),
    };
    why.map_or(String::new(), |why| format!(": {why}"))
}

/// The fault of a time of day with the right form.
fn no_such_time(clock: &str) -> Option<&'static str> {
    let clock = clock.strip_suffix('Z').unwrap_or(clock);
    let mut parts = clock.splitn(3, ':');
    let hour: u8 = digits(parts.next()?, 2)?;
    let (Some(minute), Some(second)) = (parts.next(), parts.next()) else {
        return Some("a time of day has hours, minutes and seconds");
    };
    let minute: u8 = digits(minute, 2)?;
    let second: u8 = digits(second.split('.').next()?, 2)?;
    match (hour, minute, second) {
        (24.., ..) => Some("hours are 00 to 23, and a day ends at 00:00:00 of the next"),
        (_, 60.., _) => Some("minutes are 00 to 59"),
        (.., 61..) => Some("seconds are 00 to 59, and 60 in a leap second"),
        (.., 60) => Some("there was no leap second then"),
        _ => None,
    }
}

/// The fault of a date with the right form.
fn no_such_day(text: &str) -> Option<String> {
    let (date, _) = text.split_once('T')?;
    let (year, day) = date.split_once('-')?;
    let year: i32 = digits(year, 4)?;
    let months = month_lengths(year);
    let (span, day, days) = match day.split_once('-') {
        None => (format!("{year}"), digits(day, 3)?, months.iter().sum()),
        Some((month, day)) => {
            let (month, day) = (digits::<usize>(month, 2)?, digits(day, 2)?);
            match months.get(month.wrapping_sub(1)) {
                None => return Some(format!("there is no month {month:02}")),
                Some(days) => (format!("{year}-{month:02}"), day, *days),
            }
        }
    };
    let is_valid = (1..=days).contains(&day);
    (!is_valid).then(|| format!("{span} has days 1 to {days}"))
}

/// UTC since 1900-01-01T00:00, in days of 86,400 s; a leap second counts as the second before it.
/// hifitime's own result is 1 s early during the last TAI - UTC seconds before a leap second.
pub fn utc_duration(epoch: Epoch) -> Duration {
    let (whole, fraction) = in_whole_seconds(epoch);
    #[allow(clippy::disallowed_methods)]
    let utc = whole.to_utc_duration();
    let later = utc + Unit::Second * 1;
    let is_later = Epoch::from_utc_duration(later).to_tai_duration() <= whole.to_tai_duration();
    fraction + if is_later { later } else { utc }
}

/// Days of UTC since 2000-01-01T12:00, each of 86,400 s.
pub fn utc_days_since_j2000(epoch: Epoch) -> f64 {
    let ns = utc_duration(epoch).total_nanoseconds() - J2000_NS;
    ns as f64 / DAY_NS as f64
}

/// Modified Julian date of UTC, where a day with a leap second has 86,401 s (SOFA, `iauDtf2d`:
/// "quasi-JD").
pub fn utc_mjd(epoch: Epoch) -> f64 {
    /// MJD of 1900-01-01.
    const MJD_1900: i128 = 15_020;
    let day = utc_duration(epoch).total_nanoseconds().div_euclid(DAY_NS);
    let [start, end] = [day, day + 1].map(|day| {
        Epoch::from_utc_duration(Duration::from_total_nanoseconds(day * DAY_NS)).to_tai_duration()
    });
    // hifitime's UTC steps by 10 s at 1972: earlier days have 86,400 s.
    let length_s = match (end - start).to_seconds() {
        86_402.0.. => 86_400.0,
        length_s => length_s,
    };
    let part = (epoch.to_tai_duration() - start).to_seconds() / length_s;
    (day + MJD_1900) as f64 + part
}

/// An epoch in whole TAI seconds, where hifitime's leap seconds are exact, and the fraction.
fn in_whole_seconds(epoch: Epoch) -> (Epoch, Duration) {
    let ns = epoch.to_tai_duration().total_nanoseconds();
    let fraction = ns.rem_euclid(SECOND_NS);
    let whole = from_tai_ns(ns - fraction);
    (whole, Duration::from_total_nanoseconds(fraction))
}

/// UTC text of an epoch with all its decimals, at least three; a leap second is 60.
pub fn utc_text(epoch: Epoch) -> String {
    let (whole, fraction) = in_whole_seconds(epoch);
    #[allow(clippy::disallowed_methods)]
    let (year, month, day, hour, minute, second, _) = whole.to_gregorian_utc();
    let read_back = Epoch::maybe_from_gregorian_utc(year, month, day, hour, minute, second, 0);
    // hifitime prints a leap second as the second before it.
    let leap = read_back
        .is_ok_and(|epoch| whole - epoch.to_time_scale(TimeScale::TAI) >= Unit::Second * 1);
    let second = second + u8::from(leap);
    let fraction = format!("{:09}", fraction.total_nanoseconds());
    let decimals = fraction.trim_end_matches('0').len().max(3);
    format!(
        "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{}Z",
        &fraction[..decimals]
    )
}

/// The UTC epoch of a TLE: two-digit year (57 to 99 are 19xx), day of the year (1 January is 1),
/// and the decimal digits of its fraction.
pub(crate) fn from_tle(year: u8, day: u16, fraction: &str) -> Option<Epoch> {
    let year = i32::from(year) + if year < 57 { 2000 } else { 1900 };
    month_and_day(year, day)?;
    // Days since 1900; every fourth year from 1904 on is a leap year. Faster than by a date.
    let days = 365 * (year - 1900) + (year - 1901) / 4 + i32::from(day) - 1;
    let midnight = Epoch::from_utc_duration(Unit::Day * i64::from(days));
    let of_day = scaled_fraction(fraction, DAY_NS)?;
    Some(midnight.to_time_scale(TimeScale::TAI) + Duration::from_total_nanoseconds(of_day))
}

/// Nanoseconds since 1900-01-01T00:00 TAI.
pub(crate) fn tai_ns(epoch: Epoch) -> i128 {
    epoch.to_tai_duration().total_nanoseconds()
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
    // 15 digits of a day are 86 ps.
    let digits = &fraction[..fraction.len().min(15)];
    let value: i128 = format!("0{digits}").parse().ok()?;
    Some(value * unit / 10_i128.pow(digits.len() as u32))
}

fn month_and_day(year: i32, day_of_year: u16) -> Option<(u8, u8)> {
    let mut left = day_of_year.checked_sub(1)?;
    for (month, length) in (1..).zip(month_lengths(year)) {
        if left < length {
            return Some((month, left as u8 + 1));
        }
        left -= length;
    }
    None
}

/// Lengths of the months, days.
fn month_lengths(year: i32) -> [u16; 12] {
    let leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let february = if leap { 29 } else { 28 };
    [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31]
}

/// An unsigned number with exactly `count` digits.
fn digits<T: std::str::FromStr>(text: &str, count: usize) -> Option<T> {
    let all_digits = text.len() == count && text.bytes().all(|b| b.is_ascii_digit());
    text.parse().ok().filter(|_| all_digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leap_seconds_are_read_and_written() {
        for text in [
            "2016-12-31T23:59:59.000Z",
            "2016-12-31T23:59:60.000Z",
            "2016-12-31T23:59:60.250Z",
            "2017-01-01T00:00:00.000Z",
            "2019-06-15T23:35:49.950Z",
            "1999-01-01T00:00:00.123456789Z",
        ] {
            assert_eq!(utc_text(parse_utc(text).unwrap()), text);
        }
        let at = |text| parse_utc(text).unwrap();
        // X-Val: IERS Bulletin C 52: a leap second at the end of 2016.
        let long = at("2017-01-01T00:00:00Z") - at("2016-12-31T23:59:59Z");
        assert_eq!(long, Unit::Second * 2);
        for (from, to, count) in [
            ("2016-12-31T00:00:00Z", "2017-01-01T00:00:00Z", 1),
            ("2017-01-01T00:00:00Z", "2016-12-31T00:00:00Z", -1),
            ("2017-01-01T00:00:00Z", "2026-01-01T00:00:00Z", 0),
            ("2012-06-30T23:59:59.5Z", "2017-01-01T00:00:00.25Z", 3),
            ("2016-12-31T00:00:00Z", "2016-12-31T23:59:60.999999999Z", 0),
            ("2016-12-31T23:59:60Z", "2017-01-01T00:00:00Z", 1),
        ] {
            assert_eq!(leap_seconds(at(from), at(to)), count, "{from} {to}");
        }
    }

    #[test]
    fn utc_days_with_leap_seconds_are_counted() {
        // X-Val: pyerfa 2.0.1.5, dtf2d("UTC", ...), as days and seconds of a day with a leap
        // second, and of one without.
        for (text, mjd, utc_s) in [
            (
                "2016-12-31T12:00:00Z",
                57_753.0 + 43_200.0 / 86_401.0,
                43_200.0,
            ),
            (
                "2016-12-31T23:59:40Z",
                57_753.0 + 86_380.0 / 86_401.0,
                86_380.0,
            ),
            (
                "2016-12-31T23:59:59.9999999Z",
                57_753.0 + 86_399.999_999_9 / 86_401.0,
                86_399.999_999_9,
            ),
            (
                "2016-12-31T23:59:60.5Z",
                57_753.0 + 86_400.5 / 86_401.0,
                86_399.5,
            ),
            ("2017-01-01T00:00:00Z", 57_754.0, 0.0),
            ("2017-01-01T12:00:00Z", 57_754.5, 43_200.0),
            ("1971-12-31T12:00:00Z", 41_316.5, 43_200.0),
            (
                "1972-06-30T12:00:00Z",
                41_498.0 + 43_200.0 / 86_401.0,
                43_200.0,
            ),
        ] {
            let epoch = parse_utc(text).unwrap();
            assert!(
                (utc_mjd(epoch) - mjd).abs() < 1e-11,
                "{text}: {}",
                utc_mjd(epoch)
            );
            let of_day = utc_duration(epoch).total_nanoseconds().rem_euclid(DAY_NS);
            assert_eq!(of_day, (utc_s * 1e9_f64).round() as i128, "{text}");
        }
    }

    #[test]
    fn tdb_is_within_ten_microseconds_of_a_longer_series() {
        // X-Val: pyerfa 2.0.1.5, dtdb at the Earth's centre, s.
        for (tt, expected_s) in [
            ("1950-04-03T00:00:00", 0.001_670_4),
            ("2000-10-02T00:00:00", -0.001_635_9),
            ("2019-06-15T00:00:20", 0.000_563_1),
            ("2026-04-04T12:00:00", 0.001_631_1),
            ("2049-12-24T06:00:00", -0.000_302_2),
        ] {
            let found_s = tdb_minus_tt_s(parse_ccsds(tt, TimeScale::TT).unwrap());
            assert!((found_s - expected_s).abs() < 1e-5, "{tt}: {found_s} s");
        }
    }

    #[test]
    fn every_day_of_the_year_of_a_tle_is_the_calendar_day() {
        for year in 0..100_u8 {
            let full = i32::from(year) + if year < 57 { 2000 } else { 1900 };
            let mut day = 0;
            for (month, length) in (1..).zip(month_lengths(full)) {
                for of_month in 1..=length {
                    day += 1;
                    let read = from_tle(year, day, "25").unwrap();
                    let is = parse_utc(&format!("{full}-{month:02}-{of_month:02}T06:00:00Z"));
                    assert_eq!(read, is.unwrap(), "{full} {day}");
                }
            }
            assert_eq!(from_tle(year, day + 1, ""), None);
            assert_eq!(from_tle(year, 0, ""), None);
        }
    }

    #[test]
    fn an_invalid_time_is_reported() {
        for (text, why) in [
            ("2026-02-30T00:00:00Z", "2026-02 has days 1 to 28"),
            ("2024-02-30T00:00:00Z", "2024-02 has days 1 to 29"),
            ("2026-06-00T00:00:00Z", "2026-06 has days 1 to 30"),
            ("2026-13-01T00:00:00Z", "no month 13"),
            ("2026-00-01T00:00:00Z", "no month 00"),
            ("2026-366T00:00:00Z", "2026 has days 1 to 365"),
            ("2026-02-28T24:00:00Z", "a day ends at 00:00:00 of the next"),
            ("2026-02-28T23:60:00Z", "minutes are 00 to 59"),
            ("2026-02-28T23:59:61Z", "60 in a leap second"),
            // X-Val: IERS Bulletins C: none in June 2019, and none at another time of day.
            ("2019-06-30T23:59:60Z", "no leap second then"),
            ("2016-12-31T22:59:60Z", "no leap second then"),
            ("2026-02-28T23:59+02:00", "offsets from UTC"),
            ("2026-02-28T23:59:00.5-02:00", "offsets from UTC"),
            ("2026-02-28T23:59Z", "hours, minutes and seconds"),
            ("2026-02-28", "a T stands between"),
            ("2026-02-28 00:00:00", "a T stands between"),
            ("2026-2-30T00:00:00Z", "such as 2019"),
            ("today", "such as 2019"),
        ] {
            let error = parse_utc(text).unwrap_err();
            assert!(error.contains(text) && error.contains(why), "{error}");
        }
    }
}
