//! Light of points along a streak, with a PSF that is a product of a function of x and one of y.
//!
//! In single precision, like footprints, or in double precision for light so bright that single
//! precision would lose electrons. Positions are relative to a pixel near them, to keep precision
//! far from the detector's corner.

use super::lines::{Lines, SIDE};
use super::real::Real;
use std::ops::Range;

/// Greatest distance of the tiles of two dots that are drawn together, px.
pub const MAX_TILE_OFFSET: usize = 1;

/// A point of a streak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Column and row of the first pixel that its circle may reach.
    pub first: [i32; 2],
    /// Offset from the middle of that pixel, px.
    pub off: [f64; 2],
    /// Its light (1).
    pub light: f64,
}

/// The circle over whose pixels each dot is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Its radius, px.
    pub radius: f32,
    /// Columns and rows that it may touch.
    pub side: usize,
}

/// The buffer for light: consecutive rows of pixels, each with room for all tiles in it.
#[derive(Debug)]
pub struct Sheet<'a, T> {
    /// The first row.
    pub first_row: i32,
    /// Index in `light` of the (possibly missing) pixel of column 0, by row.
    pub origins: &'a [i32],
    /// The light of each pixel (1).
    pub light: &'a mut [T],
}

impl Circle {
    /// The circle of a `radius` (px).
    pub(crate) fn new(radius: f64) -> Circle {
        Circle {
            radius: radius as f32,
            side: (2.0 * radius) as usize + 2,
        }
    }

    /// Width of the tile of a dot, or of all its tiles together, px.
    pub(crate) fn wide(&self) -> usize {
        match self.side {
            0..=8 => 8,
            9..=12 => 12,
            side => side.next_multiple_of(SIDE),
        }
    }
}

impl Dot {
    /// A point at `at` (px) with a circle of `radius` (px), less than 2^31 px from pixel 0.
    pub(crate) fn new(at: [f64; 2], light: f64, radius: f64) -> Dot {
        // (Calls of arrays' `map` would take a third of the time.)
        let (column, first) = (at[0] - radius).nearest();
        let (row, top) = (at[1] - radius).nearest();
        Dot {
            first: [column, row],
            off: [at[0] - first, at[1] - top],
            light,
        }
    }
}

/// One or two dots drawn in a common tile, whose pixels are read and written once.
struct Group<'a> {
    dots: &'a [Dot],
    /// The first column and row of their tiles.
    first: [i32; 2],
    /// Rows of their tiles.
    rows: usize,
}

impl<'a> Group<'a> {
    /// The first dot, with the second if both fit a tile of `L` columns and at most `L` rows; none
    /// without dots.
    #[inline(always)]
    fn of<T: Real, const L: usize>(
        lines: &Lines<T>,
        circle: &Circle,
        dots: &'a [Dot],
    ) -> Option<Group<'a>> {
        let (one, others) = dots.split_first()?;
        let group = Group {
            dots: &dots[..1],
            first: one.first,
            rows: circle.side,
        };
        let Some(next) = others.first() else {
            return Some(group);
        };
        let (a, b) = (one.first, next.first);
        let distance = [a[0].abs_diff(b[0]), a[1].abs_diff(b[1])].map(|pixels| pixels as usize);
        let fits = circle.side + distance[0].max(distance[1]) <= L;
        // The common tile may begin one pixel before a dot's own.
        let reaches = lines.reach_px() >= f64::from(circle.radius) + 1.0;
        if !(fits && reaches && distance[0].max(distance[1]) <= MAX_TILE_OFFSET) {
            return Some(group);
        }
        Some(Group {
            dots: &dots[..2],
            first: [a[0].min(b[0]), a[1].min(b[1])],
            rows: circle.side + distance[1],
        })
    }
}

/// Adds the light of dots, tile by tile.
#[inline(always)]
pub(crate) fn body<T: Real>(
    lines: &Lines<T>,
    circle: &Circle,
    dots: &[Dot],
    sheet: &mut Sheet<'_, T>,
) {
    // (Closures would be compiled without the level's instructions.)
    match circle.wide() {
        8 => groups::<T, 8>(lines, circle, dots, sheet),
        12 => groups::<T, 12>(lines, circle, dots, sheet),
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

/// Adds dots whose tiles have `L` columns and at most `L` rows.
#[inline(always)]
fn groups<T: Real, const L: usize>(
    lines: &Lines<T>,
    circle: &Circle,
    mut dots: &[Dot],
    sheet: &mut Sheet<'_, T>,
) {
    while let Some(group) = Group::of::<T, L>(lines, circle, dots) {
        dots = &dots[group.dots.len()..];
        match group.dots {
            [one, next] => pair::<T, L>(lines, [one, next], &group, sheet),
            group => {
                for dot in group {
                    tile::<T, L>(lines, dot, 0, 0..circle.side, sheet);
                }
            }
        }
    }
}

/// The shares of a line of pixels from `first` on, along an axis.
#[inline(always)]
fn line<T: Real, const L: usize>(lines: &Lines<T>, dot: &Dot, first: [i32; 2], k: usize) -> [T; L] {
    lines.shares::<L>(dot.off[k], first[k] - dot.first[k])
}

/// Adds two dots to the same pixels: one, then the other.
#[inline(always)]
fn pair<T: Real, const L: usize>(
    lines: &Lines<T>,
    [one, next]: [&Dot; 2],
    group: &Group<'_>,
    sheet: &mut Sheet<'_, T>,
) {
    let first = group.first;
    let (mut down, mut next_down) = (
        line::<T, L>(lines, one, first, 1),
        line::<T, L>(lines, next, first, 1),
    );
    let light = [T::of(one.light), T::of(next.light)];
    for i in 0..L {
        down[i] = down[i] * light[0];
        next_down[i] = next_down[i] * light[1];
    }
    let across = line::<T, L>(lines, one, first, 0);
    let next_across = line::<T, L>(lines, next, first, 0);
    let top = (first[1] - sheet.first_row) as u32 as usize;
    let origins = &sheet.origins[top..top + group.rows];
    for ((origin, down), next_down) in origins.iter().zip(&down).zip(&next_down) {
        let from = (origin + first[0]) as u32 as usize;
        let pixels = &mut sheet.light[from..from + L];
        for i in 0..L {
            pixels[i] = next_across[i].fused(*next_down, across[i].fused(*down, pixels[i]));
        }
    }
}

/// Adds one dot on `L` columns from `column` on and at most `L` rows.
#[inline(always)]
fn tile<T: Real, const L: usize>(
    lines: &Lines<T>,
    dot: &Dot,
    column: usize,
    rows: Range<usize>,
    sheet: &mut Sheet<'_, T>,
) {
    let mut down = lines.shares::<L>(dot.off[1], rows.start as i32);
    let light = T::of(dot.light);
    for share in &mut down {
        *share = *share * light;
    }
    let across = lines.shares::<L>(dot.off[0], column as i32);
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
pub(crate) fn twin<T: Real>(
    lines: &Lines<T>,
    circle: &Circle,
    mut dots: &[Dot],
    sheet: &mut Sheet<'_, T>,
) {
    let wide = circle.wide();
    loop {
        let group = match wide {
            8 => Group::of::<T, 8>(lines, circle, dots),
            12 => Group::of::<T, 12>(lines, circle, dots),
            _ => Group::of::<T, 0>(lines, circle, dots),
        };
        let Some(group) = group else { return };
        dots = &dots[group.dots.len()..];
        let top = (group.first[1] - sheet.first_row) as u32 as usize;
        for dot in group.dots {
            let share = |k: usize, pixel: usize| {
                let [share] =
                    lines.shares::<1>(dot.off[k], group.first[k] - dot.first[k] + pixel as i32);
                share
            };
            let across: Vec<T> = (0..wide).map(|column| share(0, column)).collect();
            for row in 0..group.rows {
                let down = share(1, row) * T::of(dot.light);
                let origin = sheet.origins[top + row] + group.first[0];
                for (column, across) in across.iter().enumerate() {
                    let pixel = &mut sheet.light[origin as u32 as usize + column];
                    *pixel = across.fused(down, *pixel);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{add_dots, add_dots_f64};
    use skyloop_orbit::sgp4_batch::Level;

    /// Columns and rows of a sheet, with room for tiles around the pixels 0..64 and 0..50.
    const WIDE: i32 = 128;
    const HIGH: i32 = 90;
    /// First column and row.
    const FIRST: i32 = -16;

    /// Shares that are a parabola of the position, 41 pixels wide.
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

    fn rasterized<T: Real>(
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

    #[test]
    fn all_levels_add_the_same_bits() {
        // One tile of each width, and several tiles.
        for radius in [3.1, 4.9, 7.2, 14.3] {
            let dots = dots(radius);
            let bits = |level: Option<Level>| {
                let single = rasterized(add_dots, level, radius, &dots);
                let double = rasterized(add_dots_f64, level, radius, &dots);
                assert!(single.iter().sum::<f32>() > 10.0);
                let double = double.into_iter().map(f64::to_bits);
                let single = single.into_iter().map(|e| u64::from(e.to_bits()));
                single.chain(double).collect::<Vec<_>>()
            };
            let twin = bits(None);
            for level in Level::available() {
                assert!(bits(Some(level)) == twin, "{level:?} {radius}");
            }
        }
    }

    #[test]
    fn a_dot_is_the_product_of_its_lines() {
        let at = [30.3, 24.9];
        for radius in [3.0, 5.2, 14.4] {
            let dot = Dot::new(at, 2.0, radius);
            let (side, wide) = (Circle::new(radius).side, Circle::new(radius).wide());
            let single = rasterized(add_dots, Some(Level::best()), radius, &[dot]);
            let double = rasterized(add_dots_f64, Some(Level::best()), radius, &[dot]);
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
                    let position = ((row - FIRST) * WIDE + column - FIRST) as usize;
                    // Resolution of single and double precision at 2 / 40^2.
                    let found = [
                        (f64::from(single[position]), 1e-9),
                        (double[position], 1e-17),
                    ];
                    for (found, tolerance) in found {
                        let off = (found - share).abs();
                        assert!(off < tolerance, "{column} {row} {found} {share}");
                    }
                }
            }
        }
    }

    #[test]
    fn dots_in_a_common_tile_equal_single_dots() {
        let radius = 4.9;
        let circle = Circle::new(radius);
        for offset in [[0.9, -0.4], [-0.8, 0.7], [0.2, 0.1], [1.9, 0.0]] {
            let ats = [[30.3, 24.9], [30.3 + offset[0], 24.9 + offset[1]]];
            let dots = ats.map(|at| Dot::new(at, 2.0, radius));
            let group = Group::of::<f64, 12>(&parabolas(), &circle, &dots).unwrap();
            assert_eq!(group.dots.len(), if offset[0] > 1.0 { 1 } else { 2 });
            let rasterized =
                |dots: &[Dot]| rasterized(add_dots_f64, Some(Level::best()), radius, dots);
            let (both, alone) = (rasterized(&dots), dots.map(|dot| rasterized(&[dot])));
            for (i, both) in both.iter().enumerate() {
                let pixel = [FIRST + i as i32 % WIDE, FIRST + i as i32 / WIDE];
                // On the squares around their circles; further out the tiles differ.
                let is_on = |dot: &Dot| {
                    (0..2).all(|k| (0..circle.side as i32).contains(&(pixel[k] - dot.first[k])))
                };
                let [one, next] = alone.each_ref().map(|light| light[i]);
                // X-Val: the sum of both alone, within the resolution of double precision at 2 /
                // 40^2.
                let off = match dots.each_ref().map(is_on) {
                    [true, true] => (both - (one + next)).abs(),
                    [true, false] => one - both,
                    [false, true] => next - both,
                    [false, false] => 0.0,
                };
                assert!(off < 1e-17, "{offset:?} {pixel:?} {off}");
            }
        }
    }
}
