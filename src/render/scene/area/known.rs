//! The nodes of the grid at which area light is evaluated first.

use super::grid::Grid;
use super::lines::Square;
use super::raster_work::RasterWork;
use rayon::prelude::*;

/// Part of the tolerance reserved for bends between the nodes.
const SPARE: f64 = 0.5;

/// The light at nodes half a square apart.
pub(crate) struct Known {
    /// Side of the squares, px.
    pub side: usize,
    /// Columns and rows of the grid before the first node.
    before: usize,
    /// Nodes a row.
    across: usize,
    /// Light (e-) row by row; none where the position has no direction.
    e: Vec<Option<f64>>,
    /// The work of the evaluations.
    pub work: RasterWork,
}

impl Known {
    /// Evaluates the nodes of a grid of squares of `side`.
    pub fn of(grid: &Grid<'_, '_>, side: usize) -> Known {
        let margin = grid.margin.next_multiple_of(side);
        let squares = |pixels: usize| (margin + pixels + grid.margin).div_ceil(side);
        let [across, down] = grid.detector.map(|pixels| 2 * squares(pixels) + 1);
        let position = |i: usize| (i * side / 2) as f64 - margin as f64;
        let rows = (0..down).into_par_iter().map(|row| {
            let mut work = RasterWork::default();
            let lights =
                (0..across).map(|column| grid.at(position(column), position(row), &mut work));
            (lights.collect(), work)
        });
        let rows: Vec<(Vec<Option<f64>>, RasterWork)> = rows.collect();
        let mut work = RasterWork::default();
        rows.iter().for_each(|(_, of_row)| work += *of_row);
        Known {
            side,
            before: grid.rim - margin,
            across,
            e: rows.into_iter().flat_map(|(row, _)| row).collect(),
            work,
        }
    }

    /// The light at the nine nodes of a square, given by its first column and row.
    pub fn nine(&self, [x, y]: [usize; 2], side: usize) -> [Option<f64>; 9] {
        let [column, row] = self.first_of([x, y]);
        let step = side / self.side;
        std::array::from_fn(|i| self.at(column + i % 3 * step, row + i / 3 * step))
    }

    /// The node at a square's first column and row.
    fn first_of(&self, from: [usize; 2]) -> [usize; 2] {
        from.map(|from| 2 * (from - self.before) / self.side)
    }

    fn at(&self, column: usize, row: usize) -> Option<f64> {
        let row = self.e.get(row * self.across..(row + 1) * self.across)?;
        row.get(column).copied().flatten()
    }

    /// The square, if interpolation between its nine nodes agrees with all known nodes in it.
    pub fn whole(&self, [x, y]: [usize; 2], side: usize, grid: &Grid<'_, '_>) -> Option<Square> {
        if grid.radiance.edge().is_some() {
            return None;
        }
        let mut nodes = [0.0; 9];
        for (node, known) in nodes.iter_mut().zip(self.nine([x, y], side)) {
            *node = known?;
        }
        let [first_column, first_row] = self.first_of([x, y]);
        let (steps, half) = (2 * side / self.side, side / self.side);
        for row in 0..=steps {
            let above = (row / half).min(1);
            let down = (row - above * half) as f64 / half as f64;
            let line = [0, 1, 2].map(|i| {
                let (from, to) = (nodes[3 * above + i], nodes[3 * above + 3 + i]);
                from + (to - from) * down
            });
            for column in 0..=steps {
                let left = (column / half).min(1);
                let part = (column - left * half) as f64 / half as f64;
                let interpolated = line[left] + (line[left + 1] - line[left]) * part;
                let known = self.at(first_column + column, first_row + row)?;
                if (known - interpolated).abs() > SPARE * grid.may_miss(known) {
                    return None;
                }
            }
        }
        Some(Square {
            x,
            y,
            side,
            nodes: nodes.map(|node| node as f32),
        })
    }
}
