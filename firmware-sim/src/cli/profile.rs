//! Pointing options of `skyloop-fc`.

use skyloop_orbit::path_text;
use std::path::PathBuf;

use anyhow::{Result, anyhow};
use clap::Args;
use hifitime::Epoch;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use skyloop_firmware_sim::attitude_list::AttitudeList;
use skyloop_firmware_sim::console::printable_line;
use skyloop_firmware_sim::profile::{LimbStare, Profile, Scan};
use skyloop_firmware_sim::text::{parse_numbers, parse_quaternion, quaternion};
use skyloop_orbit::{LARGEST_TABLE, read_text_within};

/// Range of limb heights, km.
const HEIGHTS_KM: std::ops::RangeInclusive<f64> = 0.0..=10_000.0;
/// Widest half width of a scan, deg.
const WIDEST_DEG: f64 = 180.0;
/// Fastest scan, deg/s.
const FASTEST_DEG_S: f64 = 360.0;

/// Attitude profile: exactly one option is required.
#[derive(Clone, Debug, Args)]
#[group(id = "profile", required = true, multiple = false)]
pub struct ProfileArgs {
    /// Attitudes to slerp between: a file of lines "UTC x y z w" (ICRF to body, scalar last), or a
    /// CCSDS AEM
    #[arg(long, value_name = "FILE")]
    attitudes: Option<PathBuf>,
    /// One attitude for all frames
    #[arg(long, value_name = "x,y,z,w", value_parser = parse_quaternion, allow_hyphen_values = true)]
    hold: Option<UnitQuaternion<f64>>,
    /// Attitude at the first epoch and constant body rates in deg/s
    #[arg(long, value_name = "x,y,z,w,wx,wy,wz", value_parser = parse_slew, allow_hyphen_values = true)]
    slew: Option<Slew>,
    /// Scan around the attitude at the first epoch about a body axis (x, y or z; default y): half
    /// width in deg, rate in deg/s
    #[arg(
        long,
        value_name = "x,y,z,w,DEG,RATE[,AXIS]",
        value_parser = parse_scan,
        allow_hyphen_values = true
    )]
    scan: Option<ScanText>,
    /// +Z to the Earth's centre, +X towards the velocity; needs --orbit
    #[arg(long, requires = "orbit")]
    nadir: bool,
    /// +Z to the limb: height above the ellipsoid in km, azimuth from the velocity to the right in
    /// deg (default 0); -Y up; needs --orbit
    #[arg(
        long,
        value_name = "KM[,AZIMUTH_DEG]",
        value_parser = parse_limb,
        allow_hyphen_values = true,
        requires = "orbit"
    )]
    limb_stare: Option<LimbStare>,
    /// Send no attitudes; receive the frames of another client, over links that carry only frames
    #[arg(long, conflicts_with_all = ["wall", "rate", "pause", "closed", "epoch", "period", "orbit"])]
    listen: bool,
}

/// Start attitude and body rates, rad/s.
#[derive(Clone, Debug)]
struct Slew(UnitQuaternion<f64>, Vector3<f64>);

/// A scan without its start epoch.
#[derive(Clone, Debug)]
struct ScanText {
    attitude: UnitQuaternion<f64>,
    half_width_rad: f64,
    rate_rad_s: f64,
    axis: Unit<Vector3<f64>>,
}

impl ProfileArgs {
    /// Whether another client sends the attitudes.
    #[must_use]
    pub(crate) fn listens(&self) -> bool {
        self.listen
    }

    /// The profile of a mission that starts at `start`.
    ///
    /// # Errors
    /// The file cannot be read, or is no list of attitudes.
    pub fn profile(&self, start: Epoch) -> Result<Profile> {
        if let Some(path) = &self.attitudes {
            let name = path_text(path);
            let text = read_text_within(path, LARGEST_TABLE).map_err(|error| {
                anyhow!("cannot read the attitudes in {name}: {error}; --attitudes takes a text file of lines UTC x y z w, or a CCSDS AEM")
            })?;
            let list = AttitudeList::parse(&text, &name)?;
            for remark in list.remarks() {
                eprintln!("skyloop-fc: {}", printable_line(remark));
            }
            return Ok(Profile::List(list));
        }
        if let Some(attitude) = self.hold {
            return Ok(Profile::Hold(attitude));
        }
        if let Some(Slew(attitude, rates_rad_s)) = self.slew.clone() {
            return Ok(Profile::Slew {
                start,
                attitude,
                rates_rad_s,
            });
        }
        if let Some(scan) = &self.scan {
            let ScanText {
                attitude,
                half_width_rad,
                rate_rad_s,
                axis,
            } = *scan;
            let scan = Scan::new(start, attitude, axis, half_width_rad, rate_rad_s);
            let scan = scan.ok_or_else(|| anyhow!("--scan needs a width and a rate above 0"))?;
            return Ok(Profile::Scan(scan));
        }
        if self.listen {
            return Ok(Profile::Hold(UnitQuaternion::identity()));
        }
        Ok(self.limb_stare.map_or(Profile::Nadir, Profile::LimbStare))
    }
}

fn parse_slew(text: &str) -> Result<Slew, String> {
    let [x, y, z, w, wx, wy, wz] = parse_numbers::<7>(text)?;
    Ok(Slew(
        quaternion([x, y, z, w])?,
        Vector3::new(wx, wy, wz).map(f64::to_radians),
    ))
}

fn parse_scan(text: &str) -> Result<ScanText, String> {
    let (numbers, axis) = match text.trim_end().rsplit_once([',', ' ', '\t']) {
        Some((numbers, "x" | "X")) => (numbers, Vector3::x_axis()),
        Some((numbers, "y" | "Y")) => (numbers, Vector3::y_axis()),
        Some((numbers, "z" | "Z")) => (numbers, Vector3::z_axis()),
        _ => (text, Vector3::y_axis()),
    };
    let [x, y, z, w, half_width_deg, rate_deg_s] = parse_numbers::<6>(numbers).map_err(|why| {
        format!("{why}: give x,y,z,w,DEG,RATE and then, if it is not y, the axis x or z")
    })?;
    let positive = |value: f64, max: f64, what: &str, unit: &str| match value {
        value if value > 0.0 && value <= max => Ok(value.to_radians()),
        value => Err(format!(
            "{what} is {value}; it must be above 0, at most {max} {unit}"
        )),
    };
    Ok(ScanText {
        attitude: quaternion([x, y, z, w])?,
        half_width_rad: positive(half_width_deg, WIDEST_DEG, "the half width", "deg")?,
        rate_rad_s: positive(rate_deg_s, FASTEST_DEG_S, "the rate", "deg/s")?,
        axis,
    })
}

fn parse_limb(text: &str) -> Result<LimbStare, String> {
    let numbers = match parse_numbers::<1>(text) {
        Ok([height_km]) => Ok([height_km, 0.0]),
        Err(_) => parse_numbers::<2>(text),
    };
    let [height_km, azimuth_deg] =
        numbers.map_err(|why| format!("{why}: give KM or KM,AZIMUTH_DEG"))?;
    if !HEIGHTS_KM.contains(&height_km) {
        return Err(format!(
            "the height is {height_km}; it must be {} to {} km",
            HEIGHTS_KM.start(),
            HEIGHTS_KM.end()
        ));
    }
    if azimuth_deg.abs() > 360.0 {
        return Err(format!(
            "the azimuth is {azimuth_deg}; it must be -360 to 360 deg"
        ));
    }
    Ok(LimbStare {
        height_m: height_km * 1e3,
        azimuth_rad: azimuth_deg.to_radians(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_and_limbs_are_read() {
        for (text, axis) in [
            ("0,0,0,1,10,0.5", Vector3::y_axis()),
            ("0 0 0 1 10 0.5 x", Vector3::x_axis()),
            ("0,0,0,1,10,0.5,Z", Vector3::z_axis()),
        ] {
            let scan = parse_scan(text).unwrap();
            assert_eq!(scan.axis, axis);
            let numbers = [scan.half_width_rad, scan.rate_rad_s].map(f64::to_degrees);
            assert!((numbers[0] - 10.0).abs() + (numbers[1] - 0.5).abs() < 1e-12);
        }
        let limb = parse_limb("80").unwrap();
        assert_eq!((limb.height_m, limb.azimuth_rad), (80e3, 0.0));
        let limb = parse_limb("83.5,-90").unwrap();
        assert!((limb.azimuth_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn wrong_scans_and_limbs_are_refused() {
        for row in [
            "0,0,0,1,10 => 5 numbers where 6 belong: give x,y,z,w,DEG",
            "0,0,0,1,10,0.5,w => \"w\" is no finite number",
            "0,0,0,1,nan,0.5 => \"nan\" is no finite number",
            "0,0,0,1,0,0.5 => the half width is 0; it must be above 0, at most 180 deg",
            "0,0,0,1,10,-1 => the rate is -1; it must be above 0, at most 360 deg/s",
            "0,0,0,2,10,1 => norm is 2",
        ] {
            let (text, says) = row.split_once(" => ").unwrap();
            let error = parse_scan(text).unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
        for row in [
            " => 0 numbers where 2 belong: give KM or KM,AZIMUTH_DEG",
            "80,90,1 => 3 numbers where 2 belong",
            "nan => \"nan\" is no finite number",
            "-1 => the height is -1; it must be 0 to 10000 km",
            "80,361 => the azimuth is 361; it must be -360 to 360 deg",
        ] {
            let (text, says) = row.split_once(" => ").unwrap();
            let error = parse_limb(text).unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
