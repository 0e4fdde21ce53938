//! Light of points along a streak, spread by a PSF that is a product of one line a coordinate.
//!
//! In single precision, which is what footprints keep, or for light so bright that the last digits of its sum are electrons in double. Places are told from a pixel
//! near them, so that nothing is lost far from the detector's corner.

use super::Real;
use std::ops::Range;

/// Powers of the series of a share in the place of the source, from 0 on.
const POWERS: usize = 4;
/// Pixels of a tile's side: the most that is worked out at a time.
const SIDE: usize = 16;
/// Rows whose ends are worked out side by side.
pub const ROWS: usize = 16;
/// Shares below are none: products of two stay far from what is too small for single precision.
const LEAST: f64 = 1e-15;
/// Nothing reaches so far, px.
const BEYOND_PX: f32 = 1e6;

/// The shares of pixels in a line, by where in a pixel the source is: around each of the nodes a series.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines<T> {
    /// Nodes a pixel.
    nodes: T,
    /// How far they are apart, px.
    node_px: T,
    /// Pixels on each side of the source's own.
    reach: i32,
    /// Terms of a power, one a pixel; so many that a tile may be taken anywhere.
    stride: usize,
    /// By node, by power.
    terms: Vec<T>,
}

/// A point of a streak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Column and row of the first pixel that its circle may reach.
    pub first: [i32; 2],
    /// From the middle of that one to where it is, px.
    pub off: [f64; 2],
    /// Its light (1).
    pub light: f64,
}

/// How far the light of each dot is drawn: over the pixels that a circle touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Its radius, px.
    pub radius: f32,
    /// Columns and rows that it may touch.
    pub side: usize,
}

/// The columns of each row that the dots' circles touch, from `low` up to `past`; where they touch none, `low` is the greater. There are rows for [`ROWS`] at a time.
#[derive(Debug)]
pub struct Ends<'a> {
    /// The first row.
    pub first_row: i32,
    /// The first column.
    pub low: &'a mut [i32],
    /// The column after the last.
    pub past: &'a mut [i32],
}

/// Where light is laid: rows of pixels one after another, each with room for all tiles that begin in it.
#[derive(Debug)]
pub struct Sheet<'a, T> {
    /// The first row.
    pub first_row: i32,
    /// Where the pixel of column 0 is in `light`, or would be, by row.
    pub origins: &'a [i32],
    /// A value a pixel (1).
    pub light: &'a mut [T],
}

impl Circle {
    /// The circle of a `radius` (px).
    pub fn new(radius: f64) -> Circle {
        Circle {
            radius: radius as f32,
            side: (2.0 * radius) as usize + 2,
        }
    }

    /// Columns that a tile of such a dot is wide, or all its tiles together are.
    pub fn wide(&self) -> usize {
        match self.side {
            0..=8 => 8,
            9..=12 => 12,
            side => side.next_multiple_of(SIDE),
        }
    }
}

impl Dot {
    /// A point at `at` (px) with a circle of `radius` (px), less than 2^31 px from pixel 0.
    pub fn new(at: [f64; 2], light: f64, radius: f64) -> Dot {
        let near = at.map(|x| (x - radius).nearest());
        Dot {
            first: near.map(|(first, _)| first),
            off: [0, 1].map(|k| at[k] - near[k].1),
            light,
        }
    }
}

impl<T: Real> Lines<T> {
    /// With so many `nodes` a pixel, for sources up to `reach` pixels away. `terms` gives, for a pixel so many pixels from the source's own and a
    /// source so far (0..1, px) above that one's lower edge, Taylor's series of its share in that place.
    pub fn new(nodes: usize, reach: usize, terms: impl Fn(i64, f64) -> [f64; POWERS]) -> Lines<T> {
        let pixels = 2 * reach + 1;
        let stride = pixels + SIDE;
        let mut all = vec![T::default(); (nodes + 1) * POWERS * stride];
        for (node, lines) in all.chunks_exact_mut(POWERS * stride).enumerate() {
            let above = node as f64 / nodes as f64;
            for i in 0..pixels {
                let terms = terms(i as i64 - reach as i64, above);
                if terms[0] < LEAST {
                    continue;
                }
                for (power, term) in terms.into_iter().enumerate() {
                    lines[power * stride + i] = T::of(term);
                }
            }
        }
        Lines {
            nodes: T::of(nodes as f64),
            node_px: T::of(1.0 / nodes as f64),
            reach: reach as i32,
            stride,
            terms: all,
        }
    }

    /// How far (px) they reach around any source.
    pub fn reach_px(&self) -> f64 {
        f64::from(self.reach) - 1.0
    }

    /// The shares of `L` pixels from `first` on of the light of a source that is `off` (px) from the middle of pixel 0.
    #[inline(always)]
    fn shares<const L: usize>(&self, off: f64, first: usize) -> [T; L] {
        let off = T::of(off);
        let (pixel, own) = off.nearest();
        let above = off - own + T::of(0.5);
        let (node, at) = (above * self.nodes).nearest();
        let off = (-at).fused(self.node_px, above);
        let from = node as u32 as usize * (POWERS * self.stride)
            + (self.reach - pixel) as u32 as usize
            + first;
        let terms = &self.terms[from..from + (POWERS - 1) * self.stride + L];
        let mut sum = [T::default(); L];
        for power in (0..POWERS).rev() {
            let terms = &terms[power * self.stride..][..L];
            for i in 0..L {
                sum[i] = sum[i].fused(off, terms[i]);
            }
        }
        sum
    }
}

/// Widens the rows' ends to what the dots' circles touch.
#[inline(always)]
pub fn ends_body(circle: &Circle, dots: &[Dot], ends: &mut Ends<'_>) {
    let squared = circle.radius * circle.radius;
    for dot in dots {
        let top = (dot.first[1] - ends.first_row) as u32 as usize;
        for block in 0..circle.side.div_ceil(ROWS) {
            let row = block * ROWS;
            let rows = top + row..top + row + ROWS;
            let (mut from, mut to) = ([0; ROWS], [0; ROWS]);
            for i in 0..ROWS {
                [from[i], to[i]] =
                    columns(dot, dot.off[1] as f32 - (row as f32 + i as f32), squared);
            }
            let low = &mut ends.low[rows.clone()];
            for i in 0..ROWS {
                low[i] = low[i].min(from[i]);
            }
            let past = &mut ends.past[rows];
            for i in 0..ROWS {
                past[i] = past[i].max(to[i]);
            }
        }
    }
}

/// The columns that the circle of a dot touches in a row whose middle is `away` (px) from it: from the first up to the other; where it touches none, the
/// first is far beyond.
///
/// ```text
/// x -+ (r^2 - d^2)^(1/2),   d = max(|away| - 1/2, 0)
/// ```
#[inline(always)]
fn columns(dot: &Dot, away: f32, squared: f32) -> [i32; 2] {
    let d = (away.abs() - 0.5).max(0.0);
    let rest = f32::mul_add(-d, d, squared);
    // Roots of all, so that lanes run side by side.
    let none = if rest > 0.0 { 0.0 } else { BEYOND_PX };
    let half = rest.max(0.0).sqrt() - none;
    let x = dot.off[0] as f32;
    let [column, _] = dot.first;
    [
        (x - half).nearest().0 + column,
        (x + half).nearest().0 + column + 1,
    ]
}

/// The same, row by row.
#[inline(always)]
pub fn ends_twin(circle: &Circle, dots: &[Dot], ends: &mut Ends<'_>) {
    let squared = circle.radius * circle.radius;
    for dot in dots {
        let top = (dot.first[1] - ends.first_row) as u32 as usize;
        for row in 0..circle.side.next_multiple_of(ROWS) {
            let [low, past] = columns(dot, dot.off[1] as f32 - row as f32, squared);
            ends.low[top + row] = ends.low[top + row].min(low);
            ends.past[top + row] = ends.past[top + row].max(past);
        }
    }
}

/// Adds the light of dots, tile by tile.
#[inline(always)]
pub fn body<T: Real>(lines: &Lines<T>, circle: &Circle, dots: &[Dot], sheet: &mut Sheet<'_, T>) {
    // (Closures would be compiled without the level's instructions.)
    match circle.wide() {
        8 => {
            for dot in dots {
                tile::<T, 8>(lines, dot, 0, 0..circle.side, sheet);
            }
        }
        12 => {
            for dot in dots {
                tile::<T, 12>(lines, dot, 0, 0..circle.side, sheet);
            }
        }
        wide => {
            for dot in dots {
                for row in (0..circle.side).step_by(SIDE) {
                    for column in (0..wide).step_by(SIDE) {
                        let rows = row..(row + SIDE).min(circle.side);
                        tile::<T, SIDE>(lines, dot, column, rows, sheet);
                    }
                }
            }
        }
    }
}

/// That of one on `L` columns from `column` on and no more rows.
#[inline(always)]
fn tile<T: Real, const L: usize>(
    lines: &Lines<T>,
    dot: &Dot,
    column: usize,
    rows: Range<usize>,
    sheet: &mut Sheet<'_, T>,
) {
    let mut down = lines.shares::<L>(dot.off[1], rows.start);
    let light = T::of(dot.light);
    for share in &mut down {
        *share = *share * light;
    }
    let across = lines.shares::<L>(dot.off[0], column);
    let top = (dot.first[1] - sheet.first_row) as u32 as usize;
    let first = dot.first[0] + column as i32;
    let origins = &sheet.origins[top + rows.start..top + rows.end];
    for (origin, down) in origins.iter().zip(&down) {
        let from = (origin + first) as u32 as usize;
        let pixels = &mut sheet.light[from..from + L];
        for i in 0..L {
            pixels[i] = across[i].fused(*down, pixels[i]);
        }
    }
}

/// The same, pixel by pixel.
#[inline(always)]
pub fn twin<T: Real>(lines: &Lines<T>, circle: &Circle, dots: &[Dot], sheet: &mut Sheet<'_, T>) {
    let share = |off: f64, pixel: usize| {
        let [share] = lines.shares::<1>(off, pixel);
        share
    };
    for dot in dots {
        let top = (dot.first[1] - sheet.first_row) as u32 as usize;
        for row in 0..circle.side {
            let down = share(dot.off[1], row) * T::of(dot.light);
            let origin = sheet.origins[top + row] + dot.first[0];
            for column in 0..circle.wide() {
                let pixel = &mut sheet.light[origin as u32 as usize + column];
                *pixel = share(dot.off[0], column).fused(down, *pixel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{lay_dots, lay_dots_finely, reach_dots};
    use skyloop_orbit::sgp4_batch::Level;

    /// Pixels of a sheet's rows, and how many rows; around the pixels 0..64 and 0..50 there is room for tiles.
    const WIDE: i32 = 128;
    const HIGH: i32 = 90;
    /// Where pixel 0 is.
    const FIRST: i32 = -16;

    /// Shares that are polynomials of the place: a parabola of 41 pixels, the sums of which are known.
    fn parabolas<T: Real>() -> Lines<T> {
        // (1 - (j + 1/2 - f)^2 / 400) / 40 around f.
        Lines::new(7, 20, |j, f| {
            let u = j as f64 + 0.5 - f;
            [
                (1.0 - u * u / 400.0) / 40.0,
                2.0 * u / 16_000.0,
                -1.0 / 16_000.0,
                0.0,
            ]
        })
    }

    fn dots(radius: f64) -> Vec<Dot> {
        let dot = |i: i32| {
            let at = [30.0 + 0.37 * f64::from(i), 25.3 - 0.21 * f64::from(i)];
            Dot::new(at, 0.5 + f64::from(i), radius)
        };
        (0..40).map(dot).collect()
    }

    fn laid<T: Real>(
        kernel: impl Fn(Option<Level>, &Lines<T>, &Circle, &[Dot], &mut Sheet<'_, T>),
        level: Option<Level>,
        radius: f64,
        dots: &[Dot],
    ) -> Vec<T> {
        let origins: Vec<i32> = (0..HIGH).map(|row| row * WIDE - FIRST).collect();
        let mut light = vec![T::default(); (HIGH * WIDE) as usize];
        let mut sheet = Sheet {
            first_row: FIRST,
            origins: &origins,
            light: &mut light,
        };
        let circle = Circle::new(radius);
        kernel(level, &parabolas(), &circle, dots, &mut sheet);
        light
    }

    fn ends(level: Option<Level>, radius: f64, dots: &[Dot]) -> [Vec<i32>; 2] {
        let mut ends = [vec![i32::MAX; HIGH as usize], vec![i32::MIN; HIGH as usize]];
        let [low, past] = &mut ends;
        let mut all = Ends {
            first_row: FIRST,
            low,
            past,
        };
        reach_dots(level, &Circle::new(radius), dots, &mut all);
        ends
    }

    #[test]
    fn all_levels_lay_the_same_bits() {
        // Of one tile of each width, and of several.
        for radius in [3.1, 4.9, 7.2, 14.3] {
            let dots = dots(radius);
            let bits = |level: Option<Level>| {
                let single = laid(lay_dots, level, radius, &dots);
                let double = laid(lay_dots_finely, level, radius, &dots);
                assert!(single.iter().sum::<f32>() > 10.0);
                let double = double.into_iter().map(f64::to_bits);
                let single = single.into_iter().map(|e| u64::from(e.to_bits()));
                single.chain(double).collect::<Vec<_>>()
            };
            let (twin, reached) = (bits(None), ends(None, radius, &dots));
            for level in Level::available() {
                assert!(bits(Some(level)) == twin, "{level:?} {radius}");
                assert_eq!(ends(Some(level), radius, &dots), reached, "{level:?}");
            }
        }
    }

    #[test]
    fn a_dot_is_the_product_of_its_lines() {
        let at = [30.3, 24.9];
        for radius in [3.0, 5.2, 14.4] {
            let dot = Dot::new(at, 2.0, radius);
            let (side, wide) = (Circle::new(radius).side, Circle::new(radius).wide());
            let single = laid(lay_dots, Some(Level::best()), radius, &[dot]);
            let double = laid(lay_dots_finely, Some(Level::best()), radius, &[dot]);
            for row in 0..50 {
                for column in 0..64 {
                    // X-Val: the parabola itself, at the pixel's distance from the source.
                    let line = |i: i32, at: f64| (1.0 - (f64::from(i) - at).powi(2) / 400.0) / 40.0;
                    let is_lit = (dot.first[0]..dot.first[0] + wide as i32).contains(&column)
                        && (dot.first[1]..dot.first[1] + side as i32).contains(&row);
                    let share = if is_lit {
                        2.0 * line(column, at[0]) * line(row, at[1])
                    } else {
                        0.0
                    };
                    let place = ((row - FIRST) * WIDE + column - FIRST) as usize;
                    // What single and double precision tell of 2 / 40^2.
                    let found = [(f64::from(single[place]), 1e-9), (double[place], 1e-17)];
                    for (found, most) in found {
                        let off = (found - share).abs();
                        assert!(off < most, "{column} {row} {found} {share}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_ends_of_rows_are_those_of_the_pixels_that_circles_touch() {
        for radius in [0.2, 3.0, 5.2, 11.7] {
            for at in [[30.3, 24.9], [29.5, 25.5], [40.07, 17.61]] {
                let [low, past] = ends(Some(Level::best()), radius, &[Dot::new(at, 1.0, radius)]);
                for row in FIRST..FIRST + HIGH {
                    // X-Val: pixel by pixel, the nearest place of its square.
                    let away = |i: i32, at: f64| ((f64::from(i) - at).abs() - 0.5).max(0.0);
                    let is_touched =
                        |i: &i32| away(*i, at[0]).hypot(away(row, at[1])) < radius - 1e-5;
                    let i = (row - FIRST) as usize;
                    let found: Vec<i32> = (low[i]..past[i].max(low[i])).collect();
                    let touched: Vec<i32> = (0..100).filter(is_touched).collect();
                    // Pixels whose edge or corner it meets may be told as touched.
                    let more = found.len() - touched.len();
                    assert!(touched.iter().all(|pixel| found.contains(pixel)));
                    let meets = [at[0] - radius, at[0] + radius]
                        .iter()
                        .any(|x| (x + 0.5).fract() == 0.0);
                    assert!(more == 0 || meets && more <= 2, "{radius} {at:?} {row}");
                }
            }
        }
    }
}
