//! A light curve as a table and as a plot.

use super::chart::{AMBER, BLUE, SVG_MARK};
use super::folder::{Folder, OutputError};
use super::plot::{Curve, magnitudes};
use hifitime::Epoch;
use skyloop_orbit::time::utc_text;
use skyloop_render::light_curve::Point;
use std::io::Write;
use std::path::Path;

const TABLE: &str = "lightcurve.csv";
const PICTURE: &str = "lightcurve.svg";
const HEAD: &str = "utc,t_s,mag,band_mag,range_km,phase_deg,illumination,reason";

/// Whether the files in `dir` may be replaced.
///
/// Errors: this process has read one of them; without `force`: skyloop did not write them.
pub fn may_replace_light_curve(dir: &Path, force: bool) -> Result<(), OutputError> {
    Folder::at(dir).may_replace((TABLE, &[HEAD]), &[(PICTURE, SVG_MARK)], force)
}

/// Writes `lightcurve.csv` and `lightcurve.svg` into `dir`, which is created if needed; other files
/// in it are unchanged.
///
/// Errors: the folder or a file cannot be written.
pub fn write_light_curve(dir: &Path, title: &str, points: &[Point]) -> Result<(), OutputError> {
    let folder = Folder::shared(dir)?;
    folder.write(TABLE, |out| {
        writeln!(out, "{HEAD}")?;
        for point in points {
            writeln!(out, "{}", row(point, points))?;
        }
        Ok(())
    })?;
    let values = |value: &dyn Fn(&Point) -> Option<f64>| points.iter().map(value).collect();
    let curves = [
        Curve {
            name: "in full sunlight",
            color: BLUE,
            values: values(&|point| point.mag.is_finite().then_some(point.mag)),
        },
        Curve {
            name: "as it arrives",
            color: AMBER,
            values: values(&Point::band_mag),
        },
    ];
    let epochs: Vec<Epoch> = points.iter().map(|point| point.epoch).collect();
    folder.write(PICTURE, |out| {
        out.write_all(magnitudes(title, &epochs, &curves)?.as_bytes())
    })
}

/// A line of the table; an undefined magnitude is empty.
fn row(point: &Point, points: &[Point]) -> String {
    let start = points.first().map_or(point.epoch, |first| first.epoch);
    let mag = |mag: Option<f64>| mag.map_or(String::new(), |mag| format!("{mag:.4}"));
    format!(
        "{},{:.6},{},{},{:.6},{:.6},{:.6},{}",
        utc_text(point.epoch),
        (point.epoch - start).to_seconds(),
        mag(point.mag.is_finite().then_some(point.mag)),
        mag(point.band_mag()),
        point.range_m * 1e-3,
        point.phase.to_degrees(),
        point.illumination,
        point.reason()
    )
}
