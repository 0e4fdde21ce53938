//! `images` of `[optics.psf]`: text files of samples, and their positions in the field.

use crate::camera::psf::{FURTHEST_PX, Flaw, Image, Images, SUM_TOLERANCE};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, EachOfSeveral, Number};
use skyloop_base::load::{Check, ConfigError, Fixed, Folder, Limit};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawImage {
    /// Text file: rows of samples that sum to 1, with the source in the middle.
    file: String,
    /// Position on the detector, [column, row] (px).
    at_px: Option<Fixed<f64, 2>>,
}

pub(crate) const LIMITS: &[Limit] = &[
    ("optics.psf.images[].at_px[]", Number(-1e5..=1e5)),
    ("optics.psf.images", Count(1..=usize::MAX)),
    ("optics.psf", EachOfSeveral(["images", "at_px"])),
];

/// The images at the nodes of a grid; a single one holds everywhere.
pub(crate) fn grid(
    raw: &[RawImage],
    oversampling: f64,
    principal_px: [f64; 2],
    check: &Check,
    folder: &Folder,
) -> Result<Images, ConfigError> {
    if raw.is_empty() {
        let allowed = "at least one { file = \"FILE\" }";
        return Err(check.refuse("optics.psf.images", "[]", allowed));
    }
    let mut placed = Vec::new();
    for (i, one) in raw.iter().enumerate() {
        let key = format!("optics.psf.images[{i}]");
        let at = match one.at_px {
            Some(Fixed(at)) => at,
            None if raw.len() == 1 => principal_px,
            None => {
                return Err(
                    check.explain(&format!("{key}.at_px"), "missing: one of several images")
                );
            }
        };
        check.each_limit(LIMITS, &format!("{key}.at_px"), at)?;
        let image = read(&key, one, oversampling, check, folder)?;
        // Rows first, then columns.
        placed.push(([at[1] - principal_px[1], at[0] - principal_px[0]], image));
    }
    placed.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let unique = |axis: usize| {
        let mut all: Vec<f64> = placed.iter().map(|(at, _)| at[axis]).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let (rows, columns) = (unique(0), unique(1));
    let crossings = rows
        .iter()
        .flat_map(|y| columns.iter().map(move |x| [*y, *x]));
    let whole = crossings.eq(placed.iter().map(|(at, _)| *at));
    let images = placed.into_iter().map(|(_, image)| image).collect();
    let images = whole.then(|| Images::new(oversampling, [columns, rows], images));
    images.flatten().ok_or_else(|| {
        let reason =
            "at_px must be the crossings of a grid: every column with every row, each once";
        check.explain("optics.psf.images", reason)
    })
}

fn read(
    key: &str,
    raw: &RawImage,
    oversampling: f64,
    check: &Check,
    folder: &Folder,
) -> Result<Image, ConfigError> {
    let key = format!("{key}.file");
    let found = folder.read_within(&raw.file, skyloop_orbit::LARGEST_TABLE);
    let (file, text) = found.map_err(|error| check.explain(&key, error))?;
    let max = (2.0 * FURTHEST_PX * oversampling).min(4096.0) as usize;
    let wrong = |reason: String| check.explain(&key, format!("{file}: {reason}"));
    let (mut rows, mut lines) = (Vec::new(), Vec::new());
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let words = line.split([',', ' ', '\t']).filter(|word| !word.is_empty());
        let numbers = words.map(|word| word.parse().map_err(|_| word));
        let row: Vec<f64> = numbers.collect::<Result<_, _>>().map_err(|word| {
            let form = "numbers stand between commas or spaces, remarks behind #";
            wrong(format!("line {number}: {word:?} is no number; {form}"))
        })?;
        rows.push(row);
        lines.push(number);
        if rows.len() > max || rows.iter().any(|row| row.len() > max) {
            return Err(wrong(format!("more than {max} samples a side")));
        }
    }
    let first = rows.first().map_or(0, Vec::len);
    if let Some(i) = rows.iter().position(|row: &Vec<f64>| row.len() != first) {
        return Err(wrong(format!(
            "samples in line {}: {}, in line {}: {first}; every row needs as many",
            lines[i],
            rows[i].len(),
            lines[0]
        )));
    }
    Image::new(&rows).map_err(|flaw| match flaw {
        Flaw::Ragged => wrong("no samples: give rows of numbers, one row per line".to_string()),
        Flaw::Sample(value) => {
            let has_it = |row: &Vec<f64>| row.iter().any(|s| s.total_cmp(&value).is_eq());
            let line = rows.iter().position(has_it).map_or(0, |i| lines[i]);
            let value = format!("{file} with a sample of {value} in line {line}");
            check.refuse(&key, value, "an image whose samples are 0 or more")
        }
        Flaw::Sum(sum) => {
            let value = format!("{file} with a sum of {sum}");
            let remedy = if sum > 0.0 {
                format!(": divide each by {sum}")
            } else {
                String::new()
            };
            let allowed = format!("an image whose samples sum to 1 within {SUM_TOLERANCE}{remedy}");
            check.refuse(&key, value, allowed)
        }
    })
}
