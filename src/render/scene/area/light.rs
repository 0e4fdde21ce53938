//! Area light on the pixels: interpolated light over the whole detector, and runs of pixels that
//! differ from it. Pixels are computed on demand.

use super::lines::{Lines, Places};
use super::runs::Runs;
use crate::footprint::Footprint;
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use skyloop_orbit::sgp4_batch::Level;
use std::sync::OnceLock;

/// Pixels computed together.
const CHUNK: usize = 32 * 1024;

/// Light on each pixel.
#[derive(Debug, Default)]
pub struct Light {
    lines: Lines,
    runs: Runs,
    places: OnceLock<Places>,
    drawn: OnceLock<Footprint>,
    /// The work limit of its frame.
    limit: WorkLimit,
}

impl Light {
    /// Interpolated light, and the differences from it.
    pub(crate) fn new(lines: Lines, runs: Runs) -> Light {
        Light {
            lines,
            runs,
            ..Light::default()
        }
    }

    /// The sum of several of the same detector. Computing its pixels stops if `limit` is cancelled.
    pub(crate) fn of_all(all: &[&Light], limit: &WorkLimit) -> Option<Light> {
        let lines: Vec<&Lines> = all.iter().map(|light| &light.lines).collect();
        let lines = Lines::of_all(&lines)?;
        let runs = all.iter().map(|light| &light.runs);
        let runs: Vec<&Runs> = runs.filter(|runs| !runs.is_empty()).collect();
        let runs = Runs::of_all(lines.size(), &runs);
        Some(Light {
            limit: limit.clone(),
            ..Light::new(lines, runs)
        })
    }

    /// Number of pixels that differ from the interpolation.
    pub(crate) fn uneven(&self) -> usize {
        self.runs.pixels()
    }

    /// Total, e-.
    pub(crate) fn sum(&self) -> f64 {
        self.lines.sum() + self.runs.sum()
    }

    /// Adds the light on the pixels from `first` (row-major index) on to `electrons`.
    pub(crate) fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        self.lines.add_to(level, first, electrons);
        self.runs.add_to(level, first, electrons);
    }

    /// [`Light::add_to`] for a part of a row.
    pub(crate) fn add_to_row(&self, first: usize, electrons: &mut [f32]) {
        let places = self.places.get_or_init(|| self.lines.places());
        self.lines.add_to_row(places, first, electrons);
        self.runs.add_to(None, first, electrons);
    }

    /// The light pixel by pixel, as shares of one electron.
    pub(crate) fn footprint(&self) -> &Footprint {
        self.drawn.get_or_init(|| {
            let [width, height] = self.lines.size();
            // On one thread: a waiting thread could steal work that waits for this result.
            let mut e = vec![0.0; width * height];
            let parts = e.chunks_mut(CHUNK).enumerate();
            let parts = parts.take_while(|_| !self.limit.is_cancelled());
            parts.for_each(|(part, e)| self.add_to(Some(Level::best()), part * CHUNK, e));
            Footprint::whole(width, e)
        })
    }

    /// The light on each pixel, row by row, e-.
    pub(crate) fn e(&self) -> &[f32] {
        self.footprint().shares()
    }

    /// The least and the most light of a pixel in each group of `columns` columns, e-.
    pub(crate) fn ends_of(&self, columns: usize) -> Vec<[f32; 2]> {
        let lines = self.lines.ends_of(columns);
        if self.runs.is_empty() {
            return lines;
        }
        let [width, height] = self.lines.size();
        let rows = (0..height).into_par_iter();
        let uneven = rows.fold(
            || (lines.clone(), Vec::new()),
            |(mut ends, mut light), row| {
                for (first, run) in self.runs.of_row(row) {
                    light.clear();
                    light.resize(run.len(), 0.0);
                    self.add_to_row(first, &mut light);
                    for (e, column) in light.iter().zip(first % width..) {
                        ends[column / columns] = wider(ends[column / columns], [*e; 2]);
                    }
                }
                (ends, light)
            },
        );
        let both = |a: Vec<[f32; 2]>, b| a.into_iter().zip(b).map(|(a, b)| wider(a, b)).collect();
        uneven.map(|(ends, _)| ends).reduce(|| lines.clone(), both)
    }

    /// Bound of the light of a pixel in each cell of `side` columns and rows (a power of two), e-,
    /// row by row of cells.
    pub(crate) fn max_of_cells(&self, side: usize) -> Vec<f64> {
        let [width, height] = self.lines.size();
        let across = width.div_ceil(side);
        let mut cells = vec![0.0f32; across * height.div_ceil(side)];
        self.lines.max_of_cells(side, &mut cells);
        if !self.runs.is_empty() {
            let rows = cells.par_chunks_mut(across).enumerate();
            rows.for_each(|(row, cells)| self.recompute_uneven(row * side, side, cells));
        }
        cells.into_iter().map(f64::from).collect()
    }

    /// Recomputes the cells of a row of cells that contain pixels off the interpolation.
    fn recompute_uneven(&self, top: usize, side: usize, cells: &mut [f32]) {
        let [width, height] = self.lines.size();
        let rows = top..(top + side).min(height);
        let mut uneven = vec![false; cells.len()];
        for (first, run) in rows.clone().flat_map(|row| self.runs.of_row(row)) {
            let column = first % width;
            uneven[column / side..(column + run.len()).div_ceil(side)].fill(true);
        }
        let mut light = vec![0.0; side];
        for (i, cell) in cells.iter_mut().enumerate().filter(|(i, _)| uneven[*i]) {
            let columns = i * side..((i + 1) * side).min(width);
            *cell = 0.0;
            for row in rows.clone() {
                let light = &mut light[..columns.len()];
                light.fill(0.0);
                self.add_to_row(row * width + columns.start, light);
                *cell = light.iter().copied().fold(*cell, f32::max);
            }
        }
    }

    /// Light given pixel by pixel, row by row, e-.
    #[cfg(test)]
    pub(crate) fn each(size: [usize; 2], e: Vec<f32>) -> Light {
        let rows = e.chunks(size[0]).enumerate();
        let runs = rows.map(|(row, e)| super::runs::Run {
            row,
            column: 0,
            e: e.to_vec(),
        });
        let side = size[0].max(size[1]).next_power_of_two();
        let none = Lines::new(size, side, Vec::new());
        Light::new(none, Runs::new(size, runs.collect()))
    }
}

/// The range that contains both.
fn wider(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    // Not `min` and `max`, whose handling of NaN is slow.
    [
        if b[0] < a[0] { b[0] } else { a[0] },
        if b[1] > a[1] { b[1] } else { a[1] },
    ]
}
