//! Background level and noise, measured in tiles from the pixels alone.
//!
//! For each tile, the median and the median absolute deviation give a first estimate, which stars
//! hardly change. Mean and standard deviation of the values within three sigma resolve fractions of
//! a DN. The level is bilinear between tile centres and extrapolated linearly to the frame's edge.

use crate::image::Image;

/// Approximate side of a tile, px: some hundred times the area of a star.
const TILE: usize = 32;
/// Standard deviation over median absolute deviation of a normal distribution.
const SIGMA_PER_MAD: f64 = 1.4826;
/// Standard deviation of the rounding to whole DN: 1/sqrt(12).
const QUANTISATION_DN: f64 = 0.288_675;

#[derive(Debug)]
pub(crate) struct Background {
    width: usize,
    height: usize,
    columns: usize,
    rows: usize,
    /// One (level, sigma) per tile, e-.
    tiles: Vec<(f32, f32)>,
}

impl Background {
    /// Measures a non-empty image.
    pub(crate) fn measure(image: &Image<'_>) -> Self {
        let (columns, rows) = ((image.width / TILE).max(1), (image.height / TILE).max(1));
        let bounds = |index: usize, count: usize, end: usize| {
            (index * end / count, (index + 1) * end / count)
        };
        let mut tiles = Vec::with_capacity(columns * rows);
        let mut values = Vec::with_capacity(4 * TILE * TILE);
        for row in 0..rows {
            let (top, bottom) = bounds(row, rows, image.height);
            for column in 0..columns {
                let (left, right) = bounds(column, columns, image.width);
                values.clear();
                let lines = image.pixels.chunks_exact(image.width);
                for line in lines.take(bottom).skip(top) {
                    values.extend_from_slice(&line[left..right]);
                }
                let (mean_dn, sigma_dn) = clipped_moments(&mut values);
                let gain = image.gain_e_per_dn;
                let level = (mean_dn - image.offset_dn) * gain;
                tiles.push((level as f32, (sigma_dn * gain) as f32));
            }
        }
        Self {
            width: image.width,
            height: image.height,
            columns,
            rows,
            tiles,
        }
    }

    /// Level and sigma at a pixel, e-.
    pub(crate) fn at(&self, x: usize, y: usize) -> (f32, f32) {
        let (x0, x1, u) = neighbours(x, self.width, self.columns);
        let (y0, y1, v) = neighbours(y, self.height, self.rows);
        let tile = |column: usize, row: usize| self.tiles[row * self.columns + column];
        let corners = [tile(x0, y0), tile(x1, y0), tile(x0, y1), tile(x1, y1)];
        let mix = |[a, b, c, d]: [f32; 4], u: f32, v: f32| {
            let (top, bottom) = (a + (b - a) * u, c + (d - c) * u);
            top + (bottom - top) * v
        };
        // Noise is not extrapolated: it must not become negative.
        let [within_u, within_v] = [u, v].map(|at| at.clamp(0.0, 1.0));
        let sigma = mix(corners.map(|(_, sigma)| sigma), within_u, within_v);
        (mix(corners.map(|(level, _)| level), u, v), sigma)
    }
}

/// The two tiles to interpolate between, and the position between their centres: 0 at the first, 1
/// at the second, outside 0..1 near the frame's edge.
fn neighbours(coordinate: usize, end: usize, count: usize) -> (usize, usize, f32) {
    if count < 2 {
        return (0, 0, 0.0);
    }
    let position = (coordinate as f32 + 0.5) * count as f32 / end as f32 - 0.5;
    let first = (position.max(0.0) as usize).min(count - 2);
    (first, first + 1, position - first as f32)
}

/// Mean and standard deviation of the values within three robust sigma of the median.
fn clipped_moments(values: &mut [u16]) -> (f64, f64) {
    let median = median(values);
    let mut deviations: Vec<u16> = values.iter().map(|value| value.abs_diff(median)).collect();
    // If more than half of the pixels are equal, the deviation is 0: half a DN replaces it.
    let sigma = (SIGMA_PER_MAD * f64::from(self::median(&mut deviations))).max(0.5);
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values.iter() {
        let d = f64::from(*value) - f64::from(median);
        if d.abs() <= 3.0 * sigma {
            count += 1.0;
            sum += d;
            squares += d * d;
        }
    }
    // The median is always within the limit, so count is at least 1.
    let mean = sum / count;
    let variance = (squares / count - mean * mean).max(0.0);
    let sigma = variance.sqrt().max(QUANTISATION_DN);
    (f64::from(median) + mean, sigma)
}

fn median(values: &mut [u16]) -> u16 {
    let middle = values.len() / 2;
    *values.select_nth_unstable(middle).1
}
