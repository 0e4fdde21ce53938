//! Two-line element sets: numbers in fixed columns, rounded to their digits.

use super::Written;
use crate::elements::Elements;
use crate::record::{Record, short_designator};
use crate::time::DAY_NS;
use crate::time::{utc_duration, utc_text};
use crate::two_line::{Checksum, seal};
use crate::units::{DEGREE, REV_PER_DAY};
use hifitime::{Duration, Epoch};

/// Longest name in a name line.
const LONGEST_NAME: usize = 24;
/// Set number and revolution are written modulo these: their columns hold only the last digits.
const SETS: u32 = 10_000;
const REVOLUTIONS: u32 = 100_000;
/// Resolution of epochs, a hundred-millionth of a day, ns.
const TICK_NS: i128 = 864_000;

/// Writes two lines for each record; `names` adds a name line before them.
pub(super) fn write(records: &[Record], names: bool) -> Written {
    let mut written = Written::default();
    for record in records {
        let object = format!("NORAD {}", record.elements.norad);
        let (line1, line2) = match lines(record) {
            Ok(lines) => lines,
            Err(reason) => {
                written.left_out.push(format!("{object}: {reason}"));
                continue;
            }
        };
        if let Err(error) = Elements::parse(&line1, &line2, Checksum::Required) {
            let reason = format!("its two lines cannot be read back: {error}");
            written.left_out.push(format!("{object}: {reason}"));
            continue;
        }
        if names {
            let name: String = record.name.chars().take(LONGEST_NAME).collect();
            written.text += format!("0 {name}").trim_end();
            written.text.push('\n');
        }
        written.text += &format!("{line1}\n{line2}\n");
    }
    written
}

/// The two lines of a set, with checksums.
fn lines(record: &Record) -> Result<(String, String), String> {
    let Elements {
        norad,
        epoch,
        inclination,
        node,
        eccentricity,
        perigee,
        mean_anomaly,
        mean_motion,
        drag,
    } = record.elements;
    let number = alpha_5(norad).ok_or("a TLE has numbers up to 339999")?;
    let epoch = epoch_columns(epoch)
        .ok_or("a TLE has epochs from 1957 to 2056, and none in a leap second")?;
    let class = match record.classification {
        class if class.is_ascii_graphic() => class,
        _ => 'U',
    };
    let designator = short_designator(&record.designator).unwrap_or_default();
    let dot =
        fraction(record.mean_motion_dot).ok_or("a TLE has first derivatives below 1 rev/day^2")?;
    let ddot = power(record.mean_motion_ddot).ok_or("the second derivative is beyond a TLE's")?;
    let drag = power(drag).ok_or("the drag term B* is beyond a TLE's")?;
    let set = record.element_set % SETS;
    let kind = Some(record.ephemeris_type).filter(|kind| *kind < 10);
    let kind = kind.ok_or("a TLE has an ephemeris type of one digit")?;
    let line1 =
        format!("1 {number}{class} {designator:<8} {epoch} {dot} {ddot} {drag} {kind} {set:>4}");

    let eccentricity = (eccentricity * 1e7).round();
    if eccentricity > 9_999_999.0 {
        return Err("the eccentricity rounds to 1".to_owned());
    }
    let mean_motion = mean_motion / REV_PER_DAY;
    if mean_motion >= 99.999_999_995 {
        return Err("a TLE has mean motions below 100 rev/day".to_owned());
    }
    let revolution = record.revolution % REVOLUTIONS;
    let line2 = format!(
        "2 {number} {} {} {eccentricity:07} {} {} {mean_motion:11.8}{revolution:>5}",
        format_args!("{:8.4}", inclination / DEGREE),
        angle(node),
        angle(perigee),
        angle(mean_anomaly),
    );
    Ok((seal(&line1), seal(&line2)))
}

/// Five digits, or Alpha-5 up to 339999.
fn alpha_5(number: u32) -> Option<String> {
    const LETTERS: &[u8] = b"ABCDEFGHJKLMNPQRSTUVWXYZ";
    let (lead, rest) = (number / 10_000, number % 10_000);
    match lead.checked_sub(10) {
        None => Some(format!("{number:05}")),
        Some(letter) => {
            let letter = char::from(*LETTERS.get(letter as usize)?);
            Some(format!("{letter}{rest:04}"))
        }
    }
}

/// Two digits of the year, and the day of the year with eight decimals; none in a leap second,
/// which cannot be written.
fn epoch_columns(epoch: Epoch) -> Option<String> {
    let ns = utc_duration(epoch).total_nanoseconds();
    let at = |ns| Epoch::from_utc_duration(Duration::from_total_nanoseconds(ns));
    let off = |ns| at(ns).to_tai_duration() - epoch.to_tai_duration();
    // The nearest tick, unless a leap second lies between.
    let nearest = [ns + TICK_NS / 2, ns].map(|ns| ns / TICK_NS * TICK_NS);
    let ns = nearest
        .into_iter()
        .find(|ns| off(*ns).total_nanoseconds().abs() < TICK_NS)?;
    let year: i32 = utc_text(at(ns)).get(..4)?.parse().ok()?;
    if !(1957..=2056).contains(&year) {
        return None;
    }
    let start = Epoch::maybe_from_gregorian_utc(year, 1, 1, 0, 0, 0, 0).ok()?;
    // UTC days of 86,400 s, also those with a leap second.
    let ns = ns - utc_duration(start).total_nanoseconds();
    let day = ns / DAY_NS + 1;
    let ticks = ns % DAY_NS / TICK_NS;
    Some(format!("{:02}{day:03}.{ticks:08}", year % 100))
}

/// Degrees from 0 to 360 with four decimals.
fn angle(radians: f64) -> String {
    let degrees = (radians / DEGREE).rem_euclid(360.0);
    let ticks = (degrees * 1e4).round() % 3_600_000.0;
    format!("{:8.4}", ticks / 1e4)
}

/// A sign and eight decimals without the leading zero.
fn fraction(value: f64) -> Option<String> {
    let ticks = (value.abs() * 1e8).round();
    let sign = if value < 0.0 { '-' } else { ' ' };
    (ticks < 1e8).then(|| format!("{sign}.{ticks:08}"))
}

/// A sign, five digits after an assumed decimal point, and a power of ten.
fn power(value: f64) -> Option<String> {
    let sign = if value < 0.0 { '-' } else { ' ' };
    let ticks = (value.abs() * 1e14).round();
    if ticks == 0.0 {
        return Some(" 00000-0".to_owned());
    }
    // d.dddde-5 is 0.dddddd-4.
    let text = format!("{:.4e}", value.abs());
    let (digits, exponent) = text.split_once('e')?;
    let exponent = exponent.parse::<i32>().ok()? + 1;
    if exponent < -9 {
        return Some(format!("{sign}{ticks:05}-9"));
    }
    let digits = digits.replace('.', "");
    let power = match exponent {
        0..=9 => format!("+{exponent}"),
        _ => exponent.to_string(),
    };
    // The publishers write a power of zero as -0.
    let power = power.replace("+0", "-0");
    (exponent <= 9).then(|| format!("{sign}{digits}{power}"))
}
