//! A light curve as a table and as a picture.

use super::folder::{Folder, OutputError};
use super::plot::{Plot, Series};
use super::png;
use crate::light_curve::Point;
use embedded_graphics::pixelcolor::Rgb888;
use skyloop_orbit::time::utc_text;
use std::io::Write;
use std::path::Path;

const TABLE: &str = "lightcurve.csv";
const PICTURE: &str = "lightcurve.png";
/// The head of the table.
const HEAD: &str = "utc,t_s,mag,band_mag,range_km,phase_deg,illumination,reason";

/// What arrives, and what full sunlight would make of it.
const ARRIVING: Rgb888 = Rgb888::new(255, 200, 80);
const SUNLIT: Rgb888 = Rgb888::new(110, 140, 190);

/// Whether the files in `dir` may be replaced.
///
/// Errors: this process has read one of them, or without `force`: skyloop did not make them.
pub fn may_replace_light_curve(dir: &Path, force: bool) -> Result<(), OutputError> {
    Folder::at(dir).may_replace((TABLE, &[HEAD]), &[(PICTURE, png::MARK)], force)
}

/// Writes `lightcurve.csv` and `lightcurve.png` into `dir`, which is made if it does not exist; other files in it are left alone.
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
    let line = |value: &dyn Fn(&Point) -> Option<f64>| -> Vec<Option<f64>> {
        points.iter().map(value).collect()
    };
    let plot = Plot {
        title: title.to_string(),
        value: "magnitude",
        epochs: points.iter().map(|point| point.epoch).collect(),
        series: vec![
            Series {
                name: "in full sunlight",
                color: SUNLIT,
                values: line(&|point| point.mag.is_finite().then_some(point.mag)),
            },
            Series {
                name: "as it arrives",
                color: ARRIVING,
                values: line(&Point::band_mag),
            },
        ],
    };
    let picture = plot.draw();
    folder.write(PICTURE, |out| png::write_rgb(out, &picture))
}

/// A line of the table; a magnitude is empty where there is none.
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
