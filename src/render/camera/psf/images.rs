//! A spread given as images at positions of the field.
//!
//! An image's samples are the light in its cells, `oversampling` cells per pixel, uniform within
//! each cell; the source is at the middle of the image. The cells' cumulative sum gives the exact
//! light in any rectangle; a pixel is a difference of four sums. Between the positions images are
//! mixed by bilinear weights, which conserves light; beyond them the nearest are used.

use std::ops::Range;

/// One image.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    columns: usize,
    rows: usize,
    /// Light left of and above each corner of a cell: `columns + 1` per row.
    sums: Vec<f64>,
    /// From its middle to its centroid, cells.
    offset: [f64; 2],
}

/// The images of a field.
#[derive(Debug, PartialEq)]
pub struct Images {
    /// Cells per pixel.
    oversampling: f64,
    /// Column and row positions of the images (px from the principal point), rising.
    places: [Vec<f64>; 2],
    /// Row by row.
    images: Vec<Image>,
    /// See [`crate::camera::LocalPsf::core_px`].
    core_px: f64,
    /// Half the side of the largest image, px.
    reach_px: f64,
    gradient: Gradient,
}

/// Change of a pixel's share with the position of the source.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gradient {
    /// The greatest share of any pixel (1).
    pub peak: f64,
    /// The steepest slope of a share, 1/px.
    pub slope: f64,
    /// The greatest jump of that slope at the end of a cell, 1/px.
    pub kink: f64,
    /// The peak relative to the brightest pixel of the image, for the position of the source within
    /// a pixel at which that pixel is faintest (1).
    pub over_brightest: f64,
}

/// The cell of a coordinate, and its position within the cell (0..1).
type Corner = (usize, f64);

/// Up to four images and their weights.
pub(crate) type Mix = [(usize, f64); 4];

/// Why samples are refused as a point spread function.
#[derive(Debug, Clone, PartialEq)]
pub enum Flaw {
    /// A row differs in length from the first, or there is none.
    Ragged,
    /// A sample is negative, infinite or NaN.
    Sample(f64),
    /// The light does not sum to 1.
    Sum(f64),
}

/// Tolerance of the sum of an image's samples, for rounded values. The samples are then scaled to
/// 1.
pub const SUM_TOLERANCE: f64 = 1e-3;

impl Image {
    /// The image of these rows of samples.
    pub fn new(rows: &[Vec<f64>]) -> Result<Image, Flaw> {
        let columns = rows.first().map_or(0, Vec::len);
        if columns == 0 || rows.iter().any(|row| row.len() != columns) {
            return Err(Flaw::Ragged);
        }
        let samples = || rows.iter().flatten().copied();
        if let Some(bad) = samples().find(|s| !(0.0..f64::INFINITY).contains(s)) {
            return Err(Flaw::Sample(bad));
        }
        let total: f64 = samples().sum();
        if (total - 1.0).abs() > SUM_TOLERANCE {
            return Err(Flaw::Sum(total));
        }
        let wide = columns + 1;
        let mut sums = vec![0.0; wide * (rows.len() + 1)];
        let mut offset = [0.0; 2];
        for (i, row) in rows.iter().enumerate() {
            let mut line = 0.0;
            for (j, sample) in row.iter().enumerate() {
                line += sample / total;
                let from_middle = |i: usize, cells: usize| i as f64 + 0.5 - cells as f64 / 2.0;
                offset[0] += sample / total * from_middle(j, columns);
                offset[1] += sample / total * from_middle(i, rows.len());
                sums[(i + 1) * wide + j + 1] = sums[i * wide + j + 1] + line;
            }
        }
        Ok(Image {
            columns,
            rows: rows.len(),
            sums,
            offset,
        })
    }

    /// Light left of and above a position within a cell.
    fn light(&self, (i, s): Corner, (j, t): Corner) -> f64 {
        let at = |i: usize, j: usize| self.sums[j * (self.columns + 1) + i];
        (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j))
            + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1))
    }

    /// Change of the shares with the position of the source.
    fn gradient(&self, oversampling: f64) -> Gradient {
        // At the ends of cells, and at least four times per pixel: shares are linear between.
        const MIN: f64 = 4.0;
        let per_cell = (MIN / oversampling).ceil().max(1.0);
        let steps = (oversampling * per_cell).round().clamp(1.0, 64.0);
        let positions = |cells: usize| {
            let half = cells as f64 / 2.0 / oversampling + 1.0;
            let n = (half * steps).ceil() as i64;
            (-n..=n).map(move |i| i as f64 / steps)
        };
        let corner = |px: f64, cells: usize| -> Corner {
            let position = (px * oversampling + cells as f64 / 2.0).clamp(0.0, cells as f64);
            let first = (position as usize).min(cells - 1);
            (first, position - first as f64)
        };
        let edges = |px: f64, cells: usize| [corner(px - 0.5, cells), corner(px + 0.5, cells)];
        let across: Vec<[Corner; 2]> = positions(self.columns)
            .map(|px| edges(px, self.columns))
            .collect();
        let shares: Vec<f64> = positions(self.rows)
            .map(|px| edges(px, self.rows))
            .flat_map(|[above, below]| {
                let of = move |[left, right]: &[Corner; 2]| {
                    self.light(*right, below) - self.light(*left, below) - self.light(*right, above)
                        + self.light(*left, above)
                };
                across.iter().map(of)
            })
            .collect();
        Gradient::of(&shares, across.len(), steps as usize)
    }

    /// Radius (cells) of a disc with the area of all cells above half the brightest.
    fn half_width(&self) -> f64 {
        let cell = |i: usize, j: usize| {
            let at = |i: usize, j: usize| self.sums[j * (self.columns + 1) + i];
            at(i + 1, j + 1) - at(i, j + 1) - at(i + 1, j) + at(i, j)
        };
        let cells: Vec<f64> = (0..self.rows)
            .flat_map(|j| (0..self.columns).map(move |i| cell(i, j)))
            .collect();
        let half = cells.iter().copied().fold(0.0, f64::max) / 2.0;
        let bright = cells.iter().filter(|light| **light > half).count();
        (bright as f64 / std::f64::consts::PI).sqrt()
    }
}

impl Gradient {
    /// From the shares of a pixel for source offsets in steps, `steps` per pixel, row by row.
    fn of(shares: &[f64], wide: usize, steps: usize) -> Gradient {
        let at = |i: usize, j: usize| shares[j * wide + i];
        let peak = shares.iter().copied().fold(0.0, f64::max);
        let rows = shares.len() / wide;
        let [mut slope, mut kink] = [0.0f64; 2];
        for j in 1..rows - 1 {
            for i in 1..wide - 1 {
                let own = at(i, j);
                let across = [at(i - 1, j) - own, at(i + 1, j) - own];
                let down = [at(i, j - 1) - own, at(i, j + 1) - own];
                let steeper = |[a, b]: [f64; 2]| a.abs().max(b.abs());
                slope = slope.max(libm::hypot(steeper(across), steeper(down)));
                let bend = |[a, b]: [f64; 2]| (a + b).abs();
                kink = kink.max(bend(across) + bend(down));
            }
        }
        // The brightest pixel for each position of the source within a pixel.
        let brightest = (0..steps * steps).map(|phase| {
            let rows = (phase / steps..rows).step_by(steps);
            let shares =
                rows.flat_map(|j| (phase % steps..wide).step_by(steps).map(move |i| at(i, j)));
            shares.fold(0.0, f64::max)
        });
        let faintest = brightest.fold(peak, f64::min);
        Gradient {
            peak,
            slope: slope * steps as f64,
            kink: kink * steps as f64,
            over_brightest: peak / faintest.max(f64::MIN_POSITIVE),
        }
    }

    /// A bound of both.
    fn or(self, other: Gradient) -> Gradient {
        Gradient {
            peak: self.peak.max(other.peak),
            slope: self.slope.max(other.slope),
            kink: self.kink.max(other.kink),
            over_brightest: self.over_brightest.max(other.over_brightest),
        }
    }
}

impl Images {
    /// `images`, row by row, at the nodes of `places` (columns, rows; px from the principal point,
    /// rising). None if their number differs from that of the nodes, or if there is less than one
    /// cell or more than a thousand per pixel.
    pub fn new(oversampling: f64, places: [Vec<f64>; 2], images: Vec<Image>) -> Option<Images> {
        let is_whole = images.len() == places[0].len() * places[1].len();
        if images.is_empty() || !is_whole || !(1.0..=1e3).contains(&oversampling) {
            return None;
        }
        let cells = images
            .iter()
            .map(|image| image.columns.max(image.rows))
            .max()?;
        let half = images
            .iter()
            .map(Image::half_width)
            .fold(f64::MAX, f64::min);
        // The full width at half maximum of a Gaussian is 2.3548 standard deviations.
        let core_px = 2.0 * half / oversampling / 2.354_820_045;
        let gradients = images.iter().map(|image| image.gradient(oversampling));
        let gradient = gradients.fold(Gradient::default(), Gradient::or);
        Some(Images {
            oversampling,
            places,
            core_px,
            reach_px: cells as f64 / 2.0 / oversampling,
            gradient,
            images,
        })
    }

    /// The bound of all images.
    pub(crate) fn gradient(&self) -> Gradient {
        self.gradient
    }

    /// The standard deviation of the narrowest core, px.
    pub(crate) fn core_px(&self) -> f64 {
        self.core_px
    }

    /// Half the side of the largest image, px.
    pub(crate) fn reach_px(&self) -> f64 {
        self.reach_px
    }

    /// Greatest number of images in a mix.
    pub(crate) fn mixed(&self) -> usize {
        self.images.len().min(4)
    }

    /// From the source to the centroid of its light, px.
    pub(crate) fn offset_px(&self, mix: &Mix) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (i, weight) in mix {
            let offset = self.images.get(*i).map_or([0.0; 2], |image| image.offset);
            sum = [0, 1].map(|k| sum[k] + weight * offset[k] / self.oversampling);
        }
        sum
    }

    /// The images and weights at a position of the field.
    pub(crate) fn mix(&self, field_px: [f64; 2]) -> Mix {
        let [(i, s), (j, t)] = [0, 1].map(|axis| between(&self.places[axis], field_px[axis]));
        let columns = self.places[0].len();
        let index =
            |i: usize, j: usize| j.min(self.places[1].len() - 1) * columns + i.min(columns - 1);
        [
            (index(i, j), (1.0 - s) * (1.0 - t)),
            (index(i + 1, j), s * (1.0 - t)),
            (index(i, j + 1), (1.0 - s) * t),
            (index(i + 1, j + 1), s * t),
        ]
    }

    /// Spreads `light` around `at` (px) over the rectangles between the left edges of the columns
    /// `edges` on `rows`, row by row into the empty `out`.
    pub(crate) fn spread(
        &self,
        mix: &Mix,
        light: f64,
        at: [f64; 2],
        edges: impl ExactSizeIterator<Item = i64> + Clone,
        rows: Range<i64>,
        out: &mut Vec<f64>,
    ) {
        let wide = edges.len().saturating_sub(1);
        out.resize(wide * (rows.end - rows.start) as usize, 0.0);
        let parts = mix.iter().filter(|(_, weight)| *weight > 0.0);
        for (image, weight) in parts.filter_map(|(i, weight)| Some((self.images.get(*i)?, weight)))
        {
            let corner = |i: i64, at: f64, cells: usize| -> Corner {
                let from_middle = (i as f64 - 0.5 - at) * self.oversampling;
                let position = (from_middle + cells as f64 / 2.0).clamp(0.0, cells as f64);
                let first = (position as usize).min(cells - 1);
                (first, position - first as f64)
            };
            let across = edges.clone().map(|i| corner(i, at[0], image.columns));
            let across: Vec<Corner> = across.collect();
            let corners = |row: i64, line: &mut Vec<f64>| {
                let down = corner(row, at[1], image.rows);
                line.clear();
                line.extend(across.iter().map(|across| image.light(*across, down)));
            };
            let (mut above, mut below) = (Vec::new(), Vec::new());
            corners(rows.start, &mut above);
            for (row, out) in rows.clone().zip(out.chunks_exact_mut(wide.max(1))) {
                corners(row + 1, &mut below);
                for ((out, a), b) in out.iter_mut().zip(above.windows(2)).zip(below.windows(2)) {
                    *out += light * weight * ((b[1] - b[0]) - (a[1] - a[0])).max(0.0);
                }
                std::mem::swap(&mut above, &mut below);
            }
        }
    }
}

/// The sum of the differences between the weights of each image.
pub(crate) fn apart(a: &Mix, b: &Mix) -> f64 {
    let weight = |mix: &Mix, image: usize| -> f64 {
        let same = mix.iter().filter(|(i, _)| *i == image);
        same.map(|(_, weight)| weight).sum()
    };
    let mut all: Vec<usize> = a.iter().chain(b).map(|(image, _)| *image).collect();
    all.sort_unstable();
    all.dedup();
    let apart = all
        .iter()
        .map(|image| (weight(a, *image) - weight(b, *image)).abs());
    apart.sum()
}

/// The index of the position before `at`, and the fraction of the distance to the next.
fn between(places: &[f64], at: f64) -> (usize, f64) {
    let next = places.partition_point(|place| *place <= at);
    match (
        next.checked_sub(1).and_then(|i| places.get(i)),
        places.get(next),
    ) {
        (Some(low), Some(high)) => (next - 1, (at - low) / (high - low)),
        (Some(_), None) => (next - 1, 0.0),
        _ => (0, 0.0),
    }
}
