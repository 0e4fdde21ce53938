//! Light of points along a streak, spread by a PSF that is a product of one line a coordinate.

use std::ops::Range;

/// Powers of the series of a share in the place of the source, from 0 on.
pub const POWERS: usize = 6;
/// Pixels of a tile's side: the most that is worked out at a time.
pub const SIDE: usize = 16;

/// What counts of a tile, and what does not: a product instead of jumps.
const COUNTS: [f64; 2 * SIDE] = {
    let mut counts = [0.0; 2 * SIDE];
    let mut i = 0;
    while i < SIDE {
        counts[i] = 1.0;
        i += 1;
    }
    counts
};

/// The shares of pixels in a line, by where in a pixel the source is: around each of the nodes a series.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines {
    /// Nodes a pixel.
    nodes: f64,
    /// Pixels on each side of the source's own.
    reach: i64,
    /// Terms of a power, one a pixel; so many that a tile may be taken anywhere.
    stride: usize,
    /// By node, by power.
    terms: Vec<f64>,
}

/// A point of a streak.
#[derive(Debug, Clone, PartialEq)]
pub struct Dot {
    /// Where, px.
    pub at: [f64; 2],
    /// Its light (1).
    pub light: f64,
    /// The columns and rows of the detector that are lit.
    pub pixels: [Range<i64>; 2],
}

/// Where light is laid: lines of pixels one after another, each as long as it must be, and [`SIDE`] values more.
#[derive(Debug)]
pub struct Sheet<'a> {
    /// The first row.
    pub first_row: i64,
    /// Where the pixel of column 0 is in `light`, or would be, by row.
    pub origins: &'a [i64],
    /// A value a pixel (1).
    pub light: &'a mut [f64],
}

impl Lines {
    /// With so many `nodes` a pixel, for sources up to `reach` pixels away. `terms` gives, for a pixel so many pixels from the source's own and a
    /// source so far (0..1, px) above that one's lower edge, Taylor's series of its share in that place.
    pub fn new(nodes: usize, reach: i64, terms: impl Fn(i64, f64) -> [f64; POWERS]) -> Lines {
        let pixels = 2 * reach.unsigned_abs() as usize + 1;
        let stride = pixels + SIDE;
        let mut all = vec![0.0; (nodes + 1) * POWERS * stride];
        for (node, lines) in all.chunks_exact_mut(POWERS * stride).enumerate() {
            let above = node as f64 / nodes as f64;
            for i in 0..pixels {
                for (power, term) in terms(i as i64 - reach, above).into_iter().enumerate() {
                    lines[power * stride + i] = term;
                }
            }
        }
        Lines {
            nodes: nodes as f64,
            reach,
            stride,
            terms: all,
        }
    }

    /// How far (px) they reach around any source.
    pub fn reach_px(&self) -> f64 {
        self.reach as f64 - 1.0
    }

    /// Where the terms of the pixels from `first` on begin for a source at `at` (px), and how far that is from its node, px.
    #[inline(always)]
    fn near(&self, at: f64, first: i64) -> (usize, f64) {
        let own = (at + 0.5).floor();
        let above = at + 0.5 - own;
        let node = (above * self.nodes + 0.5).floor();
        let from = node as usize * POWERS * self.stride;
        let pixel = (first - own as i64 + self.reach) as usize;
        (from + pixel, above - node / self.nodes)
    }

    /// The shares of `L` pixels from `first` on of the light of a source at `at` (px).
    #[inline(always)]
    fn shares<const L: usize>(&self, at: f64, first: i64) -> [f64; L] {
        let (from, off) = self.near(at, first);
        let mut sum = [0.0; L];
        for power in (0..POWERS).rev() {
            let from = from + power * self.stride;
            let terms = &self.terms[from..from + L];
            for i in 0..L {
                sum[i] = f64::mul_add(sum[i], off, terms[i]);
            }
        }
        sum
    }

    /// The share of one.
    #[inline(always)]
    fn share(&self, at: f64, pixel: i64) -> f64 {
        let [share] = self.shares::<1>(at, pixel);
        share
    }
}

/// Adds the light of dots, tile by tile.
#[inline(always)]
pub fn body(lines: &Lines, dots: &[Dot], sheet: &mut Sheet<'_>) {
    for dot in dots {
        let [columns, rows] = &dot.pixels;
        for row in rows.clone().step_by(SIDE) {
            let mut down = lines.shares::<SIDE>(dot.at[1], row);
            down.iter_mut().for_each(|share| *share *= dot.light);
            let rows = row - sheet.first_row..(row + SIDE as i64).min(rows.end) - sheet.first_row;
            let rows = rows.start as usize..rows.end as usize;
            let down = &down[..rows.len()];
            for column in columns.clone().step_by(SIDE) {
                let wide = (columns.end - column).min(SIDE as i64) as usize;
                match wide {
                    0..=8 => tile::<8>(lines, dot.at[0], column, wide, rows.clone(), down, sheet),
                    9..=12 => tile::<12>(lines, dot.at[0], column, wide, rows.clone(), down, sheet),
                    _ => tile::<SIDE>(lines, dot.at[0], column, wide, rows.clone(), down, sheet),
                }
            }
        }
    }
}

/// Adds that of one on `wide` of `L` columns from `column` on; nothing is added to the others, whichever they are.
#[inline(always)]
fn tile<const L: usize>(
    lines: &Lines,
    x: f64,
    column: i64,
    wide: usize,
    rows: Range<usize>,
    down: &[f64],
    sheet: &mut Sheet<'_>,
) {
    let mut across = lines.shares::<L>(x, column);
    let counts = &COUNTS[SIDE - wide..][..L];
    for i in 0..L {
        across[i] *= counts[i];
    }
    for (origin, down) in sheet.origins[rows].iter().zip(down) {
        let from = (origin + column) as usize;
        let pixels = &mut sheet.light[from..from + L];
        for i in 0..L {
            pixels[i] = f64::mul_add(across[i], *down, pixels[i]);
        }
    }
}

/// The same, pixel by pixel.
#[inline(always)]
pub fn twin(lines: &Lines, dots: &[Dot], sheet: &mut Sheet<'_>) {
    for dot in dots {
        let [columns, rows] = &dot.pixels;
        for row in rows.clone() {
            let down = lines.share(dot.at[1], row) * dot.light;
            let origin = sheet.origins[(row - sheet.first_row) as usize];
            for column in columns.clone() {
                let pixel = &mut sheet.light[(origin + column) as usize];
                *pixel = f64::mul_add(lines.share(dot.at[0], column), down, *pixel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::lay_dots;
    use skyloop_orbit::sgp4_batch::Level;

    /// Shares that are polynomials of the place: a parabola of 41 pixels, the sums of which are known.
    fn parabolas() -> Lines {
        // (1 - (j + 1/2 - f)^2 / 400) / 40 around f.
        Lines::new(7, 20, |j, f| {
            let u = j as f64 + 0.5 - f;
            [
                (1.0 - u * u / 400.0) / 40.0,
                2.0 * u / 16_000.0,
                -1.0 / 16_000.0,
                0.0,
                0.0,
                0.0,
            ]
        })
    }

    /// The light of some dots on a sheet of 64 x 50 pixels.
    fn laid(level: Option<Level>) -> Vec<f64> {
        let lines = parabolas();
        let dots: Vec<Dot> = (0..40)
            .map(|i| {
                let at = [30.0 + 0.37 * f64::from(i), 25.3 - 0.21 * f64::from(i)];
                // Of all widths, cut at edges and not.
                let around = |x: f64, wide: i64, side: i64| {
                    let first = (x + 0.5).floor() as i64 - wide / 2;
                    first.max(0)..(first + wide).min(side)
                };
                let pixels = [
                    around(at[0], i64::from(i) + 1, 64),
                    around(at[1], 38 - i64::from(i) / 2, 50),
                ];
                Dot {
                    at,
                    light: 0.5 + f64::from(i),
                    pixels,
                }
            })
            .collect();
        let origins: Vec<i64> = (0..50).map(|row| row * 64).collect();
        let mut light = vec![0.0; 64 * 50 + SIDE];
        let mut sheet = Sheet {
            first_row: 0,
            origins: &origins,
            light: &mut light,
        };
        lay_dots(level, &lines, &dots, &mut sheet);
        light
    }

    #[test]
    fn all_levels_lay_the_same_bits() {
        let twin = laid(None);
        assert!(twin.iter().sum::<f64>() > 100.0);
        for level in Level::available() {
            let bits = |light: &[f64]| {
                light
                    .iter()
                    .map(|share| share.to_bits())
                    .collect::<Vec<_>>()
            };
            assert_eq!(bits(&laid(Some(level))), bits(&twin), "{level:?}");
        }
    }

    #[test]
    fn a_dot_is_the_product_of_its_lines() {
        let lines = parabolas();
        let at = [30.3, 24.9];
        let dots = [Dot {
            at,
            light: 2.0,
            pixels: [14..47, 9..41],
        }];
        let origins: Vec<i64> = (0..50).map(|row| row * 64).collect();
        let mut light = vec![0.0; 64 * 50 + SIDE];
        let mut sheet = Sheet {
            first_row: 0,
            origins: &origins,
            light: &mut light,
        };
        lay_dots(Some(Level::best()), &lines, &dots, &mut sheet);
        for row in 0..50 {
            for column in 0..64 {
                // X-Val: the parabola itself, at the pixel's distance from the source.
                let line = |i: i64, at: f64| (1.0 - (i as f64 - at).powi(2) / 400.0) / 40.0;
                let is_lit = (9..41).contains(&row) && (14..47).contains(&column);
                let share = if is_lit {
                    2.0 * line(column, at[0]) * line(row, at[1])
                } else {
                    0.0
                };
                let found = light[(row * 64 + column) as usize];
                assert!(
                    (found - share).abs() < 1e-15,
                    "{column} {row} {found} {share}"
                );
            }
        }
    }
}
