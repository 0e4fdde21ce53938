//! The JSON text of an object. A label may have thousands of objects, so numbers are written
//! through integers, which is fast.

use super::object::{ObjectLabel, RsoLabel};
use super::planet::PlanetLabel;
use super::rounded::{rounded, scaled};
use serde::Serialize;
use serde_json::Result;

/// The separator and name of a member after the first.
macro_rules! key {
    ($name:literal) => {
        concat!(",\"", $name, "\":")
    };
}

impl ObjectLabel {
    pub(super) fn write(&self, text: &mut Vec<u8>) -> Result<()> {
        let mut object = Members(text);
        object.any("{\"kind\":", self.kind)?;
        object.any(key!("id"), &self.id)?;
        object.any(key!("names"), &self.names)?;
        object.number::<6>(key!("x_px"), self.x_px)?;
        object.number::<6>(key!("y_px"), self.y_px)?;
        object.number::<6>(key!("x0_px"), self.x0_px)?;
        object.number::<6>(key!("y0_px"), self.y0_px)?;
        object.number::<6>(key!("x1_px"), self.x1_px)?;
        object.number::<6>(key!("y1_px"), self.y1_px)?;
        object.number::<6>(key!("vx_px_s"), self.vx_px_s)?;
        object.number::<6>(key!("vy_px_s"), self.vy_px_s)?;
        object.number::<4>(key!("mag"), self.mag)?;
        match self.band_mag {
            Some(mag) => object.number::<4>(key!("band_mag"), mag)?,
            None => object.any(key!("band_mag"), &())?,
        }
        object.number::<4>(key!("electrons"), self.electrons)?;
        object.number::<4>(key!("snr"), self.snr)?;
        object.number::<9>(key!("ra_deg"), of_turn(self.ra_deg))?;
        object.number::<9>(key!("dec_deg"), self.dec_deg)?;
        object.truth(key!("in_frame"), self.in_frame);
        object.truth(key!("visible"), self.visible);
        if let Some(reason) = &self.reason {
            object.any(key!("reason"), reason)?;
        }
        if let Some(rso) = &self.rso {
            rso.write(&mut object)?;
        }
        if let Some(planet) = &self.planet {
            planet.write(&mut object)?;
        }
        text.push(b'}');
        Ok(())
    }
}

impl PlanetLabel {
    fn write(&self, object: &mut Members<'_>) -> Result<()> {
        object.number::<6>(key!("range_km"), self.range_km)?;
        object.number::<6>(key!("phase_deg"), self.phase_deg)?;
        object.number::<9>(key!("radius_deg"), self.radius_deg)?;
        object.number::<6>(key!("light"), self.light)?;
        match self.centre_px {
            Some([x, y]) => {
                object.number::<6>(concat!(key!("centre_px"), "["), x)?;
                object.number::<6>(",", y)?;
                object.0.push(b']');
            }
            None => object.any(key!("centre_px"), &())?,
        }
        object.number::<9>(key!("centre_ra_deg"), of_turn(self.centre_ra_deg))?;
        object.number::<9>(key!("centre_dec_deg"), self.centre_dec_deg)
    }
}

impl RsoLabel {
    fn write(&self, object: &mut Members<'_>) -> Result<()> {
        object.any(key!("range_km"), &self.range_km)?;
        object.any(key!("range_rate_km_s"), &self.range_rate_km_s)?;
        object.number::<6>(key!("phase_deg"), self.phase_deg)?;
        object.any(key!("illumination"), &self.illumination)?;
        object.any(key!("position_gcrf_km"), &self.position_gcrf_km)?;
        object.any(key!("velocity_gcrf_km_s"), &self.velocity_gcrf_km_s)
    }
}

/// Degrees from 0 to below 360, also after rounding.
fn of_turn(degrees: f64) -> f64 {
    if rounded(degrees, 9) < 360.0 {
        degrees
    } else {
        0.0
    }
}

/// Members of an object, appended to a text.
struct Members<'a>(&'a mut Vec<u8>);

// Inlined, so that the compiler knows the lengths of the keys.
impl Members<'_> {
    #[inline(always)]
    fn number<const DECIMALS: u32>(&mut self, key: &'static str, value: f64) -> Result<()> {
        self.0.extend_from_slice(key.as_bytes());
        number::<DECIMALS>(value, self.0)
    }

    #[inline(always)]
    fn truth(&mut self, key: &'static str, value: bool) {
        self.0.extend_from_slice(key.as_bytes());
        let text: &[u8] = if value { b"true" } else { b"false" };
        self.0.extend_from_slice(text);
    }

    #[inline]
    fn any<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<()> {
        self.0.extend_from_slice(key.as_bytes());
        serde_json::to_writer(&mut *self.0, value)
    }
}

/// Appends `value`, [`rounded`] to `DECIMALS` (9 at most), as [`serde_json`] writes it: with the
/// fewest digits that parse to the same number.
///
/// If the value has at most 15 digits in units of the last decimal, these digits without trailing
/// zeros are the fewest: no two numbers of 15 digits have the same nearest double. Values with more
/// digits, and small ones with an exponent, are left to `serde_json`.
fn number<const DECIMALS: u32>(value: f64, text: &mut Vec<u8>) -> Result<()> {
    // Below `max`, values have 15 digits at most, of which no more than eight are whole.
    let max = 10u64.pow(15.min(8 + DECIMALS));
    let unit = 10u64.pow(DECIMALS);
    // 1e-5 in these units.
    let min = 10u64.pow(DECIMALS.saturating_sub(5));
    let (negative, units) = match scaled(value, DECIMALS as i32) {
        Some(units) => (units < 0, units.unsigned_abs()),
        None => (false, max),
    };
    if units >= max || (units > 0 && units < min) {
        return serde_json::to_writer(text, &rounded(value, DECIMALS as i32));
    }
    // Sign, whole digits, point, and two times eight decimals.
    let mut number = [b'-'; 32];
    let whole = digits(units / unit);
    let leading = (whole.trailing_zeros() / 8).min(7);
    let mut at = usize::from(negative);
    number[at..at + 8].copy_from_slice(&text_of(whole >> (8 * leading)));
    at += 8 - leading as usize;
    number[at] = b'.';
    at += 1;
    let part = units % unit * 10u64.pow(2 * 8 - DECIMALS);
    let (first, second) = (digits(part / EIGHT), part % EIGHT);
    number[at..at + 8].copy_from_slice(&text_of(first));
    // Without trailing zeros, except one right after the point.
    let zeros = if DECIMALS <= 8 || second == 0 {
        8 + first.leading_zeros() / 8
    } else {
        let second = digits(second);
        number[at + 8..at + 16].copy_from_slice(&text_of(second));
        second.leading_zeros() / 8
    };
    let end = text.len() + at + (16 - zeros as usize).max(1);
    text.extend_from_slice(&number);
    text.truncate(end);
    Ok(())
}

/// Numbers of up to eight digits are below this.
const EIGHT: u64 = 100_000_000;

/// The eight digits of a number below [`EIGHT`], one per byte, the first digit in the lowest byte.
/// The number is split in half three times, all parts in parallel. Quotients are products with 1 /
/// 100 and 1 / 10, rounded up with enough bits that every quotient is exact.
fn digits(number: u64) -> u64 {
    let fours = (number / 10_000) | ((number % 10_000) << 32);
    let hundreds = ((fours * 5_243) >> 19) & 0x7f_0000_007f;
    let pairs = hundreds | ((fours - hundreds * 100) << 16);
    let tens = ((pairs * 103) >> 10) & 0x0f_000f_000f_000f;
    tens | ((pairs - tens * 10) << 8)
}

fn text_of(digits: u64) -> [u8; 8] {
    (digits | 0x3030_3030_3030_3030).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// Checks that [`number`] writes the same as `serde_json` for the rounded number.
    fn check<const DECIMALS: u32>(value: f64) {
        let mut text = Vec::new();
        number::<DECIMALS>(value, &mut text).unwrap();
        let expected = serde_json::to_string(&rounded(value, DECIMALS as i32)).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, expected, "{value:?} {DECIMALS}");
    }

    #[test]
    fn numbers_are_those_of_serde_json() {
        let check_all = |value: f64| {
            for value in [value, -value] {
                check::<4>(value);
                check::<6>(value);
                check::<9>(value);
            }
        };
        // Zero with both signs; ties of the last decimal; the limits of exponents; 15 and 16
        // digits; the smallest and greatest doubles.
        let values =
            "0.0 0.5 1.0 100.0 0.30000000000000004 0.00005 0.00015 0.1234565 2.5e-7 1e-5 9e-6
            9.9994e-6 9.9999e-6 9.9999999e-6 1.00001e-5 1e-9 5e-10 4.999e-10 359.9999999996
            999999.99999949 99999999999.99995 1e11 123456789012.345 1e15 9.007199254740993e15 1e16
            123456789012345680.0 1e22 1e300 1.7976931348623157e308 2.2250738585072014e-308 5e-324 inf NaN";
        for value in values.split_whitespace() {
            check_all(value.parse().unwrap());
        }
        // All magnitudes and lengths: a Weyl sequence, and multiples of it rounded to few decimals.
        for i in 0..300_000u32 {
            let part = f64::from(i.wrapping_mul(2_654_435_769)) / f64::from(u32::MAX);
            let size = libm::exp10(f64::from(i % 29) - 11.0);
            check_all(part * size);
            check_all(rounded(part * 1000.0, (i % 7) as i32));
        }
    }

    #[test]
    fn text_is_escaped_and_absent_members_are_omitted() {
        let mut label = ObjectLabel {
            kind: "rso",
            id: "A \"quoted\" \\ \u{1} é".to_string(),
            names: vec!["a".to_string(), "\t".to_string()],
            x_px: 1.25,
            y_px: -0.0,
            x0_px: f64::NAN,
            y0_px: 0.0,
            x1_px: 0.0,
            y1_px: 0.0,
            vx_px_s: 0.0,
            vy_px_s: 0.0,
            mag: 1.0,
            band_mag: None,
            electrons: 0.0,
            snr: 0.0,
            ra_deg: 359.999_999_999_7,
            dec_deg: 0.0,
            in_frame: true,
            visible: false,
            reason: Some("a reason".to_string()),
            rso: None,
            planet: None,
        };
        let read = |label: &ObjectLabel| -> (String, Value) {
            let mut text = Vec::new();
            label.write(&mut text).unwrap();
            let text = String::from_utf8(text).unwrap();
            let value = serde_json::from_str(&text).unwrap();
            (text, value)
        };
        let (text, value) = read(&label);
        assert_eq!(value["id"], label.id.as_str());
        assert_eq!(value["names"][1], "\t");
        assert!(text.contains("\"x_px\":1.25,\"y_px\":0.0,\"x0_px\":null,"));
        assert!(text.contains("\"band_mag\":null,") && text.contains("\"ra_deg\":0.0,"));
        assert!(text.ends_with("\"visible\":false,\"reason\":\"a reason\"}"));
        label.reason = None;
        label.band_mag = Some(2.0);
        label.planet = Some(PlanetLabel {
            range_km: 384_400.0,
            phase_deg: 90.0,
            radius_deg: 0.25,
            light: 1.0,
            centre_px: Some([12.5, -3.25]),
            centre_ra_deg: 359.999_999_999_7,
            centre_dec_deg: -1.5,
        });
        let (text, value) = read(&label);
        assert_eq!(value["band_mag"], 2.0);
        assert!(text.ends_with(
            "\"visible\":false,\"range_km\":384400.0,\"phase_deg\":90.0,\"radius_deg\":0.25,\"light\":1.0,\
             \"centre_px\":[12.5,-3.25],\"centre_ra_deg\":0.0,\"centre_dec_deg\":-1.5}"
        ));
        label.planet = None;
        label.rso = Some(RsoLabel {
            range_km: 1_000.123_456_789,
            range_rate_km_s: -1.5,
            phase_deg: 30.0,
            illumination: 1.0,
            position_gcrf_km: [1.0, 2.0, 3.5],
            velocity_gcrf_km_s: [0.0, 7.5, -1e-7],
        });
        let (text, _) = read(&label);
        // Numbers of objects in orbit are not rounded.
        assert!(text.ends_with(
            "\"range_km\":1000.123456789,\"range_rate_km_s\":-1.5,\"phase_deg\":30.0,\"illumination\":1.0,\
             \"position_gcrf_km\":[1.0,2.0,3.5],\"velocity_gcrf_km_s\":[0.0,7.5,-1e-7]}"
        ));
    }
}
