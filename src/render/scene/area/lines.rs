//! Interpolated light: squares of pixels, bilinear between nine nodes each, evaluated when drawn.

use crate::kernels;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;

/// A square of pixels whose light is interpolated between nine nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Square {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns and rows, a power of two.
    pub side: usize,
    /// Light at the corners, the middles of the sides and the middle, row by row, e-. The last
    /// nodes lie one pixel beyond the last pixels.
    pub nodes: [f32; 9],
}

/// A segment of a row: the light of its i-th pixel is `from + rise i`, e-.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment {
    column: usize,
    pixels: usize,
    from: f32,
    rise: f32,
}

/// Index of each pixel's square within its strip, on a grid of the smallest squares.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Places {
    side: usize,
    across: usize,
    squares: Vec<u32>,
}

/// Interpolated light over the whole detector.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines {
    width: usize,
    height: usize,
    /// Rows of a strip.
    side: usize,
    /// Squares by strips of `side` rows; each lies in one strip.
    strips: Vec<Vec<Square>>,
}

impl Square {
    /// Its light at the three nodes of the line `row` rows below its first, e-.
    fn line(&self, row: usize) -> [f32; 3] {
        let half = self.side / 2;
        let above = (row / half).min(1);
        let down = (row - above * half) as f32 * (1.0 / half as f32);
        let at = |i: usize| {
            let (from, to) = (self.nodes[3 * above + i], self.nodes[3 * above + i + 3]);
            from + (to - from) * down
        };
        // An array's `map` would compile to a function call.
        [at(0), at(1), at(2)]
    }

    /// The two segments of its j-th row.
    fn segments(&self, j: usize) -> [Segment; 2] {
        let half = self.side / 2;
        let (line, step) = (self.line(j), 1.0 / half as f32);
        let segment = |i: usize| Segment {
            column: self.x + i * half,
            pixels: half,
            from: line[i],
            rise: (line[i + 1] - line[i]) * step,
        };
        [segment(0), segment(1)]
    }

    /// Its light at the nine nodes of a square within it.
    fn nodes_in(&self, [x, y]: [usize; 2], side: usize) -> [f32; 9] {
        if side == self.side {
            return self.nodes;
        }
        let half = self.side / 2;
        let position = |at: usize| {
            let i = usize::from(at >= half);
            (i, at as f32 * (1.0 / half as f32) - i as f32)
        };
        let between = |from: f32, to: f32, part: f32| from + (to - from) * part;
        let mut nodes = [0.0; 9];
        for (j, nodes) in nodes.chunks_exact_mut(3).enumerate() {
            let (above, down) = position(y - self.y + j * side / 2);
            for (i, node) in nodes.iter_mut().enumerate() {
                let (left, across) = position(x - self.x + i * side / 2);
                let [a, b, c, d] = [0, 1, 3, 4].map(|k| self.nodes[3 * above + left + k]);
                *node = between(between(a, b, across), between(c, d, across), down);
            }
        }
        nodes
    }

    /// The least and the most light between two columns, counted from its first, at the rows of its
    /// nodes, e-.
    fn ends_between(&self, from: usize, to: usize) -> [f32; 2] {
        let half = self.side / 2;
        let at = |nodes: &[f32], column: usize| {
            let left = (column / half).min(1);
            let part = (column - left * half) as f32 / half as f32;
            nodes[left] + (nodes[left + 1] - nodes[left]) * part
        };
        let mut ends = [f32::INFINITY, 0.0];
        for nodes in self.nodes.chunks_exact(3) {
            let middle = (from..=to).contains(&half).then_some(nodes[1]);
            for e in [at(nodes, from), at(nodes, to)].into_iter().chain(middle) {
                ends = [ends[0].min(e), ends[1].max(e)];
            }
        }
        ends
    }
}

/// Adds the sum of `parts` to `sum`. Each part is one square that contains this square, or the
/// squares within it, quarter by quarter.
fn add_up([x, y]: [usize; 2], side: usize, parts: &[&[Square]], sum: &mut Vec<Square>) {
    let is_small = |part: &&[Square]| part.first().is_some_and(|square| square.side < side);
    if !parts.iter().any(is_small) {
        let squares = parts.iter().filter_map(|part| part.first());
        let nodes = squares.map(|square| square.nodes_in([x, y], side));
        let nodes = nodes.reduce(|a, b| std::array::from_fn(|i| a[i] + b[i]));
        sum.extend(nodes.map(|nodes| Square { x, y, side, nodes }));
        return;
    }
    let half = side / 2;
    let mut rest = parts.to_vec();
    for [dx, dy] in [[0, 0], [half, 0], [0, half], [half, half]] {
        let [columns, rows] = [x + dx, y + dy].map(|from| from..from + half);
        let quarter = rest.iter_mut().map(|rest| {
            if !is_small(&&**rest) {
                return *rest;
            }
            let is_inside =
                |square: &&Square| columns.contains(&square.x) && rows.contains(&square.y);
            let (inside, after) = rest.split_at(rest.iter().take_while(is_inside).count());
            *rest = after;
            inside
        });
        let quarter: Vec<&[Square]> = quarter.collect();
        add_up([columns.start, rows.start], half, &quarter, sum);
    }
}

impl Lines {
    /// Squares that cover the detector, each within a strip of `side` rows. They come in quadtree
    /// order, left before right and upper before lower.
    pub(crate) fn new([width, height]: [usize; 2], side: usize, squares: Vec<Square>) -> Lines {
        let mut strips = vec![Vec::new(); height.div_ceil(side)];
        for square in squares {
            if let Some(strip) = strips.get_mut(square.y / side) {
                strip.push(square);
            }
        }
        Lines {
            width,
            height,
            side,
            strips,
        }
    }

    /// Columns and rows of the detector.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The part on a detector that begins after `rim` columns and rows, a multiple of the strips'
    /// height.
    pub fn within(&self, rim: usize, size: [usize; 2]) -> Lines {
        let squares = self.strips.iter().flatten();
        let inside = squares.filter_map(|square| {
            let [x, y] = [square.x, square.y].map(|at| at.checked_sub(rim));
            let (x, y) = (x.filter(|x| *x < size[0])?, y?);
            Some(Square { x, y, ..*square })
        });
        Lines::new(size, self.side, inside.collect())
    }

    /// The sum of several, of the same detector and strips, on the smallest of their squares.
    pub(crate) fn of_all(all: &[&Lines]) -> Option<Lines> {
        let first = all.first()?;
        let mut sum = Lines {
            strips: vec![Vec::new(); first.strips.len()],
            ..**first
        };
        sum.strips
            .par_iter_mut()
            .enumerate()
            .for_each(|(y, strip)| {
                let mut rest: Vec<&[Square]> =
                    all.iter().map(|lines| &lines.strips[y][..]).collect();
                for x in (0..first.width).step_by(first.side) {
                    let whole = |square: &&Square| square.x < x + first.side;
                    let parts = rest.iter_mut().map(|rest| {
                        let (inside, after) = rest.split_at(rest.iter().take_while(whole).count());
                        *rest = after;
                        inside
                    });
                    let parts: Vec<&[Square]> = parts.collect();
                    add_up([x, y * first.side], first.side, &parts, strip);
                }
                // Removes quarters outside the detector.
                strip.retain(|square| square.x < first.width && square.y < first.height);
            });
        Some(sum)
    }

    /// Adds the light of the pixels from `first` (row-major index) on to `electrons`.
    pub(crate) fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        let (width, past) = (self.width, first + electrons.len());
        let rows = first / width..past.div_ceil(width);
        let strips = rows.start / self.side..rows.end.div_ceil(self.side);
        let strips = self.strips.get(strips).unwrap_or_default();
        for square in strips.iter().flatten() {
            let rows = square.y.max(rows.start)..(square.y + square.side).min(rows.end);
            for row in rows {
                for segment in square.segments(row - square.y) {
                    let position = |column: usize| row * width + column.min(width);
                    let from = position(segment.column);
                    let to = position(segment.column + segment.pixels).min(past);
                    let cut = first.saturating_sub(from);
                    if from + cut < to {
                        let pixels = &mut electrons[from + cut - first..to - first];
                        kernels::ramp(level, segment.from, segment.rise, cut as u32, pixels);
                    }
                }
            }
        }
    }

    /// The index of each pixel's square.
    pub fn places(&self) -> Places {
        let squares = || self.strips.iter().flatten();
        let side = squares().map(|square| square.side).min().unwrap_or(1);
        let [across, down] = [self.width, self.height].map(|pixels| pixels.div_ceil(side));
        let mut places = vec![u32::MAX; across * down];
        // Shifts, because divisions are slow for a million squares.
        let shift = side.trailing_zeros();
        for strip in &self.strips {
            for (square, i) in strip.iter().zip(0..) {
                let [columns, rows] = [(square.x, across), (square.y, down)]
                    .map(|(from, all)| from >> shift..((from + square.side) >> shift).min(all));
                for row in rows {
                    places[row * across..][columns.clone()].fill(i);
                }
            }
        }
        Places {
            side,
            across,
            squares: places,
        }
    }

    /// [`Lines::add_to`] for a part of a row.
    pub(crate) fn add_to_row(&self, places: &Places, first: usize, electrons: &mut [f32]) {
        let (from, row) = (first % self.width, first / self.width);
        let strip = self.strips.get(row / self.side).map_or(&[][..], |of| of);
        let (mut x, past) = (from, from + electrons.len());
        while x < past {
            let position = row / places.side * places.across + x / places.side;
            let square = places.squares.get(position).map(|i| *i as usize);
            let Some(square) = square.and_then(|i| strip.get(i)) else {
                x = (x / places.side + 1) * places.side;
                continue;
            };
            for segment in square.segments(row - square.y) {
                let end = (segment.column + segment.pixels).min(past);
                for at in x..end.max(x) {
                    electrons[at - from] +=
                        segment.from + segment.rise * (at - segment.column) as f32;
                }
                x = end.max(x);
            }
        }
    }

    /// Raises each cell of `side` columns and rows to a bound of its pixels' light, e-. `side` is a
    /// power of two, at most the strips' height.
    pub(crate) fn max_of_cells(&self, side: usize, cells: &mut [f32]) {
        let across = self.width.div_ceil(side);
        let strips = cells.par_chunks_mut(across * (self.side / side));
        let strips = strips.zip(&self.strips).enumerate();
        strips.for_each(|(i, (cells, squares))| {
            let (mut above, mut below) = (Vec::new(), Vec::new());
            for square in squares {
                let n = square.side / side;
                let [column, row] = [square.x / side, (square.y - i * self.side) / side];
                let mut raise = |i: usize, j: usize, to: f32| {
                    let cell = cells.get_mut((row + j) * across + column + i);
                    if let Some(cell) = cell.filter(|_| column + i < across) {
                        *cell = if to > *cell { to } else { *cell };
                    }
                };
                if n < 2 {
                    raise(0, 0, square.nodes.iter().copied().fold(0.0, f32::max));
                    continue;
                }
                // The corners bound a cell: no node lies inside.
                for j in 0..=n {
                    std::mem::swap(&mut above, &mut below);
                    let line = square.line(j * side);
                    below.clear();
                    below.extend((0..=n).map(|i| {
                        let left = (2 * i / n).min(1);
                        let part = (2 * i - left * n) as f32 / n as f32;
                        line[left] + (line[left + 1] - line[left]) * part
                    }));
                    if j > 0 {
                        for i in 0..n {
                            let max = |row: &[f32]| row[i].max(row[i + 1]);
                            raise(i, j - 1, max(&above).max(max(&below)));
                        }
                    }
                }
            }
        });
    }

    /// Total, e-.
    ///
    /// ```text
    /// sum over i < n, j < m of a quarter's light = n m times that at (n - 1) / 2, (m - 1) / 2
    /// ```
    pub(crate) fn sum(&self) -> f64 {
        let of_quarter = |square: &Square, [right, below]: [usize; 2]| {
            let half = square.side / 2;
            let pixels = |from: usize, all: usize| half.min(all.saturating_sub(from)) as f64;
            let n = pixels(square.x + right * half, self.width);
            let m = pixels(square.y + below * half, self.height);
            let [u, v] = [n, m].map(|pixels| (pixels - 1.0) / (2.0 * half as f64));
            let row = |j: usize| {
                let nodes = &square.nodes[3 * (below + j) + right..];
                let [from, to] = [nodes[0], nodes[1]].map(f64::from);
                from + (to - from) * u
            };
            n * m * (row(0) + (row(1) - row(0)) * v)
        };
        let squares = self.strips.iter().flatten();
        let sums = squares.map(|square| {
            let quarters = [[0, 0], [1, 0], [0, 1], [1, 1]];
            quarters
                .iter()
                .map(|at| of_quarter(square, *at))
                .sum::<f64>()
        });
        sums.sum()
    }

    /// The least and the most light of a pixel in each group of `columns` columns, e-: a straight
    /// line does not exceed its ends.
    pub(crate) fn ends_of(&self, columns: usize) -> Vec<[f32; 2]> {
        let mut ends = vec![[f32::INFINITY, 0.0f32]; self.width.div_ceil(columns)];
        for square in self.strips.iter().flatten() {
            let past = (square.x + square.side).min(self.width);
            let parts = square.x / columns..past.div_ceil(columns);
            for (part, ends) in parts.clone().zip(&mut ends[parts]) {
                let from = (part * columns).max(square.x) - square.x;
                let to = ((part + 1) * columns).min(past) - 1 - square.x;
                let [min, max] = square.ends_between(from, to);
                *ends = [ends[0].min(min), ends[1].max(max)];
            }
        }
        ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(lines: &Lines) -> Vec<f32> {
        let mut pixels = vec![0.0; lines.width * lines.height];
        lines.add_to(Some(Level::best()), 0, &mut pixels);
        pixels
    }

    /// Two strips of four squares over 30 columns and 13 rows, one of them cut into quarters.
    fn lines(light: impl Fn(usize, usize) -> f32) -> Lines {
        let square = |x: usize, y: usize, side: usize| {
            let half = side / 2;
            let nodes = std::array::from_fn(|i| light(x + i % 3 * half, y + i / 3 * half));
            Square { x, y, side, nodes }
        };
        let mut squares = Vec::new();
        for (x, y) in (0..8).map(|i| (i % 4 * 8, i / 4 * 8)) {
            if (x, y) == (8, 0) {
                squares.extend([(8, 0), (12, 0), (8, 4), (12, 4)].map(|(x, y)| square(x, y, 4)));
            } else {
                squares.push(square(x, y, 8));
            }
        }
        Lines::new([30, 13], 8, squares)
    }

    #[test]
    fn linear_light_is_exact_on_every_pixel_in_runs_of_any_length() {
        let light = |x: usize, y: usize| 3.0 + 0.5 * x as f32 + 0.25 * y as f32;
        let lines = lines(light);
        let expected: Vec<f32> = (0..30 * 13).map(|i| light(i % 30, i / 30)).collect();
        assert_eq!(drawn(&lines), expected);
        for run in [1, 7, 30, 64] {
            let mut pixels = vec![0.0; 30 * 13];
            for (i, pixels) in pixels.chunks_mut(run).enumerate() {
                lines.add_to(None, i * run, pixels);
            }
            assert_eq!(pixels, expected, "{run}");
        }
        let sum: f64 = expected.iter().copied().map(f64::from).sum();
        assert!((lines.sum() / sum - 1.0).abs() < 1e-12);
        // X-Val: 3 + 0.5 x + 0.25 y from row 0 to row 16, where the last nodes lie; in cells of 8
        // columns from the first to the last.
        let ends = [[3.0, 10.5], [7.0, 14.5], [11.0, 18.5], [15.0, 21.5]];
        assert_eq!(lines.ends_of(8), ends);
    }

    #[test]
    fn a_sum_adds_up_on_every_pixel() {
        let bent = lines(|x, y| (x * x) as f32 + 2.0 * y as f32);
        let nodes = std::array::from_fn(|i| [7.0, 3.0, 1.0, 8.0, 4.0, 0.0, 5.0, 5.0, 2.0][i]);
        let side = 8;
        let wide = (0..8).map(|i| Square {
            x: i % 4 * 8,
            y: i / 4 * 8,
            side,
            nodes,
        });
        let wide = Lines::new([30, 13], 8, wide.collect());
        let sum = Lines::of_all(&[&wide, &bent, &wide]).unwrap();
        // Squares of eight and of four, as in the light that has both.
        assert_eq!(sum.strips[0].len(), 3 + 4);
        let each = drawn(&wide).into_iter().zip(drawn(&bent));
        for (pixel, (sum, (wide, bent))) in drawn(&sum).into_iter().zip(each).enumerate() {
            assert!((sum - (2.0 * wide + bent)).abs() < 1e-3, "{pixel}: {sum}");
        }
        assert_eq!(Lines::of_all(&[]), None);
    }

    #[test]
    fn a_part_of_a_row_equals_its_pixels() {
        let lines = lines(|x, y| (x * x) as f32 + 2.0 * y as f32);
        let (places, pixels) = (lines.places(), drawn(&lines));
        for (from, count) in (0..28).flat_map(|from| [1, 3, 30 - from].map(|n| (from, n))) {
            for row in 0..13 {
                let first = row * 30 + from;
                let mut part = vec![0.0; count];
                lines.add_to_row(&places, first, &mut part);
                assert_eq!(part, pixels[first..][..count], "{first}");
            }
        }
    }

    #[test]
    fn no_pixel_exceeds_its_cell() {
        let lines = lines(|x, y| 40.0 - (x as f32 - 14.0).abs() - (y as f32 - 5.0).powi(2));
        let pixels = drawn(&lines);
        for side in [1, 2, 4, 8] {
            let [across, down] = [30usize, 13].map(|pixels| pixels.div_ceil(side));
            let mut cells = vec![0.0; across * down];
            lines.max_of_cells(side, &mut cells);
            let mut max = vec![0.0f32; across * down];
            for (i, e) in pixels.iter().enumerate() {
                let cell = &mut max[i / 30 / side * across + i % 30 / side];
                *cell = cell.max(*e);
            }
            // A cell's corners lie one pixel beyond its last pixels, where light is at most 26 e-
            // higher.
            let near = |(cell, max): (&f32, &f32)| cell >= max && *cell <= max + 26.0;
            assert!(cells.iter().zip(&max).all(near), "{side}");
        }
    }

    #[test]
    fn a_maximum_inside_a_square_is_found() {
        // A ridge along column 20, which is no side of a square.
        let lines = lines(|x, _| 10.0 - (x as f32 - 20.0).abs());
        let pixels = drawn(&lines);
        for (part, [min, max]) in lines.ends_of(3).into_iter().enumerate() {
            let columns = part * 3..(part * 3 + 3).min(30);
            let ridge = columns.flat_map(|x| pixels[x..].iter().step_by(30).copied());
            let (low, high) = (
                ridge.clone().fold(99.0, f32::min),
                ridge.fold(0.0, f32::max),
            );
            assert_eq!([min, max], [low, high], "{part}");
        }
    }
}
